# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rates with their Wilson intervals."""

import math
from dataclasses import dataclass

Z95 = 1.959963984540054


@dataclass(frozen=True)
class Rate:
    """`hits` of `cases`."""

    hits: int
    cases: int

    @property
    def share(self) -> float:
        """Hits over cases; NaN without cases."""
        return self.hits / self.cases if self.cases else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """E. B. Wilson's 95 % interval (1927)."""
        n, p, z = self.cases, self.share, Z95
        if n == 0:
            return 0.0, 1.0
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        return max(0.0, middle - half), min(1.0, middle + half)

    def __str__(self) -> str:
        """As a page shows it."""
        if not self.cases:
            return "no case"
        low, high = self.interval
        return f"{100 * self.share:.1f} % ({self.hits} of {self.cases}; {100 * low:.1f} to {100 * high:.1f})"


def rate(flags: list[bool]) -> Rate:
    """How many are true."""
    return Rate(sum(flags), len(flags))


def difference(one: Rate, other: Rate) -> tuple[float, float]:
    """R. G. Newcombe's 95 % interval of the difference of two rates (1998, method 10)."""
    if not one.cases or not other.cases:
        return -1.0, 1.0
    middle = one.share - other.share
    (low, high), (other_low, other_high) = one.interval, other.interval
    return (
        middle - math.hypot(one.share - low, other_high - other.share),
        middle + math.hypot(high - one.share, other.share - other_low),
    )
