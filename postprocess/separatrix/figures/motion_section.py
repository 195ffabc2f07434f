# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The section of one motion: position and velocity at a crank angle, or the events of a kind."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.errors import SeparatrixError
from separatrix.figures.caption import caption_pieces, describe_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Figures, Page
from separatrix.labels import axis_label, count_text, flag_text, plain, unit
from separatrix.open import flag_names

_RASTER = 5000
# black, blue, vermillion and bluish green differ in grey, and by their markers
_KINDS = (("#000000", "o"), (style.OKABE_ITO[5], "s"), (style.OKABE_ITO[0], "^"), (style.OKABE_ITO[2], "D"))
_ALMOST = 0.02  # of a motion that is constant, the part of its size that its axis shows


def figures(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figures:
    """Return the figure of a section by name."""
    look.require("section", "units")
    if result.sizes["time"] == 0:
        raise SeparatrixError("section: the motion has no such event after the transient")
    kind = _stroboscopic if result.attrs["section"] == "stroboscopic" else _events
    return Figures({"section": lambda: kind(look.selected(result), title, look)})


def _stroboscopic(result: xr.Dataset, title: str, look: Look) -> Figure:
    page = Page(look, (style.SINGLE_COLUMN, 68.0))
    (ax,) = page.axes
    position, velocity = result["x"].values, result["v"].values
    if "turn" in result.attrs:
        turn = float(result.attrs["turn"]) * look.factor("rad")
        position = (position + turn / 2) % turn - turn / 2
    _points(ax, position, velocity, style.MOTION, "o")
    ax.set_xlabel(axis_label(result["x"]))
    ax.set_ylabel(axis_label(result["v"]))
    _widen(ax, position, velocity)
    angle = float(result.attrs["section_angle"])
    what = f"{count_text(position.size)} points, one in each drive period at crank angle {angle:.4g} rad"
    return page.finish(title, _caption(result, look, what))


def _events(result: xr.Dataset, title: str, look: Look) -> Figure:
    """Speed over the phase of the drive, or over the position of what has no phase or no speed."""
    page = Page(look, (style.SINGLE_COLUMN, 68.0))
    (ax,) = page.axes
    part = "joint_" if "joint_x" in result else ""
    speed, position = result[f"{part}v_before"], result[f"{part}x"]
    turning = not np.any(speed.values)
    across = result.get("phase")
    if across is None:
        across, up = (position[:-1], position[1:]) if turning else (position, speed)
    else:
        up = position if turning else speed
    handles = []
    names = flag_names(result["kind"])
    codes = [code for code in names if code in np.unique(result["kind"].values)]
    for code, (colour, marker) in zip(codes, _KINDS * len(codes), strict=False):
        mine = (result["kind"].values == code)[: across.size]
        _points(ax, across.values[mine], up.values[mine], colour, marker)
        label = flag_text(names[code])
        handles.append(Line2D([], [], linestyle="", marker=marker, ms=3, mew=0, color=colour, label=label))
    following = turning and "phase" not in result
    ax.set_xlabel(axis_label(across) if across.name == "phase" or not following else _at_event(result, ""))
    ax.set_ylabel(_at_event(result, "next ") if following else axis_label(up))
    _widen(ax, across.values, up.values)
    if "phase" in result and unit(result["phase"]) == "rad":
        ax.set_xlim(0, 2 * np.pi)
        ax.set_xticks(np.pi * np.arange(0, 2.5, 0.5), ["0", r"$\pi/2$", r"$\pi$", r"$3\pi/2$", r"$2\pi$"])
    what = f"{count_text(result.sizes['time'])} events"
    return page.finish(title, _caption(result, look, what), handles if len(handles) > 1 else ())


def _at_event(result: xr.Dataset, which: str) -> str:
    kinds = " or ".join(flag_text(name) for name in str(result.attrs["section_events"]).split())
    return f"position at the {which}{kinds} ({unit(result['x'])})"


def _points(ax: Axes, across: np.ndarray, up: np.ndarray, colour: str, marker: str) -> None:
    size = float(np.clip(60.0 / np.sqrt(max(across.size, 1)), 0.5, 3.0))
    ax.plot(
        across, up, marker, markersize=size, markeredgewidth=0, color=colour,
        rasterized=across.size > _RASTER,
    )  # fmt: skip


def _widen(ax: Axes, across: np.ndarray, up: np.ndarray) -> None:
    """Show a point as a point: not the rounding errors of a periodic motion."""
    for values, limits in ((across, ax.set_xlim), (up, ax.set_ylim)):
        middle, least = (values.max() + values.min()) / 2, _ALMOST * np.abs(values).max()
        if least > 0 and np.ptp(values) < least:
            limits(middle - least, middle + least)
    ax.locator_params(axis="x", nbins=6)


def _caption(result: xr.Dataset, look: Look, what: str) -> list[str]:
    return [
        what,
        f"without the first {result.attrs['transient']} periods",
        *caption_pieces(result, look, describe_case(result)),
        plain(version_text(result)),
    ]
