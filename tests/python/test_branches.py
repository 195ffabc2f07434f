# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `branches`: its file, its log, its figure, and what it refuses."""

import json
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from separatrix import style
from separatrix.figures import branches
from separatrix.open import decode_flags, decode_words, open_result


@pytest.fixture
def run(separatrix: Path, source_dir: Path, tmp_path: Path):
    """Runs the command on a validation case; returns the file and what ended."""

    def run_it(case: str, *options: str) -> tuple[Path, subprocess.CompletedProcess]:
        out = tmp_path / "out.h5"
        path = source_dir / "examples" / "validation" / f"{case}.toml"
        return out, subprocess.run(
            [separatrix, "branches", path, "-o", out, *options], capture_output=True, text=True, check=False
        )

    return run_it


AMPLITUDE = ("--parameter", "drive.amplitude", "--from", "0.05", "--to", "0.3", "--searches", "3")


def test_a_fold_beside_a_graze_is_in_the_file_the_log_and_the_figure(run):
    out, ended = run("impact_coco", *AMPLITUDE, "--json")
    assert ended.returncode == 0, ended.stderr
    points = [line for line in map(json.loads, ended.stdout.splitlines()) if line["event"] == "point"]
    logged = {line["label"]: line["parameter"] for line in points}
    assert logged["SN"] == pytest.approx(0.099970753628, abs=1e-11)
    assert logged["GR-fold"] == pytest.approx(0.1, abs=1e-11)
    with open_result(out) as result:
        labels = decode_flags(result["label"]).values
        fold = np.flatnonzero(labels == "SN")
        assert fold.size == 1
        assert result["parameter"].values[fold[0]] == logged["SN"]
        assert result["multiplier_real"].values[fold[0], 0] == pytest.approx(1, abs=1e-8)
        # the free motion, the saddle between graze and fold, the impacting motion
        words = decode_words(result["event_word"]).values
        stable = result["stable"].values == 1
        assert set(words) == {".", "R."}
        assert stable[words == "."].all()
        between = (result["parameter"].values < 0.0999999) & (words == "R.") & (labels == "none")
        assert (~stable[between]).any() and stable[words == "R."].any()
        with style.context():
            figure = branches.figures(result, "title")["branches"]
        texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert "fold (SN)" in texts and "graze with a fold (GR-fold)" in texts


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        ((), 64, "--parameter NAME is missing"),
        (("--parameter", "drive.ration", "--from", "1", "--to", "2"), 65, "drive.ratio"),
        (("--parameter", "x0", "--from", "1", "--to", "2"), 65, "--parameter: found 'x0'"),
        (("--parameter", "body.mass"), 65, "--from and --to are needed"),
        (("--parameter", "drive.amplitude", "--from", "2", "--to", "1"), 65, "a range that rises"),
        (("--parameter", "contact.restitution", "--from", "0.5", "--to", "1.5"), 65, "--to"),
    ],
)
def test_what_makes_no_sense_is_refused(run, options, code, said):
    out, ended = run("impact_coco", *options)
    assert ended.returncode == code
    assert said in ended.stderr
    assert not out.exists()


def test_a_parameter_without_effect_has_straight_branches(run):
    out, ended = run(
        "impact_coco", "--parameter", "body.gravity", "--from", "1", "--to", "9", "--searches", "2"
    )
    assert ended.returncode == 0, ended.stderr
    with open_result(out) as result:
        for number in np.unique(result["branch"].values):
            chosen = result["branch"].values == number
            assert np.ptp(result["x"].values[chosen]) < 1e-9
        assert set(decode_flags(result["label"]).values) == {"none", "end_of_range"}


def test_a_signal_ends_it(separatrix: Path, source_dir: Path, tmp_path: Path) -> None:
    """Nothing is kept that could be resumed."""
    process = subprocess.Popen(
        [
            separatrix,
            "branches",
            source_dir / "examples" / "sweep_stribeck.toml",
            "--parameter",
            "drive.ratio",
            "-q",
        ],
        cwd=tmp_path,
    )
    time.sleep(0.5)
    process.terminate()
    assert process.wait(10) == -signal.SIGTERM
    assert list(tmp_path.iterdir()) == []
