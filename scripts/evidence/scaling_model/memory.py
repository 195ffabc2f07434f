# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Peak resident memory of a rank against the size of the map."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import h5py
from runs import SOURCE, Program

CASE = SOURCE / "examples" / "basin_coulomb.toml"
RANKS = 2
BYTES_PER_POINT = 46
"""Of the working file, see docs/file-format.md."""
WORK_SECONDS = 2.0
USUAL_TILE = 32
COLUMNS = 4096
"""From this length of a row on, the final file is packed by slabs of 2^20 values (src/io/slabs.f90)."""


@dataclass
class Peak:
    """A map and its largest process."""

    what: str
    points: int
    tiles: int
    bytes: int


@dataclass
class Memory:
    """Everything about memory."""

    whole: list[Peak]
    """Whole runs with the usual tiles."""
    started: list[Peak]
    """Larger maps, stopped early."""
    tiles: list[Peak]
    """One map, stopped early, with smaller and smaller tiles."""
    catalogue: list[Peak]
    """More slices, each with attractors of its own."""
    entries: list[int]
    """Attractors in the catalogues of those."""

    @property
    def growth(self) -> float:
        """Largest over smallest peak, of whole runs and of stopped ones."""
        groups = (self.whole, self.started)
        return max(max(p.bytes for p in peaks) / min(p.bytes for p in peaks) for peaks in groups)

    @property
    def bytes_per_tile(self) -> float:
        """Growth with the number of tiles."""
        return slope(self.tiles[0].tiles, self.tiles[-1].tiles, self.tiles)

    @property
    def bytes_per_attractor(self) -> float:
        """Growth with the catalogues."""
        return slope(self.entries[0], self.entries[-1], self.catalogue)


def slope(first: int, last: int, peaks: list[Peak]) -> float:
    """Bytes for each of what grew."""
    return (peaks[-1].bytes - peaks[0].bytes) / (last - first)


def plane(program: Program, rows: int, columns: int, tile: int, *words: object) -> Peak:
    """Peak of a map of rows x columns."""
    axes = ("--set", f"axis[1].count={rows}", "--set", f"axis[2].count={columns}")
    value, path = program.peak(RANKS, CASE, *axes, "--set", f"grid.tile=[{tile}, {tile}]", *words)
    clear(path)
    how = f"stopped after {WORK_SECONDS:g} s" if words else "whole run"
    return Peak(f"{rows} x {columns}, {how}", rows * columns, rows * columns // tile**2, value)


def slices(program: Program, count: int) -> tuple[Peak, int]:
    """Peak of a map with many slices, and the attractors of all."""
    axes = (
        f'axis=[{{name="ratio", from=1.1, to=1.3, count={count}}}, '
        '{name="x0", from=0.0, to=1.1, count=2}, {name="v0", from=-6.0, to=6.0, count=2}]'
    )
    value, path = program.peak(RANKS, CASE, "--set", axes, "--set", "attractors.sample=8")
    with h5py.File(path) as file:
        entries = len(file["catalogue/attractor"])
    clear(path)
    return Peak(f"{count} slices", 4 * count, count, value), entries


def clear(path: Path) -> None:
    """Remove what a run left."""
    path.unlink(missing_ok=True)
    path.with_name(f"{path.name}.part").unlink(missing_ok=True)


def measure(program: Program, whole: tuple, started: tuple, tiles: tuple, counts: tuple) -> Memory:
    """Rows of maps run as a whole, sides of maps stopped early, sides of tiles, numbers of slices."""
    free = shutil.disk_usage(program.folder).free
    stop = ("--time-limit", WORK_SECONDS)
    large = [side for side in started if free > 2 * BYTES_PER_POINT * side**2]
    catalogues = [slices(program, count) for count in counts]
    return Memory(
        [plane(program, rows, COLUMNS, USUAL_TILE) for rows in whole],
        [plane(program, side, side, USUAL_TILE, *stop) for side in large],
        [plane(program, started[0], started[0], tile, *stop) for tile in tiles],
        [peak for peak, _ in catalogues],
        [entries for _, entries in catalogues],
    )
