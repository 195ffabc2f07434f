# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results whose motions were given up: code 78, as the program ends where it makes one."""

from pathlib import Path

import numpy as np
import xarray as xr

from separatrix.errors import GIVEN_UP, SeparatrixError
from separatrix.labels import unit
from separatrix.variables import REASONS

GIVEN_UP_REASONS = ("not_finite", "event_budget", "step_failed", "step_budget", "mode_cycle")
_CODES = [REASONS.index(name) for name in GIVEN_UP_REASONS]


def reason_of(result: xr.Dataset) -> str:
    """Why the motion of a trajectory was given up; '' if it was not, and of other results."""
    reason = str(result.attrs.get("reason", ""))
    return reason if result.attrs.get("kind") == "trajectory" and reason in GIVEN_UP_REASONS else ""


def given_up_text(result: xr.Dataset) -> str:
    """Text of a caption for a motion that was given up."""
    time = result["time"].values
    after = f"{time[-1] if time.size else 0.0:.6g} {unit(result['time'])}"
    return f"given up after {after}: {reason_of(result).replace('_', ' ')}"


def left_text(result: xr.Dataset, domain: float) -> str:
    """Text of a caption for a motion that left the domain |x| <= `domain`; else ''."""
    if result.attrs.get("kind") != "trajectory" or result.attrs.get("reason") != "left_domain":
        return ""
    time = result["time"].values
    inside = np.flatnonzero(np.abs(result["x"].values) <= domain)
    first = min(inside[-1] + 1 if inside.size else 0, time.size - 1)
    return f"left the domain after {time[first]:.6g} {unit(result['time'])}"


def all_given_up(result: xr.Dataset) -> int:
    """How many points a result has if the motions of all were given up; 0 if one was not."""
    found = [result[name].values for name in ("reason", "branch_reason") if name in result]
    lost = all(np.isin(values, _CODES).all() for values in found)
    return sum(values.size for values in found) if lost else 0


def refuse(path: Path, result: xr.Dataset) -> None:
    """Raise a SeparatrixError of code 78 where every motion of a result was given up."""
    reason = reason_of(result)
    if reason:
        raise SeparatrixError(
            f"{path}: the motion was given up: {reason} (--partial: as far as it went)", GIVEN_UP
        )
    points = all_given_up(result)
    if points:
        raise SeparatrixError(
            f"{path}: the motions of all {points} points were given up (--partial: no error)", GIVEN_UP
        )
