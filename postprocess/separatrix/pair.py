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
from separatrix.case import describe_case, resolved_case, version_text
from separatrix.labels import axis_label, flag_text, plain
from separatrix.layout import compose
from separatrix.open import flag_names

DRIVER = "#555555"
# light enough that lines are seen on them; slip is left white
BANDS = {"stick": "#E3E3E3", "upper_barrier": "#C9E4DA", "lower_barrier": "#E6DCC4", "held": "#D6D3EA"}


def history(result: xr.Dataset, title: str) -> Figure:
    """Return both positions over time, and their difference, with the modes shaded.

    Where the stop is fixed to the ground the second panel is the distance from it.
    """
    figure = style.new_figure(style.DOUBLE_COLUMN, 100.0)
    both, apart = figure.subplots(2, 1, sharex=True)
    time, driven, driver = (result[name].values for name in ("time", "x", "driver_x"))
    both.plot(time, driver, color=DRIVER, linewidth=0.8, linestyle=(0, (4, 2)))
    both.plot(time, driven, color=style.MOTION)
    both.set_ylabel(axis_label(result["x"]))
    name, distance = _distance(result)
    apart.plot(time, distance, color=style.MOTION)
    apart.set_ylabel(f"{name} (m)")
    apart.set_xlabel(axis_label(result["time"]))
    both.set_xlim(time[0], time[-1])
    shaded = set()
    for letter, ax in zip("ab", (both, apart), strict=True):
        shaded |= shade_modes(ax, result)
        ax.set_title(f"{letter})", loc="left")
    handles = [
        Line2D([], [], color=style.MOTION, label="driven body"),
        Line2D([], [], color=DRIVER, linewidth=0.8, linestyle=(0, (4, 2)), label="driving body"),
        *(Patch(color=BANDS[mode], label=flag_text(mode)) for mode in BANDS if mode in shaded),
    ]
    compose(figure, title, caption(result), handles, columns=len(handles))
    return figure


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


def _distance(result: xr.Dataset) -> tuple[str, np.ndarray]:
    """Distance from the stop on the ground, or between the bodies."""
    body = resolved_case(result).get("body", {})
    if body.get("law") == "friction_pair":
        for name in ("upper", "lower"):
            if f"barrier_{name}" in result.attrs:
                place = float(result.attrs[f"barrier_{name}"])
                return "distance from the stop $|X - x_2|$", np.abs(place - result["x"].values)
    return "$x_2 - x_1$", result["x"].values - result["driver_x"].values


def caption(result: xr.Dataset) -> list[str]:
    """Return the bodies, their regime, and the version of the program."""
    return [
        *describe_case(result),
        f"regime: {flag_text(str(result.attrs['regime']))}",
        plain(version_text(result)),
    ]
