# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run asks of a parallel file system, and how long one with published rates takes for it."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from packing import SLAB

METADATA = ("open", "create", "stat", "rename", "unlink", "length", "lock", "sync")
"""Calls that move no data; `length`: those that change the length of a file."""
IO500_BYTES = 47_008
"""Of a record of the hard test of IOR, which many processes write into one file."""
IO500_PROCESSES, IO500_STRIPES = 64, 16


@dataclass(frozen=True)
class Storage:
    """A file system; each rate can be replaced by `--storage NAME=VALUE`."""

    stripes: float = 274
    """Of the file: servers of NERSC's Perlmutter scratch."""
    bytes_per_second: float = 3_427_179.21 * 2**20
    """Of all stripes: its acceptance test with records of 1 MiB."""
    reads_per_second: float = 4e6
    """Of all stripes, at random offsets: NERSC's page on it."""
    opens_per_second: float = 100e3
    """One metadata server opens or creates so many: operations manual of Lustre, table of known usage."""
    stats_per_second: float = 200e3
    """As before."""
    node_bytes_per_second: float = 15e9
    """Of one node: operations manual of Lustre, table of known usage."""
    lock: float = IO500_STRIPES * IO500_BYTES / (0.328757 * 2**30)
    """Seconds for which a write of others into the same stripe waits: IO500 of a Lustre with 16 stripes."""
    read: float = IO500_PROCESSES * IO500_BYTES / (0.902677 * 2**30)
    """Seconds of one read, of that run."""
    open: float = IO500_PROCESSES / 21.002955e3
    """Seconds to open, create, rename or extend a file, of that run."""
    stat: float = IO500_PROCESSES / 63.395256e3
    """Seconds, of that run."""
    unlink: float = IO500_PROCESSES / 11.505903e3
    """Seconds, of that run."""
    sync: float = 0.05
    """Seconds until a sync is answered: an assumption."""
    cached: float = 1
    """1: a node answers what it has read before, and neighbouring writes of a rank lock once; 0: not."""

    def other(self, texts: list[str]) -> Storage:
        """Return this one with the values in texts as `stripes=72`."""
        names = [field.name for field in dataclasses.fields(self)]
        values = {}
        for text in texts:
            name, _, value = text.partition("=")
            if name not in names:
                raise ValueError(f"--storage {text}: '{name}' is none of {', '.join(names)}")
            values[name] = float(value)
            if not (values[name] > 0 or (name == "cached" and values[name] == 0)):
                raise ValueError(f"--storage {text}: {value} is not positive")
        return dataclasses.replace(self, **values)


SOURCES = {
    "stripes": "servers of Perlmutter's scratch, NERSC documentation",
    "bytes_per_second": "its acceptance test, 1382 nodes, records of 1 MiB, G. K. Lockwood's page on IOR",
    "reads_per_second": "4 KiB at random offsets, NERSC documentation",
    "opens_per_second": "creates by one metadata server, known usage, Lustre operations manual",
    "stats_per_second": "the same table",
    "node_bytes_per_second": "one client, known usage, Lustre operations manual",
    "lock": "16 stripes / 7509 writes per second, `ior-hard-write`, IO500 on a cloud, see above",
    "read": "64 processes / 20 619 reads of 47 008 bytes per second, the same run",
    "open": "64 processes / 21 003 creates per second, the same run",
    "stat": "64 processes / 63 395 per second, the same run",
    "unlink": "64 processes / 11 506 per second, the same run",
    "sync": "an assumption",
    "cached": "an assumption",
}
"""Of each rate of `Storage`."""


@dataclass(frozen=True)
class Job:
    """A map and the ranks that compute it."""

    ranks: int
    tiles: int
    slabs: int
    chunks: int
    """Of the final file."""
    per_node: int = 128

    @property
    def holders(self) -> int:
        """Ranks that pack a slab."""
        return min(self.ranks, self.slabs)

    @property
    def readers(self) -> int:
        """Ranks that read one back."""
        return min(self.ranks, self.slabs)

    @property
    def several(self) -> bool:
        """Whether there is another rank than rank 0."""
        return self.ranks > 1


def job_of(ranks: int, tiles: int, points: float, chunks_per_slab: float, per_node: int = 128) -> Job:
    """Return the job of a map whose points are packed in whole slabs."""
    slabs = math.ceil(points / SLAB)
    return Job(ranks, tiles, slabs, round(slabs * chunks_per_slab), per_node)


# What rank 0 does on any number of ranks, and each of the others beside what lies in proportion to the map.
# The case has 13 variables on the grid; their number changes the calls on descriptions.
ROOT = {"open": 14, "create": 5, "stat": 44, "rename": 2, "unlink": 4, "length": 5, "lock": 1, "sync": 4}
ROOT_WRITES, ROOT_READS = {"begun": 23, "new": 74}, {"part": 29, "new": 29}
CHUNK_BYTES = 12_700
"""Of a compressed chunk of this case, mean."""
DESCRIPTION_READS, VERIFIER_READS = 78, 215
"""Of the final file, by each rank that reads back, and by the one that reads the rest."""


def counts(job: Job) -> dict[str, int]:
    """Calls of all ranks, without the writes of tiles."""
    others = job.holders - 1
    found = dict(ROOT)
    found["open"] += job.several + (job.ranks - 1) + 2 * others + job.readers + 1
    found["stat"] += (job.ranks - 1) + 2 * job.readers + 2
    found["sync"] += job.several + others
    found["read of tiles"] = ROOT_READS["part"] + job.tiles
    found["read of the final file"] = (
        ROOT_READS["new"] + VERIFIER_READS + DESCRIPTION_READS * job.readers + job.chunks
    )
    found["write of descriptions"] = sum(ROOT_WRITES.values())
    # Rank 0 writes zeros to reserve the bytes of each chunk.
    found["write of chunks"] = 2 * job.chunks
    return found


@dataclass(frozen=True)
class Times:
    """Seconds of the parts of a job in which it waits for the file system, without the writes of tiles."""

    begin: float
    """The working file is made and opened."""
    tiles_read: float
    reserved: float
    """Rank 0 writes zeros where chunks will be."""
    chunks_written: float
    synced: float
    read_back: float
    end: float
    """Rank 0 alone: the small objects, the names."""

    @property
    def total(self) -> float:
        """Of all parts."""
        return sum(dataclasses.astuple(self))

    @property
    def finish(self) -> float:
        """Of the parts after the tiles."""
        return self.total - self.begin


def times(job: Job, storage: Storage, record: float) -> Times:
    """Return what a file system takes for the job; `record`: bytes of a tile.

    Calls of one rank follow one another; those of several ranks share the rates. Half of rank 0's calls on
    names are before the tiles. A slab locks a stripe once, as its chunks are neighbours, and the
    ranks of a node share the descriptions that one of them has read, if `cached`. A sync asks each stripe.
    """
    rounds = math.ceil(job.slabs / job.ranks)
    names = (ROOT["open"] + ROOT["create"] + ROOT["rename"] + ROOT["length"] + ROOT["lock"]) * storage.open
    names += ROOT["stat"] * storage.stat + ROOT["unlink"] * storage.unlink
    opens, stats = 1 / storage.opens_per_second, 1 / storage.stats_per_second
    per_stripe = storage.reads_per_second / storage.stripes
    reads = max(job.tiles / storage.reads_per_second, job.tiles * record / storage.bytes_per_second)
    asking = math.ceil(job.readers / job.per_node) if storage.cached else job.readers
    locking = job.slabs if storage.cached else job.chunks
    return Times(
        begin=names / 2
        + ROOT_READS["part"] * storage.read
        + ROOT_WRITES["begun"] * storage.lock
        + 2 * storage.sync
        + (job.ranks - 1) * (opens + stats)
        + storage.open
        + storage.stat,
        tiles_read=2 * (job.holders * opens + storage.open)
        + max(
            reads,
            rounds
            * job.tiles
            / job.slabs
            * (storage.read + storage.stripes * record / storage.bytes_per_second),
        ),
        reserved=job.chunks
        * (CHUNK_BYTES / storage.node_bytes_per_second if storage.cached else storage.lock),
        chunks_written=max(locking / storage.stripes, rounds * locking / job.slabs) * storage.lock,
        synced=storage.sync + job.holders / per_stripe,
        read_back=job.readers * (opens + 2 * stats)
        + storage.open
        + 2 * storage.stat
        + max(asking * DESCRIPTION_READS / per_stripe, DESCRIPTION_READS * storage.read)
        + max(job.chunks / storage.reads_per_second, rounds * job.chunks / job.slabs * storage.read)
        + (VERIFIER_READS - DESCRIPTION_READS) * storage.read,
        end=names / 2
        + ROOT_READS["new"] * storage.read
        + ROOT_WRITES["new"] * storage.lock
        + 2 * storage.sync,
    )


def most_writes(storage: Storage) -> float:
    """Writes into one file per second from which on its locks are the limit."""
    return storage.stripes / storage.lock
