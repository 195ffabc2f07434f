# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor without impacts and dry friction whose motion doubles its period, beside SciPy's variational flow.

The crank is light, and turns back for a moment in every turn. The motion is not symmetric, else it could not
double; its mirror image doubles at the same voltage.
"""

import re

import numpy as np
import pytest
from program import succeed
from scipy.integrate import solve_ivp

STIFFNESS, RADIUS, DAMPING, INERTIA, SLOPE = 88.82643960980423, 0.1223, 1.436, 0.0155, 0.052
CASE = f"""\
body = {{ mass = 1, gravity = 1 }}
restoring = {{ law = "linear", stiffness = {STIFFNESS} }}
friction = {{ law = "viscous", damping = {DAMPING} }}
drive = {{ law = "harmonic", amplitude = {RADIUS} }}
start = {{ x0 = 0.0614, v0 = 2.0767 }}
run = {{ duration = 16, window = 4 }}
[motor]
law = "dc"
voltage = 11
torque_constant = 0.5
resistance = 5
inertia = {INERTIA}
bearing_damping = 0.002
crank_speed = 10.6467
[sweep]
parameter = "motor.voltage"
from = 11.005
to = 11.025
step = 0.02
directions = "up"
starts = [0, 0]
"""


def rates(voltage: float, z: np.ndarray) -> tuple[list[float], np.ndarray]:
    """Rates of (angle, crank speed, position, velocity), and their derivatives by these."""
    angle, w, x, v = z
    sine, cosine = np.sin(angle), np.cos(angle)
    force = STIFFNESS * (RADIUS * cosine - x)
    rate = [w, (0.1 * voltage - SLOPE * w + force * RADIUS * sine) / INERTIA, v, force - DAMPING * v]
    by_angle = -STIFFNESS * RADIUS * sine
    slopes = np.array([
        [0, 1, 0, 0],
        [(by_angle * sine + force * cosine) * RADIUS, -SLOPE, -STIFFNESS * RADIUS * sine, 0],
        [0, 0, 0, 1],
        [by_angle, 0, -STIFFNESS, -DAMPING],
    ])  # fmt: skip
    slopes[1] /= INERTIA
    return rate, slopes


def turn(voltage: float, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The next point of the section (crank speed, position, velocity), and its derivative by the first."""

    def flow(_: float, y: np.ndarray) -> np.ndarray:
        rate, slopes = rates(voltage, y[:4])
        return np.concatenate([rate, (slopes @ y[4:].reshape(4, 4)).ravel()])

    def section(_: float, y: np.ndarray) -> float:
        return y[0] - 2 * np.pi

    section.terminal, section.direction = True, 1
    start = np.concatenate([[0], point, np.eye(4).ravel()])
    end = solve_ivp(flow, (0, 9), start, "DOP853", events=section, rtol=1e-12, atol=1e-13).y[:, -1]
    rate, _ = rates(voltage, end[:4])
    by_start = end[4:].reshape(4, 4)
    by_start = by_start - np.outer(rate, by_start[0]) / rate[0]
    return end[1:4], by_start[1:, 1:]


def multipliers(voltage: float) -> np.ndarray:
    """Multipliers of the motion through one turn, by Newton's method."""
    point = np.array([10.6467, 0.0614, 2.0767])
    for _ in range(9):
        image, by_start = turn(voltage, point)
        change = np.linalg.solve(by_start - np.eye(3), point - image)
        point = point + change
        if np.abs(change).max() < 1e-10:
            break
    return np.sort(np.linalg.eigvals(by_start).real)


def test_sweep_finds_the_doubling(separatrix, tmp_path):
    """Where the sweep names a doubling, a multiplier of SciPy's flow is -1."""
    (tmp_path / "case.toml").write_text(CASE)
    report = succeed(separatrix, "sweep", "case.toml", "-o", "sweep.h5", folder=tmp_path).out
    voltage = float(re.search(r"run up: doubling between .* in steps; doubling at ([\d.]+);", report)[1])
    assert abs(multipliers(voltage)[0] + 1) < 1e-8


@pytest.mark.long
def test_branches_find_the_doubling(separatrix, tmp_path):
    """The multipliers at the doubling are those of SciPy's flow; the doubled motion begins there."""
    (tmp_path / "case.toml").write_text(CASE)
    words = "--parameter motor.voltage --from 10.9 --to 11.1 --searches 1 -o branches.h5".split()
    report = succeed(separatrix, "branches", "case.toml", *words, folder=tmp_path, timeout=600).out
    found = re.findall(r"PD at motor\.voltage = (\S+) V, (\.+), .* multipliers (.*) and", report)
    assert {cycle for _, cycle, _ in found} == {".", ".."}
    for voltage, cycle, values in found:
        ours = np.sort([float(value) for value in values.split(",")])
        theirs = multipliers(float(voltage))
        np.testing.assert_allclose(ours, np.sort(theirs ** len(cycle)), atol=1e-7)
