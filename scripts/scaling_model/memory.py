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
"""Of the working file, as docs/file-format.md says."""
WORK_SECONDS = 2.0


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

    sizes: list[Peak]
    """The same tiles, larger maps; the large ones stopped early."""
    tiles: list[Peak]
    """Whole runs with small tiles: more of them."""
    catalogue: list[Peak]
    """More slices, each with attractors of its own."""
    entries: list[int]
    """Attractors in the catalogues of those."""

    @property
    def bytes_per_tile(self) -> float:
        """Growth of a whole run."""
        return slope(self.tiles[0].tiles, self.tiles[-1].tiles, self.tiles)

    @property
    def bytes_per_attractor(self) -> float:
        """Growth with the catalogues."""
        return slope(self.entries[0], self.entries[-1], self.catalogue)


def slope(first: int, last: int, peaks: list[Peak]) -> float:
    """Bytes for each of what grew."""
    return (peaks[-1].bytes - peaks[0].bytes) / (last - first)


def square(program: Program, side: int, tile: int, *words: object) -> Peak:
    """Peak of a square map."""
    size = [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count={side}")]
    value, path = program.peak(RANKS, CASE, *size, "--set", f"grid.tile=[{tile}, {tile}]", *words)
    clear(path)
    how = f"stopped after {WORK_SECONDS:g} s" if words else "whole run"
    return Peak(how, side**2, (side // tile) ** 2, value)


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
    """Sides of maps run as a whole, of maps stopped early, of maps with tiles of 4 x 4, numbers of slices."""
    sizes = [square(program, side, 32) for side in whole]
    free = shutil.disk_usage(program.folder).free
    sizes += [
        square(program, side, 32, "--time-limit", WORK_SECONDS)
        for side in started
        if free > 2 * BYTES_PER_POINT * side**2
    ]
    many = [square(program, side, 4) for side in tiles]
    catalogues = [slices(program, count) for count in counts]
    return Memory(sizes, many, [peak for peak, _ in catalogues], [entries for _, entries in catalogues])
