# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Least squares over many short segments: each start is eliminated block by block, the common parameters
remain.

The normal equations of a Levenberg-Marquardt step have the form of an arrow: one 2 x 2 block per segment,
coupled only through the parameters. Their Schur complement has the size of the parameters
(tests/python/test_discovery_fit.py compares it with the dense step).
"""

from dataclasses import dataclass, replace

import numpy as np

from separatrix.discovery.fitting.problem import Evaluation, Problem

_HUBER = 1.5
_TOLERANCE = 0.02
_NEAR = 0.25
_KINK = 4.0
_TINY = 1e-12
_STRONGEST = 1e8
_FINE = 0.03
# damping of the first step
_MILD = 1e-4
# gain that is next to nothing, also as a share of chi^2, and how many such steps in a row end a fit; a
# patient one goes on for less
_LITTLE = 0.1
_LITTLE_SHARE = 3e-5
_STALLS = 2
_PATIENT_STALLS = 4


@dataclass
class Blocks:
    """Normal equations by segment; columns are the start (2), then the parameters."""

    matrix: np.ndarray
    gradient: np.ndarray


@dataclass
class Reduced:
    """What is left of each segment after its start is eliminated, to be summed or resampled."""

    matrix: np.ndarray
    gradient: np.ndarray

    def total(self) -> tuple[np.ndarray, np.ndarray]:
        """Sum over the segments."""
        return self.matrix.sum(axis=0), self.gradient.sum(axis=0)


@dataclass
class Fit:
    """The end of a minimisation; `decrement` is the chi^2 that a further Gauss-Newton step promises."""

    values: np.ndarray
    starts: np.ndarray
    evaluation: Evaluation
    reduced: Reduced
    chi2: np.ndarray
    counts: np.ndarray
    decrement: float
    iterations: int
    at_bound: np.ndarray
    movable: np.ndarray
    # in a minimum that is known not to be the lowest
    caught: bool = False
    # whether steps of every length were tried from there and gained next to nothing
    exhausted: bool = False
    # what condensed stretches leave over, and its degrees of freedom
    left_over: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def converged(self) -> bool:
        """Certificate: along every direction the minimum is within half a standard error.

        Where a body sticks, chi^2 has kinks: a step that promises more and gains nothing at any length ends
        there too, within two standard errors.
        """
        most = max(_NEAR, 1e-4 * self.total, _KINK * max(1.0, self.reduced_chi2) if self.exhausted else 0.0)
        return bool(self.decrement < most and self.good.any() and not self.caught)

    @property
    def good(self) -> np.ndarray:
        """Segments that were flown and whose impacts are steady."""
        return self.evaluation.steady & ~self.evaluation.failed & (self.counts > 0)

    @property
    def total(self) -> float:
        """Sum of squares over the good segments."""
        return float(self.chi2[self.good].sum())

    @property
    def freedom(self) -> int:
        """Residuals less unknowns, over the good segments."""
        good = self.good
        return int(self.counts[good].sum() - 2 * good.sum() - (~self.at_bound).sum())

    @property
    def reduced_chi2(self) -> float:
        """Sum of squares per degree of freedom of what is fitted, as sizes and errors are scaled by."""
        return self.total / max(1, self.freedom)

    @property
    def sample_chi2(self) -> float:
        """Sum of squares per degree of freedom of all samples, those of condensed stretches included."""
        squares, freedom = self.condensed(self.good)
        return (self.total + squares) / max(1.0, self.freedom + freedom)

    @property
    def samples(self) -> float:
        """Residuals of all samples of the good segments."""
        return float(self.counts[self.good].sum()) + self.condensed(self.good)[1]

    @property
    def excess(self) -> float:
        """What chi^2 of all samples has beyond its degrees of freedom."""
        squares, freedom = self.condensed(self.good)
        return self.total + squares - self.freedom - freedom

    def condensed(self, rows: np.ndarray) -> tuple[float, float]:
        """Sum of squares of what condensed stretches of some segments leave over, degrees of freedom."""
        if self.left_over is None:
            return 0.0, 0.0
        return tuple(float(one[rows].sum()) for one in self.left_over)

    def far_off(self, hopeless: float) -> bool:
        """Whether most segments are followed so badly that no wrong minimum of a few can be the reason."""
        reduced = np.where(self.evaluation.failed, np.inf, self.chi2 / np.maximum(1, self.counts))
        return bool(np.median(reduced) > hopeless)

    def like_noise(self, deviations: float) -> bool:
        """Whether chi^2 is what noise alone would leave, within so many standard deviations or 3 %."""
        if self.freedom <= 0:
            return False
        return self.reduced_chi2 < 1 + max(_FINE, deviations * np.sqrt(2 / self.freedom))


def blocks_of(by_start: np.ndarray, columns: np.ndarray, residual: np.ndarray, weights: np.ndarray) -> Blocks:
    """Normal equations of each segment."""
    whole = np.concatenate([by_start, columns], axis=2)
    weighted = (whole * weights[:, :, None]).transpose(0, 2, 1)
    return Blocks(weighted @ whole, (weighted @ residual[:, :, None])[:, :, 0])


def eliminate(blocks: Blocks, damping: float = 0.0) -> tuple[Reduced, np.ndarray, np.ndarray]:
    """Schur complement by segment; also inverse start blocks and couplings, to find the starts again."""
    start = blocks.matrix[:, :2, :2].copy()
    diagonal = np.einsum("kii->ki", start)
    diagonal *= 1 + damping
    diagonal += _TINY * (diagonal.max(axis=1, keepdims=True, initial=0) + 1e-300)
    determinant = start[:, 0, 0] * start[:, 1, 1] - start[:, 0, 1] * start[:, 1, 0]
    safe = np.where(determinant > 0, determinant, 1)
    inverse = np.empty_like(start)
    inverse[:, 0, 0], inverse[:, 1, 1] = start[:, 1, 1] / safe, start[:, 0, 0] / safe
    inverse[:, 0, 1] = inverse[:, 1, 0] = -start[:, 0, 1] / safe
    inverse[determinant <= 0] = 0
    coupling = blocks.matrix[:, :2, 2:]
    carried = coupling.transpose(0, 2, 1) @ inverse
    matrix = blocks.matrix[:, 2:, 2:] - carried @ coupling
    gradient = blocks.gradient[:, 2:] - (carried @ blocks.gradient[:, :2, None])[:, :, 0]
    return Reduced(matrix, gradient), inverse, coupling


def solve_scaled(
    matrix: np.ndarray, gradient: np.ndarray, open_: np.ndarray, damping: float = 0.0
) -> np.ndarray:
    """Solve for the open unknowns in units of their own diagonal; directions without information stay."""
    step = np.zeros(gradient.size)
    diagonal = np.diag(matrix)
    open_ = open_ & (diagonal > 0)
    if not open_.any():
        return step
    scale = 1 / np.sqrt(diagonal[open_])
    scaled = matrix[np.ix_(open_, open_)] * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    kept = values > 1e-11
    inverse = np.where(kept, 1 / np.where(kept, values + damping, 1), 0)
    step[open_] = scale * (vectors @ (inverse * (vectors.T @ (scale * gradient[open_]))))
    return step


def gauss_newton_step(
    blocks: Blocks, open_: np.ndarray, damping: float = 0.0
) -> tuple[np.ndarray, np.ndarray, float]:
    """Steps of the starts and the parameters, and the decrease of chi^2 that the linear model promises."""
    reduced, inverse, coupling = eliminate(blocks, damping)
    matrix, gradient = reduced.total()
    step = solve_scaled(matrix, gradient, open_, damping)
    back = blocks.gradient[:, :2] - (coupling @ step[None, :, None])[:, :, 0]
    starts = (inverse @ back[:, :, None])[:, :, 0]
    whole = np.concatenate([starts, np.broadcast_to(step, (starts.shape[0], step.size))], axis=1)
    bent = (blocks.matrix @ whole[:, :, None])[:, :, 0]
    promised = float(np.sum(whole * (2 * blocks.gradient - bent)))
    return starts, step, promised


def minimise(
    problem: Problem,
    values: np.ndarray,
    starts: np.ndarray,
    *,
    robust: bool = False,
    most: int = 25,
    tolerance: float = _TOLERANCE,
    fixed: np.ndarray | None = None,
    hopeless: float | None = None,
    patient: bool = False,
) -> Fit:
    """Minimise squares (or Huber's loss, `robust`); stop early above `hopeless` times the wanted chi^2.

    A `patient` fit goes on where steps gain next to nothing, for machines that a verdict depends on.
    """
    lower = np.array([one.lower for one in problem.free])
    upper = np.array([one.upper for one in problem.free])
    movable = np.ones(values.size, bool) if fixed is None else ~fixed
    values = np.clip(values, lower, upper)
    damping = _MILD
    current = problem.evaluate(values, starts)
    iterations = stalled = 0
    begun_anew = exhausted = False
    most_stalls = _PATIENT_STALLS if patient else _STALLS
    while iterations < most:
        iterations += 1
        weights, scale = _weights(current, robust)
        blocks = blocks_of(current.by_start, current.by_parameter, current.residual, weights)
        open_ = _open(blocks, values, lower, upper, movable)
        _, _, decrement = gauss_newton_step(blocks, open_)
        if decrement < max(tolerance, 1e-5 * _cost(current, weights > 0, scale, robust)):
            break
        good = ~current.failed & current.steady
        before = _costs(current, scale, robust)
        accepted, mild = False, damping <= _MILD
        while damping < _STRONGEST:
            start_step, step, promised = gauss_newton_step(blocks, open_, damping)
            tried = np.clip(values + step, lower, upper)
            trial = problem.evaluate(tried, starts + start_step, derivatives=False)
            both = good & ~trial.failed
            gain = float((before - _costs(trial, scale, robust))[both].sum())
            lost = int((good & trial.failed).sum())
            if gain > 0 and lost <= 0.02 * good.sum():
                accepted = True
                break
            damping = max(10 * damping, 1e-6)
        if not accepted:
            exhausted = mild or begun_anew
            if exhausted:
                break
            damping, begun_anew = _MILD, True
            continue
        values, starts = tried, starts + start_step
        damping = damping * 0.2 if gain > 0.5 * promised else damping * 2
        current = problem.evaluate(values, starts)
        little = tolerance if patient else max(_LITTLE, _LITTLE_SHARE * float(before[both].sum()))
        stalled = stalled + 1 if gain < little else 0
        if stalled >= most_stalls:
            exhausted = begun_anew
            if exhausted:
                break
            damping, stalled, begun_anew = _MILD, most_stalls - 1, True
        elif not stalled:
            begun_anew = False
        if hopeless is not None and iterations >= 4 and gain < 0.02 * before[both].sum():
            mean = before[both].sum() / max(1, current.used[both].sum())
            if mean > hopeless:
                break
    return replace(_finished(problem, values, starts, current, movable, iterations), exhausted=exhausted)


def again(problem: Problem, fit: Fit) -> Fit:
    """The same values and starts, evaluated with the noise as it is known now."""
    current = problem.evaluate(fit.values, fit.starts)
    found = _finished(problem, fit.values, fit.starts, current, fit.movable, fit.iterations)
    return replace(found, exhausted=fit.exhausted)


def _finished(problem, values, starts, current, movable, iterations) -> Fit:
    lower = np.array([one.lower for one in problem.free])
    upper = np.array([one.upper for one in problem.free])
    weights = _weights(current, robust=False)[0]
    blocks = blocks_of(current.by_start, current.by_parameter, current.residual, weights)
    _, _, decrement = gauss_newton_step(blocks, _open(blocks, values, lower, upper, movable))
    at_bound = (values <= lower) | (values >= upper)
    reduced, _, _ = eliminate(blocks)
    chi2 = np.sum(current.used * current.residual**2, axis=1)
    counts = current.used.sum(axis=1)
    found = Fit(values, starts, current, reduced, chi2, counts, decrement, iterations, at_bound, movable)
    return replace(found, left_over=problem.left_over())


def _open(
    blocks: Blocks, values: np.ndarray, lower: np.ndarray, upper: np.ndarray, movable: np.ndarray
) -> np.ndarray:
    """Unknowns that may move: not those at a bound that the step would leave."""
    open_ = movable.copy()
    for _ in range(values.size):
        _, step, _ = gauss_newton_step(blocks, open_)
        out = open_ & (((values <= lower) & (step < 0)) | ((values >= upper) & (step > 0)))
        if not out.any():
            return open_
        open_ = open_ & ~out
    return open_


def _weights(current: Evaluation, robust: bool) -> tuple[np.ndarray, float]:
    """Weights of the residuals, and the residual beyond which Huber's loss is linear."""
    used = current.used * (current.steady & ~current.failed)[:, None]
    size = np.abs(current.residual)
    inside = used > 0
    scale = _HUBER * max(1.0, 1.4826 * float(np.median(size[inside])) if inside.any() else 1.0)
    if robust:
        used = used * np.minimum(1, scale / np.maximum(size, 1e-300))
    return used, scale


def _costs(current: Evaluation, scale: float, robust: bool) -> np.ndarray:
    """Loss of each segment."""
    size = np.abs(current.residual)
    loss = np.where(size <= scale, size**2, 2 * scale * size - scale**2) if robust else size**2
    return np.sum(current.used * loss, axis=1)


def _cost(current: Evaluation, inside: np.ndarray, scale: float, robust: bool) -> float:
    return float(_costs(current, scale, robust)[inside.any(axis=1)].sum())
