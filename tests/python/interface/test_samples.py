# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts of several bodies in one slice, and starts drawn at random."""

import h5py
import numpy as np
import pytest
from program import differences, run, succeed
from scipy.stats import beta
from separatrix import open_result
from separatrix.figures import basin

AXES = """
[[axis]]
name = "x0"
from = -2
to = 1
count = 4
[[axis]]
name = "{name}"
values = {values}
"""
SAMPLE = """
[[sample]]
name = "x0"
from = -2
to = 1
[[sample]]
name = "v0"
from = -3
to = 3
[grid]
samples = {count}
seed = 7
"""


@pytest.fixture
def machine(source_dir):
    """The two masses with a stop, without axes."""
    text = (source_dir / "examples" / "structure_two_masses.toml").read_text()
    return text[: text.index("[[axis]]")]


def test_starts_of_all_bodies_are_one_slice(separatrix, machine, tmp_path):
    """One catalogue; each row is what a case with that start gives."""
    values = [-1.5, 0.0, 1.5]
    (tmp_path / "all.toml").write_text(machine + AXES.format(name="body.first.v0", values=values))
    succeed(separatrix, "basin", tmp_path / "all.toml", "-o", tmp_path / "all.h5", folder=tmp_path)
    with h5py.File(tmp_path / "all.h5") as file:
        assert set(file["catalogue/slice"][:]) == {0}
        words = file["event_word"][:]
        settled = file["settle_time"][:]
    assert len(np.unique(words)) == 2
    (tmp_path / "one.toml").write_text(machine + AXES.format(name="v0", values=[0.0]))
    for column, value in enumerate(values):
        options = ["--set", f"body.first.v0={value}", "--force", "-o", tmp_path / "one.h5"]
        succeed(separatrix, "basin", tmp_path / "one.toml", *options, folder=tmp_path)
        with h5py.File(tmp_path / "one.h5") as file:
            assert np.array_equal(file["event_word"][:, 0], words[:, column])
            # the radius of capture depends on the sample, the motion does not
            assert file["settle_time"][:, 0] == pytest.approx(settled[:, column], abs=600)
    text = succeed(separatrix, "verify", tmp_path / "all.h5", "--sample", "3", folder=tmp_path).out
    assert "0 differ from the file" in text
    assert " 0 label flips" in text


def test_shares_of_random_starts(mpi_separatrix, machine, tmp_path):
    """Same bits on one rank and two, intervals of Clopper and Pearson; of 400 other starts 0.975 strike."""
    (tmp_path / "case.toml").write_text(machine + SAMPLE.format(count=400))
    for ranks in (1, 2):
        options = ["--set", "drive.force.frequency=1.1", "-o", tmp_path / f"{ranks}.h5"]
        succeed(mpi_separatrix, "basin", tmp_path / "case.toml", *options, folder=tmp_path, ranks=ranks)
    assert differences(tmp_path / "1.h5", tmp_path / "2.h5") == []
    with h5py.File(tmp_path / "1.h5") as file:
        x0, v0 = file["x0"][:], file["v0"][:]
        catalogue = {name: file[f"catalogue/{name}"][:] for name in ("count", "regime", "share")}
        lower, upper = file["catalogue/share_lower"][:], file["catalogue/share_upper"][:]
    assert x0.min() >= -2
    assert x0.max() <= 1
    assert np.abs(v0.mean()) < 4 * np.sqrt(3 / 400)
    assert np.abs(np.corrcoef(x0, v0)[0, 1]) < 4 / np.sqrt(400)
    assert catalogue["count"].sum() == 400
    found = catalogue["count"]
    assert catalogue["share"] == pytest.approx(found / 400)
    assert lower == pytest.approx(beta.ppf(0.025, found, 401 - found), abs=1e-9)
    assert upper == pytest.approx(beta.ppf(0.975, found + 1, 400 - found), abs=1e-9)
    strikes = int(np.argmax(found))
    assert lower[strikes] < 0.975 + 0.016
    assert upper[strikes] > 0.975 - 0.016
    with open_result(tmp_path / "1.h5") as result:
        assert list(basin.figures(tmp_path / "1.h5", result, None, "t")) == ["shares"]


def test_shares_over_a_parameter(separatrix, machine, tmp_path):
    """A slice for each value of an axis, each with all starts; a normal distribution has its moments."""
    text = machine + SAMPLE.format(count=300).replace("from = -3\nto = 3", "mean = 0.5\ndeviation = 2")
    text += '[[axis]]\nname = "drive.force.frequency"\nvalues = [1.05, 1.12]\n'
    (tmp_path / "case.toml").write_text(text)
    output = tmp_path / "m.h5"
    succeed(separatrix, "basin", tmp_path / "case.toml", "-o", output, folder=tmp_path)
    with h5py.File(output) as file:
        assert file["attractor"].shape == (2, 300)
        counts = np.bincount(file["catalogue/slice"][:], file["catalogue/count"][:])
        assert counts == pytest.approx([300, 300])
        v0 = file["v0"][:]
    assert v0.mean() == pytest.approx(0.5, abs=4 * 2 / np.sqrt(300))
    assert v0.std() == pytest.approx(2, rel=0.2)
    assert "0 differ" in succeed(separatrix, "verify", output, "--sample", "3", folder=tmp_path).out


def test_what_is_refused(separatrix, machine, tmp_path):
    """A sample of what is no start, twice the same, beyond a stop, of no width; a sweep over a start."""
    good = SAMPLE.format(count=10)

    def refused(text, expected, command="basin"):
        (tmp_path / "case.toml").write_text(machine + text)
        outcome = run(separatrix, command, tmp_path / "case.toml", "-o", tmp_path / "n.h5", folder=tmp_path)
        assert outcome.code == 65, outcome.err
        assert expected in outcome.err
        assert "case.toml" in outcome.err

    refused(good.replace('"v0"', '"body.first.mass"'), "key 'sample[2].name': found \"body.first.mass\"")
    refused(good.replace('"v0"', '"x0"'), "found 'x0' again")
    refused(good.replace("to = 3", "to = -3"), "allowed more than from")
    refused(good.replace("to = 1", "to = 2"), "found bodies beyond a stop")
    refused(good.replace("to = 3", "until = 3"), "key 'sample[2].to': missing")
    refused(good.replace("samples = 10", "samples = 0"), "key 'grid.samples'")
    refused(good + "[refine]\n", "found with [[sample]]")
    sweep = '[sweep]\nparameter = "body.first.x0"\nfrom = 0\nto = 1\nstep = 0.5\nstarts = [0, 0]\n'
    refused(sweep, "key 'sweep.parameter'", "sweep")
