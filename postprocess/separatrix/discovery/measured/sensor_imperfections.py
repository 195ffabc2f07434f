# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Artefacts of a sensor that no motion causes: stray samples, held values, clipping."""

from collections.abc import Callable

import numpy as np

from separatrix.discovery.measured.signals import resolution_of, runs, white_noise
from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError

Where = Callable[[int], str]


def left_out(t: np.ndarray, x: np.ndarray, unit: str, where: Where, notes: list[str]) -> np.ndarray:
    """Rows of samples without information on the motion, reported in `notes`; too many are refused."""
    _check_rate(x, where)
    held = _held(t, x, unit, where, notes)
    rows = np.setdiff1d(np.arange(x.size), held)
    stray = _stray(t[rows], x[rows], unit, lambda row: where(rows[row]), notes)
    return np.union1d(held, rows[stray])


def _check_rate(x: np.ndarray, where: Where) -> None:
    """Refuse a record that repeats each value of a slower sensor; a coarse grid is no such thing."""
    steps = np.diff(x)
    changes = np.flatnonzero(steps)
    if changes.size < 2:
        return
    apart = float(np.median(np.diff(changes)))
    spacing = max(resolution_of(x), float(np.median(np.diff(np.unique(x)))))
    if apart >= 2 and np.median(np.abs(steps[changes])) > RECORDS.slow_sensor * spacing:
        raise SeparatrixError(
            f"{where(int(changes[0]) + 1)}: x changes in one of {apart:g} rows only, in jumps: "
            "keep one row for each value of the sensor"
        )


def _stray(t: np.ndarray, x: np.ndarray, unit: str, where: Where, notes: list[str]) -> np.ndarray:
    """Single samples that no motion reaches: away from a smooth line through two on either side."""
    off = np.zeros(x.size)
    off[2:-2] = x[2:-2] - (4 * (x[1:-3] + x[3:-1]) - (x[:-4] + x[4:])) / 6
    steps = np.diff(x)
    bend = np.full(x.size, np.inf)
    bend[2:-2] = np.abs(steps[3:] - steps[:-3])
    second = np.pad(np.abs(np.diff(x, 2)), RECORDS.stray_rows + 1)
    for shift in range(2, RECORDS.stray_rows + 1):
        for side in (-shift, shift):
            bend = np.maximum(bend, second[RECORDS.stray_rows + side : RECORDS.stray_rows + side + x.size])
    # across a gap the samples are no neighbours
    wide = np.flatnonzero(_gaps(t))
    for shift in range(-1, 3):
        bend[np.clip(wide + shift, 0, x.size - 1)] = np.inf
    least = max(
        RECORDS.stray[0] * max(white_noise(x), RECORDS.quiet * float(np.std(x))),
        RECORDS.stray[1] * resolution_of(x),
    )
    size = np.abs(off)
    rows = np.flatnonzero((size > least) & (size > RECORDS.stray[2] * bend))
    messages = [
        f"{where(row)}: x is {x[row]:.6g} {unit} between {x[row - 1]:.6g} and {x[row + 1]:.6g} {unit}"
        for row in rows
    ]
    if rows.size > RECORDS.most_stray:
        raise SeparatrixError(f"{messages[0]}; {rows.size} such samples: clean the record")
    notes += [f"{text}: left out" for text in messages]
    return rows


def _gaps(t: np.ndarray) -> np.ndarray:
    """Whether a sample is followed by a gap."""
    steps = np.diff(t)
    return steps > RECORDS.gap * np.median(steps)


def _held(t: np.ndarray, x: np.ndarray, unit: str, where: Where, notes: list[str]) -> np.ndarray:
    """Samples that repeat one before them, until the motion goes on elsewhere."""
    least = max(RECORDS.held[0] * white_noise(x), RECORDS.held[1] * resolution_of(x))
    gaps = _gaps(t)
    found = []
    for first, last in runs(np.diff(x) == 0):
        last += 1
        # a body at rest before a gap may have moved after it
        if (
            last - first < RECORDS.shortest_held
            or first < 1
            or last > x.size - 2
            or gaps[first - 1 : last].any()
        ):
            continue
        around = max(abs(x[first] - x[first - 1]), abs(x[last + 1] - x[last]))
        if abs(x[last] - x[first]) > max(least, RECORDS.held[2] * around):
            found.append((first, last))
    for first, last in found[:3]:
        notes.append(
            f"{where(first)}: x stays at {x[first]:.6g} {unit} for {last - first} samples, then jumps to "
            f"{x[last]:.6g} {unit}: left out"
        )
    if len(found) > 3:
        notes.append(f"{len(found) - 3} more intervals of held values: left out")
    return np.concatenate([np.arange(first + 1, last) for first, last in found] or [np.zeros(0, int)])


def check_clipping(x: np.ndarray, unit: str, where: Where, notes: list[str]) -> None:
    """Runs of exactly the extreme value; a coarse resolution makes such runs by itself at turning points."""
    steps = np.abs(np.diff(x))
    least = max(RECORDS.abrupt[0] * resolution_of(x), RECORDS.abrupt[1] * float(np.median(steps[steps > 0])))
    _check_limits("x", x, unit, where, notes, lambda first, last: _is_abrupt(x, first, last, least))


def check_clipped_force(force: np.ndarray, unit: str, where: Where, notes: list[str]) -> None:
    """The same of a force, which may jump to a constant value: but not without its noise."""
    inside = force[(force > force.min()) & (force < force.max())]
    if inside.size > RECORDS.fewest_inside and white_noise(inside) > max(
        RECORDS.grid_of_noise * resolution_of(force), RECORDS.quiet * float(np.std(force))
    ):
        _check_limits("force", force, unit, where, notes, lambda first, last: True)


def _check_limits(
    name: str, x: np.ndarray, unit: str, where: Where, notes: list[str], holds: Callable[[int, int], bool]
) -> None:
    """Refuse a signal that stays at one of its limits for long, in runs that no motion causes."""
    for end, extreme in (("largest", x.max()), ("smallest", x.min())):
        long = [
            (first, last)
            for first, last in runs(x == extreme)
            if last - first >= RECORDS.clipped_run and holds(first, last)
        ]
        if not long:
            continue
        share = sum(last - first for first, last in long) / x.size
        stays = f"{name} stays at its {end} value {extreme:.6g} {unit}"
        message = f"{where(long[0][0])}: {stays} in {len(long)} intervals"
        if len(long) >= 2 and share > RECORDS.clipped_share:
            raise SeparatrixError(
                f"{message}, {100 * share:.0f} % of the samples: clipped. The range of the sensor has to be "
                f"that of the {'force' if name == 'force' else 'motion'}"
            )
        notes.append(f"{message}: clipped?")


def _is_abrupt(x: np.ndarray, first: int, last: int, least: float) -> bool:
    """Whether a run begins and ends with a step of more than `least`, as far as it does within the record."""
    before = first == 0 or abs(x[first] - x[first - 1]) > least
    after = last == x.size or abs(x[last] - x[last - 1]) > least
    return before and after
