# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A measured force on fewer knots moves the body in the same way."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from separatrix.discovery.measured.thinned_force import thinned

INTERVAL, MASS = 5e-4, 2.0
T = INTERVAL * np.arange(20_001)


def moved(t: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position and speed of a free body under a force that is linear between samples."""
    fine = np.interp(T, t, force) / MASS
    speed = cumulative_trapezoid(fine, T, initial=0)
    return cumulative_trapezoid(speed, T, initial=0), speed


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_a_slow_force_has_fewer_knots_and_the_same_motion(noise: float) -> None:
    force = 3 * np.cos(7 * T) + 2 * np.sin(19 * T) + noise * np.random.default_rng(4).standard_normal(T.size)
    interval, knots = thinned(force, INTERVAL, MASS, 1e-7, np.inf)
    every = round(interval / INTERVAL)
    assert every >= 2 and knots.size == -(-(T.size - 1) // every) + 1
    x, v = moved(T, force)
    thin_x, thin_v = moved(interval * np.arange(knots.size), knots)
    assert np.max(np.abs(thin_x - x)) < 1.5e-7
    # a limit of the speed is kept as well, on fewer or as many knots
    other, more = thinned(force, INTERVAL, MASS, 1e-7, np.max(np.abs(thin_v - v)) / 10)
    assert other < interval and more.size > knots.size


def test_a_force_that_changes_at_every_sample_is_kept() -> None:
    force = np.random.default_rng(4).standard_normal(T.size)
    interval, knots = thinned(force, INTERVAL, MASS, 1e-10, np.inf)
    assert interval == INTERVAL and knots is force


def test_a_linear_force_needs_two_cells_and_a_last_value_is_repeated() -> None:
    force = 1 + 2 * T[:1025]
    interval, knots = thinned(force, INTERVAL, MASS, 1e-12, np.inf)
    np.testing.assert_allclose(knots, 1 + 2 * interval * np.arange(knots.size), rtol=1e-9)
    interval, knots = thinned(np.append(force, force[-1]), INTERVAL, MASS, 1e-6, np.inf)
    assert (knots.size - 1) * interval >= 1025 * INTERVAL
