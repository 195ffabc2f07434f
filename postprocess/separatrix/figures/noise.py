# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions under noise: some of them and the share that has not left; that share over a grid of starts."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from separatrix import style
from separatrix.figures.basin import cell_edges
from separatrix.figures.caption import caption_pieces, describe_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Figures, Page
from separatrix.labels import axis_label, plain

# Motions drawn one by one; the band has so many of all.
_DRAWN, _BAND = 5, (0.025, 0.975)


def figures(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figures:
    """Return the figures by name: of motions `motions`, over starts `survival` and `passage_time`."""
    look.require("motions under noise", "units")
    result = look.selected(result)
    if result.attrs["kind"] == "noise":
        return Figures({"motions": lambda: _motions(result, title, look)})
    return Figures(
        {
            name: lambda name=name: _over_starts(result, name, title, look)
            for name in ("survival", "passage_time")
        }
    )


def _motions(result: xr.Dataset, title: str, look: Look) -> Figure:
    """Return positions over time with the band of 95 % of the motions, and the survival below."""
    page = Page(look, (style.DOUBLE_COLUMN, 90.0), 2, sharex=True)
    top, below = page.axes
    time, positions = result["time"].values, result["x"].transpose("motion", "time").values
    low, high = np.quantile(positions, _BAND, axis=0)
    band = top.fill_between(time, low, high, color="#cccccc", linewidth=0, label="95 % of the motions")
    for one in positions[:_DRAWN]:
        (line,) = top.plot(time, one, color=style.MOTION, linewidth=0.5)
    line.set_label(f"{min(_DRAWN, len(positions))} motions")
    (mean,) = top.plot(time, positions.mean(axis=0), color="black", linewidth=1.2, label="mean")
    top.set_ylabel(axis_label(result["x"]))
    below.fill_between(
        time, result["survival_lower"].values, result["survival_upper"].values, color="#cccccc", linewidth=0
    )
    below.plot(time, result["survival"].values, color="black")
    below.set(xlim=(time[0], time[-1]), ylim=(0, 1.02), xlabel=axis_label(result["time"]))
    below.set_ylabel("share that\nhas not left")
    page.letter()
    return page.finish(title, _caption(result, look, "below: 95 % intervals"), [line, mean, band])


def _over_starts(result: xr.Dataset, name: str, title: str, look: Look) -> Figure:
    page = Page(look, (style.SINGLE_COLUMN, 62.0))
    (ax,) = page.axes
    x0, v0 = result["x0"], result["v0"]
    limits = (0, 1) if name == "survival" else (0, float(result.attrs["duration"]))
    image = ax.pcolormesh(
        cell_edges(x0.values), cell_edges(v0.values), result[name].transpose("v0", "x0").values,
        cmap=style.SCALAR_MAP, vmin=limits[0], vmax=limits[1], rasterized=True,
    )  # fmt: skip
    ax.set(xlabel=axis_label(x0), ylabel=axis_label(v0))
    # the names of the variables are too long for so short an axis
    text = {"survival": "share that has not left", "passage_time": "mean first passage (s)"}[name]
    ax.figure.colorbar(image, ax=page.axes, label=text, pad=0.02)
    half = float((result["survival_upper"] - result["survival_lower"]).max()) / 2
    extra = f"; 95 % intervals of the share at most ± {half:.2g}" if name == "survival" else ""
    return page.finish(title, _caption(result, look, f"{result.attrs['duration']:.4g} s{extra}"))


def _caption(result: xr.Dataset, look: Look, what: str) -> list[str]:
    return [
        *caption_pieces(result, look, describe_case(result)),
        f"{result.attrs['motions']} motions"
        + ("" if result.attrs["kind"] == "noise" else " from each start")
        + f", seed {result.attrs['seed']}; {what}",
        plain(version_text(result)),
    ]
