# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How well a fitted machine predicts records that the fit never saw.

Only quantities of the record itself are fitted to it: the starts of its segments, the zero of its crank, its
clock, and the curve of its sensor where imperfections of the rig are fitted. The score of a segment is the
logarithm of its predictive density, with the uncertainty of the fitted parameters.

The parameters of a wrong machine count as less certain, which would favour the worse of two wrong machines.
Candidates over such a machine are compared by squared errors alone.
"""

from dataclasses import dataclass, replace

import numpy as np

from separatrix.discovery.fitting.data import Data, fit_stages
from separatrix.discovery.fitting.fit import Fit, again, minimise
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.machine import CRANK_ZERO, Free, drive_amplitudes, on_other_records
from separatrix.discovery.fitting.rescue import suspicious
from separatrix.discovery.policy import FIT
from separatrix.errors import SeparatrixError


@dataclass
class Prediction:
    """Scores by segment of held-out records (up to a constant), and the fit of their starts."""

    score: np.ndarray
    good: np.ndarray
    record: np.ndarray
    problem: Likelihood
    fit: Fit
    # reduced chi^2 of the training records, at least 1
    misfit: float
    # of the parameters of the machine, which come first among those that are free and were not fitted here
    covariance: np.ndarray
    # whether the parameters are those beside imperfections of a rig in the training records
    with_imperfections: bool = False

    @property
    def reduced_chi2(self) -> float:
        """Sum of squares per degree of freedom; the parameters of the machine were not fitted."""
        return float(self.fit.chi2[self.good].sum() / max(1, self._freedom))

    @property
    def sample_chi2(self) -> float:
        """The same per degree of freedom of all samples, those of condensed blocks included."""
        squares, freedom = self.fit.condensed(self.good)
        return float((self.fit.chi2[self.good].sum() + squares) / max(1.0, self._freedom + freedom))

    @property
    def excess(self) -> float:
        """What chi^2 of all samples has beyond its degrees of freedom."""
        squares, freedom = self.fit.condensed(self.good)
        return float(self.fit.chi2[self.good].sum() + squares - self._freedom - freedom)

    @property
    def _freedom(self) -> int:
        good = self.good
        own = len(self.problem.free) - self.covariance.shape[0]
        starts = self.fit.unknowns * good.sum()
        return int(self.fit.counts[good].sum() - starts - own)


@dataclass
class Known:
    """Training result for the parameters of a machine: values, covariance, and which are undetermined.

    The latter are fitted to the held-out records: without an impact in training, none can be predicted.
    """

    values: np.ndarray
    covariance: np.ndarray
    unseen: np.ndarray


def predict(
    data: Data,
    model,
    free: list[Free],
    known: Known,
    misfit: float = 1.0,
    guess: Prediction | None = None,
) -> Prediction:
    """Score held-out records by a machine as far as it is known, of the given `misfit` in training.

    `guess`: what another machine predicted there, whose starts, crank and clock are tried too.
    """
    shared = [i for i, one in enumerate(free) if one.record is None]
    whole = on_other_records(free, data.prepared)
    start = np.concatenate([known.values[shared], np.zeros(len(whole) - len(shared))])
    fixed = np.arange(len(whole)) < len(shared)
    fixed[: len(shared)] &= ~known.unseen[shared]
    fit = _fit_own(data, model, whole, start, fixed, guess)
    problem = data.problem(model, data.last, whole)
    fit = again(problem, fit)
    used = known.covariance[np.ix_(shared, shared)]
    score = _scores(fit.chi2, fit.reduced.matrix, fit.reduced.gradient, used)
    return Prediction(score, fit.good, problem.segments.record, problem, fit, misfit, used)


def gained_together(one: Prediction, other: Prediction) -> np.ndarray:
    """Gain of `one` in predicting each segment; the sum is the joint gain of all segments.

    The effect of a common error of the parameters is distributed over the segments of a record. Information
    that several records share counts once, and is deducted from each in proportion to its gain.
    """
    parts = gained(one, other)
    seen = parts != 0
    whole = ahead(one, other, other.misfit)
    if not other.fit.converged:
        # it might predict so much better
        whole -= min(max(0.0, whole), 0.5 * other.fit.decrement)
    numbers = np.unique(one.record)
    alone = np.array([ahead(one, other, other.misfit, one.record == number) for number in numbers])
    sizes = np.abs(alone)
    shares = sizes / sizes.sum() if sizes.any() else np.full(sizes.size, 1 / sizes.size)
    alone += shares * (whole - alone.sum())
    for number, its in zip(numbers, alone, strict=True):
        here = seen & (one.record == number)
        parts[here] += (its - parts[here].sum()) / max(1, np.count_nonzero(here))
    return parts


def gained(one: Prediction, other: Prediction) -> np.ndarray:
    """Gain of `one` over `other` in predicting each segment, in units of log density; 0 where one fails.

    The difference of the scores. If `other` misses the records by far more than the noise, its density is
    meaningless, and the difference of squared errors counts (Diebold and Mariano), both machines as fitted.
    The machine that all candidates are compared with chooses the measure, so that gains are comparable.
    """
    wrong = other.misfit > FIT.misfit_of_errors
    parts = 0.5 * (other.fit.chi2 - one.fit.chi2) if wrong else one.score - other.score
    return np.where(one.good & other.good, parts, 0.0)


def ahead(
    one: Prediction, other: Prediction, misfit: float | None = None, rows: np.ndarray | None = None
) -> float:
    """Gain of `one` over `other` in predicting all segments, or some rows, in units of log density.

    If both leave only noise, the density is that of all segments together: the error of an uncertain
    parameter is common to all of them and counts once. The larger misfit of both chooses the measure, or a
    given one.
    """
    both = one.good & other.good
    if rows is not None:
        both &= rows
    if (max(one.misfit, other.misfit) if misfit is None else misfit) > FIT.misfit_of_errors:
        return float(0.5 * (other.fit.chi2 - one.fit.chi2)[both].sum())
    return _density(one, both) - _density(other, both)


def _density(one: Prediction, rows: np.ndarray) -> float:
    """Log density of some segments together, their starts free, the machine known up to its covariance."""
    reduced = one.fit.reduced
    chi2, matrix, gradient = (
        table[rows].sum(axis=0)[None] for table in (one.fit.chi2, reduced.matrix, reduced.gradient)
    )
    return float(_scores(chi2, matrix, gradient, one.covariance)[0])


def _fit_own(
    data: Data, model, free: list[Free], values: np.ndarray, fixed: np.ndarray, guess: Prediction | None
) -> Fit:
    """Fit what belongs to the records; the rest is written into the machine and not differentiated by."""
    known = [(one, value) for one, value, settled in zip(free, values, fixed, strict=True) if settled]
    own = ~fixed
    settled = _with(model, known)
    if settled is None:
        settled, own = model, np.ones(values.size, bool)
    # what the machine has no parameter for
    own |= np.array([one.is_imperfection or one.path == CRANK_ZERO for one in free], bool)
    kept = [one for one, mine in zip(free, own, strict=True) if mine]
    fit = None
    if guess is not None:
        problem = data.problem(settled, data.last, kept)
        begun = _records_own(guess, kept, values[own])
        fit = minimise(problem, begun, guess.fit.starts, most=12, fixed=fixed[own])
    # a guess from which all segments converge needs no shorter segments first
    if fit is None or not fit.converged or suspicious(fit).size:
        stages = list(range(len(data.stages)))
        problem, other = fit_stages(
            data, settled, kept, values[own], stages=stages, most=12, fixed=fixed[own]
        )
        if fit is None or other.good.sum() > fit.good.sum() or other.total < fit.total:
            fit = other
    if not fit.converged:
        more = minimise(problem, fit.values, fit.starts, fixed=fixed[own], patient=True)
        if more.good.sum() >= fit.good.sum() and more.total < fit.total:
            fit = more
    found = values.copy()
    found[own] = fit.values
    return replace(fit, values=found, movable=~fixed)


def _records_own(guess: Prediction, free: list[Free], values: np.ndarray) -> np.ndarray:
    """Values of what belongs to the records as another machine has them, those given where it has none."""
    pairs = zip(guess.problem.free, guess.fit.values, strict=True)
    known = {(one.path, one.record): value for one, value in pairs if one.record is not None}
    return np.array([known.get((one.path, one.record), own) for one, own in zip(free, values, strict=True)])


def _with(model, known: list[tuple[Free, float]]):
    """The machine with values written in; None where they make no case."""
    chosen: dict[str, float] = {}
    for one, value in known:
        if not one.is_nuisance:
            chosen |= one.numbers(value)
    for one, value in known:
        if one.path == "nuisance:drive_scale":
            chosen |= {path: value * amplitude for path, amplitude in drive_amplitudes(model).items()}
    try:
        return type(model).from_text(model.to_text(chosen))
    except SeparatrixError:
        return None


def explained(one: Prediction, rows: np.ndarray) -> float:
    """Part of chi^2 of some segments that likely errors of the parameters explain."""
    reduced = one.fit.reduced
    matrix, gradient = (table[rows].sum(axis=0)[None] for table in (reduced.matrix, reduced.gradient))
    return float(_explained(matrix, gradient, one.covariance)[0][0])


def _scores(chi2: np.ndarray, matrix: np.ndarray, gradient: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Log density of each segment, its start free, the machine known up to its covariance."""
    part, spread = _explained(matrix, gradient, covariance)
    _, logarithm = np.linalg.slogdet(spread)
    return -0.5 * (chi2 - part) - 0.5 * logarithm


def _explained(
    matrix: np.ndarray, gradient: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What errors of the parameters explain of chi^2 of each segment, and the spread of such errors."""
    shared = covariance.shape[0]
    values, vectors = np.linalg.eigh(covariance) if shared else (np.zeros(0), np.zeros((0, 0)))
    root = vectors * np.sqrt(np.maximum(values, 0))
    matrix = root.T @ matrix[:, :shared, :shared] @ root
    gradient = (root.T @ gradient[:, :shared, None])[:, :, 0]
    spread = matrix + np.eye(shared)
    return np.einsum("ki,ki->k", gradient, np.linalg.solve(spread, gradient[:, :, None])[:, :, 0]), spread
