# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts of points without mass: the modes that are left out are their springs."""

import sys

import h5py
import numpy as np
import pytest
from beams import cantilever
from program import run, succeed
from scipy import io, linalg, sparse

CASE = """\
[structure.beam]
mass = "mass.mtx"
stiffness = "stiffness.mtx"
damping_ratio = 0.02
modes = {modes}
point = {{ tip = {tip}, root = 1 }}
[contact.stop]
between = {between}
law = "{law}"
{more}
upper = 0.05
[drive.force]
law = "force"
body = "beam.tip"
amplitude = 0.3
frequency = 0.9
[run]
duration = 10
window = 5
average = "window"
"""


@pytest.fixture
def beam(tmp_path):
    """Files of a cantilever, its number of coordinates, F(row, modes): the flexibility left out."""
    mass, stiffness = cantilever(6)
    for name, matrix in (("mass", mass), ("stiffness", stiffness)):
        io.mmwrite(tmp_path / f"{name}.mtx", sparse.coo_array(matrix), precision=17)
    squares, shapes = linalg.eigh(stiffness, mass)

    def flexibility(row, modes):
        static = row @ np.linalg.solve(stiffness, row)
        return static - np.sum((row @ shapes[:, :modes]) ** 2 / squares[:modes])

    return len(mass), flexibility


@pytest.mark.parametrize("ends", [["beam.tip"], ["beam.root", "beam.tip"]])
def test_the_modes_left_out_are_the_spring(separatrix, beam, tmp_path, ends):
    """The flexibility is the static one less that of the modes kept; there are no impacts."""
    size, flexibility = beam
    tip = size - 1
    row = np.zeros(size)
    row[tip - 1] = 1
    if len(ends) == 2:
        row[0] -= 1
    soft = f"stiffness = {float(1 / flexibility(row, 3))!r}"
    between = "[" + ", ".join(f'"{end}"' for end in ends) + "]"
    events = []
    for law, more in (("massless", ""), ("kelvin_voigt", soft)):
        (tmp_path / "case.toml").write_text(
            CASE.format(modes=3, tip=tip, between=between, law=law, more=more)
        )
        output = succeed(
            separatrix, "trajectory", "case.toml", "--force", "-o", "motion.h5", folder=tmp_path
        ).out
        assert "warning" not in output
        with h5py.File(tmp_path / "motion.h5") as file:
            events.append((file["event_kind"][:], file["event_time"][:]))
            kinds = dict(
                zip(
                    file["event_kind"].attrs["flag_meanings"].split(),
                    file["event_kind"].attrs["flag_values"],
                    strict=True,
                )
            )
    (kind, time), (other_kind, other_time) = events
    # Later on rounding shows.
    assert np.array_equal(kind[:12], other_kind[:12])
    assert time[:12] == pytest.approx(other_time[:12], rel=1e-8)
    assert np.sum(kind == kinds["touch_upper"]) > 3
    assert set(kind) <= {kinds["touch_upper"], kinds["separation"]}


def test_a_bar_on_a_wall_pushes_as_waves_predict(source_dir, build_dir, tmp_path):
    """Rows of docs/validation.md: 16 modes and the flexibility of the others, against waves."""
    sys.path.insert(0, str(source_dir / "scripts" / "evidence"))
    try:
        from evidence_program import Program
        from validation_structures_others import bar
    finally:
        sys.path.remove(str(source_dir / "scripts" / "evidence"))
    found = bar(Program(build_dir, tmp_path))
    assert [one for one in found if one.verdict != "agrees"] == []


def test_what_is_refused(separatrix, beam, tmp_path):
    """Where nothing is left out the stiffness must be given."""
    size, _ = beam
    tip = size - 1
    case = CASE.format(modes=3, tip=tip, between='["beam.tip"]', law="massless", more="")
    (tmp_path / "case.toml").write_text(case.replace("modes = 3\n", ""))
    outcome = run(separatrix, "trajectory", "case.toml", folder=tmp_path)
    assert outcome.code == 65
    assert "key 'contact.stop.stiffness': missing, allowed more than 0 N/m" in outcome.err
    (tmp_path / "case.toml").write_text(
        case.replace("modes = 3\n", "").replace("upper", "stiffness = 100\nupper")
    )
    succeed(separatrix, "trajectory", "case.toml", "--force", folder=tmp_path)
