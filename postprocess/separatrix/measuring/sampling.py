# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What all estimators share: regions, labels, starts drawn with a seed, and intervals.

A labelling function takes points (n, d) and returns n whole numbers: the basin (from 1), 0 where it is not
known, -1 where the machine has no such start. It depends on each point alone, so that results do not depend
on how the points are shared out.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

Labels = Callable[[np.ndarray], np.ndarray]

NOT_KNOWN = 0
NO_START = -1
CONFIDENCE = 0.95
#: Points labelled at once; bounds the memory.
_PIECE = 1 << 20


@dataclass(frozen=True)
class Region:
    """A box; `turns` are the lengths after which a coordinate comes back, inf where it does not."""

    lower: np.ndarray
    upper: np.ndarray
    turns: np.ndarray

    @classmethod
    def of(cls, lower: object, upper: object, turns: object = None) -> "Region":
        """Return the region between two corners."""
        lower, upper = np.atleast_1d(np.asarray(lower, float)), np.atleast_1d(np.asarray(upper, float))
        turns = np.full(lower.size, np.inf) if turns is None else np.asarray(turns, float)
        return cls(lower, upper, turns)

    @property
    def size(self) -> np.ndarray:
        """Lengths of the sides."""
        return self.upper - self.lower

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return self.lower.size

    @property
    def volume(self) -> float:
        """Area, or volume."""
        return float(np.prod(self.size))

    def draw(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Return points drawn evenly."""
        return random.uniform(self.lower, self.upper, (count, self.dimension))

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether points are in it; a coordinate that comes back always is."""
        within = (points >= self.lower) & (points <= self.upper)
        return np.all(within | np.isfinite(self.turns), axis=1)

    def edge(self, points: np.ndarray) -> np.ndarray:
        """Distance of points to the edge; a coordinate that comes back has none."""
        free = np.isfinite(self.turns)
        away = np.minimum(points - self.lower, self.upper - points)
        return np.where(free, np.inf, away).min(axis=1)


def label_all(labels: Labels, points: np.ndarray) -> np.ndarray:
    """Label any number of points, piece by piece."""
    if len(points) <= _PIECE:
        return np.asarray(labels(points))
    pieces = [np.asarray(labels(points[i : i + _PIECE])) for i in range(0, len(points), _PIECE)]
    return np.concatenate(pieces)


def generator(seed: int, *purpose: int) -> np.random.Generator:
    """Return the random numbers of one purpose; they do not depend on what else was drawn."""
    return np.random.default_rng([seed, *purpose])


def in_ball(count: int, dimension: int, random: np.random.Generator) -> np.ndarray:
    """Return points drawn evenly from the ball of radius 1."""
    directions = random.standard_normal((count, dimension))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * random.uniform(0, 1, (count, 1)) ** (1 / dimension)


def share_interval(hits: int, count: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Return the interval of Clopper and Pearson of a share."""
    if count == 0:
        return 0.0, 1.0
    found = stats.binomtest(int(hits), int(count)).proportion_ci(confidence, method="exact")
    return float(found.low), float(found.high)


def mean_interval(values: np.ndarray, confidence: float = CONFIDENCE) -> tuple[float, float, float]:
    """Return the mean of independent values and its interval by Student's distribution."""
    mean = float(np.mean(values))
    if len(values) < 2:
        return mean, -np.inf, np.inf
    error = float(np.std(values, ddof=1) / np.sqrt(len(values)))
    half = error * float(stats.t.ppf(0.5 + confidence / 2, len(values) - 1))
    return mean, mean - half, mean + half
