# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Final-state sensitivity (Grebogi and others 1983): the uncertainty exponent over decades."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from separatrix.measuring.sampling import NOT_KNOWN, Labels, Region, generator, label_all


@dataclass(frozen=True)
class Exponent:
    """The uncertainty exponent: f ~ eps^value, its interval, and the curve that it is the slope of.

    `sizes` are the eps, `shares` the uncertain share f at each, `errors` the relative standard errors,
    `slopes` the local ones. `lost` is the share of labels that were not known.
    """

    value: float
    lower: float
    upper: float
    sizes: np.ndarray
    shares: np.ndarray
    errors: np.ndarray
    slopes: np.ndarray
    lost: float


def uncertainty_exponent(
    labels: Labels,
    region: Region,
    decades: tuple[float, float] = (1e-1, 1e-10),
    starts: int = 1000,
    batches: int = 8,
    fit_below: float = 1e-2,
    seed: int = 1,
    per_decade: int = 1,
) -> Exponent:
    """Return the exponent of the share of starts x that have another label at the distance eps.

    Pairs lie in a random direction, one for each start. Where few pairs differ, starts are drawn within the
    set that differs at any eps of the list from there on down (nested sets; subset simulation, Metropolis
    steps of the size eps), and ratios are multiplied; the share at eps itself is counted in that set. The
    slope is fitted to ln f below `fit_below`; bias and interval are those of the jackknife over `batches`
    independent runs. `eps` is in units of the shortest side of the region.
    """
    count = 1 + round(np.log10(decades[0] / decades[1]) * per_decade)
    sizes = np.geomspace(*decades, count) * region.size.min()
    runs = [_curve(labels, region, sizes, starts, generator(seed, 5, batch)) for batch in range(batches)]
    curves = np.array([curve for curve, _ in runs])
    lost = float(np.mean([missing for _, missing in runs]))
    shares = curves.mean(axis=0)
    seen = (curves > 0).sum(axis=0) >= 2
    errors = np.full(count, np.nan)
    errors[seen] = curves[:, seen].std(axis=0, ddof=1) / np.sqrt(batches) / shares[seen]
    fitted = np.flatnonzero(seen & (sizes <= fit_below * region.size.min() * (1 + 1e-9)))
    value, half = np.nan, np.nan
    if len(fitted) >= 3:
        value, half = _jackknife(np.log(sizes[fitted]), curves[:, fitted])
    slopes = np.full(count - 1, np.nan)
    both = seen[1:] & seen[:-1]
    slopes[both] = np.diff(np.log(np.where(seen, shares, 1.0)))[both] / np.diff(np.log(sizes))[both]
    return Exponent(value, value - half, value + half, sizes, shares, errors, slopes, lost)


def _jackknife(x: np.ndarray, curves: np.ndarray) -> tuple[float, float]:
    """Slope of the logarithm of the mean curve, its bias taken off, and half its 95 % interval."""
    batches = len(curves)
    whole = np.polyfit(x, np.log(curves.mean(axis=0)), 1)[0]
    parts = np.array(
        [np.polyfit(x, np.log(np.delete(curves, i, axis=0).mean(axis=0)), 1)[0] for i in range(batches)]
    )
    error = np.sqrt((batches - 1) / batches * np.sum((parts - parts.mean()) ** 2))
    value = batches * whole - (batches - 1) * parts.mean()
    return float(value), float(stats.t.ppf(0.975, batches - 1) * error)


@dataclass
class _Pairs:
    """Starts, their labels and directions; `depth` is how many sizes down they differ at any."""

    points: np.ndarray
    here: np.ndarray
    directions: np.ndarray
    depth: np.ndarray

    def take(self, chosen: np.ndarray) -> "_Pairs":
        return _Pairs(self.points[chosen], self.here[chosen], self.directions[chosen], self.depth[chosen])

    def put(self, where: np.ndarray, other: "_Pairs") -> None:
        for name in ("points", "here", "directions", "depth"):
            getattr(self, name)[where] = getattr(other, name)[where]


def _curve(
    labels: Labels, region: Region, sizes: np.ndarray, starts: int, random: np.random.Generator
) -> tuple[np.ndarray, float]:
    """Shares of the pairs that differ of one run, and the share of labels not known."""
    pairs = _pairs(labels, region.draw(starts, random), sizes, 0, random)
    lost = float(np.mean(pairs.here == NOT_KNOWN))
    shares = np.zeros(sizes.size)
    factor = 1.0
    for level in range(sizes.size):
        within = pairs.take(np.flatnonzero(pairs.depth > level))
        if not len(within.points):
            break
        nested = factor * len(within.points) / len(pairs.points)
        shares[level] = nested * np.mean(_differ(labels, within, sizes[level]))
        if len(within.points) < starts / 3 and level + 1 < sizes.size:
            factor = nested
            pairs = _refilled(labels, region, within, sizes, level, starts, random)
    return shares, lost


def _refilled(
    labels: Labels,
    region: Region,
    within: _Pairs,
    sizes: np.ndarray,
    level: int,
    starts: int,
    random: np.random.Generator,
) -> _Pairs:
    """As many starts as at first within the set of a level, by Metropolis steps from those that are in it."""
    pairs = within.take(random.integers(0, len(within.points), starts))
    for _ in range(4):
        there = pairs.points + sizes[level] * random.standard_normal(pairs.points.shape)
        moved = _pairs(labels, there, sizes, level, random)
        pairs.put(region.inside(there) & (moved.depth > level), moved)
    return pairs


def _pairs(
    labels: Labels, points: np.ndarray, sizes: np.ndarray, first: int, random: np.random.Generator
) -> _Pairs:
    """Label starts, and how many sizes down they differ at any from `first` on.

    A pair with a label that is not known, or a start that does not exist, does not differ.
    """
    directions = random.standard_normal(points.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    pairs = _Pairs(points, label_all(labels, points), directions, np.zeros(len(points), int))
    same_so_far = np.flatnonzero(pairs.here > 0)
    # From the smallest size up: the first that differs decides.
    for level in range(sizes.size - 1, first - 1, -1):
        if not len(same_so_far):
            break
        differs = _differ(labels, pairs.take(same_so_far), sizes[level])
        pairs.depth[same_so_far[differs]] = level + 1
        same_so_far = same_so_far[~differs]
    return pairs


def _differ(labels: Labels, pairs: _Pairs, size: float) -> np.ndarray:
    there = label_all(labels, pairs.points + size * pairs.directions)
    return (there > 0) & (there != pairs.here)
