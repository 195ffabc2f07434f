# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Basin entropy (Daza and others 2016) on discs, each with starts of its own."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import integrate, special, stats

from separatrix.measuring.sampling import (
    NO_START,
    NOT_KNOWN,
    Labels,
    Region,
    generator,
    in_ball,
    label_all,
    mean_interval,
)


@dataclass(frozen=True)
class Entropy:
    """Entropies at one radius: of all discs, and of those with two basins or more.

    `smooth` is the boundary entropy that a smooth boundary has with the same number of starts a disc, and
    `probability` how likely it would be to find as much as here, or more, if the boundary were smooth. `left`
    are the discs left out, because a start does not exist or a label is not known, `unknown` those of them
    that have starts throughout; `basins` is how many basins were met.
    """

    radius: float
    discs: int
    mixed: int
    starts: int
    all_discs: tuple[float, float, float]
    boundary: tuple[float, float, float]
    smooth: float
    probability: float
    left: int
    unknown: int
    basins: int

    @property
    def unsure(self) -> bool:
        """Whether so many discs have labels not known that the others do not stand for all."""
        return self.unknown > 0.01 * (self.discs + self.unknown)

    def bounds(self, interval: tuple[float, float, float], discs: int) -> tuple[float, float, float]:
        """Return a mean over so many discs with ends that allow for those whose labels are not known.

        Each of these may have from no entropy to that of all basins alike, and one more.
        """
        value, lower, upper = interval
        share = self.unknown / max(1, discs + self.unknown)
        most = np.log(self.basins + (self.unknown > 0))
        return value, max(0.0, (1 - share) * lower), min(most, (1 - share) * upper + share * most)


def basin_entropy(
    labels: Labels, region: Region, radius: float, discs: int = 2000, starts: int = 200, seed: int = 1
) -> Entropy:
    """Return the entropies of the basins in `discs` balls of a radius within the region."""
    random = generator(seed, 4, int(np.float64(radius).view(np.int64)))
    room = Region(region.lower + radius, region.upper - radius, region.turns)
    centres = room.draw(discs, random)
    entropies, left, unknown, met = [], 0, 0, set()
    step = max(1, (1 << 20) // starts)
    for first in range(0, discs, step):
        some = centres[first : first + step]
        points = some[:, None, :] + radius * in_ball(len(some) * starts, region.dimension, random).reshape(
            len(some), starts, region.dimension
        )
        found = label_all(labels, points.reshape(-1, region.dimension)).reshape(len(some), starts)
        whole, known = (found != NO_START).all(axis=1), (found != NOT_KNOWN).all(axis=1)
        good = whole & known
        left += int(np.sum(~good))
        unknown += int(np.sum(whole & ~known))
        met |= set(np.unique(found[found > 0]))
        entropies.append(_entropies(found[good]))
    values = np.concatenate(entropies) if entropies else np.empty(0)
    mixed = values[values > 0]
    smooth = smooth_entropy(starts, region.dimension)
    return Entropy(
        radius,
        len(values),
        len(mixed),
        starts,
        mean_interval(values) if len(values) else (np.nan,) * 3,
        mean_interval(mixed) if len(mixed) else (np.nan,) * 3,
        smooth,
        _above(mixed, smooth),
        left,
        unknown,
        len(met),
    )


def _entropies(found: np.ndarray) -> np.ndarray:
    """Entropy of the shares of the labels in each row."""
    total = np.zeros(len(found))
    for label in np.unique(found):
        total += special.entr(np.mean(found == label, axis=1))
    return total


def _above(mixed: np.ndarray, smooth: float) -> float:
    """Probability of such a mean, or a larger one, over a smooth boundary."""
    if len(mixed) < 2:
        return 1.0
    deviation = np.std(mixed, ddof=1)
    if deviation == 0:
        return float(np.mean(mixed) <= smooth)
    return float(stats.t.sf((np.mean(mixed) - smooth) / (deviation / np.sqrt(len(mixed))), len(mixed) - 1))


def cap_share(height: np.ndarray, dimension: int) -> np.ndarray:
    """Return the share of the unit ball beyond a plane at a distance `height` (-1 to 1) from its centre."""
    return stats.beta.cdf((1 - height) / 2, (dimension + 1) / 2, (dimension + 1) / 2)


@lru_cache(maxsize=64)
def smooth_entropy(starts: int | None, dimension: int) -> float:
    """Return the boundary entropy of two basins with a flat boundary between them.

    All distances of the boundary from the centre of a ball are equally likely. With `starts` drawn in each
    ball: the mean of the entropy found over balls in which both were found; None: of the shares themselves
    (1/2, 0.43951 and 0.39609 in one, two and three dimensions).
    """
    if starts is None:
        found, _ = integrate.quad(
            lambda h: float(_binary(cap_share(h, dimension))), 0, 1, epsabs=1e-12, limit=400
        )
        return found
    nodes, weights = np.polynomial.legendre.leggauss(120)
    # crowded at the rim, where the share goes with a power of the distance
    heights = 1 - ((1 - nodes) / 2) ** 2
    weights = weights * (1 - nodes) / 2
    shares = cap_share(heights, dimension)
    counts = np.arange(1, starts)
    chances = stats.binom.pmf(counts[None, :], starts, shares[:, None])
    above = weights @ (chances @ _binary(counts / starts))
    below = weights @ (1 - (1 - shares) ** starts - shares**starts)
    return float(above / below)


def _binary(share: np.ndarray) -> np.ndarray:
    return special.entr(share) + special.entr(1 - share)


def exponent(found: list[Entropy]) -> tuple[float, float, float]:
    """Return the slope of ln(Sb) over ln(radius), which is the uncertainty exponent, and its interval."""
    kept = [one for one in found if one.all_discs[0] > 0 and one.mixed > 1]
    if len(kept) < 2:
        return np.nan, np.nan, np.nan
    x = np.log([one.radius for one in kept])
    y = np.log([one.all_discs[0] for one in kept])
    errors = np.array([(one.all_discs[2] - one.all_discs[1]) / 3.92 / one.all_discs[0] for one in kept])
    x = x - np.average(x, weights=errors**-2)
    slope = float(np.sum(x * y / errors**2) / np.sum(x**2 / errors**2))
    half = 1.96 / float(np.sqrt(np.sum(x**2 / errors**2)))
    if len(kept) > 2:
        misfit = y - np.average(y, weights=errors**-2) - slope * x
        half *= max(1.0, float(np.sqrt(np.sum((misfit / errors) ** 2) / (len(kept) - 2))))
    return slope, slope - half, slope + half
