# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the energy of a motion is, and where it went."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from separatrix import style
from separatrix.labels import axis_label
from separatrix.layout import compose

# variable, label, colour and opacity, from the bottom up
_PARTS = (
    ("kinetic_energy", "kinetic", style.MOTION, 0.45),
    ("potential_energy", "spring", style.MOTION, 0.2),
    ("friction_loss", "friction", style.OKABE_ITO[0], 0.6),
    ("damping_loss", "damping", style.OKABE_ITO[3], 0.6),
    ("contact_loss", "contact", style.OKABE_ITO[2], 0.6),
)


def decomposition(result: xr.Dataset, title: str, caption: list[str]) -> Figure:
    """Return the energy over time and, stacked on it, what was lost; the top is what was put in."""
    figure = style.new_figure(style.DOUBLE_COLUMN, 62.0)
    ax = figure.add_subplot()
    time = result["time"].values
    level = np.zeros_like(time)
    handles = []
    for name, label, colour, opacity in _PARTS:
        part = result[name].values
        if not np.any(np.abs(part) > 1e-9 * np.abs(result["energy"].values).max()):
            continue
        ax.fill_between(time, level, level + part, color=colour, alpha=opacity, linewidth=0)
        handles.append(Patch(color=colour, alpha=opacity, label=label))
        level = level + part
    supplied = float(result.attrs["energy_start"]) + result["drive_work"].values
    ax.plot(time, supplied, color="black", linewidth=0.8)
    handles.append(Line2D([], [], color="black", linewidth=0.8, label="energy at the start and work"))
    ax.set_xlim(time[0], time[-1])
    ax.set_xlabel(axis_label(result["time"]))
    ax.set_ylabel("energy (J)")
    # the book of a motion that was given up is not closed
    missing = result.attrs.get("energy_closing_error")
    closed = [] if missing is None else [f"missing at the end: {float(missing):.1e} J"]
    compose(figure, title, [*closed, *caption], handles, columns=min(len(handles), 4))
    return figure
