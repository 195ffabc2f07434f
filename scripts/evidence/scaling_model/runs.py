# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the program and of the bare scheduler on the ranks of this machine."""

import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from evidence_rows import version_of

SOURCE = Path(__file__).resolve().parents[3]
CASE = SOURCE / "examples" / "basin_ratio_stack.toml"
STOPPED = 75
SEARCHES = 3
"""Of the same slices, for their time."""
# A process starts with the peak of the one that forked it, so a small one stands between.
LARGEST_CHILD = """
import resource, subprocess, sys
code = subprocess.call(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
print(code, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
RATIOS = (0.7, 1.5)
X0_COUNT = 48
TILE = 16
"""Side of a tile in x0 and v0; a tile has one frequency ratio."""
POINTS_PER_TILE = TILE**2


@dataclass
class Run:
    """How a run went; arrays over the tiles, in the order of the map."""

    ranks: int
    points: int
    wall: float
    rank: np.ndarray
    begin: np.ndarray
    end: np.ndarray

    @property
    def costs(self) -> np.ndarray:
        """Seconds of each tile."""
        return self.end - self.begin

    @property
    def tile_phase(self) -> float:
        """From the first tile to the end of the last."""
        return float(self.end.max())

    @property
    def around(self) -> float:
        """Seconds before the first tile and after the last: start, search, final file."""
        return self.wall - self.tile_phase

    @property
    def idle(self) -> float:
        """Share of the ranks' time in that phase that is not spent in tiles."""
        return 1 - float(self.costs.sum()) / (self.ranks * self.tile_phase)

    @property
    def tiles(self) -> np.ndarray:
        """Tiles of each rank."""
        return np.bincount(self.rank, minlength=self.ranks)


@dataclass
class Replay:
    """What the bare scheduler did; arrays over the ranks."""

    tiles: np.ndarray
    questions: np.ndarray
    makespan: float
    idle: float


@dataclass
class Search:
    """The search for attractors in the slices of a map; seconds of the processor of one rank."""

    whole: float
    """Of all slices."""
    longest: float
    """Of the slice that takes longest."""
    slices: int
    starts: int
    """Of a slice."""

    def per_rank(self, points: float) -> float:
        """Slices of each rank of a map with so many points for each, and slices like these."""
        return points / self.starts

    def seconds(self, points: float) -> float:
        """At most what the search of that map takes.

        A rank that begins the longest slice last has searched its share before: R. L. Graham (1966).
        """
        return self.per_rank(points) * self.whole / self.slices + self.longest


class Program:
    """The build that is measured."""

    def __init__(self, build: Path, folder: Path) -> None:
        self.program, self.folder = build / "bin" / "separatrix", folder
        self.replayer = build / "bin" / "tests" / "scheduler_replay"
        self.version = version_of(self.program)

    def command(self, ranks: int, name: str, case: Path, *words: object) -> tuple[list[str], Path]:
        """Return the command of a basin map under mpirun, and its file."""
        path = self.folder / f"{name}.h5"
        # two programs of one rank would both be bound to the first core
        start = ["mpirun", "--bind-to", "none", "-n", ranks]
        command = [*start, self.program, "basin", case, "-o", path, "--force", "-q", *words]
        return [str(word) for word in command], path

    def start(self, ranks: int, name: str, case: Path, *words: object) -> subprocess.Popen:
        """Start a basin map under mpirun."""
        quiet = subprocess.DEVNULL
        return subprocess.Popen(self.command(ranks, name, case, *words)[0], stdout=quiet, stderr=quiet)

    def uneven(self, ranks: int, ratios: int, v0_count: int, *words: object) -> Run:
        """Run the map of very uneven cost with a table of its tiles."""
        table = self.folder / "tiles.csv"
        began = time.perf_counter()
        process = self.start(
            ranks, "uneven", CASE, *uneven_map(ratios, v0_count), "--tile-times", table, *words
        )
        if process.wait() != 0:
            raise RuntimeError(f"the map ended with code {process.returncode}")
        wall = time.perf_counter() - began
        rows = np.genfromtxt(table, delimiter=",", names=True)
        rows = rows[np.argsort(rows["tile"])]
        points = ratios * X0_COUNT * v0_count
        return Run(ranks, points, wall, rows["rank"].astype(int), rows["begin"], rows["end"])

    def search(self, ratios: int, v0_count: int) -> Search:
        """Search the attractors of all slices of that map, and of each slice alone."""
        values = np.linspace(*RATIOS, ratios).tolist()
        alone = [self.processor_seconds([value], v0_count) for value in values]
        whole = self.processor_seconds(values, v0_count)
        # the start of the program is in each
        return Search(whole - min(alone), max(alone) - min(alone), ratios, X0_COUNT * v0_count)

    def processor_seconds(self, ratios: list[float], v0_count: int) -> float:
        """Seconds of the processor of a rank that searches the attractors at these ratios; least of some."""
        path = self.folder / "search.h5"
        words = ["-o", path, "--force", "-q", "--search-only", "--shard", "1/1"]
        command = [str(word) for word in (self.program, "basin", CASE, *uneven_map(ratios, v0_count), *words)]
        found = []
        for _ in range(SEARCHES):
            _, status, used = os.wait4(os.posix_spawn(self.program, command, os.environ), 0)
            if status != 0:
                raise RuntimeError(f"the search ended with status {status}")
            found.append(used.ru_utime + used.ru_stime)
        return min(found)

    def copies(self, count: int, ratios: int, v0_count: int) -> float:
        """Seconds that so many maps take, each on one rank, all at once."""
        began = time.perf_counter()
        words = uneven_map(ratios, v0_count)
        processes = [self.start(1, f"copy_{number}", CASE, *words) for number in range(count)]
        for process in processes:
            if process.wait() != 0:
                raise RuntimeError(f"a copy ended with code {process.returncode}")
        return time.perf_counter() - began

    def peak(self, ranks: int, case: Path, *words: object) -> tuple[int, Path]:
        """Bytes of the largest process of a map, which may stop early, and its file."""
        command, path = self.command(ranks, "memory", case, *words)
        counted = [sys.executable, "-S", "-c", LARGEST_CHILD, *command]
        code, kilobytes = subprocess.run(counted, capture_output=True, text=True, check=True).stdout.split()
        if int(code) not in (0, STOPPED):
            raise RuntimeError(f"the map ended with code {code}")
        return int(kilobytes) * 1024, path

    def replay(self, ranks: int, per_node: int, costs: np.ndarray, polls: int) -> Replay:
        """Let the bare scheduler hand out tiles of these costs to ranks that sleep instead of computing."""
        listed = self.folder / "costs.txt"
        np.savetxt(listed, costs)
        command = ["mpirun", "-n", str(ranks), self.replayer, listed, str(per_node), str(polls)]
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        rows = np.genfromtxt(text.splitlines(), delimiter=",", names=True)
        makespan = float(rows["finish"].max())
        idle = 1 - float(rows["busy"].sum()) / (ranks * makespan)
        return Replay(rows["tiles"].astype(int), rows["questions"].astype(int), makespan, idle)


def uneven_map(ratios: int | list[float], v0_count: int) -> list[str]:
    """Return the settings of the map of very uneven cost: around ratio 0.93 the motion is chaotic.

    `ratios`: their number, or some values.
    """
    chosen = f"from={RATIOS[0]}, to={RATIOS[1]}, count={ratios}"
    if isinstance(ratios, list):
        chosen = f"values={ratios}"
    axes = (
        f'{{name="ratio", {chosen}}}, '
        f'{{name="x0", from=0.0, to=1.1, count={X0_COUNT}}}, '
        f'{{name="v0", from=-6.0, to=6.0, count={v0_count}}}'
    )
    return ["--set", f"axis=[{axes}]", "--set", f"grid.tile=[1, {TILE}, {TILE}]"]
