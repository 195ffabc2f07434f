# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The section of a motion at its impacts: speed over the phase of the drive."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.figures.caption import caption_pieces, describe_case, resolved_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Page
from separatrix.labels import count_text, plain, unit
from separatrix.open import flag_names

# Fewer are better seen in the history.
FEWEST = 20
_BARRIERS = {"impact_upper": ("upper barrier", style.IMPACT), "impact_lower": ("lower barrier", style.MOTION)}


def settled(result: xr.Dataset) -> np.ndarray:
    """Return which events are impacts in the second half of the run.

    There are none without a drive, and of several bodies, whose impacts are at joints of their own.
    """
    law = resolved_case(result).get("drive", {}).get("law", "none")
    if float(result.attrs.get("drive_period", 0.0)) <= 0 or law == "none" or "event_joint" in result:
        return np.zeros(0, bool)
    late = result["event_time"].values >= float(result["time"].values[-1]) / 2
    return late & _is(result, *_BARRIERS)


def _is(result: xr.Dataset, *kinds: str) -> np.ndarray:
    """Return which events are of one of these kinds."""
    codes = [code for code, name in flag_names(result["event_kind"]).items() if name in kinds]
    return np.isin(result["event_kind"].values, codes)


def section(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the speed over the phase [deg] of the impacts in the second half of a run."""
    case, chosen = resolved_case(result), settled(result)
    period = float(result.attrs["drive_period"])
    start = float(case.get("start", {}).get("crank_angle", 0.0))
    phase = np.degrees(start + 2 * np.pi * result["event_time"].values / period) % 360
    speed = np.abs(result["event_v_before"].values)
    page = Page(look, (style.SINGLE_COLUMN, 62.0))
    (ax,) = page.axes
    handles = []
    mark = 2.5 if chosen.sum() < 500 else 0.8
    for kind, (label, colour) in _BARRIERS.items():
        mine = chosen & _is(result, kind)
        if mine.any():
            ax.plot(phase[mine], speed[mine], "o", ms=mark, mew=0, color=colour, rasterized=mine.sum() > 5000)
            handles.append(Line2D([], [], linestyle="", marker="o", ms=3, color=colour, label=label))
    ax.set(xlim=(0, 360), xticks=range(0, 361, 60), xlabel="phase of the drive (deg)")
    ax.set_ylabel(f"speed of impact ({unit(result['v'])})")
    ax.set_ylim(0, 1.05 * speed[chosen].max() or 1.0)
    caption = [
        *caption_pieces(result, look, describe_case(result)),
        f"{count_text(int(chosen.sum()))} impacts in the second half of the run",
        plain(version_text(result)),
    ]
    return page.finish(title, caption, handles)
