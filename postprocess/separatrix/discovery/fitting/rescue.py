# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Further starts for segments in a wrong minimum (one impact more or less)."""

import numpy as np

from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.policy import FIT

# starts tried, in standard errors of the smoother
_TRIED = np.array([(i, j) for i in (0, -4, -2, 2, 4) for j in (0, -3, -1.5, 1.5, 3)], float)


def suspicious(fit: Fit) -> np.ndarray:
    """Segments that are fitted far worse than the others or not at all, worst first."""
    reduced = fit.chi2 / np.maximum(1, fit.counts)
    usual = max(1.0, float(np.median(reduced[fit.good]))) if fit.good.any() else 1.0
    suspects = np.flatnonzero((reduced > FIT.suspect * usual) | ~fit.good)
    badness = np.where(fit.evaluation.failed, np.inf, reduced)
    return suspects[np.argsort(-badness[suspects], kind="stable")][: FIT.most_rescued]


def rescued(
    problem: Likelihood, fit: Fit, suspects: np.ndarray, guesses: list[np.ndarray], spread: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Starts of all segments, the suspects improved where possible, and which were.

    Each of `guesses` (segments, 2) is tried with steps of `spread`, the standard errors of the smoother.
    """
    improved = np.zeros(fit.chi2.size, bool)
    guesses = [*guesses, fit.starts]
    around = _around(fit.starts.shape[1])
    steps = np.tile(around, (len(guesses), 1))
    tries = len(steps)
    rows = np.repeat(suspects, tries)
    copies = problem.of_segments(rows)
    indices = np.tile(np.repeat(np.arange(len(guesses)), len(around)), suspects.size)
    begin = np.stack(guesses)[indices, rows] + np.tile(steps, (suspects.size, 1)) * spread[rows]
    promising = _promising(copies.evaluate(fit.values, begin, derivatives=False), tries)
    if not promising.size:
        # the segments cannot be simulated from any of the trials
        return fit.starts.copy(), improved
    rows, begin = rows[promising], begin[promising]
    found, cost = solve_starts(copies.of_segments(promising), fit.values, begin)
    starts = fit.starts.copy()
    for segment in np.unique(rows):
        trials = np.flatnonzero(rows == segment)
        best = trials[np.argmin(cost[trials])]
        before = fit.chi2[segment] if fit.good[segment] else np.inf
        if cost[best] < min(0.8 * before, before - 10):
            starts[segment] = found[best]
            improved[segment] = True
    return starts, improved


def _around(width: int) -> np.ndarray:
    """Steps of a start that are tried, in standard errors."""
    if width == _TRIED.shape[1]:
        return _TRIED
    alone = [size * row for row in np.eye(width) for size in FIT.rescue_alone]
    return np.array([np.zeros(width), *alone])


def _promising(evaluation: Evaluation, tries: int) -> np.ndarray:
    """The best trials of each segment, separately for each number of impacts.

    Numbers of impacts whose best try is behind those of several others are left out.
    """
    cost = _cost(evaluation)
    hits = evaluation.hits
    kept = []
    for first in range(0, cost.size, tries):
        mine = first + np.argsort(cost[first : first + tries], kind="stable")
        for count in list(dict.fromkeys(hits[mine]))[: FIT.rescue_numbers]:
            kept.extend(mine[hits[mine] == count][: FIT.rescue_followed])
    return np.sort([one for one in kept if np.isfinite(cost[one])]).astype(int)


def solve_starts(
    problem: Likelihood, values: np.ndarray, starts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit the start of each segment by itself, the machine fixed; also the chi^2.

    Each keeps its number of impacts: next to a graze a step would leave the minimum with one more unseen.
    """
    starts = starts.copy()
    begun = problem.evaluate(values, starts, derivatives=False)
    cost, hits = _cost(begun), begun.hits
    damping = np.full(cost.size, 1e-3)
    active = np.flatnonzero(np.isfinite(cost))
    for _ in range(FIT.rescue_iterations):
        if not active.size:
            break
        part = problem.of_segments(active)
        current = part.evaluate(values, starts[active], by_start_alone=True)
        tried = starts[active] + _steps(current, damping[active])
        ended = part.evaluate(values, tried, derivatives=False)
        reached, before = _cost(ended), cost[active]
        better = (reached < before) & (ended.hits == hits[active])
        starts[active[better]] = tried[better]
        cost[active[better]] = reached[better]
        damping[active] *= np.where(better, 0.2, 10)
        active = active[
            np.where(better, reached < before - FIT.rescue_gain, damping[active] < FIT.rescue_strongest)
        ]
    return starts, cost


def _cost(evaluation: Evaluation) -> np.ndarray:
    cost = np.sum(evaluation.used * evaluation.residual**2, axis=1)
    return np.where(evaluation.failed, np.inf, cost)


def _steps(evaluation: Evaluation, damping: np.ndarray) -> np.ndarray:
    weighted = evaluation.by_start * evaluation.used[:, :, None]
    matrix = weighted.transpose(0, 2, 1) @ evaluation.by_start
    gradient = (weighted.transpose(0, 2, 1) @ evaluation.residual[:, :, None])[:, :, 0]
    if matrix.shape[1] != 2:
        return _solved(matrix, gradient, damping, evaluation.failed)
    diagonal = np.einsum("kii->ki", matrix)
    matrix[:, [0, 1], [0, 1]] = diagonal * (1 + damping[:, None]) + 1e-300
    determinant = matrix[:, 0, 0] * matrix[:, 1, 1] - matrix[:, 0, 1] ** 2
    usable = np.isfinite(determinant) & (determinant > 0) & ~evaluation.failed
    adjugate = np.stack([matrix[:, 1, 1], -matrix[:, 0, 1], -matrix[:, 0, 1], matrix[:, 0, 0]], axis=1)
    inverse = np.zeros_like(adjugate)
    inverse[usable] = adjugate[usable] / determinant[usable, None]
    return (inverse.reshape(-1, 2, 2) @ gradient[:, :, None])[:, :, 0]


def _solved(matrix: np.ndarray, gradient: np.ndarray, damping: np.ndarray, failed: np.ndarray) -> np.ndarray:
    """Damped steps in the units of the diagonals."""
    size = np.sqrt(np.maximum(np.einsum("kii->ki", matrix), 0))
    scale = np.where(size > 0, 1 / np.where(size > 0, size, 1), 0)
    usable = np.isfinite(matrix).all(axis=(1, 2)) & ~failed
    scaled = np.where(usable[:, None, None], matrix, 0) * scale[:, :, None] * scale[:, None, :]
    scaled = scaled + (damping[:, None, None] + 1e-10) * np.eye(matrix.shape[1])
    return (
        scale * np.linalg.solve(scaled, (scale * np.where(usable[:, None], gradient, 0))[:, :, None])[:, :, 0]
    )
