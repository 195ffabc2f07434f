# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The share of motions that stay in their basin under random impulses, and the law of rare impulses."""

import xarray as xr
from matplotlib.figure import Figure

from separatrix import style
from separatrix.figures.caption import caption_pieces, describe_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Figures, Page
from separatrix.labels import axis_label, plain


def figures(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figures:
    """Return the figure by name."""
    look.require("survival under impulses", "units")
    return Figures({"survival": lambda: diagram(result, title, look)})


def diagram(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the share over the time with its band, and the law with its own."""
    page = Page(look, (style.SINGLE_COLUMN, 55.0))
    (ax,) = page.axes
    result = look.selected(result)
    time = result["time"].values
    lines = []
    for name, colour, text in (
        ("survival", style.OKABE_ITO[1], "simulated motions"),
        ("law", style.OKABE_ITO[0], "law of rare impulses, exp(-rate p t)"),
    ):
        lines += ax.plot(time, result[name].values, color=colour, label=text)
        low, high = result[f"{name}_lower"].values, result[f"{name}_upper"].values
        ax.fill_between(time, low, high, color=colour, alpha=0.25, linewidth=0)
    ax.set_xlim(time[0], time[-1])
    ax.set_ylim(0, 1.02)
    ax.set_xlabel(axis_label(result["time"]))
    ax.set_ylabel("share of the motions in their basin")
    about = result.attrs
    caption = [
        *caption_pieces(result, look, describe_case(result)),
        f"attractor {about['attractor']}, {about['motions']} motions, {about['rate']:.4g} impulses a second "
        f"of standard deviation {about['deviation']:.4g} m/s, p = {about['p']:.4g}; bands: 95 % confidence",
        plain(version_text(result)),
    ]
    return page.finish(title, caption, lines)
