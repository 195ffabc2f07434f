# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small faults that every rig has and that are no missing effect: a sensor that is not quite linear, a drive
with further harmonics.

Each is known to be no larger than some 1e-3 of the signal, which is two standard deviations here; as
nuisances with that prior they take from a residual what they may explain of it (G. E. P. Box's tentative
overfitting, with a bound).
"""

from dataclasses import dataclass, replace

import numpy as np

from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.joint_forces import FAULT, fault_columns_of
from separatrix.discovery.fitting.motions import scaled_motion
from separatrix.discovery.fitting.normal_equations import blocks_of, eliminate, solve_scaled
from separatrix.discovery.fitting.problem import Problem
from separatrix.discovery.fitting.refit import Fitted, common
from separatrix.discovery.fitting.response import force_columns, sample_times
from separatrix.discovery.fitting.screen import project

_POWERS = (2, 3)
_HARMONICS = 6
# standard deviations that a fault may have, and by which factors its prior is made narrower for that
_LARGEST = 3.0
_NARROWER, _NARROWEST = 4.0, 1e15


def fault_columns(problem: Problem, fit: Fit) -> np.ndarray:
    """Columns (segments, width, q) of faults of one standard deviation, along the fitted motion."""
    if isinstance(problem, CoordinateProblem):
        return fault_columns_of(problem, fit)
    state = scaled_motion(problem, fit)
    inside = problem.segments.inside
    columns = [_sensor(problem, fit)]
    if state["phase"] is not None:
        steps = np.diff(sample_times(problem), axis=1)
        usable = inside[:, 1:] & fit.good[:, None] & (steps > 0)
        rates = np.diff(fit.evaluation.v, axis=1)[usable] / steps[usable]
        # of the flights; impacts are far above
        usual = float(np.median(np.abs(rates))) / 0.6745 if rates.size else 0.0
        waves = [f(n * state["phase"]) for n in range(1, _HARMONICS + 1) for f in (np.sin, np.cos)]
        accelerations = FAULT * usual * np.stack(waves, axis=2) * inside[:, :, None]
        columns.append(force_columns(problem, fit, accelerations, 1.0))
    return np.concatenate(columns, axis=2)


def _sensor(problem: Problem, fit: Fit) -> np.ndarray:
    """What square and cube of what is compared, place or force, add to x or F as they are measured.

    Each record has its own: a smooth curve has other terms over another range.
    """
    signal = fit.evaluation.force if problem.in_force else fit.evaluation.x
    count, length = signal.shape
    records = len(problem.prepared)
    table = np.zeros((count, fit.evaluation.residual.shape[1], records * len(_POWERS)))
    good = problem.segments.inside & fit.good[:, None]
    for number, prepared in enumerate(problem.prepared):
        rows = np.flatnonzero(problem.segments.record == number)
        seen = signal[rows][good[rows]]
        swing = float(np.std(seen)) if seen.size else 0.0
        if swing == 0:
            continue
        u = (signal[rows] - np.mean(seen)) / swing
        sigma = prepared.deviation(problem.segments.index[rows])
        for place, power in enumerate(_POWERS, start=number * len(_POWERS)):
            table[rows, :length, place] = FAULT * swing * u**power / sigma
    return problem.whitened(table)


@dataclass(frozen=True)
class Beside:
    """Parameters fitted beside faults, linearised: their steps from the fit, and covariance."""

    shift: np.ndarray
    covariance: np.ndarray

    def of(self, places: list[int]) -> "Beside":
        """Some of the parameters."""
        return Beside(self.shift[places], self.covariance[np.ix_(places, places)])

    def add_to(self, matrix: np.ndarray, gradient: np.ndarray, open_: np.ndarray) -> None:
        """Add what is known to normal equations whose first unknowns these are, and let them move."""
        m, seen = self.shift.size, np.diag(self.covariance) > 0
        precision = _inverse(self.covariance, seen)
        matrix[:m, :m] += precision
        gradient[:m] += precision @ self.shift
        open_[:m] |= seen

    @property
    def errors(self) -> np.ndarray:
        """Standard errors, what faults may have moved a parameter by included."""
        known = np.diag(self.covariance)
        return np.where(known > 0, np.sqrt(known + self.shift**2), 0.0)


def cleaned(problem: Problem, fit: Fit, known: Beside | None = None) -> Fit:
    """The fit without what faults may explain of its residuals, its parameters fitted beside them.

    The first parameters of a held-out record were fitted to others: they are `known` from there.
    """
    evaluation = fit.evaluation
    columns, matrix, gradient, open_ = _equations(problem, fit)
    p = evaluation.by_parameter.shape[2]
    without = solve_scaled(matrix[:p, :p], gradient[:p], open_[:p])
    if known is not None:
        known.add_to(matrix, gradient, open_)
    sizes = solve_scaled(_bounded(matrix, gradient, p, open_), gradient, open_)
    # a step that the fit has without faults is none of theirs
    sizes[:p] -= without
    residual = evaluation.residual - columns @ sizes
    weights = evaluation.used * fit.good[:, None]
    chi2 = np.where(fit.good, fit.chi2 - _change(evaluation, residual, weights), fit.chi2)
    return replace(fit, evaluation=replace(evaluation, residual=residual), chi2=chi2)


def cleaned_prediction(fitted: Fitted, told: Prediction) -> Fit:
    """What a machine foretells, without what faults may explain of it and may have made of its parameters."""
    return cleaned(told.problem, told.fit, _shared(fitted))


def _shared(fitted: Fitted) -> Beside:
    """What training records know beside faults of the parameters that held-out records share with them."""
    shared = [i for i, one in enumerate(fitted.problem.free) if one.record is None]
    return beside_faults(fitted.problem, fitted.fit).of(shared)


def beside_faults(problem: Problem, fit: Fit) -> Beside:
    """Parameters of a fit as they would be, and be known, if the faults of a rig were fitted too.

    Enlarged where the fit beside them is still worse than the noise.
    """
    _, matrix, gradient, open_ = _equations(problem, fit)
    p = fit.evaluation.by_parameter.shape[2]
    matrix = _bounded(matrix, gradient, p, open_)
    steps = solve_scaled(matrix, gradient, open_)[:p] - solve_scaled(matrix[:p, :p], gradient[:p], open_[:p])
    shown = open_ & (np.diag(matrix) > 0)
    covariance = _inverse(matrix, shown)[:p, :p]
    return Beside(steps, covariance * max(1.0, cleaned(problem, fit).reduced_chi2))


def _equations(problem: Problem, fit: Fit) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Columns of parameters and faults, their normal equations beside the starts, and which may move."""
    evaluation = fit.evaluation
    columns = np.concatenate([evaluation.by_parameter, fault_columns(problem, fit)], axis=2)
    weights = evaluation.used * fit.good[:, None]
    reduced, _, _ = eliminate(blocks_of(evaluation.by_start, columns, evaluation.residual, weights))
    faults = columns.shape[2] - evaluation.by_parameter.shape[2]
    return columns, *reduced.total(), np.r_[~fit.at_bound & fit.movable, np.ones(faults, bool)]


def _inverse(matrix: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric matrix in units of its diagonal, 0 of what is not shown."""
    found = np.zeros_like(matrix)
    inner = matrix[np.ix_(shown, shown)]
    scale = 1 / np.sqrt(np.diag(inner))
    units = np.outer(scale, scale)
    found[np.ix_(shown, shown)] = np.linalg.pinv(inner * units, rcond=1e-10, hermitian=True) * units
    return found


def _bounded(matrix: np.ndarray, gradient: np.ndarray, p: int, open_: np.ndarray) -> np.ndarray:
    """Normal equations of p parameters and of faults with their prior.

    It is made narrower until no fault is larger than such faults are: what takes a larger one is none.
    """
    prior = 1.0
    while True:
        known = matrix + np.diag(np.r_[np.zeros(p), np.full(gradient.size - p, prior)])
        if np.all(np.abs(solve_scaled(known, gradient, open_)[p:]) <= _LARGEST) or prior > _NARROWEST:
            return known
        prior *= _NARROWER


def _change(evaluation: Evaluation, residual: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """By how much chi^2 of each segment falls, beyond what another start does without that."""
    found = []
    for one in (evaluation.residual, residual):
        # the residual as the only column: what is left of its square beside the start
        blocks = blocks_of(evaluation.by_start, one[:, :, None], one, weights)
        found.append(eliminate(blocks)[0].gradient[:, 0])
    return found[0] - found[1]


def share_foretold(one: Prediction, other: Prediction, base: Fitted) -> float:
    """The same of what is foretold; the other machine, `base`, is known as training records know it."""
    beside = _shared(base)
    without = Beside(np.zeros(beside.shift.size), other.covariance)
    return share_beside_faults(one, other, (without, beside))


def share_beside_faults(
    one: Fitted | Prediction, other: Fitted | Prediction, known: tuple[Beside, Beside] | None = None
) -> float:
    """Share of what one machine explains of what another leaves over that faults of a rig do not.

    Linearised, the parameters of the other machine fitted beside them; those that held-out records do not
    tell as they are `known` without and beside faults.
    """
    evaluation, both = other.fit.evaluation, common(one, other)
    moved = (evaluation.residual - one.fit.evaluation.residual)[:, :, None]
    faults = fault_columns(other.problem, other.fit)
    p, q = evaluation.by_parameter.shape[2], faults.shape[2]
    columns = np.concatenate([evaluation.by_parameter, faults, moved], axis=2)
    weights = evaluation.used * both[:, None]
    reduced, _, _ = eliminate(blocks_of(evaluation.by_start, columns, evaluation.residual, weights))
    gains = []
    for place, kept in enumerate((np.r_[:p, p + q], np.r_[: p + q + 1])):
        matrix, gradient = reduced.total()
        matrix, gradient = matrix[np.ix_(kept, kept)], gradient[kept]
        open_ = np.r_[~other.fit.at_bound & other.fit.movable, np.ones(kept.size - p - 1, bool)]
        if known is not None:
            known[place].add_to(matrix, gradient, open_)
        matrix[:-1, :-1] = _bounded(matrix[:-1, :-1], gradient[:-1], p, open_)
        gains.append(_gain(*project(matrix, gradient, kept.size - 1, open_)))
    without, beside = gains
    return float(np.clip(beside / without, 0.0, 1.0)) if without > 0 else 1.0


def _gain(left: np.ndarray, score: np.ndarray) -> float:
    size = left[0, 0]
    return float(score[0] ** 2 / size) if size > 0 else 0.0
