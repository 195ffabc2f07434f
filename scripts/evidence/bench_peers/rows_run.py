# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times the machines of `rows.py` beside the peers and checks each."""

from __future__ import annotations

import datetime
import json
import re
import subprocess
import time
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

import h5py
import numpy as np
from accuracy import Accuracy, compare
from compiled import Compiled, build
from ours import FULL, ONE_BY_ONE, Program, Timing, read_points
from python_peers import Heyoka
from reference_run import run_on_all_cores

from machine import HUNT_CROSSLEY, TOLERANCE, Outcomes, machine_of, read_case, start_points

if TYPE_CHECKING:
    from pathlib import Path

    from rows import Checks, Row

BATCH = 8
SAMPLES = 10
"""Parts of what quadruple precision reruns of a map."""
VERIFIED = (
    r"(\d+) label flips, (\d+) other impact counts, largest deviation after the duration (\S+) m, (\S+) m/s"
)
PEERS = {"heyoka_batch": 400, "heyoka": 200, "gsl": 300, "cvode": 30}
"""Starts of the peers in a round."""


@dataclass
class RowResult:
    """What a machine's row shows."""

    key: str
    commit: str
    date: str
    rates: dict[str, list[float]] = field(default_factory=dict)
    """Trajectories per second of processor time, per round: ours "full" and "stopped", and the peers'."""
    agreements: dict[str, Accuracy] = field(default_factory=dict)
    """Of us and of every peer with quadruple precision, and of our lanes with single flights ("single")."""
    flips: tuple[int, int] = (0, 0)
    """Labels of settle-and-stop that differ from full runs, and points compared."""


class RowBench:
    """One machine: everybody who runs it."""

    def __init__(self, row: Row, program: Program, build_folder: Path, quick: bool) -> None:
        self.row, self.program, self.quick = row, program, quick
        self.case = row.write(program.folder)
        self.reference = build_folder / "lib" / "libseparatrix_reference.so"
        self.peers = self.drivers(build_folder / "bench_peers") if row.has_peers else {}
        today = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d")
        self.result = RowResult(row.key, program.version["commit"], today)
        self.result.rates = {name: [] for name in ("full", "stopped", *self.peers)}
        self.starts = start_points(max(PEERS.values()))

    def drivers(self, folder: Path) -> dict:
        """The peers, warmed up."""
        machine = machine_of(read_case(self.case))
        drivers = {name: Compiled(build(name, folder), machine, TOLERANCE) for name in ("gsl", "cvode")}
        if machine.barrier_law != HUNT_CROSSLEY:
            drivers["heyoka_batch"] = Heyoka(machine, TOLERANCE, BATCH)
            drivers["heyoka"] = Heyoka(machine, TOLERANCE, 0)
            for name in ("heyoka_batch", "heyoka"):
                drivers[name].run(start_points(BATCH))
        return drivers

    def round(self) -> None:
        """Everybody once."""
        rates = self.result.rates
        rates["full"].append(self.map_rate(*FULL))
        rates["stopped"].append(self.map_rate())
        for name, driver in self.peers.items():
            starts = self.starts[: self.count(name)]
            began = time.process_time()
            driver.run(starts)
            rates[name].append(len(starts) / (time.process_time() - began))

    def count(self, peer: str) -> int:
        """Starts of a peer in a round."""
        return PEERS[peer] // 4 // BATCH * BATCH or BATCH if self.quick else PEERS[peer]

    def map_rate(self, *words: str) -> float:
        """A fine map without a coarse one, so that the search for attractors cancels."""
        short, long = (self.basin(size, *words)[0] for size in self.row.fast)
        return (long - short).points / (long - short).cpu

    def basin(self, size: int, *words: str) -> tuple[Timing, Path]:
        """A map of size x size starts."""
        path = self.program.folder / f"row_{self.row.key}_{len(words)}.h5"
        sizes = [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count={size}")]
        return self.program.timed(size**2, "basin", self.case, "-o", path, *sizes, *words), path

    def points(self, starts: np.ndarray, *words: str) -> Outcomes:
        """Our full runs of a list of starts."""
        listed, path = (self.program.folder / f"row_points.{end}" for end in ("csv", "h5"))
        listed.write_text("x0,v0\n" + "".join(f"{x0!r},{v0!r}\n" for x0, v0 in starts.tolist()))
        self.program.timed(len(starts), "points", self.case, "--list", listed, "-o", path, *FULL, *words)
        return read_points(path)

    def verified(self, sizes: Checks) -> Accuracy:
        """Samples of a map of full runs in quadruple precision, by `separatrix verify`."""
        path = self.basin(sizes.side, *FULL)[1]
        found = [self.verify(path, max(1, sizes.quadruple // SAMPLES), seed + 1) for seed in range(SAMPLES)]
        deviations = [sample.deviation for sample in found]
        points, counts, labels = (
            sum(getattr(sample, name) for sample in found) for name in ("points", "counts", "labels")
        )
        return Accuracy(points, max(deviations), counts, labels, float(np.median(deviations)))

    def verify(self, path: Path, size: int, seed: int) -> Accuracy:
        """One sample."""
        command = [self.program.program, "verify", path, "--sample", str(size), "--seed", str(seed)]
        output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        flips, counts, x, v = re.search(VERIFIED, output).groups()
        with h5py.File(path) as file:
            far = max(float(np.nanmax(np.abs(file[name][()]))) for name in ("x_max", "x_min"))
            fast = float(np.nanmax(file["v_max"][()]))
        deviation = max(float(x) / far, float(v) / fast)
        return Accuracy(size, deviation, int(counts), int(flips))

    def assess(self) -> None:
        """Quadruple precision, single flights, labels of settle-and-stop."""
        sizes, found = self.row.checks(self.quick), self.result.agreements
        if self.row.bodies:
            found["ours"] = self.verified(sizes)
        elif sizes.quadruple:
            starts = start_points(sizes.quadruple)
            truth = run_on_all_cores(self.reference, self.program.program, starts, self.case, sizes.share)
            found["ours"] = compare(self.points(starts), truth)
            for name, driver in self.peers.items():
                size = max(BATCH, min(len(starts), self.count(name)) // BATCH * BATCH)
                found[name] = compare(driver.run(start_points(size)), truth)
        starts = self.row.starts(sizes.single)
        found["single"] = compare(self.points(starts), self.points(starts, *ONE_BY_ONE))
        with (
            h5py.File(self.basin(sizes.side)[1]) as one,
            h5py.File(self.basin(sizes.side, *FULL)[1]) as other,
        ):
            differing = int(np.sum(one["attractor"][()] != other["attractor"][()]))
        self.result.flips = (differing, sizes.side**2)


def measure(row: Row, program: Program, build_folder: Path, rounds: int, quick: bool) -> RowResult:
    """A row."""
    print(f"bench: {row.title}", flush=True)
    bench = RowBench(row, program, build_folder, quick)
    for _ in range(rounds):
        bench.round()
    bench.assess()
    return bench.result


def keep(path: Path, results: list[RowResult]) -> list[RowResult]:
    """Put results into a file of results, in place of those of the same machines; returns all in it."""
    kept = {result.key: result for result in [*load(path), *results]}
    path.write_text(json.dumps([asdict(result) for result in kept.values()], indent=1) + "\n")
    return list(kept.values())


def load(path: Path) -> list[RowResult]:
    """The results in a file, none if there is no file."""
    found = [RowResult(**given) for given in json.loads(path.read_text())] if path.is_file() else []
    for result in found:
        result.agreements = {name: Accuracy(**given) for name, given in result.agreements.items()}
    return found
