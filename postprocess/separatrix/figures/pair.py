# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion of two bodies coupled by dry friction: positions with modes shaded."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from separatrix import style
from separatrix.figures.caption import caption_pieces, describe_case, resolved_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Page
from separatrix.given_up import given_up_text, left_text, reason_of
from separatrix.labels import axis_label, flag_text, plain, unit
from separatrix.open import flag_names

DRIVER = "#555555"
# light enough that lines are seen on them; slip is left white
BANDS = {"stick": "#E3E3E3", "upper_barrier": "#C9E4DA", "lower_barrier": "#E6DCC4", "held": "#D6D3EA"}


def history(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return both positions over time, and their difference, with the modes shaded.

    Where the stop is fixed to the ground the second panel is the distance from it.
    """
    page = Page(look, (style.DOUBLE_COLUMN, 100.0), 2, sharex=True)
    both, apart = page.axes
    time, driven, driver = (result[name].values for name in ("time", "x", "driver_x"))
    both.plot(time, driver, color=DRIVER, linewidth=0.8, linestyle=(0, (4, 2)))
    both.plot(time, driven, color=style.MOTION)
    both.set_ylabel(axis_label(result["x"]))
    name, distance, stops = _distance(result)
    apart.plot(time, distance, color=style.MOTION)
    apart.set_ylabel(f"{name} ({unit(result['x'])})")
    grounded = [] if carried_stop(result) else stops_of(result)
    for ax, levels in ((both, grounded), (apart, stops)):
        for level in levels:
            ax.axhline(level, color=style.BARRIER, linewidth=1.2, zorder=1)
    apart.set_xlabel(axis_label(result["time"]))
    shaded = set()
    for ax in page.axes:
        ax.set_xlim(time[0], time[-1])
        shaded |= shade_modes(ax, result)
    page.letter()
    handles = [
        Line2D([], [], color=style.MOTION, label="driven body"),
        Line2D([], [], color=DRIVER, linewidth=0.8, linestyle=(0, (4, 2)), label="driving body"),
        *([Line2D([], [], color=style.BARRIER, linewidth=1.2, label="barrier")] if stops_of(result) else []),
        *(Patch(color=BANDS[mode], label=flag_text(mode)) for mode in BANDS if mode in shaded),
    ]
    return page.finish(title, caption(result, look), handles, columns=min(len(handles), 5))


def shade_modes(ax: Axes, result: xr.Dataset) -> set[str]:
    """Shade the samples of every mode but slip and return the modes seen."""
    names = flag_names(result["mode"])
    time, mode = result["time"].values, result["mode"].values
    edges = np.flatnonzero(np.diff(mode)) + 1
    seen = set()
    for first, last in zip([0, *edges], [*edges, mode.size - 1], strict=True):
        name = names[int(mode[first])]
        if name not in BANDS or last <= first:
            continue
        ax.axvspan(time[first], time[last], color=BANDS[name], linewidth=0, zorder=0)
        seen.add(name)
    return seen


def _distance(result: xr.Dataset) -> tuple[str, np.ndarray, list[float]]:
    """Distance from the stop on the ground, or between the bodies, and where the stops are in it."""
    stops = stops_of(result)
    if stops and not carried_stop(result):
        return "distance from\nthe stop $|X - x_2|$", np.abs(stops[0] - result["x"].values), [0.0]
    return "$x_2 - x_1$", result["x"].values - result["driver_x"].values, stops


def stops_of(result: xr.Dataset) -> list[float]:
    """Return the positions of the stops, of a driving body that carries them relative to it."""
    names = ("barrier_upper", "barrier_lower")
    return [float(result.attrs[name]) for name in names if name in result.attrs]


def carried_stop(result: xr.Dataset) -> bool:
    """Whether the file is of two bodies and the driving one carries the stops."""
    return "driver_x" in result and resolved_case(result).get("body", {}).get("law") == "backlash_pair"


def relative_to_stop(result: xr.Dataset) -> xr.Dataset:
    """Return a trajectory with x and v, also of its events, in the coordinate that its barriers bound.

    This is x2 - x1 where the driving body carries them; nothing changes where they are fixed to the ground.
    """
    if not carried_stop(result):
        return result
    case = resolved_case(result)
    # a body whose motion is given does not feel an impact, otherwise the momentum of both stays
    share = case["body"]["driven_mass"] / case["body"]["mass"]
    if case.get("drive", {}).get("law") in ("velocity", "sine"):
        share = 0.0
    before, after = result["event_v_before"], result["event_v_after"]
    driver_after = result["event_driver_v"] - share * (after - before)
    seen = result.copy()
    for name, values in (
        ("x", result["x"] - result["driver_x"]),
        ("v", result["v"] - result["driver_v"]),
        ("event_x", result["event_x"] - result["event_driver_x"]),
        ("event_v_before", before - result["event_driver_v"]),
        ("event_v_after", after - driver_after),
    ):
        seen[name] = values.assign_attrs(result[name].attrs)
    seen["x"].attrs["label"] = "relative position $x_2 - x_1$"
    seen["v"].attrs["label"] = "relative velocity $v_2 - v_1$"
    return seen


def caption(result: xr.Dataset, look: Look) -> list[str]:
    """Return the bodies, their regime, and the version of the program."""
    return [
        *caption_pieces(result, look, describe_case(result)),
        _ending(result),
        plain(version_text(result)),
    ]


def _ending(result: xr.Dataset) -> str:
    """Return the regime, or why there is none."""
    if reason_of(result):
        return given_up_text(result)
    return left_text(result, np.inf) or f"regime: {flag_text(str(result.attrs['regime']))}"
