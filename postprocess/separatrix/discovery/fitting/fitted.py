# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A machine with its fit, and two of them compared fairly."""

from dataclasses import dataclass, field, replace

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.normal_equations import inverse_scaled
from separatrix.discovery.policy import FIT


@dataclass
class Fitted:
    """A machine with all its free parameters at their best values."""

    names: tuple[str, ...]
    model: object
    problem: Likelihood
    fit: Fit
    added: tuple[int, ...]
    tries: int = 1
    # the same function on more knots, where one was tried, converged or not
    finer: "Fitted | None" = None
    # squares by segment in the earlier stages, where they were asked for; a copy has none
    short: dict[int, np.ndarray] = field(default_factory=dict, init=False)

    @property
    def unseen(self) -> np.ndarray:
        """Which free parameters the records do not determine."""
        return np.diag(self.fit.reduced.matrix[self.fit.good].sum(axis=0)) <= 0

    @property
    def covariance(self) -> np.ndarray:
        """Of all free parameters, starts projected out, enlarged where the fit is worse than the noise."""
        matrix = self.fit.reduced.matrix[self.fit.good].sum(axis=0)
        open_ = ~self.fit.at_bound & (np.diag(matrix) > 0)
        return inverse_scaled(matrix, open_) * max(1.0, self.fit.reduced_chi2)


def leaves_noise(rival: Fitted, base: Fitted) -> bool:
    """Whether a machine leaves noise, or nearly so and next to nothing of a gap that was far larger."""
    fit = rival.fit
    if fit.like_noise(2):
        return True
    return fit.like_noise(FIT.nearly_noise) and fit.excess < FIT.nothing_left * base.fit.excess


def hopeless(base: Fitted) -> float:
    """Reduced chi^2 from which on a candidate is abandoned."""
    return FIT.hopeless * max(1.0, base.fit.reduced_chi2)


def beaten(one: Fitted, rival: Fitted) -> bool:
    """Whether a fit is far behind even without the segments in which it is furthest behind."""
    parts = np.sort(gain_over(one, rival)[1])
    return bool(parts[FIT.spared :].sum() < -2 * FIT.beaten)


def shared_values(base: Fitted, other: Fitted) -> np.ndarray:
    """Values of the base's parameters as another machine has them, its own where that has none."""
    own = [replace(one, value=value) for one, value in zip(base.problem.free, base.fit.values, strict=True)]
    return values_of(other, own)


def values_of(fitted: Fitted, free: list[Free]) -> np.ndarray:
    """Values of free parameters as a fitted machine has them, their own where it has none."""
    known = {
        (one.path, one.record): value
        for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True)
    }
    return np.array([known.get((one.path, one.record), one.value) for one in free])


def common(one: Fitted, other: Fitted) -> np.ndarray:
    """Segments that both fits can be scored by."""
    return one.fit.good & other.fit.good


def gain_over(one: Fitted, other: Fitted) -> tuple[float, np.ndarray]:
    """Log-likelihood of `one` over that of `other`, and its parts by segment.

    A segment that one of them simulates without steady impacts could not be fitted: its chi^2 is an upper
    bound, which counts as far as it favours that one.
    """
    parts = 0.5 * (other.fit.chi2 - one.fit.chi2)
    proven = [
        _bounded_by(one) & other.fit.good & (parts > 0),
        one.fit.good & _bounded_by(other) & (parts < 0),
    ]
    parts = np.where(common(one, other) | proven[0] | proven[1], parts, 0.0)
    return float(parts.sum()), parts


def _bounded_by(fitted: Fitted) -> np.ndarray:
    """Segments that are simulated to their end, but without steady impacts."""
    evaluation = fitted.fit.evaluation
    return ~evaluation.failed & ~evaluation.steady & (fitted.fit.counts > 0)
