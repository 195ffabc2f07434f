# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Positions of rest are one attractor where the body rests everywhere between them, several otherwise."""

import h5py
import numpy as np
import pytest
from program import succeed

AXES = """
[[axis]]
name = "x0"
from = {low}
to = {high}
count = 24
[[axis]]
name = "v0"
from = -4
to = 4
count = 5
[run]
duration = 60
"""
WELLS = """
[body.m]
mass = 1
[spring.k]
between = ["m"]
law = "polynomial"
stiffness = -10
cubic = 10
[friction.f]
between = ["m"]
force = {force}
""" + AXES.format(low=-1.5, high=1.5)
FALLING = """
[body.bob]
mass = 1
[spring.weight]
between = ["bob"]
law = "pendulum"
moment = -2
damping = 0.02
[contact.stops]
between = ["bob"]
law = "newton"
lower = -0.5
upper = 0.5
restitution = 0.6
""" + AXES.format(low=-0.45, high=0.45)


def searched(separatrix, folder, text: str) -> dict[str, np.ndarray]:
    """The map of a case and its catalogue."""
    (folder / "case.toml").write_text(text)
    printed = succeed(separatrix, "basin", "case.toml", folder=folder).out
    succeed(separatrix, "verify", "case.basin.h5", "--sample", "2", folder=folder)
    with h5py.File(folder / "case.basin.h5") as file:
        found = {name: file[name][()] for name in ("x0", "v0")} | {"map": file["attractor"][()]}
        found |= {name: file[f"catalogue/{name}"][()] for name in ("attractor", "x")}
        return found | {"printed": printed}


# The force of the spring is at most 20/(3 sqrt(3)) N = 3.849 N between the wells.
@pytest.mark.parametrize(
    ("force", "sets"), [pytest.param(0.5, 3, marks=pytest.mark.long), (3.8, 3), (3.9, 1)]
)
def test_friction_holds_a_body_in_each_well_and_between(separatrix, tmp_path, force, sets):
    found = searched(separatrix, tmp_path, WELLS.format(force=force))
    assert len(found["x"]) == sets
    starts = found["x0"]
    held = np.abs(10 * starts - 10 * starts**3) < force
    for start, label in zip(starts[held], found["map"][held, 2], strict=True):
        rest = found["x"][list(found["attractor"]).index(label)]
        between = np.linspace(start, rest, 200)
        assert (np.abs(10 * between - 10 * between**3) < force + 1e-9).all()


def test_a_body_falls_to_one_stop_or_the_other(separatrix, tmp_path):
    found = searched(separatrix, tmp_path, FALLING)
    np.testing.assert_allclose(np.sort(found["x"]), [-0.5, 0.5], atol=1e-9)
    still = found["map"][:, 2]
    sides = [found["x"][list(found["attractor"]).index(label)] for label in still]
    assert (np.sign(sides) == np.sign(found["x0"])).all()
    assert "x = -0.5" in found["printed"] and "x = 0.5" in found["printed"]


def test_rests_keep_their_numbers_along_a_parameter(separatrix, tmp_path):
    axis = '[[axis]]\nname = "friction.f.force"\nfrom = 1\nto = 3\ncount = 4\n'
    text = WELLS.format(force=1).replace("[run]", axis + "[run]")
    found = searched(separatrix, tmp_path, text)
    for number in np.unique(found["attractor"]):
        rests = found["x"][found["attractor"] == number]
        assert len(rests) == 4
        assert np.ptp(rests) < 0.5


@pytest.mark.parametrize("driven", [False, True], ids=["alone", "driven"])
def test_own_forces_press_a_body_on_its_stop(separatrix, tmp_path, driven):
    """What rests on a stop under its weight has settled."""
    case = 'body = { mass = 1 }\nforce = { w = { force = "-g", g = 9.81 } }\n'
    case += 'contact = { law = "newton", restitution = 0.5, lower = 0 }\n'
    if driven:
        case = case.replace('"-g"', '"-g + cos(phase)"') + 'drive = { law = "expression", period = 1 }\n'
    (tmp_path / "case.toml").write_text(case + AXES.format(low=0, high=1))
    succeed(separatrix, "basin", "case.toml", "--set=attractors.sample=16", "-o", "map.h5", folder=tmp_path)
    with h5py.File(tmp_path / "map.h5") as file:
        reasons = file["reason"].attrs["flag_meanings"].split()
        assert {reasons[code] for code in file["reason"][()].ravel()} == {"settled"}
        assert (file["attractor"][()] == 1).all()
