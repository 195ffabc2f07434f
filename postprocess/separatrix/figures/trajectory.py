# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One motion: its history in time and its phase portrait when it is steady."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.errors import SeparatrixError
from separatrix.figures import contact, energy, impacts, motor, pair, stroboscopic
from separatrix.figures.caption import caption_pieces, describe_case, resolved_case, version_text
from separatrix.figures.look import DEFAULT, UNITS, Look
from separatrix.figures.page import Figures, Page
from separatrix.given_up import given_up_text, left_text, reason_of
from separatrix.labels import axis_label, flag_text, plain, unit
from separatrix.open import flag_names

ZOOM_PERIODS = 5
_MOST_SAMPLES = 4000
_MOST_MARKERS = 150
# lines of the bodies beside the watched one, as many as can be distinguished
_OTHER_LINES = ("-", (0, (4, 2)), (0, (1, 1)), (0, (6, 2, 1, 2)))
# numbers among the attributes, and the variable whose unit each has
_NUMBERS = {
    "amplitude": "x", "x_max": "x", "x_min": "x", "barrier_upper": "x", "barrier_lower": "x", "turn": "x",
    "v_max": "v", "mean_impact_speed": "v", "drive_period": "time", "window": "time",
}  # fmt: skip
# these change the velocity at once
_JUMPS = {"impact_upper", "impact_lower", "chatter_upper", "chatter_lower"}


def figures(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figures:
    """Return the figures of a trajectory file by name; the section of a short motion on request alone."""
    look.require("trajectory", "units", "crank_angle", "transient")
    if result.sizes["time"] <= 1:
        raise SeparatrixError(f"found {result.sizes['time']} samples, a figure needs two or more")
    given, result = result, _in_units(result, look)
    seen = pair.relative_to_stop(result)
    two_bodies = "driver_x" in result
    caption = pair.caption(result, look) if two_bodies else _caption(result, look)
    made = {"history": partial(pair.history if two_bodies else time_history, result, title, look)}
    # files of earlier versions have no energies of one body
    if "kinetic_energy" in result:
        made["energy"] = partial(energy.decomposition, result, title, caption, look)
    if "motor_power" in result:
        made["crank"] = partial(motor.history, result, title, caption, look)
        made["turn"] = partial(motor.turn, result, title, caption, look)
        made["power"] = partial(motor.power, result, title, caption, look)
    if "contact_force" in result:
        made["contact"] = lambda: contact.loops(pair.relative_to_stop(given), title, look)
    if impacts.settled(seen).sum() >= impacts.FEWEST:
        made["impacts"] = partial(impacts.section, seen, title, look)
    made["phase"] = partial(phase_portrait, seen, title, look)
    periods = stroboscopic.periods(seen)
    section = {"section": partial(stroboscopic.section, seen, title, look)} if periods >= 1 else {}
    return Figures(made | section if periods >= stroboscopic.LONG else made, section)


def _in_units(result: xr.Dataset, look: Look) -> xr.Dataset:
    """Return a motion with its variables, and the numbers among its attributes, in the units asked for."""
    factors = {
        name: look.factor(str(result[of].attrs.get("units")))
        for name, of in _NUMBERS.items()
        if name in result.attrs
    }
    changed = look.selected(result)
    return changed.assign_attrs({name: result.attrs[name] * factor for name, factor in factors.items()})


def time_history(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the position during the whole run and, enlarged, during the last periods."""
    page = Page(look, (style.DOUBLE_COLUMN, 100.0), 2)
    whole, zoom = page.axes
    time, position = result["time"].values, result["x"].values
    whole.plot(*_envelope(time, position), color=style.MOTION, linewidth=0.7)
    end = _end(result, look)
    whole.set_xlim(time[0], end)
    start = max(time[0], end - ZOOM_PERIODS * float(result.attrs["drive_period"]))
    last = time >= start
    zoom.plot(time[last], position[last], color=style.MOTION)
    foot = {"color": "#555555", "linewidth": 0.7, "linestyle": (0, (4, 2))}
    driven = resolved_case(result).get("drive", {}).get("law") != "none" and "drive" in result
    if driven:
        zoom.plot(time[last], result["drive"].values[last], **foot)
    others = other_bodies(result)
    for style_of_line, name in zip(_OTHER_LINES, others, strict=False):
        zoom.plot(
            time[last],
            result[f"{name}_x"].values[last],
            color="#555555",
            linewidth=0.7,
            linestyle=style_of_line,
        )
    zoom.set_xlim(start, end)
    marked = False
    page.letter()
    for ax in (whole, zoom):
        _draw_barriers(ax.axhline, result)
        marked |= _mark_impacts(ax, result)
        ax.set_xlabel(axis_label(result["time"]))
        ax.set_ylabel(axis_label(result["x"]))
    handles = [
        Line2D([], [], color=style.MOTION, label=watched_body(result)),
        *[
            Line2D([], [], color="#555555", linewidth=0.7, linestyle=style_of_line, label=name)
            for style_of_line, name in zip(_OTHER_LINES, others, strict=False)
        ],
        *([Line2D([], [], **foot, label="foot of the spring $x_A$")] if driven else []),
        *_barrier_handle(result),
    ]
    if marked:
        handles.append(
            Line2D([], [], linestyle="", marker="v", markersize=2.5, color=style.IMPACT, label="impact")
        )
    caption = [f"b) the last {_zoom_text(result, end - start)}", *_caption(result, look)]
    return page.finish(title, caption, handles, columns=4)


def _zoom_text(result: xr.Dataset, length: float) -> str:
    """Return how long the enlarged part is: in drive periods where it holds as many as it should."""
    whole = length >= (1 - 1e-9) * ZOOM_PERIODS * float(result.attrs["drive_period"])
    if result.attrs.get("driven", 1) and whole:
        return f"{ZOOM_PERIODS} drive periods"
    return f"{length:.4g} {unit(result['time'])}"


def other_bodies(result: xr.Dataset) -> list[str]:
    """Return the names of the bodies beside the watched one; empty unless there are several."""
    case = resolved_case(result)
    names = [name for name, one in case.get("body", {}).items() if isinstance(one, dict)]
    return [name for name in names if f"{name}_x" in result and name != watched_body(result)]


def watched_body(result: xr.Dataset) -> str:
    """Return the name of the body that x and v belong to; 'body' where there is one."""
    return resolved_case(result).get("watch", {}).get("body", "body")


def _end(result: xr.Dataset, look: Look) -> float:
    """Return the last time, or the duration of the case if that is at most a sample away: it has a tick."""
    time = result["time"].values
    run = resolved_case(result).get("run", {})
    duration = run["duration"] * look.factor("s") if "duration" in run else time[-1]
    return float(duration if time.size > 1 and abs(duration - time[-1]) <= time[1] - time[0] else time[-1])


def phase_portrait(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return velocity against position during the last `window` seconds, impacts as jumps.

    A body that stands still then is shown from its start.
    """
    page = Page(look, (style.SINGLE_COLUMN, 68.0))
    (ax,) = page.axes
    window = float(result.attrs["window"])
    start = float(result["time"].values[-1]) - window
    window_text = f"last {window:g} {unit(result['time'])}"
    if not np.ptp(result["x"].values[result["time"].values >= start]) > 0:
        start, window_text = float(result["time"].values[0]), "from the start to rest"
    position, velocity, jumps = steady_path(result, start)
    if "turn" in result.attrs:
        position, velocity = on_circle(position, velocity, float(result.attrs["turn"]))
    ax.plot(position, velocity, color=style.MOTION, linewidth=0.8)
    for x, before, after in jumps[-_MOST_MARKERS:]:
        ax.plot([x, x], [before, after], color=style.IMPACT, linewidth=0.8)
    _draw_barriers(ax.axvline, result, linewidth=2.2)
    ax.locator_params(axis="x", nbins=6)
    ax.set_xlabel(axis_label(result["x"]))
    ax.set_ylabel(axis_label(result["v"]))
    handles = [Line2D([], [], color=style.MOTION, linewidth=0.8, label="motion"), *_barrier_handle(result)]
    if jumps:
        handles.append(Line2D([], [], color=style.IMPACT, linewidth=0.8, label="impact"))
    return page.finish(title, [window_text, *_caption(result, look)], handles, columns=3)


def steady_path(result: xr.Dataset, start: float) -> tuple[np.ndarray, np.ndarray, list[tuple]]:
    """Return position and velocity from a time on, and the impacts as (x, v before, v after).

    The path reaches each impact with the velocity before it, is broken by a NaN, and goes on with the
    velocity after it.
    """
    time, position, velocity = (result[name].values for name in ("time", "x", "v"))
    steady = time >= start
    hits = _impacts(result)
    hits = hits[result["event_time"].values[hits] >= start]
    event_time, event_x = result["event_time"].values[hits], result["event_x"].values[hits]
    before, after = result["event_v_before"].values[hits], result["event_v_after"].values[hits]
    # a sample at the instant of an impact may hold either velocity: the event has both
    steady &= ~np.isin(np.arange(time.size), _at_instants(time, event_time))
    where = np.searchsorted(time[steady], event_time)
    gap = np.full(hits.size, np.nan)
    slots = np.repeat(where, 3)
    path_x = np.insert(position[steady], slots, np.stack([event_x, gap, event_x], axis=1).ravel())
    path_v = np.insert(velocity[steady], slots, np.stack([before, gap, after], axis=1).ravel())
    return path_x, path_v, list(zip(event_x, before, after, strict=True))


def on_circle(position: np.ndarray, velocity: np.ndarray, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a path of an angle within half a turn of zero, broken by a NaN where it leaves one side."""
    turns = np.floor(position / turn + 0.5)
    jumps = np.flatnonzero(np.diff(turns) != 0) + 1
    return np.insert(position - turn * turns, jumps, np.nan), np.insert(velocity, jumps, np.nan)


def _at_instants(time: np.ndarray, instants: np.ndarray) -> np.ndarray:
    """Positions of the samples that fall on an instant, but for rounding."""
    tolerance = 1e-12 * max(1.0, float(np.abs(time).max()))
    first = np.searchsorted(time, instants - tolerance)
    last = np.searchsorted(time, instants + tolerance, side="right")
    return np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)] or [np.zeros(0, int)])


def _impacts(result: xr.Dataset) -> np.ndarray:
    """Positions of the impacts among the events."""
    codes = [code for code, name in flag_names(result["event_kind"]).items() if name in _JUMPS]
    return np.flatnonzero(np.isin(result["event_kind"].values, codes))


def _mark_impacts(ax: Axes, result: xr.Dataset) -> bool:
    """Mark the impacts in view, unless they are so many that the marks hide the motion."""
    low, high = ax.get_xlim()
    hits = _impacts(result)
    times = result["event_time"].values[hits]
    hits = hits[(times >= low) & (times <= high)]
    if not 0 < hits.size <= _MOST_MARKERS:
        return False
    ax.plot(
        result["event_time"].values[hits],
        result["event_x"].values[hits],
        linestyle="",
        marker="v",
        markersize=2.5,
        color=style.IMPACT,
        zorder=4,
    )
    return True


def _envelope(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return fewer samples with the same extremes: the smallest and the largest one of each interval."""
    if time.size <= _MOST_SAMPLES:
        return time, values
    starts = np.linspace(0, time.size, _MOST_SAMPLES // 2 + 1).astype(int)
    kept = [
        sorted((first + int(values[first:last].argmin()), first + int(values[first:last].argmax())))
        for first, last in pairwise(starts)
    ]
    index = np.unique([0, *np.ravel(kept), time.size - 1])
    return time[index], values[index]


def _draw_barriers(draw: Callable, result: xr.Dataset, linewidth: float = 1.2) -> None:
    for key in ("barrier_upper", "barrier_lower"):
        if key in result.attrs:
            draw(float(result.attrs[key]), color=style.BARRIER, linewidth=linewidth, zorder=1)


def _barrier_handle(result: xr.Dataset) -> list[Line2D]:
    if not {"barrier_upper", "barrier_lower"} & set(result.attrs):
        return []
    return [Line2D([], [], color=style.BARRIER, linewidth=1.2, label="barrier")]


def _caption(result: xr.Dataset, look: Look) -> list[str]:
    attributes = result.attrs
    pieces = caption_pieces(result, look, describe_case(result))
    domain = resolved_case(result).get("run", {}).get("domain", np.inf) * _factor(result["x"], look)
    ending = given_up_text(result) if reason_of(result) else left_text(result, domain)
    if ending:
        return [*pieces, _start_text(result, look), ending, plain(version_text(result))]
    pieces += [_start_text(result, look), f"steady motion: {_regime_text(attributes['regime'])}"]
    pieces.append(f"amplitude {attributes['amplitude']:.4g} {unit(result['x'])}")
    pieces.append(rf"$v_\mathrm{{max}}$ = {attributes['v_max']:.4g} {unit(result['v'])}")
    if attributes.get("rotation_number"):
        pieces.append(f"{attributes['rotation_number']:.4g} turns per period")
    if attributes["impacts_per_period"] > 0:
        rate = f"impacts per drive period {attributes['impacts_per_period']:.4g}"
        if not attributes.get("driven", 1):
            windows = attributes["window"] / attributes["drive_period"]
            impacts = attributes.get("impacts", round(attributes["impacts_per_period"] * windows))
            several = "impact" if impacts == 1 else "impacts"
            rate = f"{impacts} {several} in {attributes['window']:.4g} {unit(result['time'])}"
        pieces.append(f"{rate}, their mean speed {attributes['mean_impact_speed']:.4g} {unit(result['v'])}")
    return [*pieces, plain(version_text(result))]


def _factor(variable: xr.DataArray, look: Look) -> float:
    """By what SI values are multiplied to be in the unit of a variable that is in the units asked for."""
    return look.factor(next((UNITS[one][0] for one in look.units if one == unit(variable)), unit(variable)))


def _start_text(result: xr.Dataset, look: Look) -> str:
    # the first sample is the start but for rounding
    start = resolved_case(result).get("start", {})
    texts = []
    for name in ("x", "v"):
        value = (
            start[f"{name}0"] * _factor(result[name], look)
            if f"{name}0" in start
            else float(result[name].values[0])
        )
        texts.append(f"${name}_0$ = {value:g} {unit(result[name])}")
    return ", ".join(texts)


def _regime_text(regime: object) -> str:
    """The regime is an attribute here, by code or by name."""
    return flag_text(tuple(style.REGIMES)[regime] if isinstance(regime, int) else str(regime))
