# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The section of a motion at its impacts: speed over the phase of the drive."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.figures.caption import caption_pieces, describe_case, resolved_case, shown, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.labels import count_text, plain, unit
from separatrix.layout import compose
from separatrix.open import flag_names

# Fewer are better seen in the history.
FEWEST = 20
_BARRIERS = {"impact_upper": ("upper barrier", style.IMPACT), "impact_lower": ("lower barrier", style.MOTION)}


def section(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure | None:
    """Return speed [m/s] over phase [deg] of the impacts in the second half of a run; None if they are few.

    None comes also without a drive, and of several bodies, whose impacts are at joints of their own.
    """
    case = resolved_case(result)
    period = float(result.attrs.get("drive_period", 0.0))
    law = case.get("drive", {}).get("law", "none")
    if period <= 0 or law == "none" or "event_joint" in result or result.sizes.get("event", 0) < FEWEST:
        return None
    time = result["event_time"].values
    names = flag_names(result["event_kind"])
    kinds = np.array([names[int(code)] for code in result["event_kind"].values])
    settled = np.isin(kinds, list(_BARRIERS)) & (time >= float(result["time"].values[-1]) / 2)
    if settled.sum() < FEWEST:
        return None
    start = float(case.get("start", {}).get("crank_angle", 0.0))
    phase = np.degrees(start + 2 * np.pi * time / period) % 360
    speed = np.abs(result["event_v_before"].values)
    figure = style.new_figure(*(look.size or (style.SINGLE_COLUMN, 62.0)))
    ax = figure.add_subplot()
    handles = []
    mark = 2.5 if settled.sum() < 500 else 0.8
    for kind, (label, colour) in _BARRIERS.items():
        chosen = settled & (kinds == kind)
        if chosen.any():
            ax.plot(phase[chosen], speed[chosen], "o", ms=mark, mew=0, color=colour)
            handles.append(Line2D([], [], linestyle="", marker="o", ms=3, color=colour, label=label))
    ax.set(xlim=(0, 360), xticks=range(0, 361, 60), xlabel="phase of the drive (deg)")
    ax.set_ylabel(f"speed of impact ({unit(result['v'])})")
    ax.set_ylim(0, 1.05 * speed[settled].max() or 1.0)
    pieces = caption_pieces(result, look, describe_case(result))
    pieces += [f"{count_text(int(settled.sum()))} impacts in the second half of the run"]
    compose(figure, title, shown([*pieces, plain(version_text(result))], look), handles)
    return figure
