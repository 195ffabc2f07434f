# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`section`: the stroboscopic or event section of one motion."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from separatrix.cases import Case, as_case, number
from separatrix.errors import USAGE, SeparatrixError
from separatrix.motions import trajectory
from separatrix.open import flag_names

__all__ = ["section"]

_CIRCLE = 2 * np.pi
# of a drive period, up to which a sample is at a phase
_AT_PHASE = 1e-6
_OF_MOTION = (
    "format", "format_version", "title", "source", "resolved_case", "drive_period", "driven", "drive_ratio",
    "barrier_upper", "barrier_lower", "turn", "reason",
)  # fmt: skip
_EVENT = "event_"
# samples per drive period
_FINEST = 720


def section(
    case: Case | str | Path,
    x0: float | str | None = None,
    v0: float | str | None = None,
    crank_angle: float | str | None = None,
    *,
    at: float | str = 0.0,
    event: str | Sequence[str] | None = None,
    periods: int = 500,
    transient: int = 100,
) -> xr.Dataset:
    """Return the section of one motion: a point in each drive period, or one at each event of a kind.

    A stroboscopic section has the variables `x` and `v` over `time`; of several bodies also `NAME_x` and
    `NAME_v`. An event section has `kind`, `x`, `v_before` and `v_after` over `time`; with a drive also its
    `phase` [rad], from 0 to 2 pi. Units are SI. `.separatrix.plot()` draws it.
    A motion that was given up is a GivenUpError.

    Parameters
    ----------
    case, x0, v0, crank_angle
        The machine and the start, as for `trajectory`.
    at
        Crank angle of the stroboscopic section, in rad or as a text ("45 deg"): a part n/N of a turn with N
        up to 720.
    event
        Kind of the events, or several: "impact_upper", "turning_point", "stick", "release", ...
    periods
        Drive periods after the transient, 1 or more. Without a drive, units of time `drive_period`.
    transient
        Drive periods that are discarded first.

    Examples
    --------
    >>> points = sx.section("examples/basin_coulomb.toml", x0=0.4, v0=0, periods=20, transient=50)
    >>> points.sizes["time"], round(float(points["x"].std()), 9)
    (20, 0.0)
    >>> impacts = sx.section("examples/basin_coulomb.toml", x0=0.4, v0=0, event="impact_upper", periods=20)
    >>> round(float(impacts["v_before"][-1]), 3)
    3.876
    """
    for name, value, least in (("periods", periods, 1), ("transient", transient, 0)):
        if number(name, value) < least or value != int(value):
            raise SeparatrixError(f"{name}: found {value}, allowed whole numbers from {least}", USAGE)
    # the section needs no search for the cycle that the motion comes to
    case = as_case(case).with_({"run.average": "window"})
    start = case.start(x0=x0, v0=v0, crank_angle=crank_angle)
    if event is None:
        return _stroboscopic(case, start, at, int(periods), int(transient))
    kinds = (event,) if isinstance(event, str) else tuple(event)
    return _of_events(case, start, kinds, int(periods), int(transient))


def _stroboscopic(case: Case, start: dict, at: float | str, periods: int, transient: int) -> xr.Dataset:
    period = _drive_period(case)
    if "motor" in case.resolved:
        raise SeparatrixError("section: turns of a motor last no equal times; event=... is allowed", USAGE)
    angle = case.in_si("start.crank_angle", at) % _CIRCLE
    samples = _samples(angle)
    # a little longer, so that the last point is not the end, which is a sample at any phase
    motion = trajectory(case, **start, duration=(transient + periods + 0.25) * period, samples=samples)
    if not motion.attrs["driven"]:
        raise SeparatrixError("section: the machine has no drive; event=... is allowed", USAGE)
    turns = motion["time"].values / period
    away = turns + (start["crank_angle"] - angle) / _CIRCLE
    near = np.flatnonzero((np.abs(away - np.rint(away)) < _AT_PHASE) & (turns > transient - _AT_PHASE))
    chosen = near[np.unique(np.rint(away[near]), return_index=True)[1]][:periods]
    if chosen.size < periods:
        raise SeparatrixError(f"section: the motion ended after {chosen.size} points ({motion.reason})")
    names = [name for name in motion.data_vars if re.fullmatch("(?!event_)(.+_)?[xv]", str(name))]
    found = motion[names].isel(time=chosen)
    return _finished(found, motion, {"section": "stroboscopic", "section_angle": angle}, transient)


def _samples(angle: float) -> int:
    """The least number of samples per drive period that has one at an angle; the first is at 0."""
    for samples in range(2, _FINEST + 1):
        steps = angle * samples / _CIRCLE
        if abs(steps - round(steps)) < _AT_PHASE:
            return samples
    raise SeparatrixError(
        f"at: found {angle:.6g} rad, allowed parts n/N of a turn with N up to {_FINEST}", USAGE
    )


def _of_events(case: Case, start: dict, kinds: tuple[str, ...], periods: int, transient: int) -> xr.Dataset:
    period = _drive_period(case)
    motion = trajectory(case, **start, duration=(transient + periods) * period, samples=2)
    names = flag_names(motion["event_kind"])
    for kind in kinds:
        if kind not in names.values():
            raise SeparatrixError(f"event: found '{kind}', allowed {', '.join(names.values())}", USAGE)
    wanted = [code for code, name in names.items() if name in kinds]
    times = motion["event_time"].values
    chosen = np.isin(motion["event_kind"].values, wanted) & (times >= transient * period)
    data = {
        str(name).removeprefix(_EVENT): ("time", variable.values[chosen], variable.attrs)
        for name, variable in motion.data_vars.items()
        if str(name).startswith(_EVENT) and name != "event_time"
    }
    if motion.attrs["driven"] and "motor" not in case.resolved:
        phase = (start["crank_angle"] + _CIRCLE * times[chosen] / period) % _CIRCLE
        data["phase"] = ("time", phase, {"units": "rad", "long_name": "phase of the drive"})
    found = xr.Dataset(data, {"time": ("time", times[chosen], motion["event_time"].attrs)})
    return _finished(found, motion, {"section": "events", "section_events": " ".join(kinds)}, transient)


def _drive_period(case: Case) -> float:
    return _CIRCLE / case.model.drive_frequency({})


def _finished(found: xr.Dataset, motion: xr.Dataset, about: dict, transient: int) -> xr.Dataset:
    kept = {name: motion.attrs[name] for name in _OF_MOTION if name in motion.attrs}
    about = {**kept, "kind": "section", "transient": transient, **about}
    return found.drop_attrs(deep=False).assign_attrs(about)
