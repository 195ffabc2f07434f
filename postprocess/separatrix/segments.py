# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Many short segments of a motion by libseparatrix, with their derivatives (docs/library.md)."""

import ctypes
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np

from separatrix.binding import array_of, call, pointer
from separatrix.errors import CaseError

__all__ = ["Impacts", "Segments"]

_IMPACT_NUMBERS = 5
# fewer segments than this are not worth a thread
_FEWEST_OF_A_THREAD = 4


@dataclass(frozen=True)
class _Threads:
    """Threads that fly segments, and how many they are."""

    pool: ThreadPoolExecutor
    count: int


_THREADS: ContextVar[_Threads | None] = ContextVar("threads", default=None)


@contextmanager
def flown_in_threads(count: int) -> Iterator[None]:
    """Segments that are flown within are shared out to so many threads; the results have the same bits."""
    if count == 1:
        yield
        return
    with ThreadPoolExecutor(count) as pool:
        token = _THREADS.set(_Threads(pool, count))
        try:
            yield
        finally:
            _THREADS.reset(token)


@dataclass(frozen=True)
class Impacts:
    """Every impact of every segment, in order: arrays of equal length.

    `side` +1 or -1: the upper or lower stop of `contact`, which is counted from 0 (0 of one body). After a
    soft contact the speed is that when it ends, NaN if it lasts.
    """

    segment: np.ndarray
    time: np.ndarray
    contact: np.ndarray
    speed_before: np.ndarray
    speed_after: np.ndarray
    side: np.ndarray


@dataclass(frozen=True)
class Segments:
    """Samples of all segments, one after the other.

    `motion` (samples, numbers) has of one body x [m] as the sensor shows it and v [m/s]; of a structure
    positions, then velocities of its coordinates; with a motor x, crank angle [rad], v, crank speed [rad/s],
    and current [A] or integral of the speed control [rad]. `jacobian` (samples, numbers, columns): by the
    directions (each active parameter by itself, unless others were asked for), then by the numbers of the
    start; None without derivatives.

    Per segment: the number of impacts, whether it is steady (its neighbours meet the same stops in the same
    order and none is grazed; otherwise the derivatives mean little) and the reason why it could not be flown,
    0 if it was.
    """

    motion: np.ndarray
    jacobian: np.ndarray | None
    impacts: np.ndarray
    impact: Impacts
    steady: np.ndarray
    reason: np.ndarray

    @property
    def x(self) -> np.ndarray:
        """Position of one body as the sensor shows it [m]."""
        x, _ = self.motion.T
        return x

    @property
    def v(self) -> np.ndarray:
        """Velocity of one body [m/s]."""
        _, v = self.motion.T
        return v


class SegmentsCall(ctypes.Structure):
    """The struct `separatrix_segments` of include/separatrix.h, member by member."""

    _fields_ = [
        ("chosen_count", ctypes.c_int),
        ("direction_count", ctypes.c_int),
        ("segment_count", ctypes.c_int),
        ("start_numbers", ctypes.c_int),
        ("sample_numbers", ctypes.c_int),
        ("force_count", ctypes.c_int),
        ("derivatives", ctypes.c_int),
        ("impact_capacity", ctypes.c_int),
        ("tolerance", ctypes.c_double),
        ("force_interval", ctypes.c_double),
        ("chosen", ctypes.c_void_p),
        ("values", ctypes.c_void_p),
        ("directions", ctypes.c_void_p),
        ("start", ctypes.c_void_p),
        ("first", ctypes.c_void_p),
        ("times", ctypes.c_void_p),
        ("force", ctypes.c_void_p),
        ("motion", ctypes.c_void_p),
        ("jacobian", ctypes.c_void_p),
        ("impacts", ctypes.c_void_p),
        ("steady", ctypes.c_void_p),
        ("reason", ctypes.c_void_p),
        ("impact_segment", ctypes.c_void_p),
        ("impact", ctypes.c_void_p),
        ("impact_count", ctypes.c_int),
    ]


def segment_numbers(handle: ctypes.c_void_p) -> tuple[int, int]:
    """Return how many numbers a start and a sample of a model have."""
    start, sample = ctypes.c_int(), ctypes.c_int()
    call("separatrix_segment_numbers", handle, ctypes.byref(start), ctypes.byref(sample))
    return start.value, sample.value


def propagate(
    handle: ctypes.c_void_p,
    chosen: tuple[int, ctypes.Array, ctypes.Array],
    directions: np.ndarray | None,
    starts: tuple[np.ndarray, np.ndarray, np.ndarray],
    force: list,
    sample_numbers: int,
    tolerance: float,
) -> Segments:
    """Fly segments of a model from starts, first samples and times that `checked_starts` returned.

    `directions` None: without derivatives. `force` is the interval [s] and the samples [N] of a measured
    force; no samples: that of the case.
    """

    def fly(part: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Segments:
        return _propagated(handle, chosen, directions, part, force, sample_numbers, tolerance)

    threads = _THREADS.get()
    parts = [starts] if threads is None else _shared_out(starts, threads.count)
    return fly(starts) if len(parts) == 1 else _joined(list(threads.pool.map(fly, parts)))


def _shared_out(starts: tuple[np.ndarray, np.ndarray, np.ndarray], count: int) -> list[tuple]:
    """Return starts, first samples and times in at most so many parts of about as many samples."""
    start, first, times = starts
    count = max(1, min(count, len(start) // _FEWEST_OF_A_THREAD))
    ends = np.unique(np.searchsorted(first, np.linspace(0, times.size, count + 1)[1:-1]))
    bounds = [0, *ends[(ends > 0) & (ends < len(start))], len(start)]
    return [
        (start[a:b], first[a : b + 1] - first[a], times[first[a] : first[b]]) for a, b in pairwise(bounds)
    ]


def _joined(parts: list[Segments]) -> Segments:
    """Return the segments of all parts, one after the other."""
    counts = np.cumsum([0, *(len(one.reason) for one in parts[:-1])], dtype=np.int32)
    impacts = [
        replace(one.impact, segment=one.impact.segment + before)
        for one, before in zip(parts, counts, strict=True)
    ]

    def together(name: str, of: list) -> np.ndarray:
        return np.concatenate([getattr(one, name) for one in of])

    return Segments(
        together("motion", parts),
        None if parts[0].jacobian is None else together("jacobian", parts),
        together("impacts", parts),
        Impacts(*(together(one.name, impacts) for one in fields(Impacts))),
        together("steady", parts),
        together("reason", parts),
    )


def _propagated(
    handle: ctypes.c_void_p,
    chosen: tuple[int, ctypes.Array, ctypes.Array],
    directions: np.ndarray | None,
    starts: tuple[np.ndarray, np.ndarray, np.ndarray],
    force: list,
    sample_numbers: int,
    tolerance: float,
) -> Segments:
    """Fly them in one call of the library."""
    start, first, times = starts
    interval, series = force
    rows, count = sample_numbers, len(start)
    along = 0 if directions is None else len(directions)
    motion, report = np.empty((times.size, rows)), np.zeros((3, count), np.int32)
    jacobian = None if directions is None else np.empty((times.size, rows, along + start.shape[1]))
    given = SegmentsCall(
        chosen_count=chosen[0], chosen=ctypes.addressof(chosen[1]), values=ctypes.addressof(chosen[2]),
        direction_count=along, directions=pointer(directions),
        segment_count=count, start_numbers=start.shape[1], sample_numbers=rows,
        start=pointer(start), first=pointer(first), times=pointer(times),
        force_count=len(series), force_interval=interval, force=pointer(series),
        derivatives=int(directions is not None), tolerance=tolerance,
        motion=pointer(motion), jacobian=pointer(jacobian),
        impacts=pointer(report[0]), steady=pointer(report[1]), reason=pointer(report[2]),
        impact_capacity=4 * count + 64,
    )  # fmt: skip
    while True:
        room = given.impact_capacity
        segment, impact = np.empty(room, np.int32), np.empty((room, _IMPACT_NUMBERS))
        given.impact_segment, given.impact = pointer(segment), pointer(impact)
        call("separatrix_propagate", handle, ctypes.byref(given))
        found = given.impact_count
        if found <= room:
            break
        given.impact_capacity = found
    time, contact, before, after, side = impact[:found].T
    impacts = Impacts(segment[:found], time, contact.astype(int), before, after, side.astype(int))
    return Segments(motion, jacobian, report[0], impacts, report[1].astype(bool), report[2])


def checked_starts(
    start: np.ndarray, width: int, first: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return starts (segments, width), first samples and times, as the library reads them."""
    start = np.asarray(start, float)
    start = array_of(start, (len(start), width), "start")
    first = np.ascontiguousarray(first, np.int32)
    if first.shape != (len(start) + 1,):
        raise CaseError(f"first: found shape {first.shape}, allowed ({len(start) + 1},)")
    return start, first, array_of(times, (int(first[-1]),), "times")


def checked_directions(directions: np.ndarray | None, parameters: int) -> np.ndarray:
    """Return the directions to differentiate along, a row each: as given, else each parameter by itself."""
    if directions is None:
        return np.eye(parameters)
    return array_of(directions, (len(directions), parameters), "directions")


def with_force(
    start: np.ndarray,
    first: np.ndarray,
    times: np.ndarray,
    force: tuple[np.ndarray, float, np.ndarray] | None,
) -> tuple[np.ndarray, float, np.ndarray]:
    """Return starts whose crank angle is the phase of the force, its interval and its samples."""
    if force is None:
        return start, 0.0, np.empty(0)
    begins, interval, series = force
    series = array_of(series, (len(series),), "force")
    begins = array_of(begins, (len(start),), "force: begin of each segment")
    duration = (len(series) - 1) * interval
    last_sample = np.minimum(first[1:], len(times)) - 1
    ends = begins + np.where(np.diff(first) > 0, times[last_sample], 0.0) if len(times) else begins
    lowest, highest = begins.min(initial=0.0), ends.max(initial=0.0)
    if not (duration > 0 and lowest >= 0 and highest <= duration * (1 + 1e-9)):
        raise CaseError(f"force: segments from {lowest} to {highest} s, allowed 0 to {duration} s")
    angle = 2 * np.pi * begins / duration
    return np.column_stack([start[:, :2], angle]), float(interval), series
