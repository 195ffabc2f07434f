# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each candidate could explain, from linearised signatures, without a refit.

The signature of an effect is its change of the samples. The part that the starts of the segments and the
parameters of the base machine can imitate is projected out. The rest determines whether the effect is visible
(d'), whether it is distinguishable from another (cosines) and how much of the residual it explains (score).
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from separatrix.discovery.fitting.catalogue import Candidate
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.normal_equations import solve_scaled
from separatrix.discovery.policy import FIT


@dataclass
class Signature:
    """Columns (segments, width, q) of an effect of the usual size, and the values of its parameters there."""

    name: str
    columns: np.ndarray
    origin: np.ndarray
    # which parameters the columns belong to; none: the effect as a whole
    live: np.ndarray


@dataclass
class Screened:
    """By effect: gain of log-likelihood, step of its amplitudes, their standard errors; all cosines."""

    names: list[str]
    gain: dict[str, float]
    step: dict[str, np.ndarray]
    error: dict[str, np.ndarray]
    # which parameters of an effect have a signature of their own
    live: dict[str, np.ndarray]
    origin: dict[str, np.ndarray]
    cosines: np.ndarray
    # what the base leaves of each signature
    shares: dict[str, float]
    # as many independent tests would be as likely to raise a false alarm
    tests: float

    def seen(self, name: str) -> bool:
        """Whether something of a signature is left beside the base."""
        return self.shares[name] > FIT.screen_nothing

    def cosine(self, one: str, other: str) -> float:
        """Largest cosine between what is left of two signatures."""
        return float(self.cosines[self.names.index(one), self.names.index(other)])


def signature(base: Likelihood, fit: Fit, candidate: Candidate) -> Signature | None:
    """Signature of the added effect at the fitted base, in its form of largest gain; None without one."""
    by_path = {(one.path, one.record): value for one, value in zip(base.free, fit.values, strict=True)}
    values = np.array([by_path.get((one.path, one.record), one.value) for one in candidate.free])
    problem = base.like(candidate.model, candidate.free)
    added = list(candidate.added)
    best, best_gain = None, -1.0
    for origin in candidate.forms:
        values[added] = origin
        shown = _shown(problem, fit, candidate, values)
        if shown is not None:
            gain = screen(fit, [shown]).gain[shown.name]
            if gain > best_gain:
                best, best_gain = shown, gain
    return best


def _shown(problem: Likelihood, fit: Fit, candidate: Candidate, values: np.ndarray) -> Signature | None:
    """The signature at given shape parameters."""
    added = list(candidate.added)
    good = fit.good
    if not candidate.linear.any():
        # no size at which the effect is absent: the difference that this one makes
        shown = problem.evaluate(values, fit.starts, derivatives=False)
        columns = (fit.evaluation.residual - shown.residual)[:, :, None]
        steady = good & ~shown.failed
        live = np.zeros(len(added), bool)
        if np.max(np.abs(columns[steady]), initial=0) < FIT.screen_same:
            # the base machine has these numbers, which are to be freed
            shown = problem.evaluate(values, fit.starts)
            columns, steady = shown.by_parameter[:, :, added], good & ~shown.failed & shown.steady
    else:
        shown = problem.evaluate(values, fit.starts)
        sizes = np.array([candidate.free[i].size for i in added])
        columns = shown.by_parameter[:, :, added] * sizes
        live = candidate.linear & np.any(columns != 0, axis=(0, 1))
        columns = columns[:, :, live]
        steady = good & ~shown.failed & shown.steady
    if steady.sum() < 2 or not np.any(columns):
        return None
    columns = np.where(steady[:, None, None], columns, 0)
    return Signature(candidate.names[-1], columns, values[added], live)


def screen(fit: Fit, signatures: list[Signature]) -> Screened:
    """Project all signatures off starts and base parameters and compare them."""
    base = fit.evaluation.by_parameter
    p = base.shape[2]
    matrix, gradient = fit.normal_equations(base, *[one.columns for one in signatures]).total()
    open_ = ~fit.at_bound
    left, score = project(matrix, gradient, p, open_)
    names = [one.name for one in signatures]
    edges = np.cumsum([0, *[one.columns.shape[2] for one in signatures]])
    gain, step, error = {}, {}, {}
    roots = []
    for i, one in enumerate(signatures):
        part = slice(edges[i], edges[i + 1])
        inner, slope = left[part, part], score[part]
        all_open = np.ones(slope.size, bool)
        amplitude = solve_scaled(inner, slope, all_open)
        gain[one.name] = 0.5 * float(slope @ amplitude)
        step[one.name] = amplitude
        error[one.name] = 1 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
        roots.append(_whitening(inner))
    cosines = np.eye(len(signatures))
    for i in range(len(signatures)):
        for j in range(i):
            cross = left[edges[i] : edges[i + 1], edges[j] : edges[j + 1]]
            shared = roots[i] @ cross @ roots[j].T
            size = np.linalg.norm(shared, 2) if shared.size else 0.0
            cosines[i, j] = cosines[j, i] = min(1.0, float(size))
    live = {one.name: one.live for one in signatures}
    origin = {one.name: one.origin for one in signatures}
    # what the base can do itself is no candidate
    raw = np.diag(matrix)[p:]
    share = np.where(raw > 0, np.diag(left) / np.where(raw > 0, raw, 1), 0)
    own = [float(share[first:last].max(initial=0)) for first, last in itertools.pairwise(edges)]
    shares = dict(zip(names, own, strict=True))
    tested = [root if size > FIT.screen_nothing else root[:0] for root, size in zip(roots, own, strict=True)]
    tests = _independent_tests(left, edges, tested) if len(names) > 1 else float(len(names))
    return Screened(names, gain, step, error, live, origin, cosines, shares, tests)


def _independent_tests(left: np.ndarray, edges: np.ndarray, roots: list[np.ndarray]) -> float:
    """How many independent tests the candidates are worth: parametric bootstrap of the linearised null.

    Under a right base the scores of all candidates are Gaussian with the matrix `left` as covariance. The
    smallest p value of a draw falls below its own 5 % quantile as often as that of so many tests would.
    """
    size = np.sqrt(np.maximum(np.diag(left), 0))
    # what the base can do itself leaves nothing but rounding, which has no direction
    scale = np.where(size > FIT.screen_rounding, size, np.inf)
    values, vectors = np.linalg.eigh(np.clip(left / np.outer(scale, scale), -1, 1))
    half = vectors * np.sqrt(np.maximum(values, 0))
    draws = (
        np.random.default_rng(FIT.screen_seed).standard_normal((FIT.screen_draws, size.size)) @ half.T * size
    )
    lowest = np.ones(FIT.screen_draws)
    for (first, last), root in zip(itertools.pairwise(edges), roots, strict=True):
        if root.size:
            squares = np.sum((draws[:, first:last] @ root.T) ** 2, axis=1)
            lowest = np.minimum(lowest, chi2.sf(squares, root.shape[0]))
    # signatures that all but vanish are rounding; there are never more tests than parameters
    least = float(
        np.clip(np.quantile(lowest, FIT.screen_tail), np.finfo(float).tiny, 1 - np.finfo(float).epsneg)
    )
    return float(np.clip(np.log1p(-FIT.screen_tail) / np.log1p(-least), 1.0, edges[-1]))


def project(
    matrix: np.ndarray, gradient: np.ndarray, p: int, open_: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Schur complement of the first p unknowns (those that are open)."""
    kept = np.flatnonzero(open_ & (np.diag(matrix)[:p] > 0))
    inner = matrix[np.ix_(kept, kept)]
    scale = 1 / np.sqrt(np.diag(inner))
    values, vectors = np.linalg.eigh(inner * np.outer(scale, scale))
    usable = values > 1e-11
    root = (vectors[:, usable] / np.sqrt(values[usable])).T * scale
    cross = root @ matrix[np.ix_(kept, np.arange(p, gradient.size))]
    return matrix[p:, p:] - cross.T @ cross, gradient[p:] - cross.T @ (root @ gradient[kept])


def _whitening(inner: np.ndarray) -> np.ndarray:
    """A root of the inverse, without directions that nothing is left of."""
    diagonal = np.diag(inner)
    live = diagonal > 0
    if not live.any():
        return np.zeros((0, diagonal.size))
    scale = np.where(live, 1 / np.sqrt(np.where(live, diagonal, 1)), 0)
    values, vectors = np.linalg.eigh(inner * np.outer(scale, scale))
    usable = values > 1e-8
    return (vectors[:, usable] / np.sqrt(values[usable])).T * scale
