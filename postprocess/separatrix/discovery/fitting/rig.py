# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small imperfections of every rig, which are not missing effects.

A slightly nonlinear sensor, a drive with further harmonics.

Each is at most some 1e-3 of the signal, which is two standard deviations here. As nuisances with that prior
they remove from a residual what they may explain (G. E. P. Box's tentative overfitting, with a bound).
"""

from dataclasses import dataclass, replace

import numpy as np

from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.fitted import Fitted, common
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.machine import IMPERFECTION, Free
from separatrix.discovery.fitting.normal_equations import blocks_of, eliminate, inverse_scaled, solve_scaled
from separatrix.discovery.policy import FIT


def imperfection_columns(problem: Likelihood, fit: Fit) -> np.ndarray:
    """Columns (segments, width, q) of imperfections of one standard deviation, along the fitted motion.

    None where they are fitted already.
    """
    if problem.imperfections:
        return np.zeros((*fit.evaluation.residual.shape, 0))
    return problem.imperfection_columns(fit)


@dataclass(frozen=True)
class Beside:
    """Parameters fitted beside imperfections, linearised: their steps from the fit, and covariance."""

    shift: np.ndarray
    covariance: np.ndarray

    def of(self, indices: list[int]) -> "Beside":
        """Some of the parameters."""
        return Beside(self.shift[indices], self.covariance[np.ix_(indices, indices)])

    def add_to(self, matrix: np.ndarray, gradient: np.ndarray, open_: np.ndarray) -> None:
        """Add what is known to normal equations whose first unknowns these are, and let them move."""
        m, seen = self.shift.size, np.diag(self.covariance) > 0
        precision = inverse_scaled(self.covariance, seen)
        matrix[:m, :m] += precision
        gradient[:m] += precision @ self.shift
        open_[:m] |= seen

    @property
    def errors(self) -> np.ndarray:
        """Standard errors, what imperfections may have moved a parameter by included."""
        known = np.diag(self.covariance)
        return np.where(known > 0, np.sqrt(known + self.shift**2), 0.0)


def cleaned(problem: Likelihood, fit: Fit, known: Beside | None = None) -> Fit:
    """The fit less the part of its residuals that imperfections may explain, refitted beside them.

    The first parameters of a held-out record are `known` from the training records.
    """
    evaluation = fit.evaluation
    columns, sizes = _explained(problem, fit, known)
    residual = evaluation.residual - columns @ sizes
    weights = evaluation.used * fit.good[:, None]
    chi2 = np.where(fit.good, fit.chi2 - _change(evaluation, residual, weights), fit.chi2)
    return replace(fit, evaluation=replace(evaluation, residual=residual), chi2=chi2)


def imperfections_of(problem: Likelihood, fit: Fit, usual: float) -> dict[tuple[str, int | None], np.ndarray]:
    """Contribution of each imperfection of one standard deviation to x and v along a fit, as in `Likelihood`.

    Sensors are curved in each record by themselves; the drive has its harmonics in all of them, of one size
    over the `usual` acceleration [m/s^2].
    """
    records = range(len(problem.prepared))
    keys = [(f"{IMPERFECTION}curve_{power}", number) for number in records for power in FIT.imperfect_powers]
    curves = len(keys)
    columns = np.nan_to_num(problem.in_units(problem.imperfection_columns(fit, usual)))
    columns[:, :, :, curves:] *= fit.good[:, None, None, None]
    if columns.shape[3] > curves:
        orders = range(1, FIT.imperfect_harmonics + 1)
        keys += [(f"{IMPERFECTION}{wave}_{n}", None) for n in orders for wave in ("sine", "cosine")]
    return dict(zip(keys, np.moveaxis(columns, 3, 0), strict=True))


def as_nuisances(imperfections: dict[tuple[str, int | None], np.ndarray]) -> list[Free]:
    """The sizes of imperfections as unknowns, in standard deviations."""
    return [
        Free(path, 0.0, -FIT.imperfection_largest, FIT.imperfection_largest, record=record, error=1.0)
        for path, record in imperfections
    ]


def _explained(problem: Likelihood, fit: Fit, known: Beside | None) -> tuple[np.ndarray, np.ndarray]:
    """Columns of parameters and imperfections, with the steps and sizes that explain most of a residual."""
    columns, matrix, gradient, open_ = _equations(problem, fit)
    p = fit.evaluation.by_parameter.shape[2]
    without = solve_scaled(matrix[:p, :p], gradient[:p], open_[:p])
    if known is not None:
        known.add_to(matrix, gradient, open_)
    sizes = solve_scaled(_bounded(matrix, gradient, p, open_)[0], gradient, open_)
    # the step without imperfections is not due to them
    sizes[:p] -= without
    return columns, sizes


def cleaned_prediction(fitted: Fitted, prediction: Prediction) -> Fit:
    """A prediction less the part that imperfections may explain, also by their shift of the parameters."""
    return cleaned(prediction.problem, prediction.fit, _shared(fitted, prediction))


def _shared(fitted: Fitted, prediction: Prediction) -> Beside:
    """Step of the shared parameters that training records suggest beside imperfections."""
    shared = [i for i, one in enumerate(fitted.problem.free) if one.record is None]
    known = with_imperfections(fitted.problem, fitted.fit).of(shared)
    return replace(known, shift=np.zeros_like(known.shift)) if prediction.with_imperfections else known


def with_imperfections(problem: Likelihood, fit: Fit) -> Beside:
    """Parameters of a fit and their covariance if the imperfections of a rig were fitted too.

    The covariance is enlarged where that fit is still worse than the noise.
    """
    _, matrix, gradient, open_ = _equations(problem, fit)
    p = fit.evaluation.by_parameter.shape[2]
    matrix, _ = _bounded(matrix, gradient, p, open_)
    steps = solve_scaled(matrix, gradient, open_)[:p] - solve_scaled(matrix[:p, :p], gradient[:p], open_[:p])
    shown = open_ & (np.diag(matrix) > 0)
    covariance = inverse_scaled(matrix, shown)[:p, :p]
    return Beside(steps, covariance * max(1.0, cleaned(problem, fit).reduced_chi2))


def _equations(problem: Likelihood, fit: Fit) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Columns of parameters and imperfections, their normal equations without starts, and which may move."""
    evaluation = fit.evaluation
    columns = np.concatenate([evaluation.by_parameter, imperfection_columns(problem, fit)], axis=2)
    imperfections = columns.shape[2] - evaluation.by_parameter.shape[2]
    return (
        columns,
        *fit.normal_equations(columns).total(),
        np.r_[~fit.at_bound & fit.movable, np.ones(imperfections, bool)],
    )


def _bounded(matrix: np.ndarray, gradient: np.ndarray, p: int, open_: np.ndarray) -> tuple[np.ndarray, float]:
    """Normal equations of p parameters and of imperfections with their prior, and its precision.

    The prior is narrowed until no imperfection exceeds its largest size.
    """
    prior = 1.0
    while True:
        known = matrix + np.diag(np.r_[np.zeros(p), np.full(gradient.size - p, prior)])
        if (
            np.all(np.abs(solve_scaled(known, gradient, open_)[p:]) <= FIT.imperfection_largest)
            or prior > FIT.imperfection_narrowest
        ):
            return known, prior
        prior *= FIT.imperfection_narrower


def _change(evaluation: Evaluation, residual: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Fall of chi^2 of each segment beyond that of a refitted start."""
    found = []
    for one in (evaluation.residual, residual):
        # the residual as the only column: what is left of its square beside the start
        blocks = blocks_of(evaluation.by_start, one[:, :, None], one, weights)
        found.append(eliminate(blocks)[0].gradient[:, 0])
    return found[0] - found[1]


@dataclass(frozen=True)
class Contest:
    """A machine against another one with imperfections of a rig, in log-likelihood, linearised.

    `gain`: what it explains of the residual of the other one. For each usual size of imperfections,
    `imperfections` is the evidence of the other one with them over that without them, and `beside` is what
    the machine explains then.
    """

    gain: float
    imperfections: np.ndarray
    beside: np.ndarray

    def __add__(self, other: "Contest") -> "Contest":
        """Of two groups of records of one rig."""
        return Contest(
            self.gain + other.gain, self.imperfections + other.imperfections, self.beside + other.beside
        )

    @property
    def lead(self) -> float:
        """Evidence of the machine over the other one: a rig has imperfections of one size or it has none."""
        return max(self.gain, float(np.max(self.imperfections + self.beside))) - max(
            0.0, float(self.imperfections.max())
        )


def share_with_imperfections(one: Fitted, other: Fitted) -> float:
    """Share of the gain of one machine over another that remains evidence beside imperfections."""
    return _share(_contest(one, other))


def shares_with_imperfections(
    fitted: tuple[Fitted, Fitted], predictions: tuple[Prediction, Prediction]
) -> tuple[float, float]:
    """The same in training and for the predictions of two machines: all records are of one rig."""
    training, held_out = _contest(*fitted), _held_out_contest(predictions, fitted[1])
    return _share(training), _share(held_out, training)


def weight_of_imperfections(fitted: Fitted, prediction: Prediction | None) -> tuple[float, float]:
    """Log-likelihood that imperfections of a rig gain beside a machine, on fitted and on predicted records.

    It is 0 where they do not pay for their freedom in training.

    The noise counts as known, so that the residuals of different machines are comparable.
    """
    training = _contest(fitted, fitted, noise_known=True)
    size = int(np.argmax(training.imperfections))
    if training.imperfections[size] <= 0:
        return 0.0, 0.0
    if prediction is None:
        return float(training.imperfections[size]), 0.0
    held_out = _held_out_contest((prediction, prediction), fitted, noise_known=True)
    return float(training.imperfections[size]), float(held_out.imperfections[size])


def evidence_of_imperfections(fitted: Fitted, prediction: Prediction) -> float:
    """Evidence that a rig has imperfections where a machine is right but for them, at least 0."""
    both = _contest(fitted, fitted) + _held_out_contest((prediction, prediction), fitted)
    return max(0.0, float(both.imperfections.max()))


def _held_out_contest(
    predictions: tuple[Prediction, Prediction], other: Fitted, noise_known: bool = False
) -> Contest:
    """Contest of two predictions; training gives the parameters of the other, also beside imperfections."""
    beside = _shared(other, predictions[1])
    without = Beside(np.zeros(beside.shift.size), predictions[1].covariance)
    return _contest(*predictions, (without, beside), noise_known)


def _share(new: Contest, known: Contest | None = None) -> float:
    """Share of a gain that is evidence, on top of what is known."""
    if new.gain <= 0:
        return 1.0
    lead = new.lead if known is None else (new + known).lead - known.lead
    return float(np.clip(lead / new.gain, 0.0, 1.0))


def _contest(
    one: Fitted | Prediction,
    other: Fitted | Prediction,
    known: tuple[Beside, Beside] | None = None,
    noise_known: bool = False,
) -> Contest:
    """Compare a machine with one whose parameters are `known` without and beside imperfections, or free.

    Unless the noise is known, it counts as larger where the machine is worse than it.
    """
    evaluation, both = other.fit.evaluation, common(one, other)
    moved = (evaluation.residual - one.fit.evaluation.residual)[:, :, None]
    imperfections = imperfection_columns(other.problem, other.fit)
    p, q = evaluation.by_parameter.shape[2], imperfections.shape[2]
    # segments that one of them does not follow are NaN
    columns = np.concatenate([evaluation.by_parameter, imperfections, moved], axis=2)
    columns[~both] = 0.0
    residual = np.where(both[:, None], evaluation.residual, 0.0)
    by_start = np.where(both[:, None, None], evaluation.by_start, 0.0)
    misfit = one.misfit if isinstance(one, Prediction) else max(1.0, one.fit.reduced_chi2)
    weights = evaluation.used * both[:, None] / (1.0 if noise_known else misfit)
    reduced, _, _ = eliminate(blocks_of(by_start, columns, residual, weights))
    open_ = np.r_[~other.fit.at_bound & other.fit.movable, np.ones(q + 1, bool)]
    equations = _Evidence(*reduced.total(), open_, p)
    without, beside = known or (None, None)
    prior = equations.narrowest(beside)
    plain = equations.of(without, None)
    tried = [equations.of(beside, prior * narrower) for narrower in FIT.imperfection_sizes]
    return Contest(
        plain[1],
        np.array([evidence - plain[0] for evidence, _ in tried]),
        np.array([gain for _, gain in tried]),
    )


@dataclass(frozen=True)
class _Evidence:
    """Normal equations of p parameters, of imperfections, and last of the contribution of another machine."""

    matrix: np.ndarray
    gradient: np.ndarray
    open_: np.ndarray
    p: int

    def narrowest(self, known: Beside | None) -> float:
        """Precision of imperfections for which none exceeds its largest size."""
        matrix, gradient, open_ = self._known(known)
        return _bounded(matrix[:-1, :-1], gradient[:-1], self.p, open_[:-1])[1]

    def of(self, known: Beside | None, prior: float | None) -> tuple[float, float]:
        """Log evidence (up to a constant) with imperfections of a precision, or none; the gain then."""
        matrix, gradient, open_ = self._known(known)
        kept = np.ones(gradient.size, bool)
        logarithm = _surprise(known)
        if prior is None:
            kept[self.p : -1] = False
        else:
            matrix[self.p : -1, self.p : -1] += prior * np.eye(gradient.size - 1 - self.p)
            logarithm += (gradient.size - 1 - self.p) * np.log(prior)
        kept &= open_
        machine = kept & (np.arange(kept.size) < kept.size - 1)
        found = [0.5 * gradient @ solve_scaled(matrix, gradient, which) for which in (machine, kept)]
        spread = 0.5 * (_log_determinant(matrix, machine) - logarithm)
        return float(found[0] - spread), float(found[1] - found[0])

    def _known(self, known: Beside | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        matrix, gradient, open_ = self.matrix.copy(), self.gradient.copy(), self.open_.copy()
        if known is not None:
            known.add_to(matrix, gradient, open_)
        return matrix, gradient, open_


def _surprise(known: Beside | None) -> float:
    """Logarithm of the precision with which parameters are known, less the square of where they are."""
    if known is None:
        return 0.0
    seen = np.diag(known.covariance) > 0
    precision = inverse_scaled(known.covariance, seen)
    return _log_determinant(precision, seen) - float(known.shift @ precision @ known.shift)


def _log_determinant(matrix: np.ndarray, open_: np.ndarray) -> float:
    """Of the open unknowns with information, without undetermined directions."""
    shown = open_ & (np.diag(matrix) > 0)
    size = np.sqrt(np.diag(matrix)[shown])
    values = np.linalg.eigvalsh(matrix[np.ix_(shown, shown)] / np.outer(size, size))
    return float(np.log(np.maximum(values, FIT.imperfection_shown)).sum() + 2 * np.log(size).sum())
