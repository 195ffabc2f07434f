# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn into the classes of a map: attractors on the section, settling time as lightness."""

import re

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from separatrix.classes import Class
from separatrix.figures import section
from separatrix.figures.look import Look

_MARKS = "osD^vP*X"
_MOST_NOTES = 4


def shaded(
    index: np.ndarray,
    entries: list[Class],
    settle_time: np.ndarray,
    by: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Return the colour of each pixel: that of its class, light where it settles early, dark where late.

    The lightness goes by rank within each class, so that every class uses all of it. `by`: index and settling
    time of the image whose ranks count, for a part of it that is to have its colours.
    """
    image = np.empty((*index.shape, 3))
    ranked, times_ranked = by or (index, settle_time)
    for position, entry in enumerate(entries):
        mine = index == position
        times = settle_time[mine]
        values, numbers = np.unique(times_ranked[ranked == position], return_counts=True)
        ranks = (np.cumsum(numbers) - 0.5 * numbers) / max(1, numbers.sum())
        known = np.isfinite(values)
        rank = np.full(times.shape, 0.5)
        if known.any():
            rank = np.where(np.isfinite(times), np.interp(times, values[known], ranks[known]), 0.5)
        rank = rank[:, np.newaxis]
        light, dark = np.clip(0.5 - rank, 0, None) * 2 * 0.6, np.clip(rank - 0.5, 0, None) * 2 * 0.5
        image[mine] = (np.array(to_rgb(entry.colour)) * (1 - light) + light) * (1 - dark)
    return image


def draw(
    grid: list[Axes],
    whole: xr.Dataset,
    result: xr.Dataset,
    across: str,
    others: list[str],
    slices: list[tuple],
    look: Look,
) -> tuple[dict[int, dict], list[str]]:
    """Mark the points of each attractor on the section; return how, by label, and what the picture lacks."""
    marked: dict[int, dict] = {}
    lacking: dict[str, None] = {}
    for ax, indices in zip(grid, slices, strict=True):
        # Indices in the whole result: the catalogue counts its slices.
        at = {}
        for name, k in zip(others, indices, strict=True):
            shown = result[name].values[k] / look.scale(whole, name)[0]
            at[name] = int(np.abs(whole[name].values - shown).argmin())
        limits = ax.get_xlim(), ax.get_ylim()
        for identity, x, v in section.points(whole, at):
            mark = _MARKS[(identity - 1) % len(_MARKS)]
            drawn = {
                "marker": mark,
                "markersize": 3.6,
                "markerfacecolor": "white",
                "markeredgecolor": "black",
            }
            drawn |= {"linestyle": "", "markeredgewidth": 0.6, "zorder": 5}
            lacking |= dict.fromkeys(_not_shown(whole, identity, x, v))
            x, v = x * look.scale(whole, "catalogue_x")[0], v * look.scale(whole, "catalogue_v")[0]
            ax.plot(*((x, v) if across == "x0" else (v, x)), **drawn)
            marked[identity] = drawn
        ax.set_xlim(limits[0])
        ax.set_ylim(limits[1])
    notes = list(lacking)
    if len(notes) > _MOST_NOTES:
        notes = [*notes[:_MOST_NOTES], f"and the same for {len(notes) - _MOST_NOTES} more"]
    return marked, notes


def _not_shown(whole: xr.Dataset, identity: int, x: np.ndarray, v: np.ndarray) -> list[str]:
    """Note how many points of an attractor are outside the map."""
    if not np.isfinite(x).all():
        return [f"points of attractor {identity}: not known"]
    outside = np.zeros(x.size, bool)
    for name, values in (("x0", x), ("v0", v)):
        axis = whole[name].values
        outside |= (values < axis.min()) | (values > axis.max())
    if not outside.any():
        return []
    return [f"attractor {identity}: {outside.sum()} of {x.size} points outside the map"]


def on_legend(handle: Patch, marked: dict[int, dict]) -> Patch | Line2D:
    """Return an entry of the legend with the mark of its attractor on its colour."""
    found = re.match(r"attractor (\d+):", handle.get_label())
    mark = marked.get(int(found[1])) if found else None
    if mark is None:
        return handle
    line = {"color": handle.get_facecolor(), "linewidth": 5.5, "linestyle": "-", "solid_capstyle": "butt"}
    return Line2D([], [], **{**mark, **line, "markersize": 3.0}, label=handle.get_label())
