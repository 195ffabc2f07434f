# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions of equations by expressions that begin on a stop, and those whose time only a rate contains."""

import math

import h5py
import numpy as np
import pytest
from program import succeed
from scipy.integrate import solve_ivp

ON_STOP = """
[body]
mass = 1
[force.spring]
force = "-k*x"
k = 400
[contact]
law = "newton"
restitution = 0.5
{side} = "{stop} mm"
[start]
x0 = "{stop} mm"
v0 = {v0}
[run]
duration = 0.01
average = "window"
{more}
"""
LOAD = """
[friction]
law = "coulomb"
kinetic_coefficient = 0.1
load = "n"
n = "1e-9 N"
"""
# Of event_kind, at the upper and at the lower stop.
IMPACTS = (1, 2)
IN_TIME = """
[body]
mass = 1
[state.z]
rate = "{rate}"
[force.f]
force = "z"
[start]
v0 = 1
[run]
duration = 4
average = "window"
"""


def motion(separatrix, folder, text: str) -> dict[str, float]:
    """The last values of a trajectory, and the number of its impacts."""
    (folder / "case.toml").write_text(text)
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", folder=folder)
    with h5py.File(folder / "out.h5") as file:
        last = {name: float(file[name][-1]) for name in ("x", "v") if name in file}
        return last | {"impacts": float(np.isin(file["event_kind"][()], IMPACTS).sum())}


# By the spring alone the motion from the stop is x cos(w t) + (v/w) sin(w t), w = 20 rad/s.
@pytest.mark.parametrize("more", ["", LOAD])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("towards", [0.6, -0.6])
def test_a_body_that_starts_on_a_stop_hits_it_if_it_moves_towards_it(
    separatrix, tmp_path, more, side, towards
):
    text = ON_STOP.format(side="upper" if side > 0 else "lower", stop=30 * side, v0=towards * side, more=more)
    found = motion(separatrix, tmp_path, text)
    v = -0.5 * towards if towards > 0 else towards
    assert found["impacts"] == (towards > 0)
    assert found["x"] == pytest.approx(side * (0.03 * math.cos(0.2) + v / 20 * math.sin(0.2)), abs=1e-9)


# The acceleration is the state.
@pytest.mark.parametrize(
    ("rate", "x"),
    [
        ("cos(t)", 8 - math.sin(4)),
        ("t", 4 + 4**4 / 24),
        ("if(t < 3, t, 0)", 4 + 3**4 / 24 + 3**3 / 6 + 4.5 / 2),
    ],
)
def test_the_time_of_a_rate_goes_on(separatrix, tmp_path, rate, x):
    assert motion(separatrix, tmp_path, IN_TIME.format(rate=rate))["x"] == pytest.approx(x, abs=1e-9)


WHEEL = """
[body.wheel]
mass = 600
load = -6e4
[body.rail]
mass = 150
[spring.track]
between = ["rail"]
stiffness = 7e7
damping = 5e4
[spring.contact]
law = "expression"
between = ["rail", "wheel"]
force = "9e10*max(-x, 0)^1.5"
[start]
x0 = -1e-3
[run]
duration = 5e-3
window = 5e-3
average = "window"
"""


def test_bodies_that_part_far_from_their_origins(separatrix, tmp_path):
    """Their distance has fewer digits than its size: the corner of a contact ended in `mode_cycle`."""

    def slope(_: float, y: np.ndarray) -> list[float]:
        force = 9e10 * max(y[1] - y[0], 0) ** 1.5
        return [y[2], y[3], (force - 6e4) / 600, (-force - 7e7 * y[1] - 5e4 * y[3]) / 150]

    end = solve_ivp(slope, (0, 5e-3), [-1e-3, 0, 0, 0], method="DOP853", rtol=1e-11, atol=1e-14).y[:, -1]
    found = motion(separatrix, tmp_path, WHEEL)
    assert [found["x"], found["v"]] == pytest.approx([end[0], end[2]], rel=1e-7)
