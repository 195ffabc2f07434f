# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Least squares over many short segments: damped Gauss-Newton steps of all starts and parameters together."""

from dataclasses import dataclass, replace

import numpy as np

from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.normal_equations import (
    Blocks,
    Reduced,
    blocks_of,
    eliminate,
    gauss_newton_step,
)
from separatrix.discovery.fitting.time_limit import present_limit
from separatrix.discovery.policy import FIT


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
    in_local_minimum: bool = False
    # whether steps of every length from there gained a negligible amount
    exhausted: bool = False
    # residual squares of condensed blocks, and their degrees of freedom
    left_over: tuple[np.ndarray, np.ndarray] | None = None
    # unknowns of each segment: its start, or none where the motion is known
    unknowns: int = 2

    @property
    def converged(self) -> bool:
        """Certificate: along every direction the minimum is within half a standard error.

        Where a body sticks, chi^2 has kinks: a step that promises more and gains nothing at any length ends
        there too, within two standard errors.
        """
        most = max(
            FIT.fit_near,
            1e-4 * self.total,
            FIT.fit_kink * max(1.0, self.reduced_chi2) if self.exhausted else 0.0,
        )
        return bool(self.decrement < most and self.good.any() and not self.in_local_minimum)

    def normal_equations(self, *columns: np.ndarray) -> Reduced:
        """Of derivatives of the residual (segments, samples, any), starts eliminated, over good segments."""
        seen = self.evaluation
        weights = seen.used * self.good[:, None]
        whole = np.concatenate(columns, axis=2)
        return eliminate(blocks_of(seen.by_start, whole, seen.residual, weights))[0]

    @property
    def good(self) -> np.ndarray:
        """Segments that were simulated and whose impacts are steady."""
        return self.evaluation.steady & ~self.evaluation.failed & (self.counts > 0)

    @property
    def total(self) -> float:
        """Sum of squares over the good segments."""
        return float(self.chi2[self.good].sum())

    @property
    def freedom(self) -> int:
        """Residuals less unknowns, over the good segments."""
        good = self.good
        starts = self.unknowns * good.sum()
        return int(self.counts[good].sum() - starts - (~self.at_bound).sum())

    @property
    def reduced_chi2(self) -> float:
        """Sum of squares per degree of freedom of what is fitted, as sizes and errors are scaled by."""
        return self.total / max(1, self.freedom)

    @property
    def sample_chi2(self) -> float:
        """Sum of squares per degree of freedom of all samples, those of condensed blocks included."""
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
        """Residual sum of squares of the condensed blocks of some segments, and degrees of freedom."""
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
        return self.reduced_chi2 < 1 + max(FIT.like_noise, deviations * np.sqrt(2 / self.freedom))


def minimise(
    problem: Likelihood,
    values: np.ndarray,
    starts: np.ndarray,
    *,
    robust: bool = False,
    most: int = 25,
    tolerance: float = FIT.fit_tolerance,
    fixed: np.ndarray | None = None,
    hopeless: float | None = None,
    patient: bool = False,
    rough: bool = False,
    beat: float | None = None,
    begun: Evaluation | None = None,
) -> Fit:
    """Minimise squares (or Huber's loss, `robust`); stop early above `hopeless` times the wanted chi^2.

    A `patient` fit, for machines that a verdict depends on, continues with negligible gains. A `rough` one
    only starts another and ends within a standard error. A fit that is behind the sum of squares `beat` by
    far more than it can still gain is abandoned. `begun`: the evaluation at values and starts, if known.
    """
    movable = np.ones(values.size, bool) if fixed is None else ~fixed
    tolerance = max(tolerance, FIT.fit_rough) if rough else tolerance
    descent = _Descent(problem, values, starts, movable, robust, begun)
    iterations = without_gain = 0
    begun_anew = exhausted = False
    most_without_gain = FIT.fit_patience if patient else FIT.fit_without_gain
    limit = present_limit()
    while iterations < most and not limit.ends_fits():
        iterations += 1
        if not descent.look(tolerance, rough):
            break
        if beat is not None and iterations > FIT.fit_fewest and descent.behind(beat):
            break
        mild = descent.damping <= FIT.fit_mild
        if not descent.step():
            exhausted = mild or begun_anew
            if exhausted:
                break
            descent.damping, begun_anew = FIT.fit_mild, True
            continue
        little = tolerance if patient else max(FIT.fit_little, FIT.fit_little_share * descent.before)
        without_gain = without_gain + 1 if descent.gain < little else 0
        if without_gain >= most_without_gain:
            exhausted = begun_anew
            if exhausted:
                break
            descent.damping, without_gain, begun_anew = FIT.fit_mild, most_without_gain - 1, True
        elif not without_gain:
            begun_anew = False
        if hopeless is not None and iterations > FIT.fit_fewest and descent.hopeless(hopeless):
            break
    if not rough:
        descent.renew()
    found = _finished(problem, descent.values, descent.starts, descent.current, movable, iterations)
    return replace(found, exhausted=exhausted)


@dataclass
class _Trial:
    """The end of a step: its gain, whether it may be gone, and what it is measured by."""

    values: np.ndarray
    starts: np.ndarray
    evaluation: Evaluation
    gain: float
    lower: bool
    before: float
    count: int


class _Descent:
    """State of a minimisation and its damped steps.

    Derivatives cost far more than residuals, so they are kept while steps gain what they promise and the
    decrement falls by `_FALLS` each time.
    """

    def __init__(
        self,
        problem: Likelihood,
        values: np.ndarray,
        starts: np.ndarray,
        movable: np.ndarray,
        robust: bool,
        begun: Evaluation | None,
    ) -> None:
        self.problem, self.movable, self.robust = problem, movable, robust
        self.lower = np.array([one.lower for one in problem.free])
        self.upper = np.array([one.upper for one in problem.free])
        self.values, self.starts = np.clip(values, self.lower, self.upper), starts
        self.current = problem.evaluate(self.values, starts) if begun is None else begun
        self.damping = FIT.fit_mild
        self.gain = self.before = self.decrement = 0.0
        self.steps = 0
        # decrement of the step before, where the derivatives are those of an earlier point
        self.kept: float | None = None

    def renew(self) -> None:
        """Derivatives of here, if they are those of an earlier point."""
        if self.kept is not None:
            self.current, self.kept = self.problem.evaluate(self.values, self.starts), None

    @property
    def creeps(self) -> bool:
        """Whether so many steps were needed that bounds and bends of the valley may be in their way."""
        return self.steps > FIT.fit_creeps

    @property
    def room(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Lowest and highest steps of the parameters, where they are looked at in advance."""
        return (self.lower - self.values, self.upper - self.values) if self.creeps else None

    def look(self, tolerance: float, rough: bool) -> bool:
        """Whether a further step promises more than `tolerance`."""
        while True:
            weights, self.scale = _weights(self.current, self.robust)
            self.inside = weights > 0
            residual = self.current.residual
            self.blocks = blocks_of(self.current.by_start, self.current.by_parameter, residual, weights)
            self.open = _open(self.blocks, self.values, self.lower, self.upper, self.movable)
            _, _, self.decrement = gauss_newton_step(self.blocks, self.open, room=self.room)
            cost = _cost(self.current, self.inside, self.scale, self.robust)
            share = FIT.fit_rough_share if rough and self.robust else FIT.fit_share
            more = self.decrement >= max(tolerance, share * cost)
            if self.kept is None or (rough and not more):
                return more
            if more and self.decrement * FIT.fit_falls <= self.kept:
                return True
            self.renew()

    def step(self) -> bool:
        """Go a step that lowers the loss; false where none of any length does."""
        self.steps += 1
        while True:
            while self.damping < FIT.fit_strongest:
                start_step, step, promised = gauss_newton_step(
                    self.blocks, self.open, self.damping, self.room
                )
                trial = self._tried(start_step, step)
                straight = trial.lower and trial.gain > FIT.fit_bends * promised
                if self.creeps and self.kept is None and not straight:
                    trial = self._tried_along_a_curve(start_step, step, trial)
                self.gain = trial.gain
                if trial.lower:
                    self.before, self.count = trial.before, trial.count
                    self._take(trial, promised)
                    return True
                if self.kept is not None:
                    break
                self.damping = max(10 * self.damping, 1e-6)
            if self.kept is None:
                return False
            # the outdated derivatives may be the cause
            self.renew()
            self.look(0.0, rough=False)

    def _tried(self, start_step: np.ndarray, step: np.ndarray) -> "_Trial":
        good = ~self.current.failed & self.current.steady
        before = _costs(self.current, self.scale, self.robust)
        values, starts = np.clip(self.values + step, self.lower, self.upper), self.starts + start_step
        found = self.problem.evaluate(values, starts, derivatives=False)
        both = good & ~found.failed
        gain = float((before - _costs(found, self.scale, self.robust))[both].sum())
        lower = gain > 0 and (good & found.failed).sum() <= 0.02 * good.sum()
        return _Trial(
            values, starts, found, gain, bool(lower), float(before[both].sum()), self.current.used[both].sum()
        )

    def _tried_along_a_curve(self, start_step: np.ndarray, step: np.ndarray, straight: "_Trial") -> "_Trial":
        """The better of a step and of one that follows the valley of the loss to second order.

        That is the geodesic acceleration of Transtrum and Sethna (2012), https://arxiv.org/abs/1201.5885. The
        second derivative along the step is that of residuals a small share of it away.
        """
        share, current = FIT.fit_curve_share, self.current
        begun = self.problem.evaluate(
            np.clip(self.values + share * step, self.lower, self.upper),
            self.starts + share * start_step,
            derivatives=False,
        )
        whole = np.concatenate([current.by_start, current.by_parameter], axis=2)
        whole_step = np.concatenate([start_step, np.broadcast_to(step, (len(start_step), step.size))], axis=1)
        slope = np.einsum("klq,kq->kl", whole, whole_step)
        second = 2 / share * ((begun.residual - current.residual) / share + slope)
        weights = _weights(current, self.robust)[0] * ~begun.failed[:, None]
        gradient = np.einsum("klq,kl->kq", whole, weights * second)
        bend = replace(self.blocks, gradient=gradient)
        start_bend, bent, _ = gauss_newton_step(bend, self.open, self.damping)
        sizes = [self._size(*one) for one in ((start_bend, bent), (start_step, step))]
        if not sizes[0] < FIT.fit_curved_most * sizes[1]:
            return straight
        curved = self._tried(start_step + start_bend / 2, step + bent / 2)
        return curved if curved.lower and not (straight.lower and straight.gain >= curved.gain) else straight

    def _size(self, start_step: np.ndarray, step: np.ndarray) -> float:
        """Length of a step in units of what each unknown by itself changes."""
        diagonal, n = np.einsum("kii->ki", self.blocks.matrix), self.blocks.starts
        squares = np.sum(diagonal[:, :n] * start_step**2) + np.sum(diagonal[:, n:] @ step**2)
        return float(np.sqrt(squares))

    def _take(self, tried: "_Trial", promised: float) -> None:
        self.values, self.starts, trial = tried.values, tried.starts, tried.evaluation
        self.damping = self.damping * 0.2 if self.gain > 0.5 * promised else self.damping * 2
        alike = np.array_equal(trial.hits, self.current.hits) and np.array_equal(
            trial.failed, self.current.failed
        )
        if alike and abs(self.gain - promised) < FIT.fit_as_promised * promised:
            old = self.current
            self.current = replace(
                trial,
                by_start=old.by_start,
                by_parameter=old.by_parameter,
                transition=old.transition,
                steady=old.steady,
            )
            self.kept = self.decrement
        else:
            self.current, self.kept = self.problem.evaluate(self.values, self.starts), None

    def behind(self, beat: float) -> bool:
        """Whether the squares are above `beat` by far more than the next steps may gain.

        A few segments may be in a wrong minimum and are left out.
        """
        squares = np.sort(_costs(self.current, self.scale, robust=False)[self.inside.any(axis=1)])
        return bool(
            squares[: -FIT.fit_spared].sum() - beat > max(FIT.fit_lost, FIT.fit_over * self.decrement)
        )

    def hopeless(self, limit: float) -> bool:
        """Whether steps gain little far above the wanted chi^2."""
        return bool(self.gain < 0.02 * self.before and self.before > limit * max(1, self.count))


def blocking(problem: Likelihood, values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Segments that lose more by a Gauss-Newton step than it promises in total, and so block it."""
    descent = _Descent(problem, values, starts, np.ones(values.size, bool), False, None)
    descent.look(0.0, rough=False)
    start_step, step, promised = gauss_newton_step(descent.blocks, descent.open, FIT.fit_mild)
    tried = np.clip(descent.values + step, descent.lower, descent.upper)
    trial = problem.evaluate(tried, starts + start_step, derivatives=False)
    lost = _costs(trial, 1.0, robust=False) - _costs(descent.current, 1.0, robust=False)
    return np.flatnonzero((lost > promised) | trial.failed)


def without_segments(fit: Fit, rows: np.ndarray) -> Fit:
    """The same fit with some segments marked as not good."""
    steady = fit.evaluation.steady.copy()
    steady[rows] = False
    return replace(fit, evaluation=replace(fit.evaluation, steady=steady))


def again(problem: Likelihood, fit: Fit) -> Fit:
    """The same values and starts, evaluated with the noise as it is known now."""
    current = problem.evaluate(fit.values, fit.starts)
    found = _finished(problem, fit.values, fit.starts, current, fit.movable, fit.iterations)
    return replace(found, exhausted=fit.exhausted)


def _finished(problem, values, starts, current, movable, iterations) -> Fit:
    lower = np.array([one.lower for one in problem.free])
    upper = np.array([one.upper for one in problem.free])
    weights = _weights(current, robust=False)[0]
    blocks = blocks_of(current.by_start, current.by_parameter, current.residual, weights)
    room = (lower - values, upper - values) if iterations > FIT.fit_creeps else None
    _, _, decrement = gauss_newton_step(blocks, _open(blocks, values, lower, upper, movable), room=room)
    at_bound = (values <= lower) | (values >= upper)
    reduced, _, _ = eliminate(blocks)
    chi2 = np.sum(current.used * current.residual**2, axis=1)
    counts = current.used.sum(axis=1)
    found = Fit(values, starts, current, reduced, chi2, counts, decrement, iterations, at_bound, movable)
    return replace(found, left_over=problem.left_over(), unknowns=current.unknowns)


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
    scale = FIT.huber * max(1.0, 1.4826 * float(np.median(size[inside])) if inside.any() else 1.0)
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
