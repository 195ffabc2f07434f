# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A measured force on fewer knots that moves the body in the same way.

A flight ends a step at every knot of a force, so one that is sampled far faster than it changes costs most
of a fit. The force on fewer knots is the projection on the piecewise linear functions over them: the
displacement that it makes agrees with that of all samples at every knot, its impulse at the end.
"""

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import solveh_banded


def thinned(
    force: np.ndarray, interval: float, mass: float, position: float, speed: float
) -> tuple[float, np.ndarray]:
    """The interval [s] and the samples [N] of the force on the fewest knots that are allowed.

    Between knots, `position` [m] and `speed` [m/s] of a free body of that `mass` may differ by so much from
    those under all samples. A last value is repeated where the record ends between knots.
    """
    found, every = (interval, force), 2
    while force.size > 2 * every:
        cells = -(-(force.size - 1) // every)
        whole = np.append(force, np.full(cells * every + 1 - force.size, force[-1]))
        knots = _projected(whole, every)
        left = np.interp(np.arange(whole.size), every * np.arange(cells + 1), knots) - whole
        impulse = interval * cumulative_trapezoid(left, initial=0)
        way = interval * cumulative_trapezoid(impulse, initial=0)
        if np.max(np.abs(way)) > mass * position or np.max(np.abs(impulse)) > mass * speed:
            break
        found, every = (interval * every, knots), 2 * every
    return found


def _projected(force: np.ndarray, every: int) -> np.ndarray:
    """Values at each `every`-th sample of the nearest function that is linear between these."""
    moment = force * 4.0
    moment[0], moment[-1] = 2 * force[0], 2 * force[-1]
    moment[1:] += force[:-1]
    moment[:-1] += force[1:]
    parts, share = moment[:-1].reshape(-1, every), np.arange(every) / every
    right = np.zeros(len(parts) + 1)
    right[:-1] = parts @ (1 - share)
    right[1:] += parts @ share
    right[-1] += moment[-1]
    diagonal = np.full(right.size, 4.0)
    diagonal[[0, -1]] = 2.0
    return solveh_banded(every * np.array([np.ones(right.size), diagonal]), right)
