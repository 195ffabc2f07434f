# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments whose start is caught in a wrong minimum (one impact more or less), tried from others."""

import numpy as np

from separatrix.discovery.fit import Fit
from separatrix.discovery.problem import Evaluation, Problem
from separatrix.discovery.segments import padded

# reduced chi^2 of a segment, over that of the median one, that looks like a wrong minimum
_SUSPECT = 1.7
_MOST_SEGMENTS = 12
_ITERATIONS = 10
# starts tried, in standard errors of the smoother
_TRIED = np.array([(0, 0), (0, -3), (0, -1.5), (0, 1.5), (0, 3), (-2, 0), (2, 0), (-2, 2), (2, -2)], float)


def suspicious(fit: Fit) -> np.ndarray:
    """Segments that are fitted far worse than the others or not at all, worst first."""
    reduced = fit.chi2 / np.maximum(1, fit.counts)
    usual = max(1.0, float(np.median(reduced[fit.good]))) if fit.good.any() else 1.0
    suspects = np.flatnonzero((reduced > _SUSPECT * usual) | ~fit.good)
    return suspects[np.argsort(-reduced[suspects])][:_MOST_SEGMENTS]


def rescued(
    problem: Problem, fit: Fit, suspects: np.ndarray, guesses: list[np.ndarray], spread: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Starts of all segments, the suspects improved where possible, and which were.

    Each of `guesses` (segments, 2) is tried with steps of `spread`, the standard errors of the smoother.
    """
    improved = np.zeros(fit.chi2.size, bool)
    guesses = [*guesses, fit.starts]
    steps = np.tile(_TRIED, (len(guesses), 1))
    tries = len(steps)
    rows = np.repeat(suspects, tries)
    segments = problem.segments
    copies = Problem(
        problem.model,
        problem.prepared,
        padded(segments.record[rows], segments.first[rows], segments.last[rows]),
        problem.free,
    )
    places = np.tile(np.repeat(np.arange(len(guesses)), len(_TRIED)), suspects.size)
    begin = np.stack(guesses)[places, rows] + np.tile(steps, (suspects.size, 1)) * spread[rows]
    found, cost = solve_starts(copies, fit.values, begin)
    cost = cost.reshape(suspects.size, tries)
    best = np.argmin(cost, axis=1)
    starts = fit.starts.copy()
    before = np.where(fit.good[suspects], fit.chi2[suspects], np.inf)
    better = cost[np.arange(suspects.size), best] < np.minimum(0.8 * before, before - 10)
    for place in np.flatnonzero(better):
        starts[suspects[place]] = found[place * tries + best[place]]
        improved[suspects[place]] = True
    return starts, improved


def solve_starts(problem: Problem, values: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit the start of each segment by itself, the machine fixed; also the chi^2."""
    starts = starts.copy()
    current = problem.evaluate(values, starts)
    cost = _cost(current)
    damping = np.full(cost.size, 1e-3)
    for _ in range(_ITERATIONS):
        step = _steps(current, damping)
        trial = problem.evaluate(values, starts + step, derivatives=False)
        reached = _cost(trial)
        better = reached < cost
        damping = np.where(better, 0.2 * damping, 10 * damping)
        starts[better] += step[better]
        idle = not np.any(better & ((cost == np.inf) | (reached < cost - 0.01)))
        cost = np.where(better, reached, cost)
        if idle:
            break
        current = problem.evaluate(values, starts)
    return starts, cost


def _cost(evaluation: Evaluation) -> np.ndarray:
    cost = np.sum(evaluation.used * evaluation.residual**2, axis=1)
    return np.where(evaluation.failed, np.inf, cost)


def _steps(evaluation: Evaluation, damping: np.ndarray) -> np.ndarray:
    weighted = evaluation.by_start * evaluation.used[:, :, None]
    matrix = weighted.transpose(0, 2, 1) @ evaluation.by_start
    gradient = (weighted.transpose(0, 2, 1) @ evaluation.residual[:, :, None])[:, :, 0]
    diagonal = np.einsum("kii->ki", matrix)
    matrix[:, [0, 1], [0, 1]] = diagonal * (1 + damping[:, None]) + 1e-300
    determinant = matrix[:, 0, 0] * matrix[:, 1, 1] - matrix[:, 0, 1] ** 2
    safe = np.where(determinant > 0, determinant, np.inf)
    step = np.stack(
        [
            matrix[:, 1, 1] * gradient[:, 0] - matrix[:, 0, 1] * gradient[:, 1],
            matrix[:, 0, 0] * gradient[:, 1] - matrix[:, 0, 1] * gradient[:, 0],
        ],
        axis=1,
    )
    return step / safe[:, None]
