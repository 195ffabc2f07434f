# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of a map drawn larger beside it, so that it hides nothing."""

from dataclasses import replace

import xarray as xr
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.patches import ConnectionPatch, Rectangle

from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures.look import Look
from separatrix.labels import axis_label

_FEWEST = 2


def enlarged(whole: xr.Dataset, axes: tuple[str | None, str], panels: int, look: Look) -> xr.Dataset:
    """Return what the inset shows of a result, in the units asked for.

    `axes`: the axes of the map; the inset needs a range of both, in SI units. `panels`: maps of the figure.
    """
    if panels != 1:
        raise SeparatrixError(
            f"inset: found {panels} maps in the figure, allowed one; slice takes one", USAGE
        )
    found = {name.replace(".", "_") for name in look.inset}
    if None in axes or found != set(axes):
        wanted = " and ".join(str(name) for name in reversed(axes) if name)
        raise SeparatrixError(f"inset: found {', '.join(look.inset)}, allowed the axes {wanted}", USAGE)
    # what is not in the figure cannot be enlarged
    shown = replace(look, units=(), inset={}).selected(whole)
    part = replace(look, slice={}, inset={}, region=look.inset).selected(shown, "inset")
    for name in axes:
        if part.sizes[name] < _FEWEST:
            raise SeparatrixError(f"inset {name}: found one point, allowed {_FEWEST} and more", USAGE)
    return part


def frame(main: Axes, inset: Axes, part: xr.Dataset, axes: tuple[str, str]) -> None:
    """Outline on the map what the inset shows and join the two; the ticks of the inset stand on the right."""
    (left, right), (low, high) = inset.get_xlim(), inset.get_ylim()
    halo = [patheffects.Stroke(linewidth=1.6, foreground="white"), patheffects.Normal()]
    looks = {"linewidth": 0.7, "edgecolor": "black", "path_effects": halo, "zorder": 4}
    main.add_patch(Rectangle((left, low), right - left, high - low, fill=False, **looks))
    for height, corner in ((low, 0), (high, 1)):
        line = ConnectionPatch((right, height), (0, corner), main.transData, inset.transAxes, **looks)
        line.set_in_layout(False)
        main.figure.add_artist(line)
    inset.yaxis.tick_right()
    inset.yaxis.set_label_position("right")
    inset.set_xlabel(axis_label(part[axes[1]]))
    inset.set_ylabel(axis_label(part[axes[0]]))
