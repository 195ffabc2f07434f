# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The known motion of a record whose force is compared: speed, acceleration, and where they give a force.

At rest friction equals the other forces, and a speed that is within its error of zero has no known direction;
such samples are not compared.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from separatrix.discovery.measured.smoother import Smoothed
from separatrix.discovery.policy import RECORDS


@dataclass
class Driven:
    """The motion at the samples of a record."""

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    # of mass times acceleration [N]
    inertia_error: np.ndarray
    # whether the direction of the motion is known
    moves: np.ndarray
    # position where the motion turned between the sample before and this one [m], else that of the sample
    turned: np.ndarray

    def scaled(self, scale: float, rate: float) -> "Driven":
        """The same motion about its middle, `scale` times as large and `rate` times as fast."""
        middle = 0.5 * (self.x.min() + self.x.max())
        x, turned = (middle + scale * (one - middle) for one in (self.x, self.turned))
        return Driven(
            x,
            scale * rate * self.v,
            scale * rate**2 * self.a,
            scale * rate**2 * self.inertia_error,
            self.moves,
            turned,
        )

    def strokes(self, first: int, last: int) -> list[tuple[int, int, int, float]]:
        """Intervals (first, last + 1) of a piece between turning points, their direction and start [m]."""
        sign = np.where(self.v[first:last] < 0, -1, 1)
        edges = [0, *(np.flatnonzero(sign[1:] != sign[:-1]) + 1).tolist(), sign.size]
        return [
            (first + a, first + b, int(sign[a]), float(self.turned[first + a])) for a, b in pairwise(edges)
        ]

    def ways(self, pieces: list[tuple[int, int]]) -> np.ndarray:
        """Way since the last turning point [m] at each sample."""
        found = np.zeros(self.x.size)
        for piece in pieces:
            for a, b, _, begun in self.strokes(*piece):
                found[a:b] = np.abs(self.x[a:b] - begun)
        return found


def driven(
    smoothed: Smoothed,
    v: np.ndarray | None,
    velocity_sigma: float,
    mass: float,
    pieces: list[tuple[int, int]],
) -> Driven:
    """The motion as smoothed; with a measured speed `v` of noise `velocity_sigma`, their weighted mean."""
    x, speed, a = smoothed.state.T
    variance = np.maximum(smoothed.covariance[:, 1, 1], 0.0)
    if v is not None:
        share = variance / (variance + velocity_sigma**2)
        speed = (1 - share) * speed + share * v
        variance = (1 - share) * variance
    least = np.maximum(
        RECORDS.driven_rest * np.sqrt(variance), RECORDS.driven_rest_share * np.sqrt(np.mean(speed**2))
    )
    moves = np.abs(speed) > least
    for first, last in pieces:
        turns = speed[first : last - 1] * speed[first + 1 : last] <= 0
        moves[first : last - 1] &= ~turns
        moves[first + 1 : last] &= ~turns
        moves[first:last] &= np.cumsum(
            np.abs(np.diff(x[first:last], prepend=x[first]))
        ) > RECORDS.driven_beginning * np.ptp(x)
    error = RECORDS.driven_errors * mass * np.sqrt(np.maximum(smoothed.covariance[:, 2, 2], 0.0))
    turned = _turning_positions(smoothed, x, speed, pieces)
    return Driven(x.copy(), speed.copy(), a.copy(), error, moves, turned)


def _turning_positions(
    smoothed: Smoothed, x: np.ndarray, v: np.ndarray, pieces: list[tuple[int, int]]
) -> np.ndarray:
    """Positions where the motion turned between each sample and the one before; a jump of speed is a kink."""
    found = x.copy()
    at = np.flatnonzero((v[1:] < 0) != (v[:-1] < 0))
    # the motion in a gap is unknown
    at = at[~np.isin(at + 1, [first for first, _ in pieces])]
    steps = np.diff(smoothed.t)[at]
    before, after = v[at], v[at + 1]
    jump = np.isin(at, smoothed.impacts)
    # two straight lines that meet, or a parabola
    met = (x[at + 1] - after * steps - x[at]) / (before - after)
    time = np.where(jump, np.clip(met, 0.0, steps), 0.5 * steps * before / (before - after))
    found[at + 1] = x[at] + before * time
    return found
