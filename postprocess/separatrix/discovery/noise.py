# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Size and memory of the noise of a record, from what short segments leave over.

Over a fifth of a period the wrong model does little that a free start and a constant force could not undo. What is left is
noise, less what these three took away: both moments of it are compared with those of noise of correlation r^|k|.
"""

import numpy as np

from separatrix.discovery.fit import Fit
from separatrix.discovery.problem import Problem
from separatrix.discovery.response import force_columns

_MEMORIES = np.linspace(-0.2, 0.9, 45)
_LEAST = 0.05
_SURE = 4.0


def noise_of(problem: Problem, fit: Fit, number: int, channel: int, mass: float) -> tuple[float, float]:
    """Factor on the assumed standard deviation, and correlation of neighbours, in one record and channel."""
    length = problem.segments.inside.shape[1]
    rows = np.flatnonzero((problem.segments.record == number) & fit.good)
    rows = rows[problem.segments.inside[rows].sum(axis=1) >= 7]
    if rows.size < 4:
        return 1.0, 0.0
    part = slice(channel * length, (channel + 1) * length)
    constant = force_columns(problem, fit, np.ones((*problem.segments.inside.shape, 1)), mass)
    columns = np.concatenate([fit.evaluation.by_start, constant], axis=2)[rows, part]
    residual = fit.evaluation.residual[rows, part]
    inside = problem.segments.inside[rows]
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    basis = np.linalg.qr(columns / np.where(size > 0, size, 1))[0]
    left = np.eye(length)[None] * inside[:, :, None] - basis @ basis.transpose(0, 2, 1)
    cleaned = (left @ residual[:, :, None])[:, :, 0]
    # robust against single segments that the model misses altogether
    powers = np.sum(cleaned**2, axis=1)
    share = np.trace(left, axis1=1, axis2=2)
    usual = np.median(powers / share)
    kept = powers < 2.5 * usual * share
    cleaned, left = cleaned[kept], left[kept]
    power = float(np.sum(cleaned**2))
    neighbours = float(np.sum(cleaned[:, 1:] * cleaned[:, :-1]))
    shifted = left[:, 1:].transpose(0, 2, 1) @ left[:, :-1]
    lags = np.abs(np.subtract.outer(np.arange(length), np.arange(length)))
    expected = []
    for memory in _MEMORIES:
        covariance = np.sign(memory) ** lags * np.abs(memory) ** lags if memory else np.eye(length)
        expected.append((np.sum(left * covariance), np.sum(shifted * covariance)))
    powers_expected, neighbours_expected = np.array(expected).T
    ratio = neighbours_expected / powers_expected
    memory = float(np.interp(neighbours / power, ratio, _MEMORIES))
    count = float(np.trace(left, axis1=1, axis2=2).sum())
    if memory < max(_LEAST, _SURE / np.sqrt(count)):
        memory = 0.0
    size = float(np.interp(memory, _MEMORIES, powers_expected))
    return float(np.sqrt(power / size)), memory
