# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lyapunov exponents over a parameter, below the bifurcation diagram of the same motions."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.figures.caption import caption_pieces, describe_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Figures, Page, show_all
from separatrix.labels import axis_label, count_text, plain, unit

_COLOURS = ("#000000", "#777777")
_MARKS = {"chaotic": (3, style.IMPACT, "s"), "quasi_periodic": (2, style.OKABE_ITO[1], "^")}
_BAND = 1.96  # standard errors on each side


def figures(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figures:
    """Return the figure of exponents along a parameter by name."""
    look.require("figure of exponents", "region", "units")
    return Figures({"exponents": lambda: diagram(look.selected(result), title, look)})


def diagram(result: xr.Dataset, title: str, look: Look) -> Figure:
    """Return the two largest exponents over the parameter, and above them the points of the section."""
    dim = str(result.attrs["parameter"]).replace(".", "_")
    both = "section_x" in result and len(look.ax) != 1
    page = Page(look, (style.DOUBLE_COLUMN, 105.0 if both else 60.0), 2 if both else 1, sharex=True)
    values = result[dim].values
    if both:
        _section(page.axes[0], result, values)
    ax = page.axes[-1]
    handles = _exponents(ax, result, values) + _kinds(ax, result, values)
    ax.set_xlabel(axis_label(result[dim]))
    ax.set_ylabel(f"Lyapunov exponents ({unit(result['exponent'])})")
    show_all(ax, values)
    page.letter()
    caption = [f"{count_text(values.size)} values of the parameter"]
    if both:
        caption.append(f"{count_text(result.sizes['point'])} points of the section at each")
    if np.isneginf(result["exponent"].values[:, :2]).any():
        caption.append("exponents of minus infinity (sticking) are not drawn")
    caption += [*caption_pieces(result, look, describe_case(result)), plain(version_text(result))]
    return page.finish(title, caption, handles, columns=4)


def _section(ax: Axes, result: xr.Dataset, values: np.ndarray) -> None:
    points = result["section_x"].values
    along = np.broadcast_to(values[:, np.newaxis], points.shape)
    size = float(np.clip(250.0 / values.size, 0.25, 2.5))
    ax.scatter(along, points, s=size, c=style.BOTH_RUNS, linewidths=0, rasterized=points.size > 2000)
    ax.set_ylabel(f"position $x$ ({unit(result['section_x'])})\nonce per drive period")


def _exponents(ax: Axes, result: xr.Dataset, values: np.ndarray) -> list[Line2D]:
    """Draw the two largest with their bands of 95 %."""
    ax.axhline(0.0, color="#999999", linewidth=0.6)
    handles = []
    found, errors = result["exponent"].values, result["exponent_error"].values
    for number, (colour, line) in enumerate(zip(_COLOURS, ("-", (0, (3, 1.5))), strict=True)):
        if number >= found.shape[1]:
            break
        mean = np.where(np.isfinite(found[:, number]), found[:, number], np.nan)
        band = _BAND * np.nan_to_num(errors[:, number], posinf=0.0)
        ax.fill_between(values, mean - band, mean + band, color=colour, alpha=0.2, linewidth=0)
        # a value between two that are not drawn is a dot
        dots = {"marker": "o", "markersize": 1.2, "markeredgewidth": 0}
        handles += ax.plot(
            values, mean, color=colour, linestyle=line, label=("largest", "second")[number], **dots
        )
    return handles


def _kinds(ax: Axes, result: xr.Dataset, values: np.ndarray) -> list[Line2D]:
    """Mark the chaotic and the quasi-periodic values at the lower edge."""
    handles = []
    for kind, (code, colour, marker) in _MARKS.items():
        mine = values[result["motion"].values == code]
        if mine.size:
            look = {
                "linestyle": "",
                "marker": marker,
                "markersize": 2.4,
                "markeredgewidth": 0,
                "color": colour,
            }
            ax.plot(mine, np.full(mine.size, 0.02), transform=ax.get_xaxis_transform(), clip_on=False, **look)
            handles.append(Line2D([], [], label=kind.replace("_", "-"), **look))
    return handles
