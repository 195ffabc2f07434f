# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of a gap a machine closes, and what remains: sizes, which do not change with the rate of sampling.

A gap is the excess of chi^2 over its degrees of freedom. Divided by the number of samples it is the mean
square difference of motion and machine over that of the noise, for any sampling rate. A test of significance
finds any gap once there are enough samples.
"""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.decision.scoring import ScoredCandidate
from separatrix.discovery.fitting.ceiling import Ceiling, ceiling
from separatrix.discovery.fitting.data import Data
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.measured.preflight import Prepared
from separatrix.discovery.policy import SEARCH


@dataclass
class Remains:
    """Of one use of records: share of the gap that is closed, and what remains over the noise of a sample."""

    use: str
    closed: float | None
    size: float
    # what a force that closes most of the rest depends on; '' where nothing remains or nothing does
    depends_on: str

    def text(self) -> str:
        """In words."""
        where = {"training": "in training", "held_out": "on held-out records"}[self.use]
        done = (
            "there was no gap" if self.closed is None else f"{share_text(self.closed)} of the gap is closed"
        )
        left = (
            "what remains is below the noise of a sample"
            if self.size < SEARCH.worth_words
            else (f"what remains is {self.size:.2g} times the noise of a sample")
        )
        rest = f", mostly a force that depends on {self.depends_on}" if self.depends_on else ""
        return f"{where}, {done}; {left}{rest}"


def share_text(share: float) -> str:
    """A share in per cent, with as many digits as it takes to see what it lacks to the whole."""
    lacking = 100 * (1 - share)
    if lacking <= 0:
        return "100 %"
    digits = int(np.clip(-np.floor(np.log10(lacking)), 0, 4))
    return f"{np.floor(100 * share * 10**digits) / 10**digits:.{digits}f} %"


def noise_and_signal(data: Data) -> tuple[float, float]:
    """Root mean square noise and standard deviation of what is compared first, over all records [SI]."""
    sizes = [(one.signal.size, _noise_of(one), float(np.std(one.signal))) for one in data.prepared]
    counts, *both = (np.array(column) for column in zip(*sizes, strict=True))
    noise, signal = (float(np.sqrt(np.average(one**2, weights=counts))) for one in both)
    return noise, signal


def _noise_of(prepared: Prepared) -> float:
    """The noise of a record. Of a force that with the error of mass times acceleration.

    Where it differs from sample to sample, an equal difference everywhere makes the same chi^2 over it.
    """
    if getattr(prepared, "driven", None) is None:
        return prepared.sigma
    return float(np.mean(prepared.deviation(slice(None)) ** -2.0) ** -0.5)


def remains_of(
    base: Fitted, predicted: Prediction | None, best: ScoredCandidate, mass: float
) -> list[Remains]:
    """What an accepted effect leaves of the gap, in training and on held-out records."""
    found = [_remains("training", base, best.fitted, mass, best.ceiling)]
    if best.prediction is not None and predicted is not None:
        found.append(_remains("held_out", predicted, best.prediction, mass))
    return found


def _remains(
    use: str,
    before: Fitted | Prediction,
    after: Fitted | Prediction,
    mass: float,
    known: Ceiling | None = None,
) -> Remains:
    closed = closed_share(_fit_of(before), _fit_of(after))
    size = float(np.sqrt(max(0.0, _fit_of(after).sample_chi2 - 1)))
    if size < SEARCH.worth_words or after.problem.locates:
        # with several bodies, forces at several locations explain what remains
        return Remains(use, closed, size, "")
    return Remains(use, closed, size, (known or ceiling(after.problem, after.fit, mass)).mostly)


def _fit_of(one: Fitted | Prediction) -> Fit | Prediction:
    return one.fit if isinstance(one, Fitted) else one


def closed_share(before: Fit | Prediction, after: Fit | Prediction) -> float | None:
    """Share of a gap that is closed, 0 where it has grown; None where there was none."""
    gap, left = (max(0.0, one.sample_chi2 - 1) for one in (before, after))
    return None if gap == 0 else max(0.0, 1 - left / gap)
