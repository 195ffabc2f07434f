# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Regions of a motion in which a missing force is estimated: bins of time, position, speed, phase."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.joint_response import columns_of
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.motions import after_impacts, impacts_at, scaled_motion
from separatrix.discovery.policy import SEARCH
from separatrix.discovery.wording import Units

IMPACT_SPEED = "impact speed"
LOW, SINCE = "low speed", "time since the last impact"
SPEED, POSITION, PLANE, PHASE = "velocity", "position", "position and velocity", "drive phase"


@dataclass(frozen=True)
class Region:
    """Bins of one variable, or two, and the columns of a force in each."""

    name: str
    unit: str
    force_unit: str
    edges: np.ndarray
    other_edges: np.ndarray | None
    columns: np.ndarray


def regions_of_body(problem: Likelihood, fit: Fit, mass: float, units: Units) -> list[Region]:
    """Bins of the motion of one body, and of its impacts."""
    state = scaled_motion(problem, fit)
    x, v = fit.evaluation.x, fit.evaluation.v
    inside = problem.segments.inside & fit.good[:, None]
    maps = [
        *_times(problem, inside),
        _bins(POSITION, units.position, x, inside, 10),
        _bins(SPEED, units.velocity, v, inside, 10),
        _bins(LOW, units.velocity, np.where(np.abs(v) < 0.2 * state["speed"], v, np.nan), inside, 6),
    ]
    if state["phase"] is not None:
        maps.append(_bins(PHASE, "rad", np.mod(state["phase"], 2 * np.pi), inside, 12))
    since = after_impacts(problem, fit)
    if np.isfinite(since).any():
        maps.append(_bins(SINCE, "s", since, inside, 6))
    maps.append(_plane(x, v, inside, 5, units))
    maps = [one for one in maps if one is not None]
    columns = problem.force_columns(fit, np.concatenate([one[4] for one in maps], axis=2), mass)
    found = _with_columns(maps, columns, units.force)
    impacts = _impacts(problem, fit, units)
    if impacts is not None:
        found += _with_columns([impacts], problem.kick_columns(fit, impacts[4]), units.velocity)
    return found


def regions_of_joints(problem: Likelihood, fit: Fit) -> list[Region]:
    """Bins of extension and speed at every location of several bodies."""
    inside, n = problem.segments.inside & fit.good[:, None], problem.structure.n
    motion = fit.evaluation.motion
    found = []
    for location in problem.structure.locations:
        of_location = (
            (POSITION, "m", motion[:, :, :n] @ location.row),
            (SPEED, "m/s", motion[:, :, n:] @ location.row),
        )
        for name, unit, values in of_location:
            one = _bins(f"{name} of {location.name}", unit, values, inside, 8)
            if one is not None:
                found += _with_columns([one], columns_of(problem, fit, one[4], location.row), "N")
    return found


def _with_columns(maps: Sequence[tuple], columns: np.ndarray, force_unit: str) -> list[Region]:
    ends = np.cumsum([0, *(one[4].shape[2] for one in maps)])
    return [
        Region(name, unit, force_unit, edges, other, columns[:, :, a:b])
        for (name, unit, edges, other, _), a, b in zip(maps, ends[:-1], ends[1:], strict=True)
    ]


def _times(problem, inside: np.ndarray) -> list[tuple | None]:
    """Bins of time for each record by itself, as records may be of different days."""
    found = []
    count = max(4, 12 // len(problem.prepared))
    for number, prepared in enumerate(problem.prepared):
        rows = problem.segments.record == number
        seconds = np.zeros(inside.shape)
        seconds[rows] = prepared.samples.t[problem.segments.index[rows]] - prepared.record.t[0]
        name = "time" if len(problem.prepared) == 1 else f"time in {prepared.record.name}"
        found.append(_bins(name, "s", seconds, inside & rows[:, None], count))
    return found


def _bins(name: str, unit: str, values: np.ndarray, inside: np.ndarray, count: int) -> tuple | None:
    """Bins of equal numbers of samples."""
    usable = inside & np.isfinite(values)
    if usable.sum() < 10 * count:
        return None
    edges = np.unique(np.quantile(values[usable], np.linspace(0, 1, count + 1)))
    if edges.size < 3:
        return None
    index = np.clip(
        np.searchsorted(edges, np.where(usable, values, edges[0]), side="right") - 1, 0, edges.size - 2
    )
    member = ((index[:, :, None] == np.arange(edges.size - 1)) & usable[:, :, None]).astype(float)
    return name, unit, edges, None, member


def _plane(x: np.ndarray, v: np.ndarray, inside: np.ndarray, count: int, units: Units) -> tuple | None:
    one, other = _bins("", "", x, inside, count), _bins("", "", v, inside, count)
    if one is None or other is None:
        return None
    member = (one[4][:, :, :, None] * other[4][:, :, None, :]).reshape(*x.shape, -1)
    return PLANE, f"{units.position}, {units.velocity}", one[2], other[2], member


def _impacts(problem, fit, units: Units) -> tuple | None:
    """Bins of the speed before an impact, in which the speed after it is changed."""
    before, at = impacts_at(problem, fit)
    at = at * fit.good[:, None]
    hit = at != 0
    if hit.sum() < SEARCH.impacts_per_bin * SEARCH.impact_bins:
        return None
    edges = np.unique(np.quantile(before[hit], np.linspace(0, 1, SEARCH.impact_bins + 1)))
    if edges.size < 3:
        return None
    index = np.clip(np.searchsorted(edges, before, side="right") - 1, 0, edges.size - 2)
    member = (index[:, :, None] == np.arange(edges.size - 1)) * at[:, :, None]
    return IMPACT_SPEED, units.velocity, edges, None, member
