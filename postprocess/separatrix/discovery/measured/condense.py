# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The fitted samples of a record, with smooth blocks condensed to a few values of the same information.

A block of b samples that a polynomial of degree n - 1 follows down to the noise is replaced by the values of
its least-squares polynomial at the n zeros of the discrete orthogonal (Gram) polynomial of degree n. There
the errors of the values are independent (Gauss quadrature: Golub and Welsch, Calculation of Gauss quadrature
rules, Math. Comp. 23 (1969)), and a term of degree n does not change them. The residual of the polynomial is
noise, whose size is kept.

Samples stay where the motion is not smooth: around impacts, where the body turns or sticks (friction jumps
there), and wherever the noise does not hide a term of degree n or n + 1.
"""

from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from separatrix.discovery.measured.records import Record
from separatrix.discovery.measured.signals import white_noise
from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError


@dataclass
class Samples:
    """The fitted values of a record, row by row."""

    t: np.ndarray
    x: np.ndarray
    v: np.ndarray | None
    # intervals of rows without gaps as (first, last + 1)
    pieces: list[tuple[int, int]]
    # samples of the block of a row (1: it is a sample), and index of the value in the block
    size: np.ndarray
    node: np.ndarray
    # offset in the record in samples
    offset: np.ndarray
    # residual sums of squares of blocks, and of products of neighbours, at their first rows
    left: np.ndarray
    left_v: np.ndarray
    products: np.ndarray
    # factor of the noise within which blocks are smooth: above 1 where too many rows would stay
    factor: float = 1.0
    # rows whose velocity is not compared: the sample may be on either side of a near impact
    blind: np.ndarray | None = None
    _noises: dict[float, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict, repr=False)

    @cached_property
    def lengths(self) -> list[int]:
        """Lengths of the blocks of rows [samples]."""
        return [int(size) for size in np.unique(self.size) if size > 1]

    @property
    def condensed(self) -> bool:
        """Whether any row represents more than a sample."""
        return bool(self.lengths)

    @cached_property
    def freedom(self) -> np.ndarray:
        """Residual degrees of freedom of blocks, at their first rows."""
        return np.where((self.node == 0) & (self.size > 1), self.size - RECORDS.block_values, 0)

    def spread(self, memory: float) -> np.ndarray:
        """Standard deviation of each row over that of a sample, of noise with correlation memory^|k|."""
        return self._of_noise(memory)[0]

    def links(self, memory: float) -> np.ndarray:
        """Correlation of the noise of each row with that of the row before, of the same noise; 0 of none."""
        return self._of_noise(memory)[1]

    def weights(self, memory: float) -> np.ndarray:
        """Degrees of freedom over the squares that such noise of size 1 leaves, at first rows."""
        found = np.zeros(self.size.size)
        for size in self.lengths:
            rows = (self.size == size) & (self.node == 0)
            found[rows] = (size - RECORDS.block_values) / expected_left(size, round(memory, 3))[0]
        return found

    def _of_noise(self, memory: float) -> tuple[np.ndarray, np.ndarray]:
        if memory not in self._noises:
            # noise may have been measured again
            self._noises.clear()
            self._noises[memory] = self._computed(memory)
        return self._noises[memory]

    def _computed(self, memory: float) -> tuple[np.ndarray, np.ndarray]:
        spread, first, last, within = np.ones((4, self.size.size))
        begin = self.offset.copy()
        for size in self.lengths:
            rows = self.size == size
            noise, node = _block_noise(size, round(memory, 3)), self.node[rows]
            for table, values in zip((spread, first, last, within), noise, strict=True):
                table[rows] = values[node]
            begin[rows] -= _basis(size)[1][node]
        links = np.zeros(self.size.size)
        # from the end of a block or sample to the beginning of the next
        neighbours = begin[1:] - begin[:-1] - self.size[:-1] < 0.5
        links[1:] = np.where(neighbours, memory * last[:-1] * first[1:], 0.0)
        return spread, np.where(self.node > 0, within, links)


def whole(record: Record) -> Samples:
    """Every sample as a row."""
    n = record.t.size
    none = np.zeros(n)
    return Samples(
        record.t,
        record.x,
        record.v,
        list(record.pieces),
        np.ones(n, int),
        np.zeros(n, int),
        np.arange(n, dtype=float),
        none,
        none,
        none,
    )


def stride(period: float, samples: int) -> int:
    """Stride that still resolves a motion of `period` samples in a record of `samples`."""
    return (
        1
        if period < RECORDS.condensed_from or samples <= RECORDS.never_condensed
        else max(1, round(period / RECORDS.condensed_to))
    )


@cache
def _basis(size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orthonormal polynomials (size, values + 2) on a block; nodes [samples]; values there by coefficient."""
    u = np.linspace(-1, 1, size)
    q, r = np.linalg.qr(np.polynomial.legendre.legvander(u, RECORDS.block_values + 1))
    q *= np.sign(np.diag(r))
    jacobi = q[:, : RECORDS.block_values].T @ (u[:, None] * q[:, : RECORDS.block_values])
    nodes, vectors = np.linalg.eigh(jacobi)
    # the polynomial of degree 0 is positive
    values = (vectors / (vectors[0] * np.sqrt(size))).T
    return q, 0.5 * (nodes + 1) * (size - 1), values


@cache
def _block_noise(size: int, memory: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Noise of the values of a block, for noise of samples with correlation memory^|k| and size 1.

    Standard deviations; correlations with the first and the last sample; with the value before (0 of the
    first).
    """
    q, _, values = _basis(size)
    weights = values @ q[:, : RECORDS.block_values].T
    forth = lfilter([1.0], [1.0, -memory], weights, axis=1)
    back = lfilter([1.0], [1.0, -memory], weights[:, ::-1], axis=1)[:, ::-1]
    carried = forth + back - weights
    covariance = weights @ carried.T
    spread = np.sqrt(np.maximum(np.diag(covariance), 1e-12))
    before = np.concatenate([[0.0], np.diag(covariance, -1) / (spread[1:] * spread[:-1])])
    return spread, carried[:, 0] / spread, carried[:, -1] / spread, before


@cache
def expected_left(size: int, memory: float) -> tuple[float, float]:
    """Residual sum of squares, and of products of neighbours, of noise of size 1 in a block."""
    q = _basis(size)[0][:, : RECORDS.block_values]
    noise = toeplitz(memory ** np.arange(size))
    carried = noise @ q
    inner = q.T @ carried
    # tr(P R P) and the sum beside its diagonal, P = 1 - q q'
    beside = (size - 1) * memory - np.sum(q[1:] * carried[:-1]) - np.sum(carried[1:] * q[:-1])
    return float(size - np.trace(inner)), float(beside + np.sum((q[1:] @ inner) * q[:-1]))


def condense(
    record: Record, period: float, sigma: float, events: tuple[np.ndarray, np.ndarray, float]
) -> Samples:
    """Rows of a record whose motion has `period` samples per oscillation and noise of `sigma`.

    `events`: flags of samples that must stay, flags of those near which friction may jump, and the usual
    acceleration.
    """
    kept, slow, acceleration = events
    noise = max(sigma, white_noise(record.x)) * _inflation(record)
    longest = _power(period * RECORDS.longest_block)
    # the hidden part of a jump of friction stays below the noise of the values
    jump = RECORDS.jump_hidden * max(acceleration, 1e-300) * record.interval**2
    at_jumps = (RECORDS.jump_shift * noise / jump) ** 0.4
    unseen = RECORDS.block_chi2
    while True:
        taken = _taken(record, (kept, slow), longest, at_jumps, noise * np.sqrt(unseen / RECORDS.block_chi2))
        rows = sum(RECORDS.block_values * first.size for _, first in taken) + int(
            record.t.size - sum(size * first.size for size, first in taken)
        )
        if rows <= RECORDS.most_rows:
            break
        if unseen > 1e12:
            raise SeparatrixError(
                f"{record.file}: {rows} of {record.t.size} samples are around impacts or where the body "
                f"turns, at most {RECORDS.most_rows} can be fitted: keep every "
                f"{-(-rows // RECORDS.most_rows)}th row, or a part of the record"
            )
        unseen *= 4
        at_jumps *= 2
    found = _rows(record, taken)
    found.factor = float(np.sqrt(unseen / RECORDS.block_chi2))
    return found


def _power(samples: float) -> int:
    """Longest block of at most so many samples: the shortest one times a power of two."""
    return int(RECORDS.shortest_block * 2 ** np.floor(np.log2(max(1.0, samples / RECORDS.shortest_block))))


def _inflation(record: Record) -> float:
    """Noise of slow terms over that of white noise of the same size, from short blocks."""
    blocks = _blocks(record.pieces, np.zeros(record.t.size, bool), RECORDS.memory_block)
    if not blocks.size:
        return 1.0
    q = _basis(RECORDS.memory_block)[0][:, : RECORDS.block_values]
    at = blocks[:: max(1, blocks.size // 2000), None] + np.arange(RECORDS.memory_block)
    y = record.x[at] - record.x[at].mean(axis=1, keepdims=True)
    y = y - (y @ q) @ q.T
    power, product = np.sum(y**2, axis=1), np.sum(y[:, 1:] * y[:, :-1], axis=1)
    quiet = power <= 2 * np.median(power)
    seen = product[quiet].sum() / max(power[quiet].sum(), 1e-300)
    memories = np.linspace(0, RECORDS.condensed_memory, 19)
    ratios = [two / one for one, two in (expected_left(RECORDS.memory_block, memory) for memory in memories)]
    memory = float(np.interp(seen, ratios, memories))
    return float(np.sqrt((1 + memory) / (1 - memory)))


def _blocks(pieces: list[tuple[int, int]], taken: np.ndarray, size: int) -> np.ndarray:
    """First samples of blocks of `size` on a grid in each piece, without taken samples."""
    first = np.concatenate(
        [np.arange(a, b - size + 1, size) for a, b in pieces if b - a >= size] or [np.zeros(0, int)]
    ).astype(int)
    total = np.concatenate([[0], np.cumsum(taken)])
    return first[total[first + size] == total[first]]


def _taken(
    record: Record, events: tuple[np.ndarray, np.ndarray], longest: int, at_jumps: float, noise: float
) -> list[tuple[int, np.ndarray]]:
    """Blocks to condense, as their length and first samples; the longest that are smooth."""
    kept, slow = events
    taken = kept.copy()
    slow_before = np.concatenate([[0], np.cumsum(slow)])
    found = []
    size = longest
    while size >= RECORDS.shortest_block:
        first = _blocks(record.pieces, taken, size)
        if size > at_jumps:
            first = first[slow_before[first + size] == slow_before[first]]
        for part in np.array_split(first, max(1, first.size * size // 1_000_000)):
            smooth = part[_smooth(record, part, size, noise)]
            taken[(smooth[:, None] + np.arange(size)).ravel()] = True
            if smooth.size:
                found.append((size, smooth))
        size //= 2
    return found


def _smooth(record: Record, first: np.ndarray, size: int, noise: float) -> np.ndarray:
    """Whether the noise hides the next two terms of each block in x and v, at even times."""
    at = first[:, None] + np.arange(size)
    q = _basis(size)[0][:, RECORDS.block_values :]
    smooth = np.sum((record.x[at] @ q) ** 2, axis=1) < RECORDS.block_chi2 * noise**2
    if record.v is not None:
        smooth &= np.sum((record.v[at] @ q) ** 2, axis=1) < RECORDS.block_chi2 * white_noise(record.v) ** 2
    span = record.t[first + size - 1] - record.t[first]
    off = np.abs(record.t[at] - record.t[first, None] - span[:, None] * np.linspace(0, 1, size))
    return smooth & (off.max(axis=1, initial=0) < 1e-3 * record.interval)


def _rows(record: Record, taken: list[tuple[int, np.ndarray]]) -> Samples:
    """The rows in order: values of the blocks, samples elsewhere."""
    single = np.ones(record.t.size, bool)
    parts = []
    for size, first in taken:
        at = first[:, None] + np.arange(size)
        single[at.ravel()] = False
        q, nodes, values = _basis(size)
        q = q[:, : RECORDS.block_values]
        channels = []
        for y in (record.x, record.v):
            if y is None:
                channels.append((np.zeros((first.size, RECORDS.block_values)), *np.zeros((2, first.size))))
                continue
            middle = y[at].mean(axis=1, keepdims=True)
            centred = y[at] - middle
            terms = centred @ q
            rest = centred - terms @ q.T
            products = np.sum(rest[:, 1:] * rest[:, :-1], axis=1)
            channels.append((middle + terms @ values.T, np.sum(rest**2, axis=1), products))
        offset = first[:, None] + nodes
        span = (record.t[first + size - 1] - record.t[first]) / (size - 1)
        begun = np.arange(RECORDS.block_values) == 0
        (x, left, products), (v, left_v, _) = channels
        columns = (offset, record.t[first][:, None] + nodes * span[:, None], x, v)
        columns = (*columns, *(one[:, None] * begun for one in (left, left_v, products)))
        flat = [one.ravel() for one in columns]
        parts.append(
            [*flat, np.full(offset.size, size), np.tile(np.arange(RECORDS.block_values), first.size)]
        )
    rows = np.flatnonzero(single)
    none = np.zeros(rows.size)
    v = none if record.v is None else record.v[rows]
    samples = [rows.astype(float), record.t[rows], record.x[rows], v, none, none, none]
    parts.append([*samples, np.ones(rows.size, int), np.zeros(rows.size, int)])
    whole_ = [np.concatenate(columns) for columns in zip(*parts, strict=True)]
    order = np.argsort(whole_[0], kind="stable")
    offset, t, x, v, left, left_v, products, size, node = (column[order] for column in whole_)
    edges = [
        (int(np.searchsorted(offset, a)), int(np.searchsorted(offset, b - 0.5))) for a, b in record.pieces
    ]
    return Samples(t, x, None if record.v is None else v, edges, size, node, offset, left, left_v, products)
