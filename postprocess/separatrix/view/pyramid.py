# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Planes of a map at every scale, in tiles of 256 x 256 cells; a cell of level L stands for 2^L x 2^L points.

Fine levels are read from the file, coarse ones are kept in memory. They are made block by block in an order
that covers the whole plane early, so that a large file is seen at once and becomes sharp while one looks. A
cell of a variable of classes has its two commonest classes and their shares; of other variables the mean of
the numbers in it, of the grazing margin the smallest.
"""

import threading
import zlib
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from separatrix.cores import cores
from separatrix.view.files import ResultFile
from separatrix.words import decode_word

__all__ = ["TILE", "Plane"]

TILE = 256
_BLOCK_LEVEL = 8  # a block is one tile of points, one cell of this level
_MOST_CELLS = 16_000_000  # of the finest level in memory
_FIRST_BLOCKS = 150  # of the first pass
_SMALL = 4_000_000  # points of a plane that is made before its first tile
_MOST_CLASSES = 65534
_COUNTED = 24  # classes distinguished in a block


class Plane:
    """One variable over two axes of a map, the others being fixed."""

    def __init__(self, source: ResultFile, variable: int, across: int, up: int, at: tuple[int, ...]) -> None:
        """Prepare a plane: `across` and `up` are the axes, `at` the index on every axis."""
        self.source, self.across, self.up, self.at = source, across, up, at
        self.described = source.variables[variable]
        self.classes = self.described["classes"]
        self.smallest = self.described["name"] == "grazing_margin"
        self.data = source.dataset(variable)
        self.shape = (source.shape[up], source.shape[across])
        self.words: dict[int, int] | None = {} if self.data.dtype.itemsize == 8 and self.classes else None
        self.top = 0
        while max(self.shape) >> self.top > TILE:
            self.top += 1
        self.first = 1
        while np.prod([-(-n >> self.first) or 1 for n in self.shape], dtype=float) > _MOST_CELLS:
            self.first += 1
        self.done_blocks, self.blocks = 0, int(np.prod([-(-n // TILE) for n in self.shape]))
        self.error: Exception | None = None
        self._levels: dict[int, dict[str, np.ndarray]] = {}
        self._lock, self._seen = threading.Lock(), threading.Event()
        self._thread: threading.Thread | None = None
        self._ended = False

    @property
    def complete(self) -> bool:
        """Whether the coarse levels are finished."""
        return self.done_blocks >= self.blocks

    def close(self) -> None:
        """End the work on coarse levels."""
        self._ended = True
        if self._thread:
            self._thread.join()

    def finish(self) -> None:
        """Wait until the coarse levels are complete."""
        self._begin()
        self._thread.join()

    def tile(self, level: int, row: int, column: int) -> dict[str, np.ndarray]:
        """Return a tile's cells: `first`, and of classes above level 0 `second` and shares of 255."""
        if level < self.first:
            size = TILE << level
            rows = slice(row * size, min((row + 1) * size, self.shape[0]))
            columns = slice(column * size, min((column + 1) * size, self.shape[1]))
            return self._reduce(self.read(rows, columns), level)[level]
        self._begin()
        self._seen.wait()
        if self.error:
            raise self.error
        cells = self._level(level)
        part = (slice(row * TILE, (row + 1) * TILE), slice(column * TILE, (column + 1) * TILE))
        return {name: array[part] for name, array in cells.items()}

    def tiles(self, level: int) -> tuple[int, int]:
        """Return rows and columns of tiles at a level."""
        return tuple(-(-n // (TILE << level)) for n in self.shape)

    def read(self, rows: slice, columns: slice) -> np.ndarray:
        """Return values of the plane, class numbers where it has classes."""
        values = self._chunk(rows, columns)
        if values is None:
            index = list(self.at)
            index[self.up], index[self.across] = rows, columns
            values = self.data[tuple(index)]
        if self.across < self.up:
            values = values.T
        if self.words is not None:
            return self._numbers(values)
        if self.classes:
            return np.clip(values, 0, _MOST_CLASSES).astype(np.int32, copy=False)
        return values.astype(np.float32, copy=False)

    def _chunk(self, rows: slice, columns: slice) -> np.ndarray | None:
        """Return values that are one chunk of the file, unpacked so that several threads can; else None."""
        data, origin = self.data, (rows.start, columns.start)
        if self.across < self.up:
            origin = origin[::-1]
        whole = rows.stop - rows.start == columns.stop - columns.start == TILE
        whole = whole and rows.start % TILE == columns.start % TILE == 0 and data.chunks == (TILE, TILE)
        if not whole or data.compression != "gzip" or data.fletcher32:
            return None
        mask, packed = data.id.read_direct_chunk(origin)
        try:
            if mask:
                return None
            values = zlib.decompress(packed)
            if data.shuffle:
                values = np.frombuffer(values, np.uint8).reshape(data.dtype.itemsize, -1).T.tobytes()
            return np.frombuffer(values, data.dtype).reshape(TILE, TILE)
        except zlib.error as error:
            raise OSError(f"a chunk is damaged: {error}") from error

    def class_names(self) -> dict[int, str]:
        """Return the names of classes that are not plain numbers."""
        if self.words is not None:
            return {number: decode_word(word) or "none" for word, number in list(self.words.items())}
        return {int(code): name for code, name in self.described["codes"].items()}

    def _numbers(self, values: np.ndarray) -> np.ndarray:
        """Return event words as numbers, in the order in which they are met."""
        words, where = np.unique(values, return_inverse=True)
        with self._lock:
            for word in words.tolist():
                if word not in self.words and len(self.words) < _MOST_CLASSES:
                    self.words[word] = len(self.words)
            numbers = np.array([self.words.get(word, _MOST_CLASSES) for word in words.tolist()], np.int32)
        return numbers[where.reshape(values.shape)]

    def _begin(self) -> None:
        with self._lock:
            if self._thread:
                return
            for level in range(self.first, _BLOCK_LEVEL + 1):
                shape = [-(-n // (1 << level)) for n in self.shape]
                self._levels[level] = _empty(self.classes, shape)
            self._thread = threading.Thread(target=self._build, daemon=True)
            self._thread.start()
        if self.shape[0] * self.shape[1] <= _SMALL:
            self._thread.join()

    def _build(self) -> None:
        """Fill the levels block by block: every 2^k-th block first, standing for its neighbours too."""
        counts = [-(-n // TILE) for n in self.shape]
        stride = 1
        while self.blocks / stride**2 > _FIRST_BLOCKS:
            stride *= 2
        before = 0
        try:
            with ThreadPoolExecutor(cores()) as pool:
                while stride and not self._ended:
                    blocks = [
                        (i, j, stride)
                        for i in range(0, counts[0], stride)
                        for j in range(0, counts[1], stride)
                        if not (before and i % before == 0 and j % before == 0)
                    ]
                    for _ in pool.map(self._fill, blocks):
                        self.done_blocks += 1
                    self._seen.set()
                    before, stride = stride, stride // 2
        except Exception as error:
            self.error = error
        finally:
            self._seen.set()

    def _fill(self, block: tuple[int, int, int]) -> None:
        """Fill the cells of a block, and until they are known those of its neighbours up to a stride."""
        if self._ended:
            return
        i, j, stride = block
        rows = slice(i * TILE, min((i + 1) * TILE, self.shape[0]))
        columns = slice(j * TILE, min((j + 1) * TILE, self.shape[1]))
        made = self._reduce(self.read(rows, columns), _BLOCK_LEVEL)
        whole = made[_BLOCK_LEVEL]
        for level, cells in self._levels.items():
            n = TILE >> level
            for name, array in cells.items():
                if stride > 1:
                    array[i * n : (i + stride) * n, j * n : (j + stride) * n] = whole[name][0, 0]
                part = made[level][name]
                array[i * n : i * n + part.shape[0], j * n : j * n + part.shape[1]] = part

    def _reduce(self, values: np.ndarray, last: int) -> dict[int, dict[str, np.ndarray]]:
        """Return the cells of levels 0 (or the first in memory) to `last` of a piece of the plane."""
        return self._reduce_classes(values, last) if self.classes else self._reduce_numbers(values, last)

    def _reduce_classes(self, values: np.ndarray, last: int) -> dict[int, dict[str, np.ndarray]]:
        if last == 0:
            return {0: {"first": values.astype(np.uint16)}}
        made = {}
        begin = min(self.first, last)
        lowest = int(values.min())
        if lowest == values.max():
            for level in range(begin, last + 1):
                shape = [-(-n // (1 << level)) for n in values.shape]
                made[level] = _empty(True, shape)
                made[level]["first"][:] = lowest
                made[level]["share"][:] = 255
            return made
        sizes = np.bincount(values.ravel("K") - lowest)
        found = np.argsort(-sizes, kind="stable")[: min(_COUNTED, np.count_nonzero(sizes))] + lowest
        total = _sizes(values.shape, begin)
        if len(found) == 2:
            one = _sums(values == found[0], begin)
            counts = np.stack([one, total - one])
        else:
            counts = np.stack([_sums(values == one, begin) for one in found])
        for level in range(begin, last + 1):
            if level > begin:
                counts, total = _halved(counts), _halved(total)
            made[level] = _commonest(found, counts, total)
        return made

    def _reduce_numbers(self, values: np.ndarray, last: int) -> dict[int, dict[str, np.ndarray]]:
        if last == 0:
            return {0: {"first": values}}
        made = {}
        begin = min(self.first, last)
        if self.smallest:
            cells = _minima(np.where(np.isnan(values), np.inf, values), begin)
            for level in range(begin, last + 1):
                cells = _minima(cells, 1) if level > begin else cells
                made[level] = {"first": cells}
            return made
        finite = np.isfinite(values)
        sums, counts = _sums(np.where(finite, values, 0), begin), _sums(finite, begin)
        for level in range(begin, last + 1):
            if level > begin:
                sums, counts = _halved(sums), _halved(counts)
            with np.errstate(invalid="ignore", divide="ignore"):
                made[level] = {"first": (sums / counts).astype(np.float32)}
        return made

    def _level(self, level: int) -> dict[str, np.ndarray]:
        """Return a level; those above the blocks are few cells and made anew from the blocks."""
        if level <= _BLOCK_LEVEL:
            return self._levels[level]
        below = self._level(level - 1)
        if not self.classes:
            cells = below["first"]
            if self.smallest:
                return {"first": _minima(cells, 1)}
            finite = np.isfinite(cells)
            with np.errstate(invalid="ignore", divide="ignore"):
                return {"first": (_sums(np.where(finite, cells, 0), 1) / _sums(finite, 1)).astype(np.float32)}
        found = np.unique([below["first"], below["second"]])[:_COUNTED]
        counts = np.stack(
            [
                _sums(
                    (below["first"] == one) * below["share"].astype(float)
                    + (below["second"] == one) * below["rest"].astype(float),
                    1,
                )
                for one in found
            ]
        )
        return _commonest(found, counts, 255.0 * _sums(np.ones(below["first"].shape, bool), 1))


def _empty(classes: bool, shape: list[int]) -> dict[str, np.ndarray]:
    if not classes:
        return {"first": np.full(shape, np.nan, np.float32)}
    numbers = {name: np.zeros(shape, np.uint16) for name in ("first", "second")}
    return numbers | {name: np.zeros(shape, np.uint8) for name in ("share", "rest")}


def _commonest(found: np.ndarray, counts: np.ndarray, total: np.ndarray) -> dict[str, np.ndarray]:
    """Return the two classes with most points in each cell and their shares of 255."""
    counts = counts.copy()
    first = counts.argmax(0)
    share = np.take_along_axis(counts, first[None], 0)[0]
    np.put_along_axis(counts, first[None], -1, 0)
    second = counts.argmax(0)
    rest = np.maximum(np.take_along_axis(counts, second[None], 0)[0], 0)
    # A class that is there is never shown as nothing.
    parts = [np.where(part > 0, np.maximum(np.rint(255 * part / total), 1), 0) for part in (share, rest)]
    cells = {"first": found[first].astype(np.uint16), "second": found[second].astype(np.uint16)}
    return cells | {"share": parts[0].astype(np.uint8), "rest": parts[1].astype(np.uint8)}


def _sums(values: np.ndarray, level: int) -> np.ndarray:
    """Return sums over cells of 2^level x 2^level; those at the edge are smaller."""
    kind = np.int32 if values.dtype == bool else float
    for axis in (0, 1):
        edges = np.arange(0, values.shape[axis], 1 << level)
        values = np.add.reduceat(values, edges, axis, dtype=kind)
    return values


def _sizes(shape: tuple[int, int], level: int) -> np.ndarray:
    """Return the numbers of points in cells."""
    return np.outer(*(np.minimum(1 << level, n - np.arange(0, n, 1 << level)) for n in shape))


def _halved(values: np.ndarray) -> np.ndarray:
    for axis in (-2, -1):
        edges = np.arange(0, values.shape[axis], 2)
        values = np.add.reduceat(values, edges, axis)
    return values


def _minima(values: np.ndarray, level: int) -> np.ndarray:
    for axis in (0, 1):
        values = np.minimum.reduceat(values, np.arange(0, values.shape[axis], 1 << level), axis)
    return values
