# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of several sensors that are sampled far faster than they move, on fewer rows.

A row is the mean of a block of samples, less what the curvature of the motion adds to a mean: a value at the
middle of the block. The curvature is that of means two blocks apart, so that the noise of rows stays nearly
white. Rows whose fourth difference stands out of the noise are not compared: there the motion jumps, or is
faster than the blocks.
"""

import itertools
from dataclasses import replace

import numpy as np

from separatrix.discovery.measured.records import Record
from separatrix.discovery.measured.signals import FOURTH
from separatrix.discovery.policy import RECORDS


def block_length(record: Record, columns: dict[str, np.ndarray], sigmas: dict[str, float]) -> int:
    """Samples of a block: the most that leave enough rows, most of them smooth in each column; or 1."""
    if record.t.size <= RECORDS.never_condensed or not _even(record):
        return 1
    size = record.t.size // RECORDS.thinned_rows
    while size > 1:
        rough = [
            np.mean(~smooth_rows(means_of(record, values, size), sigmas[name] / np.sqrt(size)))
            for name, values in columns.items()
        ]
        if max(rough) <= RECORDS.most_rough:
            return size
        size //= 2
    return 1


def _even(record: Record) -> bool:
    """Whether steps are even in each piece, so that the mean time of a block is that of its middle."""
    return all(
        np.ptp(np.diff(record.t[first:last])) < RECORDS.uneven * record.interval
        for first, last in record.pieces
        if last - first > 1
    )


def means_of(record: Record, values: np.ndarray, size: int) -> list[np.ndarray]:
    """Means of the blocks of each piece."""
    return [values[a : b - (b - a) % size].reshape(-1, size).mean(axis=1) for a, b in record.pieces]


def at_middle(means: list[np.ndarray], size: int) -> np.ndarray:
    """Values at the middle of the blocks of all pieces."""
    found = []
    for one in means:
        bent = np.zeros(one.size)
        if one.size >= 6:
            bent[2:-2] = (one[4:] - 2 * one[2:-2] + one[:-4]) / 4
            for ends in (bent, bent[::-1]):
                ends[1], ends[0] = 2 * ends[2] - ends[3], 3 * ends[2] - 2 * ends[3]
        found.append(one - (1 - 1 / size**2) / 24 * bent)
    return np.concatenate(found)


def smooth_rows(means: list[np.ndarray], sigma: float) -> np.ndarray:
    """Rows in whose surroundings the fourth difference is noise of size `sigma` (of a mean)."""
    found = []
    for one in means:
        smooth = np.ones(one.size, bool)
        if one.size >= 5:
            rough = np.flatnonzero(np.abs(np.diff(one, 4)) > RECORDS.rough * np.sqrt(FOURTH) * sigma)
            for shift in (1, 2, 3):
                smooth[rough + shift] = False
        found.append(smooth)
    return np.concatenate(found)


def thinned_record(record: Record, size: int) -> Record:
    """The record with a row for each block of `size` samples; pieces of less than a block are dropped."""

    def rows(values: np.ndarray) -> np.ndarray:
        return at_middle(means_of(record, values, size), size)

    lengths = [(b - a) // size for a, b in record.pieces]
    ends = np.cumsum([0, *lengths])
    pieces = [(int(a), int(b)) for a, b in itertools.pairwise(ends) if b > a]
    return replace(
        record,
        t=np.concatenate(means_of(record, record.t, size)),
        x=rows(record.x),
        v=None if record.v is None else rows(record.v),
        phi=None,
        sensors={name: rows(values) for name, values in record.sensors.items()},
        pieces=pieces,
    )
