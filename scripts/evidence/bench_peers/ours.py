# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Our program, timed without its start-up: the difference of a long and a short run."""

import resource
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from evidence_rows import version_of
from reference_run import IMPACT_REGIMES

from machine import SOURCE, Outcomes


@dataclass
class Timing:
    """What a number of trajectories took."""

    points: int
    cpu: float
    wall: float

    def __sub__(self, other: "Timing") -> "Timing":
        return Timing(self.points - other.points, self.cpu - other.cpu, self.wall - other.wall)


class Program:
    """Runs separatrix as a user does, on one core."""

    def __init__(self, program: Path, folder: Path) -> None:
        self.program, self.folder = program, folder
        self.version = version_of(program)

    def timed(self, points: int, *words: object) -> Timing:
        """Run it and wait; CPU time is user and system time of the process."""
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([self.program, *map(str, words), "--force", "--quiet"], check=True)
        wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
        return Timing(points, sum(after[:2]) - sum(before[:2]), wall)

    def points(self, law: str, starts: np.ndarray, name: str, *words: str) -> tuple[Timing, Path]:
        """Run starts for the whole duration."""
        listed, path = self.folder / f"{name}.csv", self.folder / f"{name}.h5"
        lines = [f"{x0!r},{v0!r}\n" for x0, v0 in starts.tolist()]
        listed.write_text("x0,v0\n" + "".join(lines))
        case = SOURCE / "examples" / f"basin_{law}.toml"
        return self.timed(len(starts), "points", case, "--list", listed, "-o", path, *words), path

    def basin(self, law: str, count: int, name: str, *words: str) -> tuple[Timing, Path]:
        """A map of count x count starts."""
        path = self.folder / f"{name}.h5"
        size = [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count={count}")]
        case = SOURCE / "examples" / f"basin_{law}.toml"
        return self.timed(count**2, "basin", case, "-o", path, *size, *words), path


FULL = ("--set", 'run.stop="duration"')
ONE_BY_ONE = ("--set", 'integrator.lanes="off"')


class Maps:
    """`separatrix basin`: a fine map minus a coarse one; both search for the attractors first."""

    def __init__(self, program: Program, law: str, sizes: tuple[int, int], *words: str) -> None:
        self.program, self.law, self.sizes, self.words = program, law, sizes, words
        self.path = Path()

    def round(self) -> Timing:
        """Both maps once."""
        name = "_".join(["map", self.law, *(word for word in self.words if word != "--set")]).replace('"', "")
        short, _ = self.program.basin(self.law, self.sizes[0], f"{name}_short", *self.words)
        long, self.path = self.program.basin(self.law, self.sizes[1], name, *self.words)
        return long - short

    def labels(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Starts and labels of points of the last map, given by their number."""
        with h5py.File(self.path) as file:
            regime = file["regime"][()]
            i, j = np.unravel_index(chosen, regime.shape)
            starts = np.column_stack([file["x0"][()][i], file["v0"][()][j]])
        return starts, np.isin(regime[i, j], IMPACT_REGIMES)


def flips(program: Program, count: int) -> tuple[int, int]:
    """Labels of a map that differ when nothing ends at its capture, and points of the map."""
    _, stopped = program.basin("coulomb", count, "stopped_map")
    _, full = program.basin("coulomb", count, "full_map", *FULL)
    with h5py.File(stopped) as one, h5py.File(full) as other:
        return int(np.sum(one["attractor"][()] != other["attractor"][()])), count**2


def read_points(path: Path) -> Outcomes:
    """The file of a list of starts."""
    with h5py.File(path) as file:
        x, v, impacts, regime = (file[name][()] for name in ("x", "v", "impacts", "regime"))
    return Outcomes(x, v, impacts, np.isin(regime, IMPACT_REGIMES))
