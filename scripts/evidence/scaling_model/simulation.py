# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Predictions of the model for more ranks than this machine has."""

from dataclasses import dataclass

import numpy as np
from costs import tiles_for
from model import Model, Outcome, setting
from packing import Constants
from runs import Search
from storage import Storage, job_of, times

RANKS_PER_NODE = 128
SPREADS = (1, 10, 100, 1000)
RANKS = (16, 128, 1000, 10_000, 100_000)
TILES_PER_RANK = (3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 200)
MANY_RANKS = 10_000
BAR_SPREAD = 100
USUAL = 100
"""Tiles per rank by default."""
CANDIDATES = (200, 150, 100, 80, 70, 60, 50, 45, 40, 35, 30, 25, 20, 15, 10, 5)
TRAJECTORIES_PER_TILE = 1024
TILE_SECONDS = (0.01, 0.1, 1.0, 10.0)
LOOKS = (1024, 16, 1)
SLOW = 50e-6
CALL = 1e-3
"""Seconds of a call that writes: a message and a lock of the file system; an assumption."""
STORES = {"100 GB/s": 1e11, "1 TB/s": 1e12}
"""Bytes per second that a file system takes from all ranks; assumptions."""
JOB_RANKS = {1000: 0.9, 10_000: 0.9, 100_000: 0.8}
"""Ranks of whole jobs, and the efficiency that they have to reach."""
JOB_TILE_SECONDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
RECORD_BYTES = 48 * TRAJECTORIES_PER_TILE + 16
"""A tile in the working file of the case of the packing runs."""


CHUNKS_PER_SLAB = 52
"""Of the case of the packing runs: 13 variables, 4 chunks of each."""
STATED = 2.0
"""Seconds of a tile of the job whose parts are shown."""


@dataclass
class Simulated:
    """Efficiencies."""

    mean: float
    """Seconds of a tile, mean."""
    by_ranks: dict[int, list[float]]
    """spread: for each of RANKS"""
    neighbours: list[float]
    """With blocks of neighbouring tiles, spread BAR_SPREAD, for each of RANKS."""
    with_store: dict[str, list[float]]
    """With the writing of tiles at each of STORES, spread BAR_SPREAD, for each of RANKS."""
    with_file: list[float]
    """With writing at the last of STORES and the final file, spread BAR_SPREAD, for each of RANKS."""
    writes: int
    """Calls that write tiles on MANY_RANKS."""
    by_tiles: dict[int, list[float]]
    """spread: for each of TILES_PER_RANK on MANY_RANKS"""
    by_looks: dict[int, list[float]]
    """looks of rank 0 per tile: for each of TILE_SECONDS on MANY_RANKS"""
    slow: float
    """With SLOW messages and answers."""
    questions: int
    longest_queue: int
    least_tiles: int | None
    """Tiles per rank from which on the bar holds."""
    jobs: dict[int, list[float]]
    """ranks: efficiency of whole jobs for the mean and each of JOB_TILE_SECONDS"""
    before: "Before"
    """What is before the first tile of a whole job."""
    parts: dict[int, "Parts"]
    """ranks: of the job with tiles of STATED seconds"""
    storage: Storage


@dataclass
class Parts:
    """Seconds of a whole job without its start and search, and what it asks of its working file."""

    busy: float
    """Of a rank in tiles, mean; the next two as well."""
    writing: float
    idle: float
    seconds: dict[str, float]
    """Of the parts before and after the tiles."""
    writes_per_second: float
    """Of all ranks, into the working file."""

    @property
    def total(self) -> float:
        """Of all parts."""
        return self.busy + self.writing + self.idle + sum(self.seconds.values())


@dataclass
class Before:
    """What a job does before its first tile; seconds."""

    start: float
    search: Search
    commit: str
    """Of the search."""
    ranks_points: float = USUAL * TRAJECTORIES_PER_TILE
    """Points of a rank."""

    @property
    def seconds(self) -> float:
        """Of a job of any number of ranks."""
        return self.start + self.search.seconds(self.ranks_points)


def jobs_after(jobs: dict[int, list[float]], mean: float, old: float, new: float) -> dict[int, list[float]]:
    """Efficiencies of whole jobs whose first tile begins after `new` instead of `old` seconds.

    `jobs`: for the mean and each of JOB_TILE_SECONDS.
    """
    work = [USUAL * value for value in (mean, *JOB_TILE_SECONDS)]
    return {
        ranks: [busy / (busy / found - old + new) for busy, found in zip(work, line, strict=True)]
        for ranks, line in jobs.items()
    }


class Simulation:
    """The model with the measured costs."""

    def __init__(
        self, model: Model, costs: np.ndarray, mean: float, packing: Constants, storage: Storage
    ) -> None:
        self.model, self.costs, self.mean, self.packing = model, costs, mean, packing
        self.storage = storage

    def efficiency(self, ranks: int, per_rank: int, spread: float, *, mean: float = 0, **more) -> float:
        """Efficiency of a map with so many tiles per rank."""
        machine, tiles = self.problem(ranks, per_rank, spread, mean or self.mean, **more)
        return self.model.run(machine, tiles).efficiency

    def stored(self, ranks: int, rate: float) -> Outcome:
        """Run a map of the usual size and the bar's spread whose ranks share a rate of writing."""
        slow = {"write": CALL, "write_tile": RECORD_BYTES * ranks / rate}
        return self.model.run(*self.problem(ranks, USUAL, BAR_SPREAD, self.mean, **slow))

    def with_file(self, ranks: int, rate: float) -> float:
        """Efficiency with writing and the final file, for which the tiles are read back at the same rate."""
        found = self.stored(ranks, rate)
        finish = self.packing.seconds(ranks * USUAL * TRAJECTORIES_PER_TILE, ranks)
        finish += ranks * USUAL * RECORD_BYTES / rate
        return float(found.busy.sum() / (ranks * (found.makespan + finish)))

    def parts(self, ranks: int, mean: float) -> Parts:
        """Return what a whole job takes after its search, with all calls on its files."""
        storage = self.storage
        one = RECORD_BYTES * storage.stripes / storage.bytes_per_second
        stripes = {"lock": storage.lock, "write_tile": one, "stripes": int(storage.stripes)}
        found = self.model.run(*self.problem(ranks, USUAL, BAR_SPREAD, mean, **stripes))
        points = ranks * USUAL * TRAJECTORIES_PER_TILE
        job = job_of(ranks, ranks * USUAL, points, CHUNKS_PER_SLAB, RANKS_PER_NODE)
        waits = times(job, storage, RECORD_BYTES)
        busy, writing = float(found.busy.mean()), float(found.writing.mean())
        seconds = {
            "working file: created, opened by all ranks": waits.begin,
            "final file: tiles read": waits.tiles_read,
            "final file: compressed, offsets taken by rank 0": self.packing.seconds(points, ranks),
            "final file: chunks reserved by rank 0": waits.reserved,
            "final file: chunks written": waits.chunks_written,
            "final file: synchronised": waits.synced,
            "final file: read back": waits.read_back,
            "final file: small objects, names": waits.end,
        }
        idle = found.makespan - busy - writing
        return Parts(busy, writing, idle, seconds, found.writes / found.makespan)

    def whole_jobs(self, before: float) -> dict[int, list[float]]:
        """Efficiency of whole jobs: for each number of ranks the measured mean, then JOB_TILE_SECONDS.

        `before`: seconds before the first tile.
        """
        found = {}
        for ranks in JOB_RANKS:
            parts = [self.parts(ranks, mean) for mean in (self.mean, *JOB_TILE_SECONDS)]
            found[ranks] = [one.busy / (before + one.total) for one in parts]
        return found

    def stated_jobs(self) -> dict[int, Parts]:
        """Return the parts of the jobs with tiles of STATED seconds."""
        return {ranks: self.parts(ranks, STATED) for ranks in JOB_RANKS}

    def problem(self, ranks: int, per_rank: int, spread: float, mean: float, **more):
        """Return the machine and the tiles."""
        machine = setting(ranks, RANKS_PER_NODE, **({"polls_per_tile": TRAJECTORIES_PER_TILE} | more))
        return machine, tiles_for(self.costs, ranks * per_rank, spread, mean)

    def least_tiles(self, bar: float) -> int | None:
        """Return the fewest of CANDIDATES from which on the bar holds."""
        found = None
        for per_rank in CANDIDATES:
            if self.efficiency(MANY_RANKS, per_rank, BAR_SPREAD) < bar:
                break
            found = per_rank
        return found

    def everything(self, bar: float, before: Before) -> Simulated:
        """All that the page shows; `before`: what a whole job does before its first tile."""
        machine, tiles = self.problem(MANY_RANKS, USUAL, BAR_SPREAD, self.mean)
        many = self.model.run(machine, tiles)
        neighbours = [
            self.model.run(*self.problem(ranks, USUAL, BAR_SPREAD, self.mean), spread=False).efficiency
            for ranks in RANKS
        ]
        return Simulated(
            mean=self.mean,
            by_ranks={s: [self.efficiency(ranks, USUAL, s) for ranks in RANKS] for s in SPREADS},
            neighbours=neighbours,
            with_store={
                name: [self.stored(ranks, rate).efficiency for ranks in RANKS]
                for name, rate in STORES.items()
            },
            with_file=[self.with_file(ranks, max(STORES.values())) for ranks in RANKS],
            writes=self.stored(MANY_RANKS, max(STORES.values())).writes,
            by_tiles={s: [self.efficiency(MANY_RANKS, n, s) for n in TILES_PER_RANK] for s in SPREADS},
            by_looks={
                looks: [
                    self.efficiency(MANY_RANKS, USUAL, BAR_SPREAD, mean=seconds, polls_per_tile=looks)
                    for seconds in TILE_SECONDS
                ]
                for looks in LOOKS
            },
            slow=self.efficiency(MANY_RANKS, USUAL, BAR_SPREAD, latency=SLOW, service=SLOW),
            questions=int(many.questions.sum()),
            longest_queue=many.longest_queue,
            least_tiles=self.least_tiles(bar),
            jobs=self.whole_jobs(before.seconds),
            before=before,
            parts=self.stated_jobs(),
            storage=self.storage,
        )
