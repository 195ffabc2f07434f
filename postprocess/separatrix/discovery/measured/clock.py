# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Time stamps of a record: gaps, and scatter about the times of sampling."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.ndimage import maximum_filter1d

from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError


def pieces_of(
    t: np.ndarray, x: np.ndarray, fewest: int, where: Callable[[int], str], notes: list[str]
) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Times of the samples, and the intervals without gaps as (first, last + 1).

    If stamps scatter and the motion does not follow them, they are those of the computer and not of the
    sensor: the samples were taken at even times. `fewest` samples must lie in intervals that can be fitted.
    """
    steps = np.diff(t)
    usual = float(np.median(steps))
    whole = steps[steps < RECORDS.gap * usual]
    uneven = float(np.quantile(np.abs(whole / usual - 1), 0.9)) > RECORDS.uneven
    gaps = _lost(t, steps, float(whole.mean())) if uneven else np.flatnonzero(steps > RECORDS.gap * usual) + 1
    pieces = list(pairwise([0, *gaps.tolist(), t.size]))
    for row in gaps[:3]:
        notes.append(f"{where(row)}: gap of {t[row] - t[row - 1]:.4g} s; nothing is fitted across it")
    if gaps.size > 3:
        notes.append(f"{gaps.size - 3} more gaps")
    long = sum(last - first for first, last in pieces if last - first >= RECORDS.fewest_in_piece)
    if long < fewest:
        raise SeparatrixError(
            f"{where(int(gaps[0]) if gaps.size else 0)}: gaps leave {long} samples in intervals of at least "
            f"{RECORDS.fewest_in_piece}, {fewest} are needed"
        )
    if uneven:
        t = _evened(t, x, pieces, where, notes)
    return t, pieces


def _lost(t: np.ndarray, steps: np.ndarray, usual: float) -> np.ndarray:
    """Rows after a gap where stamps scatter: after a gap all later stamps are late, not one alone."""
    rows = np.flatnonzero(steps > RECORDS.late * usual) + 1
    late = np.pad(t - usual * np.arange(t.size), RECORDS.around_step)
    before = sum(late[rows + k] for k in range(RECORDS.around_step)) / np.minimum(RECORDS.around_step, rows)
    after = sum(late[rows + RECORDS.around_step + k] for k in range(RECORDS.around_step)) / np.minimum(
        RECORDS.around_step, t.size - rows
    )
    jumps = np.full(t.size, -np.inf)
    jumps[rows] = after - before
    largest = jumps == maximum_filter1d(jumps, 2 * RECORDS.around_step - 1)
    lasting = (jumps[rows] > 0.5 * usual) & largest[rows]
    return rows[(steps[rows - 1] > RECORDS.lost * usual) | lasting]


def _evened(t: np.ndarray, x: np.ndarray, pieces, where, notes: list[str]) -> np.ndarray:
    """Even times within the pieces, if x shows that the samples were taken at these."""
    index = np.arange(t.size)
    above = below = 0.0
    for first, last in pieces:
        centred = index[first:last] - index[first:last].mean()
        above += float(centred @ t[first:last])
        below += float(centred @ centred)
    interval = above / below
    even = interval * index
    for first, last in pieces:
        even[first:last] += np.mean(t[first:last] - even[first:last])
    late = t - even
    follows, error = _followed(x, late, interval, pieces)
    row = int(np.argmax(np.abs(late)))
    deviation = f"{where(row)}: t is {abs(late[row]):.3g} s off even steps, {np.std(late):.3g} s is usual"
    if follows + 2 * error < 0.5:
        notes.append(f"{deviation}; x does not follow: even times are taken")
        return even
    follow = "and x follows" if follows - 2 * error > 0.5 else "and x does not show whether it follows"
    notes.append(f"{deviation}, {follow}: noise, and impacts if there are any, are found less well")
    return t


def _followed(x: np.ndarray, late: np.ndarray, interval: float, pieces) -> tuple[float, float]:
    """Lead of x where a stamp is late over speed times delay, and its error; 1: true times, 0: scatter."""
    delays, positions = [], []
    for first, last in pieces:
        if last - first >= RECORDS.fewest_in_piece:
            speed = np.gradient(x[first:last])[2:-2] / interval
            delays.append(speed * np.diff(late[first:last], 4))
            positions.append(np.diff(x[first:last], 4))
    delay, position = np.concatenate(delays), np.concatenate(positions)
    usual = 5 * 1.4826 * float(np.median(np.abs(position)))
    size = float(delay @ delay)
    if size == 0 or usual == 0:
        return 0.5, np.inf
    # limits impacts, but not the response of x in a fast part of a slow record
    most = np.maximum(usual, 2 * np.abs(delay))
    position = np.clip(position, -most, most)
    slope = float(delay @ position) / size
    # fourth differences of neighbours are correlated
    return slope, 2 * float(np.std(position - slope * delay)) / np.sqrt(size)
