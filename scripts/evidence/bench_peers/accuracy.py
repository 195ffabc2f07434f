# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two runs of the same starts compared."""

from dataclasses import dataclass

import numpy as np

from machine import Outcomes


@dataclass
class Accuracy:
    """A contestant against quadruple precision."""

    points: int
    deviation: float | None
    """Largest of |dx|/max|x| and |dv|/max|v| of final states, where the numbers of impacts agree."""
    counts: int | None
    labels: int
    typical: float | None = None
    """Median of the largest deviations of several samples."""


def compare(found: Outcomes, reference: Outcomes) -> Accuracy:
    """Compare as many starts as both have."""
    points = min(len(found.x), len(reference.x))
    same = found.impacts[:points] == reference.impacts[:points]
    deviation = max(
        float(np.max(np.abs(mine[:points] - true[:points])[same], initial=0.0) / np.max(np.abs(true)))
        for mine, true in ((found.x, reference.x), (found.v, reference.v))
    )
    labels = int(np.sum(found.label[:points] != reference.label[:points]))
    return Accuracy(points, deviation, int(np.sum(~same)), labels)
