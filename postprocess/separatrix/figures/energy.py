# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the energy of a motion is, and where it went."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from separatrix import style
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Page
from separatrix.labels import axis_label, unit

# variable, label, colour and opacity, from the bottom up
_PARTS = (
    ("kinetic_energy", "kinetic", style.MOTION, 0.45),
    ("potential_energy", "spring", style.MOTION, 0.2),
    ("friction_loss", "friction", style.OKABE_ITO[0], 0.6),
    ("damping_loss", "damping", style.OKABE_ITO[3], 0.6),
    ("contact_loss", "contact", style.OKABE_ITO[2], 0.6),
)


def decomposition(result: xr.Dataset, title: str, caption: list[str], look: Look = DEFAULT) -> Figure:
    """Return the energy over time and, stacked on it, what was lost; the top is what was put in."""
    page = Page(look, (style.DOUBLE_COLUMN, 62.0))
    (ax,) = page.axes
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
    ax.set_ylabel(f"energy ({unit(result['energy'])})")
    # a motion that was given up has none
    missing = result.attrs.get("energy_closing_error")
    closed = [] if missing is None else [f"error of the energy balance: {abs(float(missing)):.1e} J"]
    return page.finish(title, [*closed, *caption], handles, columns=min(len(handles), 4))
