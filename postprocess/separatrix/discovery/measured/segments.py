# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records cut into short segments, each with a start of its own.

A segment starts where the motion is smooth: away from impacts, from turning points (where friction switches
and may hold the body) and from gaps. Segments of a record follow one another without a hole.
"""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.measured.clock import FEWEST_IN_PIECE
from separatrix.discovery.measured.records import Record
from separatrix.discovery.measured.smoother import Smoothed

_FEWEST = 6
_IMPACT_MARGIN = 2
_SLOW = 0.3


@dataclass
class Segments:
    """Segments of several records as a table: `index[i, j]` is sample j of segment i, `inside` if any."""

    record: np.ndarray
    first: np.ndarray
    last: np.ndarray
    index: np.ndarray
    inside: np.ndarray

    @property
    def count(self) -> int:
        """Number of segments."""
        return self.record.size


def cut(records: list[Record], smoothed: list[Smoothed], lengths: list[int]) -> Segments:
    """Cut each record into segments of about `lengths` samples."""
    rows: list[tuple[int, int, int]] = []
    for number, (record, smooth, length) in enumerate(zip(records, smoothed, lengths, strict=True)):
        smoothness = _calm(smooth)
        for first, last in record.pieces:
            if last - first >= max(_FEWEST, min(length, FEWEST_IN_PIECE)):
                rows += [(number, a, b) for a, b in _cut_piece(first, last, length, smoothness)]
    table = np.array(rows, int).reshape(-1, 3)
    return padded(table[:, 0], table[:, 1], table[:, 2])


def padded(record: np.ndarray, first: np.ndarray, last: np.ndarray) -> Segments:
    """Segments from the first sample to the last + 1, as a table."""
    longest = int((last - first).max()) if first.size else 0
    steps = np.arange(longest)
    inside = steps[None, :] < (last - first)[:, None]
    index = np.where(inside, first[:, None] + steps, first[:, None])
    return Segments(record, first, last, index, inside)


def _calm(smooth: Smoothed) -> np.ndarray:
    """How good a start each sample is: speed over its usual size, 0 near impacts."""
    speed = np.abs(smooth.v)
    calm = speed / max(float(np.sqrt(np.mean(speed**2))), 1e-300)
    for k in smooth.impacts:
        calm[max(0, k - _IMPACT_MARGIN) : k + 2 + _IMPACT_MARGIN] = 0
    return calm


def _cut_piece(first: int, last: int, length: int, calm: np.ndarray) -> list[tuple[int, int]]:
    # a piece between gaps may be much shorter
    within = min(max(2, length // 4), (last - first) // 2)
    starts = [first + int(np.argmax(calm[first : first + within] > _SLOW))]
    reach = max(1, length // 3)
    while last - starts[-1] > 1.5 * length:
        aim = starts[-1] + length
        near = np.arange(aim - reach, aim + reach + 1)
        near = near[np.argsort(np.abs(near - aim), kind="stable")]
        good = near[calm[near] > _SLOW]
        starts.append(int(good[0] if good.size else near[np.argmax(calm[near])]))
    return list(zip(starts, [*starts[1:], last], strict=True))
