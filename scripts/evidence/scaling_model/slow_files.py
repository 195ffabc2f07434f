# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs on a file system of this machine that delays each operation, beside what the model predicts."""

from __future__ import annotations

import contextlib
import os
import shlex
import subprocess
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from model import FOLDER, Model, setting
from packing import CASE
from runs import Program
from simulation import RECORD_BYTES
from storage import Job, Storage, times

DELAYS = (0.0, 1.0, 10.0)
"""Milliseconds."""
RANKS = (1, 4)
REPETITIONS = 2
PROBES, TOGETHER, PROBE_BYTES, LARGE = 20, 4, 16384, 2**22


@dataclass
class Slow:
    """Runs of one map; seconds."""

    ranks: int
    delay: float
    measured: float
    predicted: float


def build(folder: Path) -> Path:
    """Compile the file system; needs libfuse 3."""
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "fuse3"], capture_output=True, text=True, check=True
    ).stdout
    path = folder / "slow_files"
    source = FOLDER / "slow_files.c"
    subprocess.run(["cc", "-O2", "-o", path, source, *shlex.split(flags)], check=True)
    return path


@contextlib.contextmanager
def mounted(program: Path, folder: Path, delay: float) -> Iterator[Path]:
    """Mount an empty folder on which each operation takes `delay` ms."""
    behind, point = folder / f"behind-{delay:g}", folder / f"slow-{delay:g}"
    behind.mkdir(exist_ok=True)
    point.mkdir(exist_ok=True)
    server = subprocess.Popen([program, behind, str(delay), point, "-f"], stderr=subprocess.DEVNULL)
    try:
        for _ in range(500):
            if point.is_mount():
                break
            time.sleep(0.01)
        else:
            raise RuntimeError(f"{point} is not mounted")
        yield point
    finally:
        subprocess.run(["fusermount3", "-u", point], check=True)
        server.wait(20)


def each(work: Callable[[int], object], count: int = PROBES) -> float:
    """Seconds of one call, mean."""
    began = time.perf_counter()
    for number in range(count):
        work(number)
    return (time.perf_counter() - began) / count


def together(work: Callable[[int], object]) -> float:
    """Seconds for each of many calls of several threads at once."""
    with ThreadPoolExecutor(TOGETHER) as pool:
        began = time.perf_counter()
        list(pool.map(work, range(PROBES)))
        return (time.perf_counter() - began) / PROBES


def rates(folder: Path) -> Storage:
    """Measure what each call takes here, with a few calls of one process."""
    data = bytes(PROBE_BYTES)
    names = [folder / f"probe-{number}" for number in range(PROBES)]
    created = each(lambda i: os.close(os.open(names[i], os.O_RDWR | os.O_CREAT)))
    opened = each(lambda i: os.close(os.open(names[i], os.O_RDWR)))
    stat = each(lambda i: names[i].stat())
    file = os.open(names[0], os.O_RDWR)
    fstat = each(lambda _: os.fstat(file))
    locked = together(lambda i: os.pwrite(file, data, i * PROBE_BYTES))
    read = each(lambda i: os.pread(file, PROBE_BYTES, i * PROBE_BYTES))
    shared = together(lambda i: os.pread(file, PROBE_BYTES, i * PROBE_BYTES))
    opens = together(lambda i: os.close(os.open(names[i], os.O_RDWR)))
    stats = together(lambda i: names[i].stat())
    large = each(lambda _: os.pwrite(file, bytes(LARGE), 0), 3)
    sync = each(lambda _: os.fsync(file))
    os.close(file)
    unlink = each(lambda i: names[i].unlink())
    return Storage(
        stripes=1,
        bytes_per_second=LARGE / max(large - locked, 1e-6),
        reads_per_second=1 / shared,
        opens_per_second=1 / opens,
        stats_per_second=1 / stats,
        node_bytes_per_second=1e12,
        lock=locked,
        read=read,
        open=(created + opened) / 2,
        stat=(stat + fstat) / 2,
        unlink=unlink,
        sync=sync,
        cached=0,
    )


def timed(program: Program, ranks: int, folder: Path, words: list[str]) -> tuple[float, np.ndarray]:
    """Seconds of a run whose file is in the folder, least of some, and of its tiles."""
    best, costs = float("inf"), np.zeros(0)
    table = program.folder / "slow.csv"
    for _ in range(REPETITIONS):
        command, _ = program.command(ranks, "slow", CASE, *words, "--tile-times", table)
        command[command.index("-o") + 1] = str(folder / "map.h5")
        began = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        seconds = time.perf_counter() - began
        if seconds < best:
            best, rows = seconds, np.genfromtxt(table, delimiter=",", names=True)
            costs = (rows["end"] - rows["begin"])[np.argsort(rows["tile"])]
        (folder / "map.h5").unlink()
    return best, costs


def compare(program: Program, model: Model, words: list[str], jobs: dict[int, Job]) -> list[Slow]:
    """Run the map on the ranks of `jobs` with each of DELAYS; predict all from the runs without a delay."""
    server = build(program.folder)
    found, first = [], {}
    for delay in DELAYS:
        with mounted(server, program.folder, delay) as folder:
            storage = rates(folder)
            for ranks, job in jobs.items():
                seconds, costs = timed(program, ranks, folder, words)
                if delay == 0:
                    first[ranks] = seconds, costs, storage
                began, own, free = first[ranks]
                expected = began + waits(model, job, storage, own) - waits(model, job, free, own)
                found.append(Slow(ranks, delay, seconds, expected))
    return found


def waits(model: Model, job: Job, storage: Storage, costs: np.ndarray) -> float:
    """Seconds of the tiles and of all other calls."""
    one = RECORD_BYTES / storage.bytes_per_second
    machine = setting(job.ranks, job.ranks, lock=storage.lock, write_tile=one, stripes=int(storage.stripes))
    return model.run(machine, costs).makespan + times(job, storage, RECORD_BYTES).total
