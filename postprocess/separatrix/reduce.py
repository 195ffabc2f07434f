# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Read one plane of a map by slabs and reduce it to about the pixels of a figure.

Memory is bounded by the slab, not by the map.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil

import h5py
import numpy as np

TARGET = 1024  # cells kept along an axis
SLAB_BYTES = 8 * 2**20


@dataclass
class Plane:
    """A reduced plane: `image[i, j]` belongs to rows `row_starts[i]:row_starts[i+1]` of the map."""

    image: np.ndarray
    row_starts: np.ndarray
    column_starts: np.ndarray
    factors: tuple[int, int]
    counts: dict[int, int]


class Strip:
    """A dataset with one axis seen as one with a second axis of length 1."""

    ndim = 2
    chunks = None

    def __init__(self, dataset: h5py.Dataset | np.ndarray) -> None:
        """Keep the dataset."""
        self._dataset = dataset
        self.shape = (*dataset.shape, 1)
        self.dtype = dataset.dtype

    def __getitem__(self, selection: tuple) -> np.ndarray:
        """Return a part of it."""
        return self._dataset[selection[0]][:, np.newaxis][:, selection[1]]


def majority_plane(
    dataset: h5py.Dataset, plane: tuple[int, int], index: Sequence[int], target: int = TARGET
) -> Plane:
    """Return the most frequent label of each block, the smallest one of a tie, and the label counts.

    `plane` names the axes of rows and columns of the image, `index` the position on the other axes.
    The counts are those of the map, not those of the image.
    """
    counts: dict[int, int] = {}

    def reduce(slab: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        labels, numbers = np.unique(slab, return_counts=True)
        for label, number in zip(labels.tolist(), numbers.tolist(), strict=True):
            counts[label] = counts.get(label, 0) + number
        return block_majority(slab, labels, rows, columns)

    return _reduce_plane(dataset, plane, index, target, reduce, counts)


def scalar_plane(
    dataset: h5py.Dataset,
    plane: tuple[int, int],
    index: Sequence[int],
    target: int = TARGET,
    smallest: bool = False,
) -> Plane:
    """Return the mean (or the smallest) of the finite values of each block; NaN where there is none."""
    return _reduce_plane(dataset, plane, index, target, block_minimum if smallest else block_mean, {})


def block_majority(slab: np.ndarray, labels: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the most frequent of `labels` (ascending) in the blocks that start at `rows` and `columns`."""
    image = np.full((rows.size, columns.size), labels[0], dtype=slab.dtype)
    if labels.size == 1:
        return image
    best = np.zeros(image.shape, dtype=np.int32)
    for label in labels:
        count = _block_sum(slab == label, rows, columns, np.int32)
        ahead = count > best
        image[ahead] = label
        best[ahead] = count[ahead]
    return image


def block_mean(slab: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the mean of the finite values of each block."""
    finite = np.isfinite(slab)
    number = _block_sum(finite, rows, columns, np.int32)
    total = _block_sum(np.where(finite, slab, 0), rows, columns, np.float64)
    return np.divide(total, number, out=np.full(total.shape, np.nan), where=number > 0)


def block_minimum(slab: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the smallest finite value of each block."""
    values = np.where(np.isfinite(slab), slab, np.inf)
    lowest = np.minimum.reduceat(np.minimum.reduceat(values, rows, axis=0), columns, axis=1)
    return np.where(np.isfinite(lowest), lowest, np.nan).astype(np.float64)


def block_factor(size: int, target: int) -> int:
    """Return how many cells of an axis are merged so that at most `target` are left."""
    return max(1, ceil(size / target))


def _block_sum(values: np.ndarray, rows: np.ndarray, columns: np.ndarray, dtype: type) -> np.ndarray:
    # rows first: that sum runs along contiguous memory and leaves little for the second
    return np.add.reduceat(np.add.reduceat(values, rows, axis=0, dtype=dtype), columns, axis=1)


def _reduce_plane(
    dataset: h5py.Dataset,
    plane: tuple[int, int],
    index: Sequence[int],
    target: int,
    reduce: Callable,
    counts: dict[int, int],
) -> Plane:
    row_axis, column_axis = plane
    shape = dataset.shape
    factors = (block_factor(shape[row_axis], target), block_factor(shape[column_axis], target))
    row_starts = np.arange(0, shape[row_axis], factors[0])
    column_starts = np.arange(0, shape[column_axis], factors[1])
    step = _slab_rows(dataset, row_axis, column_axis, factors[0])
    pieces = []
    for first in range(0, shape[row_axis], step):
        last = min(first + step, shape[row_axis])
        slab = _read_slab(dataset, plane, index, slice(first, last))
        pieces.append(reduce(slab, np.arange(0, last - first, factors[0]), column_starts))
    return Plane(np.concatenate(pieces), row_starts, column_starts, factors, counts)


def _read_slab(
    dataset: h5py.Dataset, plane: tuple[int, int], index: Sequence[int], rows: slice
) -> np.ndarray:
    """Read rows of a plane as an array (rows, columns), whatever the order of the axes in the file."""
    rest = iter(index)
    selection = [
        rows if axis == plane[0] else slice(None) if axis == plane[1] else next(rest)
        for axis in range(dataset.ndim)
    ]
    slab = dataset[tuple(selection)]
    return np.ascontiguousarray(slab if plane[0] < plane[1] else slab.T)


def _slab_rows(dataset: h5py.Dataset, row_axis: int, column_axis: int, factor: int) -> int:
    """Rows of a slab: whole blocks, and whole chunks where that fits, so that none is unpacked twice."""
    rows = max(1, SLAB_BYTES // (dataset.shape[column_axis] * dataset.dtype.itemsize))
    # an array in memory has none
    chunks = getattr(dataset, "chunks", None)
    chunk = chunks[row_axis] if chunks else 1
    unit = int(np.lcm(factor, chunk))
    unit = unit if unit <= rows else factor
    return max(unit, rows // unit * unit)
