# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Loose points: their starts, coloured by the regime that they ended in."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from separatrix import style
from separatrix.classes import class_counts, classes
from separatrix.figures.caption import caption_pieces, describe_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Figures, Page
from separatrix.labels import axis_label, count_text, plain, share_texts

# a second cue beside colour
_MARKERS = "osD^vP*X"


def figures(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figures:
    """Return the figure of a points file by name."""
    look.require("list of points", "units")
    return Figures({"regime": lambda: scatter(look.selected(result), title, look)})


def scatter_axes(result: xr.Dataset) -> tuple[str, str]:
    """Return the two starting values to draw, horizontal first: those that vary, x0 and v0 preferred."""
    names = ["x0", "v0", "ratio"]
    varying = [name for name in names if np.ptp(result[name].values) > 0]
    across, up = (varying + [name for name in names if name not in varying])[:2]
    return across, up


def scatter(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the starting points by regime."""
    across, up = scatter_axes(result)
    codes = result["regime"].values
    counts = dict(zip(*(part.tolist() for part in np.unique(codes, return_counts=True)), strict=True))
    entries = classes(result, "regime", counts)
    shares = share_texts(class_counts(entries, counts))
    size = float(np.clip(400.0 / np.sqrt(codes.size), 0.5, 14.0))

    page = Page(look, (style.SINGLE_COLUMN, 65.0))
    (ax,) = page.axes
    handles = []
    for entry, share, marker in zip(entries, shares, _MARKERS, strict=False):
        chosen = np.isin(codes, entry.codes)
        ax.scatter(
            result[across].values[chosen],
            result[up].values[chosen],
            s=size,
            c=entry.colour,
            marker=marker,
            linewidths=0,
            rasterized=codes.size > 5000,
        )
        label = f"{entry.text} ({share})"
        handles.append(
            Line2D([], [], linestyle="", marker=marker, markersize=3.5, color=entry.colour, label=label)
        )
    ax.xaxis.set_major_locator(MaxNLocator(6))
    ax.set_xlabel(axis_label(result[across]))
    ax.set_ylabel(axis_label(result[up]))
    caption = [
        *caption_pieces(result, look, describe_case(result)),
        f"$N$ = {count_text(codes.size)} points",
        plain(version_text(result)),
    ]
    return page.finish(title, caption, handles)
