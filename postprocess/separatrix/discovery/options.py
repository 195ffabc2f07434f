# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user may choose, and the thresholds of the gates."""

from collections.abc import Callable
from dataclasses import dataclass, field

from separatrix.errors import USAGE, SeparatrixError

COMPARED = ("motion", "force")
"""What of the records can be compared."""


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
    # what of the records is compared: the motion, or the force that a known motion takes
    compare: str = "motion"
    # name effects that help though a gap remains that none closes
    partial: bool = False
    # None = the whole catalogue
    candidates: tuple[str, ...] | None = None
    # family-wise error of the detection
    detection_level: float = 0.01
    # of that error, the share for a gap that no effect closes: a flexible force is tried beside all effects
    gap_share: float = 0.3
    # log-likelihood by which a name must beat the next one: odds of 20 to 1
    separation: float = 3.0
    # the same for two names of one motion, over `separation`: they differ only while the body sticks
    equivalent: float = 2.0
    # the same for a pair over each of its effects alone, over `separation`: pairs are chosen among many
    needed: float = 2.0
    # log score that a held-out record may lose by a name: the separation of two names
    harm: float = -3.0
    # share of block bootstraps in which an effect has to pay for its parameters
    inclusion: float = 0.9
    # share of the segments of the base that the machine with the effect must follow too: losing more would
    # pass for a gain
    followed: float = 0.9
    # scales of the drive beyond which it would be another drive
    drive_scales: tuple[float, float] = (0.5, 2.0)
    # largest reduced chi^2 and smallest share of the closable gap of an adequate model
    adequate_chi2: float = 1.1
    # reduced chi^2 above which a record of unstated noise is missed: that noise is an estimate
    missed_chi2: float = 2.0
    adequate_share: float = 0.8
    # p value of what is left below which no share is enough
    adequate_p: float = 1e-4
    # root mean square over the noise of a sample below which a flexible force explains no gap, and below
    # which nothing is named: with enough samples even imperfections of a rig are significant
    least_gap: float = 0.05
    least_effect: float = 0.02
    # share of the gap, in training and on held-out records, that may remain of a closed one: a remainder so
    # small has another cause
    remaining: float = 1e-2
    # share of the gap, in training and on held-out records, that a force must close, linearised, for the
    # dependence of an unnamed gap to be reported
    characterised: float = 0.5
    # size of what counts as visible, in standard errors
    visible: float = 5.0
    bootstraps: int = 400
    progress: Callable[[str, float], None] = field(default=_silent, compare=False)

    def __post_init__(self) -> None:
        """Refuse what cannot be compared."""
        if self.compare not in COMPARED:
            raise SeparatrixError(f"compare: found '{self.compare}', allowed {' and '.join(COMPARED)}", USAGE)
