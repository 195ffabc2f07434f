# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user may choose, and the thresholds of the decision in one place."""

from collections.abc import Callable
from dataclasses import dataclass, field


def _silent(stage: str, done: float) -> None:
    """Report nothing."""


@dataclass(frozen=True)
class Options:
    """Choices of one run; the defaults are those of the campaign in docs/discovery.md."""

    seed: int = 1
    quick: bool = False
    # longest segment in drive periods, or in seconds where there is no period
    segment_periods: float = 1.0
    segment_seconds: float | None = None
    most_effects: int = 3
    # name effects that help though a gap remains that none closes
    partial: bool = False
    # None = the whole catalogue
    candidates: tuple[str, ...] | None = None
    # family-wise error of the detection
    detection_level: float = 0.01
    # log-likelihood by which a name must beat the next one
    separation: float = 3.0
    # largest reduced chi^2 and smallest share of the closable gap of an adequate model
    adequate_chi2: float = 1.1
    adequate_share: float = 0.8
    # size of what counts as visible, in standard errors
    visible: float = 5.0
    bootstraps: int = 400
    progress: Callable[[str, float], None] = field(default=_silent, compare=False)
