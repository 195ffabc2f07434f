# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures over a parameter: the erosion profile, with bands, births and deaths, and the branches above."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures import branches as branch_diagram
from separatrix.figures.caption import caption_pieces, describe_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Figures, Page
from separatrix.labels import axis_label, plain, unit
from separatrix.open import decode_flags

#: Labels of branches at which motions appear, vanish or lose their stability: drawn through all panels.
_ENDS = {"SN": ":", "PD": "-.", "GR": "--", "GR-fold": "--"}
_WORDS = {
    "global_integrity": "share of the window",
    "local_integrity": "LIM",
    "local_integrity_over_phases": "LIM over phases",
    "integrity_factor": "IF",
    "safe_basin": "safe at all phases",
    "safe_basin_integrity_factor": "IF, safe at all phases",
    "basin_stability": "basin stability",
    "convergence_time": "time to settle",
    "critical_impulse": "critical impulse",
    "basin_entropy": "$S_b$",
    "boundary_basin_entropy": "$S_{bb}$",
    "uncertainty_exponent": r"$\alpha$",
    "wada_merging": "unshared boundary",
    "wada_grid": "$W_N$",
}


def figures(
    result: xr.Dataset, title: str, look: Look = DEFAULT, branches: xr.Dataset | None = None
) -> Figures:
    """Return the figure of a file of measures by name."""
    look.require("file of measures", "region", "units")
    return Figures({"erosion": lambda: diagram(result, title, look, branches)})


def diagram(
    result: xr.Dataset, title: str, look: Look = DEFAULT, branches: xr.Dataset | None = None
) -> Figure:
    """Return each measure over the parameter, one panel above the other; `branches` of it on top."""
    result = look.selected(result)
    dim = str(result.attrs["parameter"])
    names = [name for name in _WORDS if name in result]
    panels = len(names) + (branches is not None)
    page = Page(look, (style.DOUBLE_COLUMN, 34.0 * panels + 12.0), panels, sharex=True)
    axes = page.axes
    handles: list[Line2D] = []
    if branches is not None:
        handles += _branches(axes, branches, dim, Look(units=look.units))
    for ax, name in zip(axes[panels - len(names) :], names, strict=True):
        _panel(ax, result, name, dim)
    colours = _colours(result)
    handles += [Line2D([], [], color=colours[number], label=f"attractor {number}") for number in colours]
    handles += _births(axes, result, dim)
    axes[-1].set_xlabel(axis_label(result[dim]))
    values = result[dim].values
    for ax in axes if values.size > 1 else ():
        ax.set_xlim(values.min(), values.max())
    caption = [
        *caption_pieces(result, look, describe_case(result)),
        f"{values.size} values, {result.attrs['starts_a_value']} starts of the map at each; bands: the "
        f"interval of each measure",
        plain(version_text(result)),
    ]
    return page.finish(title, caption, handles, columns=4)


def _colours(result: xr.Dataset) -> dict[int, str]:
    numbers = [int(number) for number in result["basin"].values]
    colours = style.palette(max(numbers, default=0))
    return {number: colours[(number - 1) % len(colours)] for number in numbers}


def _panel(ax: Axes, result: xr.Dataset, name: str, dim: str) -> None:
    across = result[dim].values
    measure = result[name]
    columns = (
        [(None, measure)]
        if "basin" not in measure.dims
        else [(int(number), measure.sel(basin=number)) for number in result["basin"].values]
    )
    colours = _colours(result)
    for number, values in columns:
        low, high = (result[f"{name}_{end}"] for end in ("lower", "upper"))
        if number is not None:
            low, high = low.sel(basin=number), high.sel(basin=number)
        colour = "black" if number is None else colours[number]
        known = np.isfinite(values.values)
        ax.plot(across, values.values, color=colour, marker="o", markersize=1.6, linewidth=0.8)
        band = known & np.isfinite(low.values) & np.isfinite(high.values)
        ax.fill_between(across, low.values, high.values, where=band, color=colour, alpha=0.25, linewidth=0)
    text = _WORDS[name]
    ax.set_ylabel(text if measure.attrs["units"] == "1" else f"{text} ({unit(measure)})")
    low, high = ax.get_ylim()
    ax.set_ylim(min(0.0, low), high)


def _births(axes: Sequence[Axes], result: xr.Dataset, dim: str) -> list[Line2D]:
    """Marks on the lower edge where an attractor appears or vanishes between two values."""
    exists, across = result["exists"].values, result[dim].values
    colours, drawn = _colours(result), False
    for column, number in enumerate(result["basin"].values):
        changes = np.flatnonzero(np.diff(exists[:, column]))
        for change in changes:
            middle = (across[change] + across[change + 1]) / 2
            drawn = True
            for ax in axes:
                ax.plot([middle], [0.03], "|", color=colours[int(number)], markersize=7, markeredgewidth=1.4,
                        transform=ax.get_xaxis_transform(), clip_on=False)  # fmt: skip
    mark = Line2D(
        [], [], color="0.3", marker="|", linestyle="none", markersize=7, label="appears or vanishes"
    )
    return [mark] if drawn else []


def _branches(axes: Sequence[Axes], branches: xr.Dataset, dim: str, look: Look) -> list[Line2D]:
    """The diagram on top, and lines down from the points at which motions end."""
    over = str(branches.attrs["parameter"]).replace(".", "_")
    if over != dim:
        raise SeparatrixError(f"branches: found them over {over}, allowed over {dim}", USAGE)
    handles = branch_diagram.draw(axes[0], branches, look)
    # the panel is lower than the label in one line
    axes[0].set_ylabel(branch_diagram.height(branches, look)[1].replace("amplitude ", "amplitude\n"))
    if "label" not in branches:
        return handles
    labels, factor = decode_flags(branches["label"]).values, look.scale(branches, "parameter")[0]
    for name, line in _ENDS.items():
        for value in (branches["parameter"].values * factor)[labels == name]:
            for ax in axes[1:]:
                ax.axvline(value, color="0.6", linestyle=line, linewidth=0.6, zorder=0)
    return handles
