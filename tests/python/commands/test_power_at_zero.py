# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A Hertz force between parts, by an expression that is not defined where they are apart."""

import numpy as np
import pytest
import separatrix as sx
from scipy.integrate import solve_ivp

CASE = {
    "body": {"ball": {"mass": 1, "load": -1}},
    "spring": {"ground": {"law": "expression", "between": ["ball"], "force": "k*max(-x, 0)^1.5", "k": 1}},
    "start": {"x0": 1},
    "run": {"duration": 10, "average": "window"},
}


@pytest.mark.parametrize("stiffness", [1, 7, 1e3, 1e6])
def test_a_ball_leaves_the_ground_again(stiffness):
    """The base of the power becomes negative within the steps by which the separation is found."""
    ours = sx.trajectory(sx.Case.from_dict(CASE).with_({"spring.ground.k": stiffness}))

    def slope(_, y):
        return [y[1], stiffness * max(-y[0], 0) ** 1.5 - 1]

    def crossing(_, y):
        return y[0]

    crossing.terminal = True
    t, y, count = 0.0, np.array([1.0, 0.0]), 0
    while t < 10:
        crossing.direction = -1 if count % 2 == 0 else 1
        flight = solve_ivp(slope, (t, 10), y, "DOP853", rtol=1e-12, atol=1e-14, events=crossing)
        t, y, count = flight.t[-1], flight.y[:, -1], count + 1
    assert count > 3
    np.testing.assert_allclose([float(ours.x[-1]), float(ours.v[-1])], y, rtol=0, atol=1e-7)
