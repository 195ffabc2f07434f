# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A sweep of two bodies coupled by dry friction: the regimes along the parameter and where each gives way."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from separatrix import style
from separatrix.figures.caption import caption_pieces, describe_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Page, show_all
from separatrix.figures.regions import brackets, limit_texts
from separatrix.labels import axis_label, flag_text, plain, unit
from separatrix.open import flag_names, table

_COLOURS = {0: style.RUN_UP, 1: style.RUN_DOWN}
_NAMES = {0: "run-up", 1: "run-down"}


def regimes(result: xr.Dataset, name: str, title: str, look: Look = DEFAULT) -> Figure:
    """Return the largest and the stroboscopic velocities of the driven body, with the regimes as bands."""
    page = Page(look, (style.DOUBLE_COLUMN, 105.0), 2, sharex=True, height_ratios=(3, 2))
    top, bottom = page.axes
    values = result[name].values
    handles = []
    for run, code in enumerate(result["direction"].values):
        if not np.any(result["reason"].isel(direction=run).values):
            continue
        largest = result["v_max"].isel(direction=run).values
        section = result["section_v"].isel(direction=run).transpose(name, "sample").values
        marks = {"linestyle": "", "marker": "o", "color": _COLOURS[int(code)], "markeredgewidth": 0.6}
        shape = {"markersize": 3.4, "markerfacecolor": "none"} if code == 0 else {"markersize": 1.5}
        top.plot(values, largest, **marks, **shape)
        bottom.plot(
            np.repeat(values, section.shape[1]),
            section.ravel(),
            **marks,
            **shape,
            rasterized=section.size > 2000,
        )
        handles.append(Line2D([], [], **marks, **shape, label=_NAMES[int(code)]))
    edges = spans(result, name)
    for lower, upper, regime in edges:
        for ax in (top, bottom):
            ax.axvspan(lower, upper, color=style.REGIMES[regime], alpha=0.18, linewidth=0, zorder=0)
    seen = dict.fromkeys(regime for _, _, regime in edges)
    handles += [Patch(color=style.REGIMES[regime], alpha=0.18, label=flag_text(regime)) for regime in seen]
    speed = unit(result["v_max"])
    top.set_ylabel(f"largest velocity\nof the driven body ({speed})")
    bottom.set_ylabel(f"velocity ({speed})\nonce per drive period")
    bottom.set_xlabel(axis_label(result[name]))
    for ax in page.axes:
        show_all(ax, values)
    page.letter()
    pieces = caption_pieces(result, look, describe_case(result))
    caption = [*pieces, *_limits_caption(result), plain(version_text(result))]
    return page.finish(title, caption, handles, columns=min(5, len(handles)))


def spans(result: xr.Dataset, name: str) -> list[tuple[float, float, str]]:
    """Return intervals of the parameter and the regime of the first run in them, bounded by the limits."""
    values = result[name].values
    run = int(np.flatnonzero(result["reason"].transpose("direction", name).values.any(axis=1))[0])
    codes = result["regime"].isel(direction=run).values
    names = flag_names(result["regime"])
    order = np.argsort(values)
    values, codes = values[order], codes[order]
    middles = np.sort(brackets(table(result, "limits"), in_steps=True).mean(axis=1))
    found = []
    start = values[0]
    for k in range(1, values.size + 1):
        if k < values.size and codes[k] == codes[k - 1]:
            continue
        end = values[-1]
        if k < values.size:
            between = middles[(middles >= values[k - 1]) & (middles <= values[k])]
            end = float(between[0]) if between.size else (values[k - 1] + values[k]) / 2
        found.append((float(start), float(end), names[int(codes[k - 1])]))
        start = end
    return found


def _limits_caption(result: xr.Dataset) -> list[str]:
    return limit_texts(table(result, "limits")) or ["one regime throughout"]
