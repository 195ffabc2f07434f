# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the final file takes after the last tile, here and on more ranks."""

from __future__ import annotations

import math
import re
import statistics
import subprocess
from dataclasses import dataclass
from typing import TYPE_CHECKING

from runs import SOURCE

if TYPE_CHECKING:
    from runs import Program

CASE = SOURCE / "docs" / "record" / "basin_1e8.toml"
"""Cheap trajectories, each computed: the file is a large part of the run."""
RANKS = 2
SLAB = 2**18
"""Points of a slab (src/io/slabs.f90)."""
UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}


@dataclass
class Finish:
    """One run; seconds."""

    points: int
    whole: float
    """From the start to the final file."""
    packed: float
    """From the last tile to it."""
    alone: float
    """Of that, in which rank 0 worked and the others waited."""

    @property
    def share(self) -> float:
        """Of the whole run."""
        return self.packed / self.whole


@dataclass
class Packing:
    """The runs, a list for each size of map, smallest first."""

    runs: list[list[Finish]]

    def middle(self, size: int, name: str) -> float:
        """Median of an attribute over the runs of a size."""
        return statistics.median(getattr(run, name) for run in self.runs[size])

    def least(self, size: int, name: str) -> float:
        """Least of an attribute over the runs of a size.

        Waits for a disk that others use do not grow with the map.
        """
        return min(getattr(run, name) for run in self.runs[size])

    @property
    def fixed(self) -> float:
        """Seconds of rank 0 alone that do not grow with the map."""
        return max(self.middle(0, "alone") - self.alone_per_point * self.runs[0][0].points, 0.0)

    @property
    def alone_per_point(self) -> float:
        """Seconds of rank 0 alone for each point of the map."""
        more = self.runs[-1][0].points - self.runs[0][0].points
        return max((self.least(-1, "alone") - self.least(0, "alone")) / more, 0.0)

    @property
    def shared_per_point(self) -> float:
        """Seconds of a rank for each point that it packs."""
        points = self.runs[-1][0].points
        return RANKS * (self.middle(-1, "packed") - self.middle(-1, "alone")) / points

    @property
    def constants(self) -> Constants:
        """What other maps need."""
        return Constants(self.fixed, self.alone_per_point, self.shared_per_point)


@dataclass
class Constants:
    """Seconds of rank 0 alone, of it for each point of a map, and of a rank for each point that it packs."""

    fixed: float
    alone: float
    shared: float

    def seconds(self, points: float, ranks: int) -> float:
        """What so many ranks would take for such a map: whole slabs, in rounds of one for each rank."""
        slabs = math.ceil(points / SLAB)
        packed = min(points / slabs, SLAB) * math.ceil(slabs / ranks)
        return self.fixed + points * self.alone + packed * self.shared


def seconds_of(words: str) -> float:
    """Seconds of a duration as the program prints it."""
    return sum(float(number) * UNITS[unit] for number, unit in re.findall(r"([\d.]+) (s|min|h)", words))


def read(text: str, points: int) -> Finish:
    """Take the durations from what a run has printed."""
    packed = re.search(r"^checked and packed in (.*), (.*) of it by rank 0 alone$", text, re.MULTILINE)
    whole = re.search(r"^wrote .* in ([^/]*)$", text, re.MULTILINE)
    if packed is None or whole is None:
        raise RuntimeError(f"the map did not report its durations: {text}")
    return Finish(points, seconds_of(whole[1]), seconds_of(packed[1]), seconds_of(packed[2]))


def time_files(program: Program, sides: tuple[int, ...], repetitions: int) -> Packing:
    """Run square maps of these sides, in turn."""
    runs: list[list[Finish]] = [[] for _ in sides]
    for _ in range(repetitions):
        for found, side in zip(runs, sides, strict=True):
            counts = ("--set", f"axis[1].count={side}", "--set", f"axis[2].count={side}")
            command, path = program.command(RANKS, "packing", CASE, *counts)
            command.remove("-q")
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            found.append(read(done.stdout, side**2))
            path.unlink()
    return Packing(runs)
