# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Python cases of structures and the files that they name."""

import numpy as np
import pytest
import separatrix as sx
from beams import cantilever
from scipy import io, sparse


def test_a_case_keeps_its_files(tmp_path, monkeypatch):
    """A saved case, and one whose process has changed its folder, resolves as where it was read."""
    folder = tmp_path / "machine"
    folder.mkdir()
    for name, matrix in zip(("mass", "stiffness"), cantilever(12), strict=True):
        io.mmwrite(folder / f"{name}.mtx", sparse.coo_array(matrix))
    (folder / "case.toml").write_text(
        """
[structure.beam]
mass = "mass.mtx"
stiffness = "stiffness.mtx"
damping_ratio = 0.02
modes = 2
[structure.beam.point]
tip = 1
[drive.shaker]
law = "force"
body = "beam.tip"
amplitude = 1
frequency = 3
[run]
duration = 10.0
window = 5.0
"""
    )
    monkeypatch.chdir(folder)
    case = sx.load("case.toml")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert sx.load(case.save(elsewhere / "case.toml")) == case
    beside = case.save(folder / "copy.toml")
    assert beside.read_text() == (folder / "case.toml").read_text()
    monkeypatch.chdir(elsewhere)
    (elsewhere / "case.toml").unlink()
    # what bears the name of its file here is not its file
    (elsewhere / "mass.mtx").write_text("nothing")
    changed = case.with_({"structure.beam.damping_ratio": 0.05})
    assert changed != case
    assert changed.with_({"structure.beam.damping_ratio": 0.02}) == case
    assert sx.load(case.save("copy.toml")) == case
    assert np.array_equal(sx.trajectory(case)["x"], sx.trajectory(beside)["x"])
    (elsewhere / "bad.toml").write_text("[structure.beam]\nmass = 1\n")
    with pytest.raises(sx.CaseError, match="structure.beam.stiffness") as refused:
        sx.load("bad.toml")
    assert str(refused.value).startswith("bad.toml:")


def test_numbers_of_a_file_are_reported_as_they_are(tmp_path):
    """A matrix that ends early ends the file; friction at break-away is not below zero."""
    io.mmwrite(tmp_path / "mass.mtx", np.eye(2), precision=17)
    (tmp_path / "stiffness.mtx").write_text("%%MatrixMarket matrix array real general\n2 2\n3\n-1\n")
    structure = '[structure.f]\nmass = "mass.mtx"\nstiffness = "stiffness.mtx"\npoint.roof = 2\n'
    friction = (
        '[body.b]\nmass = 1\n[friction.f]\nbetween = ["b"]\nlaw = "coulomb"\nforce = 1\nstatic_force = -0.5\n'
    )
    for text, message in (
        (structure, "stiffness.mtx:4: found the end of the file, allowed a number for row 1 of column 2"),
        (friction, "key 'friction.f.static_force': found -0.5 N, allowed at least 0"),
    ):
        (tmp_path / "case.toml").write_text(text + "[run]\nduration = 5\n")
        with pytest.raises(sx.CaseError) as refused:
            sx.trajectory(sx.load(tmp_path / "case.toml"))
        assert message in str(refused.value)
