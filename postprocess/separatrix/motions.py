# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`trajectory`: one motion with all its events, computed in this process."""

import tempfile
from pathlib import Path

import numpy as np
import xarray as xr

from separatrix import simulate
from separatrix.cases import Case, as_case, number
from separatrix.errors import USAGE, GivenUpError, SeparatrixError
from separatrix.figures.parts import several_bodies
from separatrix.given_up import reason_of
from separatrix.maps import kept_in_memory
from separatrix.open import open_result
from separatrix.progress import Progress
from separatrix.runner import run_at_once
from separatrix.variables import (
    EVENTS,
    FORMAT_VERSION,
    KINDS,
    REASONS,
    REGIMES,
    SAMPLES,
    attributes,
)
from separatrix.version import __version__

_BOOK = (
    "energy_start", "energy_end", "energy_lost_to_friction", "energy_lost_to_damping",
    "energy_lost_to_contacts", "energy_put_in", "energy_closing_error",
)  # fmt: skip
_STEADY = ("amplitude", "x_max", "x_min", "v_max", "impacts_per_period", "mean_impact_speed")
_HUGE = 1e308


def trajectory(
    case: Case | str | Path,
    x0: float | str | None = None,
    v0: float | str | None = None,
    crank_angle: float | str | None = None,
    *,
    duration: float | str | None = None,
    samples: int | None = None,
    partial: bool = False,
) -> xr.Dataset:
    """Return one motion, equidistant samples and every event, as a file of `separatrix trajectory` has it.

    Of several bodies it has the variables `NAME_x` and `NAME_v` of each.
    A motion that had to be given up is a GivenUpError, whose `result` is the dataset as far as it went.

    Parameters
    ----------
    case
        The machine, as a Case or the file of one.
    x0, v0, crank_angle
        The start: numbers [m, m/s, rad] or texts with a unit ("-3 mm"); what is not given is that of the
        case.
    duration
        Seconds, or a text with a unit; that of the case if not given.
    samples
        Samples per drive period, two or more; those of the case if not given.
    partial
        Return a motion that was given up as far as it went; its attribute `reason` is the cause.

    Examples
    --------
    >>> motion = sx.trajectory("examples/basin_coulomb.toml", x0="400 mm", v0=0, duration=10)
    >>> int((sx.decode_flags(motion["event_kind"]) == "impact_upper").sum())
    17
    """
    case = as_case(case)
    if isinstance(duration, str):
        # The window of the case may be longer.
        duration = case.with_({"run": {}}).in_si("run.duration", duration)
    if duration is not None and not 0 < number("duration", duration) < np.inf:
        raise SeparatrixError(f"duration: found {duration}, allowed more than 0", USAGE)
    if samples is not None and not number("samples", samples) >= 2:
        raise SeparatrixError(f"samples: found {samples}, allowed 2 or more", USAGE)
    start = case.start(x0=x0, v0=v0, crank_angle=crank_angle)
    asked = {f"start.{name}": value for name, value in start.items()}
    if duration is not None:
        window = min(float(case.resolved["run"]["window"]), duration)
        asked |= {"run.duration": float(duration), "run.window": window}
    if samples is not None:
        asked["trajectory.samples_per_period"] = int(samples)
    changed = case.with_(asked)
    result, given_up = (_of_program if _has_more(changed.resolved) else _of_library)(changed)
    if given_up and not partial:
        message = f"{given_up} after {float(result.time[-1]) if result.time.size else 0.0:.6g} s"
        raise GivenUpError(f"{message} (partial=True returns it as far as it went)", result)
    return result


def _has_more(resolved: dict) -> bool:
    """Whether a motion has more than the samples of one body: other bodies, a crank, derived quantities."""
    return several_bodies(resolved) or "motor" in resolved or "derived" in resolved


def _of_library(case: Case) -> tuple[xr.Dataset, str]:
    """The motion of a case, and why it was given up."""
    start, given_up = case.resolved["start"], ""
    try:
        motion = simulate.trajectory(case.model, (start["x0"], start["v0"], start["crank_angle"]))
    except GivenUpError as error:
        given_up, motion = str(error), error.result
    return _dataset(case, motion, _cycle(case, motion.summary)), given_up


def _of_program(case: Case) -> tuple[xr.Dataset, str]:
    """The same by the program, which alone has every body and joint."""
    with tempfile.TemporaryDirectory(prefix="separatrix-") as folder, Progress(False) as report:
        named, path = case.on_command_line(Path(folder)), Path(folder) / "motion.h5"
        command = ["trajectory", *named, "-o", str(path), "--partial", "--json"]
        run_at_once(command, report, rename={named[0]: case.name})
        with open_result(path) as file:
            result = kept_in_memory(file)
    reason = reason_of(result)
    return result, f"the motion was given up: {reason}" if reason else ""


def _cycle(case: Case, summary: dict[str, float]) -> dict[str, float] | None:
    """The cycle that a motion has come to by its end, as the program looks for it; None if there is none."""
    run, start = case.resolved["run"], case.resolved["start"]
    if run.get("average") != "whole_periods" or REASONS[int(summary["trajectory_reason"])] != "time_over":
        return None
    if run["duration"] < summary["drive_period"]:
        return None
    starts = np.array([[start["x0"], start["v0"], start["crank_angle"]]])
    catalogue = simulate.Catalogue(case.model).search(starts)
    label = catalogue.labels(starts)
    found = [one.numbers for one in catalogue.attractors if one.numbers["attractor"] == label["attractor"][0]]
    if not found or not label["settle_time"][0] <= run["duration"]:
        return None
    return found[0] if KINDS[found[0]["kind"] - 1] == "cycle" else None


def _dataset(case: Case, motion: simulate.Motion, cycle: dict[str, float] | None) -> xr.Dataset:
    summary = motion.summary
    two_bodies = bool(summary["two_bodies"])
    columns = dict(motion.samples)
    columns["potential_energy"] = columns["energy"] - columns["kinetic_energy"]
    if not two_bodies:
        columns["drive"] = columns.pop("driver_x")
        del columns["driver_v"]
    if not summary["soft"]:
        del columns["contact_force"]
    time = columns.pop("time")
    columns["mode"] = columns["mode"].astype(np.int8)
    events = dict(motion.events)
    events["kind"] = events["kind"].astype(np.int8)
    if not two_bodies:
        del events["driver_x"], events["driver_v"]
    angle = bool(summary["position_is_angle"])
    data = {
        name: ("time", columns[name], attributes(row, angle))
        for name, row in SAMPLES.items()
        if name in columns
    }
    data |= {
        f"event_{name}": ("event", events[name], attributes(EVENTS[name], angle))
        for name in EVENTS
        if name in events
    }
    return xr.Dataset(
        data, {"time": ("time", time, attributes(SAMPLES["time"]))}, _about(case, summary, cycle)
    )


def _window(run: dict, period: float) -> float:
    """The window, of whole drive periods unless it is asked for as it is."""
    if run.get("average") != "whole_periods" or run["duration"] < period:
        return float(run["window"])
    return min(max(1.0, np.floor(run["window"] / period + 0.5)), np.floor(run["duration"] / period)) * period


def _about(case: Case, summary: dict[str, float], cycle: dict[str, float] | None) -> dict[str, object]:
    resolved = case.resolved
    steady = cycle or summary
    # several bodies may have no drive at all
    ratio = float(resolved.get("drive", {}).get("ratio", 0.0))
    about: dict[str, object] = {
        "format": "separatrix", "format_version": FORMAT_VERSION, "kind": "trajectory", "complete": 1,
        "title": case.title, "source": f"Separatrix {__version__}", "resolved_case": case.to_toml(),
        "drive_period": summary["drive_period"], "driven": int(summary["driven"]), "drive_ratio": ratio,
        "window": _window(resolved["run"], summary["drive_period"]),
        "period": int(cycle["period"]) if cycle else 0, "reason": REASONS[int(summary["trajectory_reason"])],
        "regime": REGIMES[int(steady["regime"])],
    }  # fmt: skip
    if cycle and cycle["cycle_time"] > 0:
        about["cycle_time"] = cycle["cycle_time"]
    about |= {name: steady[name] for name in _STEADY}
    about |= {name: summary[name] for name in _BOOK if np.isfinite(summary[name])}
    for name in ("barrier_upper", "barrier_lower"):
        if abs(summary[name]) < _HUGE:
            about[name] = summary[name]
    return about
