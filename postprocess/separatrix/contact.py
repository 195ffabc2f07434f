# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The force of a soft barrier over its penetration, a closed loop, and over time."""

from itertools import pairwise

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.case import describe_case, version_text
from separatrix.labels import plain
from separatrix.layout import compose

MOST_LOOPS = 8
_LEAST_SAMPLES = 5


def loops(result: xr.Dataset, title: str) -> Figure:
    """Return force over penetration and over time of the contacts, one colour each, at most `MOST_LOOPS`.

    Of more contacts those with the most different speeds are shown.
    """
    figure = style.new_figure(style.DOUBLE_COLUMN, 68.0)
    over_depth, over_time = figure.subplots(1, 2)
    found = contacts(result)
    order = np.argsort([-speed for _, speed, _, _, _ in found])
    if len(found) > MOST_LOOPS:
        order = order[np.linspace(0, len(found) - 1, MOST_LOOPS).round().astype(int)]
    handles = []
    for place, index in enumerate(order):
        start, speed, time, depth, force = found[index]
        colour = style.palette(MOST_LOOPS)[place]
        over_depth.plot(depth, force, color=colour)
        over_time.plot(time - start, force, color=colour)
        handles.append(Line2D([], [], color=colour, label=f"{speed:.3g} m/s"))
    over_depth.set_xlabel("penetration (m)")
    over_time.set_xlabel("time since first touch (s)")
    for letter, ax in zip("ab", (over_depth, over_time), strict=True):
        ax.set_ylabel("force of the barrier (N)")
        ax.axhline(0, color="#BBBBBB", linewidth=0.5, zorder=0)
        ax.set_title(f"{letter})", loc="left")
    caption = [f"{len(order)} of {len(found)} contacts, by impact speed", *describe_case(result)]
    compose(figure, title, [*caption, plain(version_text(result))], handles, columns=max(1, len(handles)))
    return figure


def contacts(result: xr.Dataset) -> list[tuple[float, float, np.ndarray, np.ndarray, np.ndarray]]:
    """Return time of touch, impact speed, and samples of time, penetration and force of every contact."""
    time, x, v, force = (result[name].values for name in ("time", "x", "v", "contact_force"))
    found = []
    for name, side in (("barrier_upper", 1), ("barrier_lower", -1)):
        if name not in result.attrs:
            continue
        depth = side * (x - float(result.attrs[name]))
        pressed = depth > 0
        edges = np.flatnonzero(np.diff(pressed.astype(int)))
        for first, last in pairwise(edges):
            if not pressed[first + 1] or last - first < _LEAST_SAMPLES:
                continue
            inside = slice(first + 1, last + 1)
            # the surface is met between two samples
            start = time[first + 1] - depth[first + 1] / (side * v[first + 1])
            speed = side * v[first]
            found.append((start, speed, time[inside], depth[inside], -side * force[inside]))
    return found
