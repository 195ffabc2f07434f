# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The force of a soft barrier over its penetration, a closed loop, and over time."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.figures import pair
from separatrix.figures.caption import caption_pieces, describe_case, resolved_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Page
from separatrix.labels import plain, unit

MOST_LOOPS = 8
_LEAST_SAMPLES = 5
_DRAWN = ("x", "time", "contact_force")


def loops(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return force over penetration and over time of the contacts, one colour each, at most `MOST_LOOPS`.

    Of more contacts those with the most different speeds are shown.
    """
    page = _panels(result, look)
    found = contacts(result)
    speed_unit = unit(result["v"])
    speed, shown = look.factor(speed_unit), look.unit(speed_unit)
    order = np.argsort([-one[1] for one in found])
    if len(found) > MOST_LOOPS:
        order = order[np.linspace(0, len(found) - 1, MOST_LOOPS).round().astype(int)]
    handles = []
    for number, index in enumerate(order):
        colour = style.OKABE_ITO[number]
        _draw(page.axes, found[index], colour, *(look.factor(unit(result[name])) for name in _DRAWN))
        label = f"impact at {found[index][1] * speed:.3g} {shown}"
        handles.append(Line2D([], [], color=colour, label=label))
    caption = [f"{len(order)} of {len(found)} contacts, by impact speed"]
    caption += caption_pieces(result, look, describe_case(result))
    return page.finish(title, [*caption, plain(version_text(result))], handles, columns=4)


def beside(results: Sequence[xr.Dataset], title: str) -> Figure:
    """Return the fastest contact of each trajectory over penetration and time, one colour for each."""
    page = _panels(results[0], DEFAULT)
    handles, captions = [], []
    for number, result in enumerate(results):
        found = contacts(pair.relative_to_stop(result))
        if not found:
            continue
        colour = style.OKABE_ITO[number % len(style.OKABE_ITO)]
        fastest = max(found, key=lambda item: item[1])
        _draw(page.axes, fastest, colour)
        law = resolved_case(result)["contact"]["law"].replace("_", " ")
        handles.append(Line2D([], [], color=colour, label=f"{law}, {fastest[1]:.3g} {unit(result['v'])}"))
        captions += describe_case(result)
    return page.finish(title, [*captions, plain(version_text(results[0]))], handles, columns=2)


def _panels(result: xr.Dataset, look: Look) -> Page:
    page = Page(look, (style.DOUBLE_COLUMN, 68.0), 2, columns=2)
    over_depth, over_time = page.axes
    over_depth.set_xlabel(f"penetration ({look.unit(unit(result['x']))})")
    over_time.set_xlabel(f"time since first touch ({look.unit('s')})")
    for ax in page.axes:
        ax.set_ylabel(f"force of the barrier ({look.unit(unit(result['contact_force']))})")
        ax.axhline(0, color="#BBBBBB", linewidth=0.5, zorder=0)
    page.letter()
    return page


def _draw(
    axes: Sequence[Axes],
    contact: tuple,
    colour: str,
    of_depth: float = 1.0,
    of_time: float = 1.0,
    of_force: float = 1.0,
) -> None:
    """Draw a contact from no force to no force, times these factors: jumps lie between that and its ends."""
    start, _, time, depth, force = contact
    over_depth, over_time = axes
    # the force at first touch follows from the first two samples
    early = time[:2] - start
    touch = force[0] - early[0] * (force[1] - force[0]) / (early[1] - early[0])
    force = of_force * np.concatenate([[0.0, touch], force, [0.0]])
    depths = of_depth * np.concatenate([[0.0, 0.0], depth, depth[-1:]])
    times = of_time * np.concatenate([[0.0, 0.0], time - start, time[-1:] - start])
    over_depth.plot(depths, force, color=colour)
    over_time.plot(times, force, color=colour)


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
