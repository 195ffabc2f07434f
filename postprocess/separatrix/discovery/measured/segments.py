# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records cut into short segments, each with a start of its own.

A segment starts where the motion is smooth: away from impacts (also those that only a velocity shows), from
turning points (where friction switches and may hold the body) and from gaps. Segments of a record are
contiguous.
"""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.measured.condense import Samples
from separatrix.discovery.measured.smoother import Smoothed
from separatrix.discovery.policy import RECORDS


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


def cut(records: list[Samples], smoothed: list[Smoothed], lengths: list[int]) -> Segments:
    """Cut each record into segments that last about `lengths` samples of the sensor."""
    rows: list[tuple[int, int, int]] = []
    for number, (record, smooth, length) in enumerate(zip(records, smoothed, lengths, strict=True)):
        smoothness = _calm(smooth)[smooth.nearest(record.t)]
        if record.blind is not None:
            # impacts that only the velocity shows, as at the beginning of the record
            smoothness[record.blind] = 0
        for first, last in record.pieces:
            if last - first >= max(RECORDS.segment_samples, min(length, RECORDS.fewest_in_piece)):
                piece = slice(first, last)
                cuts = _cut_piece(record.offset[piece], length, smoothness[piece])
                rows += [(number, first + a, first + b) for a, b in cuts]
    table = np.array(rows, int).reshape(-1, 3)
    return padded(table[:, 0], table[:, 1], table[:, 2])


def padded(record: np.ndarray, first: np.ndarray, last: np.ndarray) -> Segments:
    """Segments from the first sample to the last + 1, as a table."""
    longest = int((last - first).max()) if first.size else 0
    steps = np.arange(longest)
    inside = steps[None, :] < (last - first)[:, None]
    index = np.where(inside, first[:, None] + steps, first[:, None])
    return Segments(record, first, last, index, inside)


def padded_table(flat: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Values of samples one after the other as a table by segment, 0 where a segment has none."""
    table = np.zeros(inside.shape + flat.shape[1:])
    table[inside] = flat
    return table


def seeing(segments: Segments, records: list[Samples]) -> np.ndarray:
    """Samples of the segments (segments, length) whose velocity is compared, if it was measured."""
    found = segments.inside.copy()
    for number, samples in enumerate(records):
        if samples.blind is not None:
            rows = segments.record == number
            found[rows] &= ~samples.blind[segments.index[rows]]
    return found


def _calm(smooth: Smoothed) -> np.ndarray:
    """Suitability of each sample as a start: speed over its usual size, 0 near impacts."""
    speed = np.abs(smooth.v)
    calm = speed / max(float(np.sqrt(np.mean(speed**2))), 1e-300)
    for k in smooth.impacts:
        calm[max(0, k - RECORDS.impact_margin) : k + 2 + RECORDS.impact_margin] = 0
    return calm


def _cut_piece(offset: np.ndarray, length: int, calm: np.ndarray) -> list[tuple[int, int]]:
    """Rows at which the segments of a piece begin and end; `offset` counts samples of the sensor."""
    # a piece between gaps may be much shorter
    whole = offset[-1] - offset[0] + 1
    within = min(max(2, length // 4), whole // 2)
    begin = int(np.searchsorted(offset, offset[0] + within))
    starts = [int(np.argmax(calm[:begin] > RECORDS.slow_start))]
    reach = max(1, length // 3)
    while offset[-1] + 1 - offset[starts[-1]] > 1.5 * length:
        aim = offset[starts[-1]] + length
        near = np.arange(np.searchsorted(offset, aim - reach), np.searchsorted(offset, aim + reach, "right"))
        near = near[near > starts[-1] + RECORDS.segment_samples]
        if not near.size:
            near = np.array([min(starts[-1] + RECORDS.segment_samples + 1, offset.size - 1)])
        near = near[np.argsort(np.abs(offset[near] - aim), kind="stable")]
        good = near[calm[near] > RECORDS.slow_start]
        starts.append(int(good[0] if good.size else near[np.argmax(calm[near])]))
    return list(zip(starts, [*starts[1:], offset.size], strict=True))
