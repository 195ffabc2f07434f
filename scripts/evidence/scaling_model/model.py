# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The model of the scheduler: what a number of ranks would take for tiles of given costs."""

import ctypes
import math
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent
COMPILER = "cc"
FLAGS = ("-O2", "-std=c11", "-fPIC", "-shared")


class Setting(ctypes.Structure):
    """As `struct scheduler_setting`; times in seconds."""

    _fields_ = [
        ("ranks", ctypes.c_int),
        ("ranks_per_node", ctypes.c_int),
        ("share", ctypes.c_double),
        ("latency", ctypes.c_double),
        ("service", ctypes.c_double),
        ("pause", ctypes.c_double),
        ("polls_per_tile", ctypes.c_double),
        ("run", ctypes.c_double),
        ("write", ctypes.c_double),
        ("lock", ctypes.c_double),
        ("write_tile", ctypes.c_double),
        ("most_held", ctypes.c_long),
        ("stripes", ctypes.c_int),
        ("seed", ctypes.c_ulonglong),
    ]


class _Outcome(ctypes.Structure):
    _fields_ = [
        ("busy", ctypes.POINTER(ctypes.c_double)),
        ("finish", ctypes.POINTER(ctypes.c_double)),
        ("tiles", ctypes.POINTER(ctypes.c_long)),
        ("questions", ctypes.POINTER(ctypes.c_long)),
        ("writing", ctypes.POINTER(ctypes.c_double)),
        ("service", ctypes.c_double),
        ("writes", ctypes.c_long),
        ("longest_queue", ctypes.c_int),
    ]


# src/parallel: half of a node's fair share, 100 us between two looks, runs of half a second
SHARE = 0.5
PAUSE = 100e-6
RUN = 0.5
# src/io/tile_store.f90: 4 MiB of records of 1024 points of the case of the packing runs
MOST_HELD = 85
# a message, and an answer of rank 0, on a usual cluster
LATENCY = 5e-6
SERVICE = 5e-6


def setting(
    ranks: int,
    ranks_per_node: int,
    *,
    latency: float = LATENCY,
    service: float = SERVICE,
    polls_per_tile: float = 1024,
    share: float = SHARE,
    write: float = 0.0,
    lock: float = 0.0,
    write_tile: float = 0.0,
    most_held: int = MOST_HELD,
    stripes: int = 0,
    seed: int = 1,
) -> Setting:
    """Return a machine and what its messages and writes take."""
    times = (latency, service, PAUSE, polls_per_tile, RUN, write, lock, write_tile)
    return Setting(ranks, ranks_per_node, share, *times, most_held, stripes, seed)


@dataclass
class Outcome:
    """What happened; arrays over the ranks."""

    busy: np.ndarray
    finish: np.ndarray
    tiles: np.ndarray
    questions: np.ndarray
    writing: np.ndarray
    service: float
    writes: int
    longest_queue: int

    @property
    def makespan(self) -> float:
        """Time until the last rank is done."""
        return float(self.finish.max())

    @property
    def efficiency(self) -> float:
        """Share of the ranks' time spent in tiles."""
        return float(self.busy.sum() / (len(self.busy) * self.makespan))


def handed_out(count: int) -> np.ndarray:
    """Return the positions in the order in which the MPI scheduler hands them out, from 0."""
    step = spread_step(count)
    return (np.arange(count, dtype=np.int64) * step) % max(count, 1)


def spread_step(count: int) -> int:
    """Return the stride of src/parallel/spread_order.f90: near the golden section, no common divisor."""
    step = max(1, int(0.6180339887498949 * count))
    while math.gcd(step, count) > 1:
        step += 1
    return step


class Model:
    """The compiled model."""

    def __init__(self, folder: Path) -> None:
        library = folder / "libscheduler_model.so"
        subprocess.run(
            [COMPILER, *FLAGS, "-o", library, FOLDER / "scheduler_model.c", "-lm"],
            check=True,
        )
        self.entry = ctypes.CDLL(str(library)).simulate
        self.entry.restype = ctypes.c_int
        self.entry.argtypes = [
            ctypes.POINTER(Setting),
            ctypes.c_long,
            np.ctypeslib.ndpointer(np.float64, flags="C"),
            ctypes.POINTER(_Outcome),
        ]

    def run(self, machine: Setting, costs: np.ndarray, *, spread: bool = True) -> Outcome:
        """Hand out tiles of these costs, seconds in the order of the map."""
        order = handed_out(len(costs)) if spread else slice(None)
        costs = np.ascontiguousarray(costs[order], dtype=np.float64)
        busy, finish, writing = (np.zeros(machine.ranks) for _ in range(3))
        tiles, questions = np.zeros(machine.ranks, np.int64), np.zeros(machine.ranks, np.int64)
        raw = _Outcome(
            busy.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
            finish.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
            tiles.ctypes.data_as(ctypes.POINTER(ctypes.c_long)),
            questions.ctypes.data_as(ctypes.POINTER(ctypes.c_long)),
            writing.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
        )
        if self.entry(ctypes.byref(machine), len(costs), costs, ctypes.byref(raw)):
            raise MemoryError("the model of the scheduler")
        return Outcome(busy, finish, tiles, questions, writing, raw.service, raw.writes, raw.longest_queue)
