# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One loop of force over position of records that are compared in force, from details.h5."""

import h5py
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from separatrix import style
from separatrix.discovery.report.figures import AFTER, BEFORE, MEASURED

_MOST_LOOPS = 3
"""Records that are shown; of more, the last one is held out where one is."""


_MOST_MARKERS = 90
_TURN_SHARE = 0.25
"""Share of its range that a motion must pass on either side of its middle to have turned."""
_STAGES = (
    ("before", "--", "D", BEFORE, "base machine"),
    ("after", "-", "o", AFTER, "extended machine"),
)


def loops(details: h5py.File) -> Figure | None:
    """The loop of force over position and what the machines leave of it; None for records of a motion.

    Of each record the period is shown in which the base machine misses as much as it usually does.
    """
    if details.attrs["compared"] != "force":
        return None
    rows = [(use, name) for use in ("training", "held_out") if use in details for name in details[use]]
    rows = rows[: _MOST_LOOPS - 1] + rows[-1:] if len(rows) > _MOST_LOOPS else rows
    if not rows:
        return None
    figure = style.new_figure(style.DOUBLE_COLUMN, 104.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, len(rows), squeeze=False, sharex="col", height_ratios=(3, 2))
    handles = {}
    for (use, name), (top, bottom) in zip(rows, axes.T, strict=True):
        record, group = details["records"][name], details[use][name]
        t, x, force = (record[key][:] for key in ("t", "x", "force"))
        begin, end = _usual_period(periods_of(t, x), t, force, group)
        inside = np.flatnonzero((t >= begin) & (t <= end))
        shown = inside[:: -(-inside.size // _MOST_MARKERS)]
        handles["measured"] = top.plot(
            x[shown], force[shown], linestyle="", marker="o", markersize=2.4, color=MEASURED,
            markerfacecolor="white", markeredgewidth=0.5,
        )[0]  # fmt: skip
        for stage, dash, marker, colour, label in _STAGES:
            if stage in group:
                part = {key: group[stage][key][:] for key in ("t", "segment", "x", "force")}
                one = {key: value[(part["t"] >= begin) & (part["t"] <= end)] for key, value in part.items()}
                handles[label] = _show(top, bottom, one, np.interp(one["t"], t, force), dash, marker, colour)
        bottom.axhline(0, color="black", linestyle=":", linewidth=0.8, zorder=0)
        top.set_title(f"{name}, {use.replace('_', ' ')}, {begin:.3g} to {end:.3g} s", loc="left")
        bottom.set_xlabel(f"position $x$ ({details.attrs['position_unit']})")
    unit = details.attrs["force_unit"]
    axes[0, 0].set_ylabel(f"force ({unit})")
    axes[1, 0].set_ylabel(f"measured less machine ({unit})")
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=3, handlelength=3.6)
    return figure


def _show(
    top: Axes, bottom: Axes, one: dict, measured: np.ndarray, dash: str, marker: str, colour: str
) -> object:
    """The loop of a machine, and what it leaves; its handle in the legend."""
    breaks = np.flatnonzero(np.diff(one["segment"])) + 1
    x, force = (np.insert(one[key], breaks, np.nan) for key in ("x", "force"))
    top.plot(x, force, dash, color=colour, linewidth=1.0)
    every = max(1, one["x"].size // _MOST_MARKERS)
    left = (measured - one["force"])[::every]
    bottom.plot(one["x"][::every], left, marker, color=colour, markersize=2.0, markeredgewidth=0)
    # the dash is of the upper panel, the marker of the lower one
    return top.plot([], [], dash, marker=marker, color=colour, linewidth=1.0, markersize=3.0)[0]


def periods_of(t: np.ndarray, x: np.ndarray) -> list[tuple[float, float]]:
    """Times between passages upwards through the middle of a motion; all of a motion without two."""
    low, high = np.percentile(x, (1, 99))
    middle, margin = 0.5 * (low + high), _TURN_SHARE * (high - low)
    side = np.where(x > middle + margin, 1, np.where(x < middle - margin, -1, 0))
    turned = np.flatnonzero(side)
    up = turned[1:][(side[turned[1:]] > 0) & (side[turned[:-1]] < 0)]
    return list(zip(t[up[:-1]], t[up[1:]], strict=True)) or [(float(t[0]), float(t[-1]))]


def _usual_period(
    periods: list[tuple[float, float]], t: np.ndarray, force: np.ndarray, group: h5py.Group
) -> tuple[float, float]:
    """The period in which the base machine misses the force by the median."""
    part = group["before"]
    at = part["t"][:]
    missed = np.abs(np.interp(at, t, force) - part["force"][:])
    inside = [missed[(at >= begin) & (at <= end)] for begin, end in periods]
    followed = [k for k, one in enumerate(inside) if one.size]
    order = sorted(followed, key=lambda k: float(np.sqrt(np.mean(inside[k] ** 2))))
    return periods[order[len(order) // 2]] if order else periods[0]
