# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Size and memory of the noise of records, from the residuals of segments of half a period.

Over half a period, a free start and a force that is constant over quarters compensate a wrong model. The
residual is noise, less the share of these unknowns. Its power and the product of its neighbours are compared
with those that noise of correlation r^|k| would leave. With R its correlation and Q an orthonormal basis of
the unknowns that is tr(P R P), P = 1 - Q Q'; only R Q is formed.

For a condensed record the residuals of its smooth blocks are used, which need no machine.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.response import standardised
from separatrix.discovery.measured.condense import Samples, expected_left
from separatrix.discovery.policy import FIT

_MEMORIES = np.linspace(-0.2, 0.9, 45)


@dataclass
class Left:
    """What is left of pieces of records: power, products of neighbours; both of noise by memory (rows)."""

    record: np.ndarray
    power: np.ndarray
    product: np.ndarray
    freedom: np.ndarray
    powers: np.ndarray
    products: np.ndarray


@dataclass(frozen=True)
class Noise:
    """Factor on the assumed standard deviation by record, and the correlation of neighbours in all."""

    factors: dict[int, float]
    memory: float
    # standard error of that correlation
    error: float = 0.0
    # whether the memory is that of residuals of condensed blocks, which are independent of the machine
    of_samples: bool = False


def noise_of(problem: Likelihood, fit: Fit, channel: int, mass: float, known: float | None = None) -> Noise:
    """Size and memory of the noise of one channel of all records; the memory may be `known`."""
    left, condensed, most = problem.left_of_noise(fit, channel, mass)
    # a row of blocks stands for all of one length
    if left.record.size < FIT.noise_segments and not condensed:
        return Noise({}, 0.0)
    memory, error = _memory_of(_joined(condensed) if condensed else left)
    if known is not None:
        memory = known
    if memory > most:
        memory = 0.0
    factors = {}
    for number in np.unique(left.record):
        rows = left.record == number
        expected = float(np.interp(memory, _MEMORIES, left.powers[:, rows].sum(axis=1)))
        factors[int(number)] = float(np.sqrt(left.power[rows].sum() / expected))
    return Noise(factors, memory, error, bool(condensed))


def left_of_motion(
    problem: Likelihood, fit: Fit, channel: int, mass: float
) -> tuple[Left, list[Left], float]:
    """Residuals of a motion; those of condensed blocks; the memory above which it is not that of a sensor."""
    condensed = _of_blocks(problem, channel)
    return _joined([_of_segments(problem, fit, channel, mass), *condensed]), condensed, np.inf


def left_of_force(problem: Likelihood, fit: Fit) -> tuple[Left, list[Left], float]:
    """The same of a force."""
    return _of_short_pieces(problem, fit), [], FIT.most_memory


def _memory_of(left: Left) -> tuple[float, float]:
    """Correlation of neighbours of noise that leaves as much, 0 if it may be chance; its standard error."""
    # each record in its own size
    size = np.ones(left.record.size)
    for number in np.unique(left.record):
        rows = left.record == number
        size[rows] = left.power[rows].sum() / left.freedom[rows].sum()
    ratio = left.products.sum(axis=1) / left.powers.sum(axis=1)
    seen = float(np.sum(left.product / size) / np.sum(left.power / size))
    memory = float(np.interp(seen, ratio, _MEMORIES))
    # Bartlett's variance of the correlation of neighbours, over how fast it changes with the memory
    freedom = left.freedom.sum()
    slope = float(np.interp(memory, _MEMORIES, np.gradient(ratio, _MEMORIES)))
    error = float(np.sqrt((1 - memory**2) / freedom)) / max(slope, 1e-3)
    return (0.0 if memory < max(FIT.least_memory, FIT.memory_sure / np.sqrt(freedom)) else memory), error


def white_share(memory: float) -> float:
    """Power of the fourth differences of noise of correlation r^|k| over that of white noise of its size."""
    return float(np.polyval([2, -16, 56, -112, 70], memory)) / 70


def _joined(parts: list[Left]) -> Left:
    names = ("record", "power", "product", "freedom", "powers", "products")
    return Left(*(np.concatenate([getattr(one, name) for one in parts], axis=-1) for name in names))


def _of_blocks(problem: Likelihood, channel: int) -> list[Left]:
    """Residuals of condensed blocks, a row for all blocks of one length in a record."""
    found = []
    for number, prepared in enumerate(problem.prepared):
        samples = prepared.samples
        if not samples.condensed or (channel == 1 and samples.v is None):
            continue
        sigma = prepared.velocity_sigma if channel == 1 else prepared.sigma
        parts = [_of_length(samples, size, channel, sigma) for size in samples.lengths]
        columns = [np.array(column) for column in zip(*parts, strict=True)]
        record = np.full(len(parts), number)
        found.append(Left(record, *columns[:3], columns[3].T, columns[4].T))
    return found


def _of_length(samples: Samples, size: int, channel: int, sigma: float) -> tuple:
    rows = (samples.size == size) & (samples.node == 0)
    count = rows.sum()
    squares = (samples.left_v if channel == 1 else samples.left)[rows].sum() / sigma**2
    expected = np.array([expected_left(size, float(memory)) for memory in _MEMORIES]) * count
    # products are kept of positions alone; those of velocities are as white noise leaves them
    white = expected_left(size, 0.0)[1] * count * squares / samples.freedom[rows].sum()
    product = white if channel == 1 else samples.products[rows].sum() / sigma**2
    return squares, product, samples.freedom[rows].sum(), expected[:, 0], expected[:, 1]


def _of_segments(problem: Likelihood, fit: Fit, channel: int, mass: float) -> Left:
    """Residuals of segments of samples with their starts and forces projected out."""
    segments = problem.segments
    length = segments.inside.shape[1]
    counts = segments.inside.sum(axis=1)
    piece = np.minimum(np.arange(length)[None, :] * FIT.noise_pieces // counts[:, None], FIT.noise_pieces - 1)
    part = slice(channel * length, (channel + 1) * length)
    fitting = fit.good & (counts >= 2 * (FIT.noise_pieces + 2)) & np.any(fit.evaluation.used[:, part], axis=1)
    condensed = np.array([one.samples.condensed for one in problem.prepared])
    rows = np.flatnonzero(fitting & ~condensed[segments.record])
    if not rows.size:
        none = np.zeros(0)
        return Left(none.astype(int), none, none, none, *np.zeros((2, _MEMORIES.size, 0)))
    forces = (piece[:, :, None] == np.arange(FIT.noise_pieces)) * segments.inside[:, :, None].astype(float)
    columns = np.concatenate([fit.evaluation.by_start, problem.force_columns(fit, forces, mass)], axis=2)
    columns, residual = columns[rows, part], fit.evaluation.residual[rows, part]
    if channel == 0:
        columns = np.concatenate([columns, _bent_sensor(problem, fit)[rows]], axis=2)
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    basis, singular, _ = np.linalg.svd(columns / np.where(size > 0, size, 1), full_matrices=False)
    basis = basis * (singular > 1e-6 * singular[:, :1])[:, None, :]
    cleaned = residual * segments.inside[rows]
    # as if the samples left out had the noise of the others
    cleaned *= np.sqrt(counts[rows] / np.maximum(1, fit.evaluation.used[rows, part].sum(axis=1)))[:, None]
    cleaned = cleaned - np.einsum("klq,kq->kl", basis, np.einsum("klq,kl->kq", basis, cleaned))
    freedom = counts[rows] - np.sum(basis**2, axis=(1, 2))
    return _without_outliers(segments.record[rows], cleaned, freedom, basis, counts[rows])


def _bent_sensor(problem: Likelihood, fit: Fit) -> np.ndarray:
    """Square and cube of the position, (segments, samples, 2): errors of a slightly nonlinear sensor.

    They have kinks where the speed jumps, unlike forces, and would appear as memory of the noise.
    """
    seen = problem.segments.inside & fit.good[:, None]
    u = np.where(seen, standardised(problem, fit.evaluation.x)[0], 0.0)
    return u[:, :, None] ** np.array([2, 3])


def _of_short_pieces(problem: Likelihood, fit: Fit) -> Left:
    """Residuals of short pieces of measured forces less a parabola in time each.

    A force shows every kink of a law at once; pieces with large residuals of a wrong machine are left out.
    """
    length = problem.segments.inside.shape[1] // FIT.noise_samples * FIT.noise_samples
    pieces = fit.evaluation.residual[:, :length].reshape(-1, FIT.noise_samples)
    used = fit.evaluation.used[:, :length].reshape(-1, FIT.noise_samples).all(axis=1)
    record = np.repeat(problem.segments.record, length // FIT.noise_samples)[used]
    basis = np.linalg.qr(np.vander(np.linspace(-1, 1, FIT.noise_samples), FIT.noise_powers))[0]
    cleaned = pieces[used] - pieces[used] @ basis @ basis.T
    count = np.full(record.size, FIT.noise_samples)
    whole = np.broadcast_to(basis, (record.size, *basis.shape))
    return _without_outliers(record, cleaned, (count - FIT.noise_powers).astype(float), whole, count)


def _without_outliers(
    record: np.ndarray, cleaned: np.ndarray, freedom: np.ndarray, basis: np.ndarray, counts: np.ndarray
) -> Left:
    """Powers of the residuals, without pieces that the model misses altogether."""
    power = np.sum(cleaned**2, axis=1)
    share = power / freedom
    kept = np.zeros(record.size, bool)
    for number in np.unique(record):
        kept |= (record == number) & (share < FIT.noise_outlier * np.median(share[record == number]))
    product = np.sum(cleaned[:, 1:] * cleaned[:, :-1], axis=1)
    expected = _expected(basis[kept], counts[kept])
    return Left(record[kept], power[kept], product[kept], freedom[kept], *expected)


def _expected(basis: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Power and products of neighbours that noise of each memory would leave, (memories, segments)."""
    inside = (np.arange(basis.shape[1])[None, :] < counts[:, None])[:, :, None]
    powers, products = [], []
    for memory in _MEMORIES:
        # R Q by a filter forth and back
        forth = lfilter([1.0], [1.0, -memory], basis, axis=1)
        back = lfilter([1.0], [1.0, -memory], basis[:, ::-1], axis=1)[:, ::-1]
        carried = (forth + back - basis) * inside
        inner = basis.transpose(0, 2, 1) @ carried
        powers.append(counts - np.trace(inner, axis1=1, axis2=2))
        mixed = np.sum(basis[:, 1:] * carried[:, :-1], axis=(1, 2))
        mixed += np.sum(carried[:, 1:] * basis[:, :-1], axis=(1, 2))
        both = np.sum((basis[:, 1:] @ inner) * basis[:, :-1], axis=(1, 2))
        products.append((counts - 1) * memory - mixed + both)
    return np.array(powers), np.array(products)
