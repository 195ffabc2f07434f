# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user may choose, and the thresholds of the gates."""

from collections.abc import Callable
from dataclasses import dataclass, field

from separatrix.checks import count
from separatrix.discovery.policy.row import row
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
    # seconds after which the search ends with what it knows; None = no limit
    time_limit: float | None = None
    # threads that fly segments, which do not change the verdict
    workers: int = 1
    # None = the whole catalogue
    candidates: tuple[str, ...] | None = None
    # fmt: off
    detection_level: float = row(0.01, "1", "test", "family-wise error of the detection")
    gap_share: float = row(0.3, "1", "test", "share of that error for a gap that no effect closes")
    separation: float = row(3.0, "log-likelihood", "test",
        "distance by which a name must beat the next one: odds of 20 to 1")
    equivalent: float = row(2.0, "separation", "test", "the same for two names of one motion")
    needed: float = row(2.0, "separation", "test",
        "the same for a set over the set without one of its effects")
    harm: float = row(-3.0, "log-likelihood", "test", "score that a held-out record may lose by a name")
    inclusion: float = row(0.9, "1", "test", "share of bootstraps in which an effect pays for its parameters")
    followed: float = row(0.9, "1", "campaign",
        "share of the segments of the base that a machine must follow: losing more would pass for a gain")
    drive_scales: tuple[float, float] = row((0.5, 2.0), "1", "rig",
        "scales of the drive beyond which it would be another drive")
    adequate_chi2: float = row(1.1, "1", "campaign", "largest reduced chi^2 of an adequate machine")
    missed_chi2: float = row(2.0, "1", "campaign",
        "the same for a record of unstated noise, which is an estimate")
    adequate_share: float = row(0.8, "1", "campaign", "share of the closable gap that it must close")
    adequate_p: float = row(1e-4, "1", "test", "p value of what is left below which no share is enough")
    least_gap: float = row(0.05, "noise", "campaign",
        "root mean square of a sample below which a flexible force explains no gap")
    least_effect: float = row(0.02, "noise", "campaign",
        "the same below which nothing is named: imperfections of a rig may be as large")
    remaining: float = row(1e-2, "1", "campaign",
        "share that may remain of a closed gap, as of another cause")
    characterised: float = row(0.5, "1", "campaign",
        "share of the gap that a force must close for its dependence to be reported")
    visible: float = row(5.0, "standard error", "test", "size of what counts as visible")
    bootstraps: int = row(400, "1", "effort", "draws of a bootstrap")
    # fmt: on
    progress: Callable[[str, float], None] = field(default=_silent, compare=False)

    def __post_init__(self) -> None:
        """Refuse what cannot be compared."""
        if self.compare not in COMPARED:
            raise SeparatrixError(f"compare: found '{self.compare}', allowed {' and '.join(COMPARED)}", USAGE)
        count("workers", self.workers)
