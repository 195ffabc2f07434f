# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of the force that the base machine lacks, from details.h5; None where there is nothing to show."""

from string import ascii_lowercase

import h5py
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import NullLocator

from separatrix import style
from separatrix.discovery.decision.where import IMPACT_SPEED, quantity_of
from separatrix.discovery.report.figures import BEFORE, LINE, MEASURED

_DIVERGING = "PuOr"


def where_lines(details: h5py.File) -> Figure | None:
    """The missing force over time, phase, position, velocity, low speed, time since an impact; at impacts."""
    names = [name for name in details["where"] if "velocity_edges" not in details["where"][name]]
    order = (
        "drive phase",
        "position",
        "velocity",
        "low speed",
        "time since the last impact",
        IMPACT_SPEED,
    )
    names.sort(key=lambda name: order.index(name) if name in order else -1)
    if not names:
        return None
    rows = -(-len(names) // 3)
    figure = style.new_figure(style.DOUBLE_COLUMN, 12.0 + 46.0 * rows)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(rows, 3, squeeze=False).ravel()
    for ax in axes[len(names) :]:
        ax.set_visible(False)
    for letter, ax, name in zip(ascii_lowercase, axes, names, strict=False):
        _draw_bins(ax, details["where"][name])
        unit = details["where"][name].attrs["unit"]
        ax.set_xlabel(f"{name} ({unit})")
        ax.set_title(f"{letter})", loc="left")
    for index, (ax, name) in enumerate(zip(axes, names, strict=False)):
        if index % 3 == 0 or name == IMPACT_SPEED:
            ax.set_ylabel(f"missing {quantity_of(name)} ({details['where'][name].attrs['force_unit']})")
    handles = [
        Line2D([], [], linestyle="", marker="o", color=BEFORE, markersize=3.5, label="flagged"),
        Line2D(
            [], [], linestyle="", marker="o", color=MEASURED, markersize=3.5, markerfacecolor="white",
            label="within chance",
        ),
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside upper center", ncols=2)
    return figure


def _draw_bins(ax: Axes, group: h5py.Group) -> None:
    edges, force, error = group["edges"][:], group["force"][:], group["error"][:]
    flagged, known = group["flagged"][:].astype(bool), np.isfinite(group["error"][:])
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    ax.axhline(0, color=LINE, linewidth=0.6, zorder=0)
    for chosen, colour, face in ((flagged, BEFORE, BEFORE), (~flagged, MEASURED, "white")):
        part = chosen & known
        ax.errorbar(
            middle[part], force[part], 1.96 * error[part], half[part], linestyle="", marker="o",
            markersize=3, color=colour, markerfacecolor=face, elinewidth=0.7,
        )  # fmt: skip


def where_plane(details: h5py.File) -> Figure | None:
    """The missing force over position and velocity."""
    found = [group for group in details["where"].values() if "velocity_edges" in group]
    if not found:
        return None
    group = found[0]
    x, v = group["edges"][:], group["velocity_edges"][:]
    shape = (x.size - 1, v.size - 1)
    force = np.where(np.isfinite(group["error"][:]), group["force"][:], np.nan).reshape(shape)
    error, flagged = group["error"][:].reshape(shape), group["flagged"][:].astype(bool).reshape(shape)
    figure = style.new_figure(style.SINGLE_COLUMN, 68.0)
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    largest = float(np.nanmax(np.abs(force))) if np.isfinite(force).any() else 1.0
    largest = largest or 1.0
    norm = SymLogNorm(linthresh=0.05 * largest, vmin=-largest, vmax=largest)
    image = ax.pcolormesh(x, v, force.T, cmap=_DIVERGING, norm=norm, edgecolor="white", linewidth=0.4)
    for i, j in np.ndindex(*shape):
        if force[i, j] < 0:
            # the two ends of the colours are alike in grey
            size = x[i + 1] - x[i], v[j + 1] - v[j]
            ax.add_patch(
                Rectangle((x[i], v[j]), *size, fill=False, hatch="////", edgecolor="#00000040", linewidth=0)
            )
        if np.isfinite(error[i, j]):
            tone = abs(float(norm(force[i, j])) - 0.5)
            ax.text(
                0.5 * (x[i] + x[i + 1]), 0.5 * (v[j] + v[j + 1]),
                f"{force[i, j]:+.2g}" + ("*" if flagged[i, j] else ""),
                ha="center", va="center", fontsize=5.0, color="white" if tone > 0.35 else "black",
            )  # fmt: skip
    of_x, of_v = group.attrs["unit"].split(", ")
    ax.set_xlabel(f"position $x$ ({of_x})")
    ax.set_ylabel(f"velocity $v$ ({of_v})")
    power = 10.0 ** np.floor(np.log10(largest))
    bar = figure.colorbar(
        image, ax=ax, label=f"missing force ({group.attrs['force_unit']})", ticks=[-power, 0.0, power]
    )
    bar.ax.yaxis.set_minor_locator(NullLocator())
    return figure
