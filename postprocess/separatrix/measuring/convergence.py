# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long motions take to their attractor: times of the starts that come to it, and of no others."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from separatrix.measuring.sampling import mean_interval

QUANTILES = (0.5, 0.9, 0.99)


@dataclass(frozen=True)
class Times:
    """Times [s] of the starts of one basin: mean with interval, quantiles with theirs, the longest."""

    count: int
    mean: tuple[float, float, float]
    quantiles: tuple[tuple[float, float, float, float], ...]
    longest: float


def convergence_times(times: np.ndarray) -> Times:
    """Return the statistics of times that are all of one basin.

    The interval of a quantile is between two of the times, chosen by the binomial distribution, 95 %.
    """
    times = np.sort(times[np.isfinite(times)])
    count = len(times)
    if not count:
        return Times(0, (np.nan,) * 3, tuple((q, np.nan, np.nan, np.nan) for q in QUANTILES), np.nan)
    found = []
    for q in QUANTILES:
        low, high = stats.binom.ppf([0.025, 0.975], count, q).astype(int)
        lower = float(times[low - 1]) if low >= 1 else -np.inf
        upper = float(times[high]) if high < count else np.inf
        found.append((q, float(np.quantile(times, q)), lower, upper))
    return Times(count, mean_interval(times), tuple(found), float(times[-1]))
