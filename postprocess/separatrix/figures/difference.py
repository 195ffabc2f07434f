# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two maps of one grid: where the motion that a start settles on is another one."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures import basin
from separatrix.figures.look import DEFAULT, Look


def differing(first: xr.Dataset, second: xr.Dataset) -> xr.DataArray:
    """Return where regime, period or event word of the two differ, over the axes of both.

    Attractors are numbered in each map for itself, so their numbers are not compared; mirror images of a
    motion count as one.
    """
    for name in first["regime"].dims:
        same = name in second.dims and np.array_equal(first[name].values, second[name].values)
        if not same or first["regime"].dims != second["regime"].dims:
            raise SeparatrixError(f"difference: the maps do not have the same points along {name}", USAGE)
    return sum(
        (first[name] != second[name].values).astype(np.int8) for name in ("regime", "period", "event_word")
    ).clip(0, 1)


def difference(
    first: xr.Dataset, second: xr.Dataset, field: str | None, title: str, look: Look = DEFAULT
) -> Figure:
    """Return the map of the first with black where the second has another motion."""
    for result in (first, second):
        if result.attrs.get("kind") != "basin":
            found = result.attrs.get("kind")
            raise SeparatrixError(f"difference: found a {found}, allowed two basin files", USAGE)
    black = differing(first, second)
    name = field or "attractor"
    return basin.basin_map(None, first.assign(differs=black), name, title, look, over="differs")
