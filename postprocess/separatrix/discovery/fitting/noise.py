# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Size and memory of the noise of records, from what segments of half a period leave over.

A wrong model does little over half a period that a free start and a force that is constant over quarters of
it could not undo. What is left is noise, less what these unknowns took away: its power and the product of its
neighbours are compared with what noise of correlation r^|k| would leave.
"""

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.problem import Problem
from separatrix.discovery.fitting.response import force_columns

_MEMORIES = np.linspace(-0.2, 0.9, 45)
_PIECES = 4
_LEAST = 0.04
_SURE = 3.5
_OUTLIER = 2.5


def noise_of(problem: Problem, fit: Fit, channel: int, mass: float) -> tuple[dict[int, float], float]:
    """Factor on the assumed standard deviation by record, and the correlation of neighbours in all."""
    cleaned, left, record = _cleaned(problem, fit, channel, mass)
    length = problem.segments.inside.shape[1]
    if record.size < 4:
        return {}, 0.0
    shifted = left[:, 1:].transpose(0, 2, 1) @ left[:, :-1]
    lags = np.abs(np.subtract.outer(np.arange(length), np.arange(length)))
    powers, products = [], []
    for memory in _MEMORIES:
        covariance = np.sign(memory) ** lags * np.abs(memory) ** lags if memory else np.eye(length)
        powers.append(np.sum(left * covariance, axis=(1, 2)))
        products.append(np.sum(shifted * covariance, axis=(1, 2)))
    power = np.sum(cleaned**2, axis=1)
    product = np.sum(cleaned[:, 1:] * cleaned[:, :-1], axis=1)
    # each record in its own size
    size = np.ones(record.size)
    for number in np.unique(record):
        size[record == number] = (
            power[record == number].sum() / np.trace(left, axis1=1, axis2=2)[record == number].sum()
        )
    ratio = np.sum(products, axis=1) / np.sum(powers, axis=1)
    seen = float(np.sum(product / size) / np.sum(power / size))
    memory = float(np.interp(seen, ratio, _MEMORIES))
    count = float(np.trace(left, axis1=1, axis2=2).sum())
    if memory < max(_LEAST, _SURE / np.sqrt(count)):
        memory = 0.0
    factors = {}
    for number in np.unique(record):
        rows = record == number
        expected = float(np.interp(memory, _MEMORIES, np.sum(powers, axis=1, where=rows)))
        factors[int(number)] = float(np.sqrt(power[rows].sum() / expected))
    return factors, memory


def white_share(memory: float) -> float:
    """Power of the fourth differences of noise of correlation r^|k| over that of white noise of its size."""
    return float(np.polyval([2, -16, 56, -112, 70], memory)) / 70


def _cleaned(
    problem: Problem, fit: Fit, channel: int, mass: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residuals of one channel, starts and forces projected out, the projectors, and their records."""
    segments = problem.segments
    length = segments.inside.shape[1]
    counts = segments.inside.sum(axis=1)
    piece = np.minimum(np.arange(length)[None, :] * _PIECES // counts[:, None], _PIECES - 1)
    forces = (piece[:, :, None] == np.arange(_PIECES)) * segments.inside[:, :, None].astype(float)
    columns = np.concatenate([fit.evaluation.by_start, force_columns(problem, fit, forces, mass)], axis=2)
    part = slice(channel * length, (channel + 1) * length)
    rows = np.flatnonzero(
        fit.good & (counts >= 2 * (_PIECES + 2)) & np.any(fit.evaluation.used[:, part], axis=1)
    )
    columns, residual = columns[rows, part], fit.evaluation.residual[rows, part]
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    basis, singular, _ = np.linalg.svd(columns / np.where(size > 0, size, 1), full_matrices=False)
    basis = basis * (singular > 1e-6 * singular[:, :1])[:, None, :]
    left = np.eye(length)[None] * segments.inside[rows][:, :, None] - basis @ basis.transpose(0, 2, 1)
    cleaned = (left @ residual[:, :, None])[:, :, 0]
    share = np.trace(left, axis1=1, axis2=2)
    kept = np.zeros(rows.size, bool)
    record = segments.record[rows]
    for number in np.unique(record):
        # robust against single segments that the model misses altogether
        power = np.sum(cleaned**2, axis=1) / share
        kept |= (record == number) & (power < _OUTLIER * np.median(power[record == number]))
    return cleaned[kept], left[kept], record[kept]
