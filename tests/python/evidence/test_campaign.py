# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The discovery campaign: its baselines, command line, page and archive, and that it can be killed."""

import dataclasses
import hashlib
import json
import lzma
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from types import SimpleNamespace

import pytest
from separatrix.library import effects

pytestmark = pytest.mark.long
"""Pages of evidence, which change with their scripts alone."""

CASES = 3
SEED = 3
# what discovery answers in the campaigns of these tests, which are about the campaign
STAND_IN = """\
import time

class Options:
    def __init__(self, seed): self.seed = seed

def discover(base, records, hold_out, options):
    time.sleep({pause})
    gap = {{"training": {{"before": 2.0, "after": 1.0}}, "held_out": {{"before": 3.0, "after": 1.2}}}}
    doubts = {doubts} and len(records) == 2
    asked = {{"drive_ratio": 1.2, "scale": 0.6, "d_prime": 9.0, "use": "training"}}
    return {{"outcome": "ambiguous" if doubts else "named", "effects": ["cubic_spring"],
            "alternatives": ["viscous"] if doubts else [], "gap": gap, "version": "0",
            "experiments": [asked] if doubts else [],
            "parameters": {{}}, "records": [str(len(records) + len(hold_out))], "seed": options.seed}}
"""


@pytest.mark.parametrize(("name", "size"), [("none", 0.0), ("quadratic_drag", 0.3), ("cubic_spring", 40.0)])
def test_the_baselines_name_what_is_large(campaign, tmp_path, name, size):
    pytest.importorskip("pysindy")
    import baselines
    import design
    import effects
    import records

    # the filter rounds the jump of dry friction and raises a false alarm, not in a viscous machine
    regime = "damped" if size > 0 else "viscous"
    drawn = (design.draw(SEED, n) for n in range(400) if design.plan(SEED, n)[0] == "none")
    case = next(one for one in drawn if one.regime == regime)
    case.level, case.colour, case.velocity, case.crank_angle = 1e-4 if size > 0 else 1e-2, "white", True, True
    for experiment in (*case.training, case.held_out):
        experiment.samples_per_period = 400
    if size > 0:
        case.hidden = [design.Hidden(name, effects.CATALOGUE[name], {}, 1.0, size)]
        case.machine = case.hidden[0].on(case.base)
    records.write_case(tmp_path, tmp_path / "truth.json", case)
    training = [tmp_path / name for name in records.TRAINING]
    known = set(baselines.terms(tomllib.loads((tmp_path / records.BASE).read_text()), training).names)
    # a constant stands for the sensor; the friction that the base machine has is none of the terms
    others = {"sensor_bias", "sensor_gain", "viscous", "coulomb"}
    assert known - others == campaign.scoring.HAVE_A_TERM - others
    found = baselines.verdicts(tmp_path / records.BASE, training, 1)
    assert set(found) == {"STLSQ", "ensemble SINDy"}
    assert set(found.values()) == {name}


def test_the_families_are_those_of_the_library(campaign, library):
    """A verdict of one family is scored as one."""
    for family, members in campaign.scoring.FAMILIES.items():
        assert members == {name for name, one in effects().items() if one.family == family}


@pytest.mark.parametrize(("option", "code"), [("--help", 0), ("--many", 64), ("--cases", 64)])
def test_the_command_line(source_dir, option, code):
    command = [source_dir / "scripts/evidence/discovery_campaign", option]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == code
    assert (option in result.stderr) == (code != 0)


def test_a_seed_is_asked_for_and_the_page_states_whether_it_was_developed_on(campaign, monkeypatch, capsys):
    import campaign as program
    import seeds

    monkeypatch.setattr(sys, "argv", ["discovery_campaign"])
    assert program.main() == 64
    assert f"{seeds.DEVELOPED_ON[0]}, {seeds.DEVELOPED_ON[1]}" in capsys.readouterr().err
    assert "is not among them" in seeds.of_page(max(seeds.DEVELOPED_ON) + 1)
    for seed in seeds.DEVELOPED_ON:
        commit = seeds.BLIND_UP_TO.get(seed)
        assert (f"up to commit {commit}" if commit else f"{seed}, is one of them") in seeds.of_page(seed)
    assert set(seeds.BLIND_UP_TO) <= set(seeds.DEVELOPED_ON)


def test_the_page_states_which_source_and_library_gave_the_verdicts(campaign, tmp_path, monkeypatch):
    import campaign as program
    import report

    library = tmp_path / "libseparatrix.so"
    library.write_bytes(b"a library")
    monkeypatch.setenv("SEPARATRIX_LIBRARY", str(library))
    for command in ("init -q", "add .", "-c user.name=a -c user.email=b commit -q -m one"):
        (tmp_path / "source").mkdir(exist_ok=True)
        (tmp_path / "source" / "file").write_text("as committed")
        subprocess.run(["git", "-C", tmp_path / "source", *command.split()], check=True)
    monkeypatch.setattr(program, "SOURCE", tmp_path / "source")
    program.commit.cache_clear()
    program.library.cache_clear()
    clean = program.commit()
    (tmp_path / "source" / "file").write_text("changed")
    program.commit.cache_clear()
    assert program.commit() == f"{clean}-dirty"
    folders = program.Folders(tmp_path)
    folders.make()
    folders.result(3).write_text(json.dumps({"commit": program.commit(), "library": program.library()}))
    found = report.versions(folders, [SimpleNamespace(number=3)])
    digest = hashlib.sha256(b"a library").hexdigest()
    assert found == f"{clean}-dirty with library {digest[:12]} (1)"
    program.commit.cache_clear()
    program.library.cache_clear()


def start(source_dir, folder, pause: float, *more: str, doubts: bool = False) -> subprocess.Popen:
    """A campaign with an answer that is always the same; it `doubts` with two records for training."""
    package = folder / "stand_in" / "separatrix"
    (package / "discovery").mkdir(parents=True, exist_ok=True)
    (package / "discovery" / "__init__.py").write_text(STAND_IN.format(pause=pause, doubts=doubts))
    for name in ("errors", "style", "palette"):
        (package / f"{name}.py").write_text(
            (source_dir / "postprocess" / "separatrix" / f"{name}.py").read_text()
        )
    (package / "__init__.py").write_text("")
    (folder / "stand_in" / "pysindy.py").write_text("STLSQ = None\n")
    (folder / "stand_in" / "baselines.py").write_text(
        "verdicts = lambda *_: {'STLSQ': 'none', 'ensemble SINDy': 'none'}\n"
    )
    program = source_dir / "scripts/evidence/campaign/campaign.py"
    # the finder of an editable installation comes before the path
    code = "import sys, runpy, importlib.machinery as m; sys.meta_path.insert(0, m.PathFinder); "
    code += f"sys.path.insert(0, {str(folder / 'stand_in')!r}); import baselines; "
    code += (
        f"sys.path.insert(1, {str(program.parent)!r}); runpy.run_path({str(program)!r}, run_name='__main__')"
    )
    words = [
        "--cases",
        str(CASES),
        "--seed",
        str(SEED),
        "--out",
        folder / "out",
        "--output",
        folder / "page.md",
        *more,
    ]
    environment = {**os.environ, "PYTHONPATH": str(folder / "stand_in"), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen([sys.executable, "-c", code, *words], env=environment, stdout=subprocess.DEVNULL)


def test_a_killed_campaign_goes_on_and_gives_the_same_page(source_dir, tmp_path):
    results = {}
    for name in ("whole", "killed"):
        folder = tmp_path / name
        if name == "killed":
            first = start(source_dir, folder, 0.5)
            done = folder / "out" / f"seed_{SEED}" / "results" / "0000.json"
            deadline = time.monotonic() + 120
            while not done.is_file() and time.monotonic() < deadline:
                time.sleep(0.05)
            first.send_signal(signal.SIGKILL)
            first.wait()
            assert done.is_file()
            assert not (folder / "page.md").is_file()
        assert start(source_dir, folder, 0.0).wait(timeout=300) == 0
        results[name] = (folder / "page.md").read_text()
        assert f"The seed of this page, {SEED}, is one of them." in results[name]
        found = sorted((folder / "out" / f"seed_{SEED}" / "results").glob("*.json"))
        assert all(json.loads(path.read_text())["verdict"]["effects"] == ["cubic_spring"] for path in found)
        assert [json.loads(path.read_text())["number"] for path in found] == list(range(CASES))
        assert (folder / "figures" / "discovery_confusion.png").is_file()
    # one sentence states a measured time
    measured = re.compile(r"median [0-9]+ s(?= of\s+processor time)")
    assert all(len(measured.findall(page)) == 1 for page in results.values())
    untimed = {name: measured.sub("", page) for name, page in results.items()}
    assert untimed["whole"] == untimed["killed"]


def test_the_archive_and_the_page_name_no_folder_of_the_machine(campaign, tmp_path):
    import archive
    import report
    from campaign import Folders

    folders = Folders(tmp_path / "seed")
    folders.make()
    found = f"{folders.cases}/0000/base.toml:3: key 'body.mass': missing"
    folders.result(0).write_text(json.dumps({"number": 0, "verdict": {"reasons": [found]}}))
    kept = tmp_path / "archive.jsonl.xz"
    assert archive.pack(kept, folders, [0, 1]) == 1
    text = lzma.open(kept, "rt").read()
    assert "0000/base.toml:3: key" in text
    assert str(tmp_path) not in text
    # nor does the page
    strong = SimpleNamespace(strong=True, decided=False, number=0, column="no verdict")
    assert report.undecided(folders, [strong]) == [
        ["no verdict", "0000/base.toml:3: key 'body.mass': missing", "1"]
    ]


def test_the_page_can_be_written_again_from_the_archive_alone(source_dir, tmp_path):
    archive = tmp_path / "archive.jsonl.xz"
    whole, again = tmp_path / "whole", tmp_path / "again"
    assert start(source_dir, whole, 0.0, "--archive", str(archive)).wait(timeout=300) == 0
    kept = archive.read_bytes()
    assert start(source_dir, again, 0.0, "--summary", "--archive", str(archive)).wait(timeout=300) == 0
    assert (again / "page.md").read_text() == (whole / "page.md").read_text()
    assert archive.read_bytes() == kept
    assert not any((again / "out" / f"seed_{SEED}" / "cases").iterdir())


def test_the_record_that_a_set_asks_for_is_made_and_asked_with(campaign, source_dir, tmp_path):
    import design
    import records

    archive = tmp_path / "archive.jsonl.xz"
    words = ("--follow-up", "--archive", str(archive))
    assert start(source_dir, tmp_path, 0.0, *words, doubts=True).wait(timeout=300) == 0
    out = tmp_path / "out" / f"seed_{SEED}"
    found = [json.loads(path.read_text()) for path in sorted((out / "follow_ups").iterdir())]
    assert [one["number"] for one in found] == list(range(CASES))
    assert {one["verdict"]["outcome"] for one in found} == {"named"}
    first, asked = (
        (out / "cases" / "0000" / name).read_text() for name in (records.TRAINING[0], records.ASKED)
    )
    assert "# drive_ratio: 1.2\n" in asked
    assert "# drive_scale: 0.6\n" in asked
    ends = [float(text.split("\n")[-2].split(",")[0]) for text in (first, asked)]
    assert ends[1] == pytest.approx(ends[0], rel=0.06)
    # the amplitude of the drive is what it was asked to be, and nothing else of the machine
    case = design.draw(SEED, 0)
    machine = case.training[0].driven(case.machine)
    scaled = dataclasses.replace(case.training[0], scale=0.6).driven(case.machine)
    assert scaled.scale == 0.6 * machine.scale
    assert scaled.mean == machine.mean
    page = (tmp_path / "page.md").read_text()
    assert f"| nothing hidden | {sum(design.plan(SEED, n)[0] == 'none' for n in range(CASES))} |" in page
    again = tmp_path / "again"
    assert start(source_dir, again, 0.0, "--summary", "--archive", str(archive)).wait(timeout=300) == 0
    assert (again / "page.md").read_text() == page


@pytest.mark.long
def test_another_truth_than_the_sealed_one_is_noticed(campaign, source_dir, tmp_path):
    assert start(source_dir, tmp_path, 0.0).wait(timeout=300) == 0
    sealed = tmp_path / "out" / f"seed_{SEED}" / "sealed" / "0001.json"
    sealed.write_text(sealed.read_text().replace('"kind"', '"kind" '))
    (tmp_path / "page.md").unlink()
    assert start(source_dir, tmp_path, 0.0).wait(timeout=300) != 0
    assert not (tmp_path / "page.md").is_file()
