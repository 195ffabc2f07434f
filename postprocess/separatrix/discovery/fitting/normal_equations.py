# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Normal equations of many short segments: each start is eliminated block by block, the common parameters
remain.

The normal equations of a Levenberg-Marquardt step have the form of an arrow: one small block per segment (2 x
2 of one body, 2 n x 2 n of n coordinates), coupled only through the parameters. Their Schur complement has
the size of the parameters (tests/python/discovery/test_discovery_fit.py compares it with the dense step).
"""

from dataclasses import dataclass

import numpy as np

_TINY = 1e-12


@dataclass
class Blocks:
    """Normal equations by segment; columns are the start, then the parameters."""

    matrix: np.ndarray
    gradient: np.ndarray
    # unknowns of a start
    starts: int


@dataclass
class Reduced:
    """What is left of each segment after its start is eliminated, to be summed or resampled."""

    matrix: np.ndarray
    gradient: np.ndarray

    def total(self) -> tuple[np.ndarray, np.ndarray]:
        """Sum over the segments."""
        return self.matrix.sum(axis=0), self.gradient.sum(axis=0)


def blocks_of(by_start: np.ndarray, columns: np.ndarray, residual: np.ndarray, weights: np.ndarray) -> Blocks:
    """Normal equations of each segment."""
    whole = np.concatenate([by_start, columns], axis=2)
    weighted = (whole * weights[:, :, None]).transpose(0, 2, 1)
    return Blocks(weighted @ whole, (weighted @ residual[:, :, None])[:, :, 0], by_start.shape[2])


def eliminate(blocks: Blocks, damping: float = 0.0) -> tuple[Reduced, np.ndarray, np.ndarray]:
    """Schur complement by segment; also inverse start blocks and couplings, to find the starts again."""
    s = blocks.starts
    start = blocks.matrix[:, :s, :s].copy()
    diagonal = np.einsum("kii->ki", start)
    diagonal *= 1 + damping
    if s == 2:
        diagonal += _TINY * (diagonal.max(axis=1, keepdims=True, initial=0) + 1e-300)
        inverse = _inverse_of_two(start)
    else:
        inverse = _inverse(start)
    coupling = blocks.matrix[:, :s, s:]
    carried = coupling.transpose(0, 2, 1) @ inverse
    matrix = blocks.matrix[:, s:, s:] - carried @ coupling
    gradient = blocks.gradient[:, s:] - (carried @ blocks.gradient[:, :s, None])[:, :, 0]
    return Reduced(matrix, gradient), inverse, coupling


def _inverse_of_two(start: np.ndarray) -> np.ndarray:
    """Inverses of 2 x 2 blocks, 0 of those without any."""
    determinant = start[:, 0, 0] * start[:, 1, 1] - start[:, 0, 1] * start[:, 1, 0]
    safe = np.where(determinant > 0, determinant, 1)
    inverse = np.empty_like(start)
    inverse[:, 0, 0], inverse[:, 1, 1] = start[:, 1, 1] / safe, start[:, 0, 0] / safe
    inverse[:, 0, 1] = inverse[:, 1, 0] = -start[:, 0, 1] / safe
    inverse[determinant <= 0] = 0
    return inverse


def _inverse(start: np.ndarray) -> np.ndarray:
    """Inverses of symmetric blocks in units of their diagonals; what no sample shows of a start stays."""
    size = np.sqrt(np.maximum(np.einsum("kii->ki", start), 0))
    scale = np.where(size > 0, 1 / np.where(size > 0, size, 1), 0)
    values, vectors = np.linalg.eigh(start * (scale[:, :, None] * scale[:, None, :]))
    kept = values > _TINY
    inner = vectors * np.where(kept, 1 / np.where(kept, values, 1), 0)[:, None, :]
    return scale[:, :, None] * (inner @ vectors.transpose(0, 2, 1)) * scale[:, None, :]


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


def inverse_scaled(matrix: np.ndarray, known: np.ndarray, smallest: float = 1e-10) -> np.ndarray:
    """Inverse of the known rows and columns of a symmetric matrix, else 0; in units of its diagonal
    directions below `smallest` of the largest do not count."""
    found = np.zeros_like(matrix)
    block = np.ix_(known, known)
    scale = 1 / np.sqrt(np.diag(matrix)[known])
    units = np.outer(scale, scale)
    found[block] = np.linalg.pinv(matrix[block] * units, rcond=smallest, hermitian=True) * units
    return found


def gauss_newton_step(
    blocks: Blocks,
    open_: np.ndarray,
    damping: float = 0.0,
    room: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Steps of the starts and the parameters, and the decrease of chi^2 that the linear model promises.

    `room`: lowest and highest steps of the parameters; one that would go farther ends there, and the others
    step as belongs to that.
    """
    reduced, inverse, coupling = eliminate(blocks, damping)
    matrix, gradient = reduced.total()
    if room is None:
        step = solve_scaled(matrix, gradient, open_, damping)
    else:
        step = _within(matrix, gradient, open_, damping, room)
    back = blocks.gradient[:, : blocks.starts] - (coupling @ step[None, :, None])[:, :, 0]
    starts = (inverse @ back[:, :, None])[:, :, 0]
    whole = np.concatenate([starts, np.broadcast_to(step, (starts.shape[0], step.size))], axis=1)
    bent = (blocks.matrix @ whole[:, :, None])[:, :, 0]
    promised = float(np.sum(whole * (2 * blocks.gradient - bent)))
    return starts, step, promised


def _within(
    matrix: np.ndarray,
    gradient: np.ndarray,
    open_: np.ndarray,
    damping: float,
    room: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """The step to the ends of the room: on a way each part of which lowers the linear model."""
    step, free = np.zeros(gradient.size), open_.copy()
    while True:
        onward = solve_scaled(matrix, gradient - matrix @ step, free, damping)
        ends = np.where(onward < 0, *room)
        left = np.full(step.size, np.inf)
        np.divide(ends - step, onward, out=left, where=onward != 0)
        share = max(0.0, left.min(initial=np.inf))
        if not (share < 1 and np.isfinite(onward).all()):
            return step + onward
        out = left <= share
        step = np.where(out, ends, step + share * onward)
        free &= ~out
