# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines with a motor: speed and power in time, speed within a turn, shares of the power."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.figures.caption import resolved_case
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Page
from separatrix.labels import axis_label, unit

#: the axis of a map over the speed at the start
SPEED = "motor_crank_speed"
# so many of the last turns are drawn over one
_TURNS = 5
# so many values of the parameter have a line of the motor, named below this share of the height
_LINES = 6
_LABELS = 0.93
_LOSSES = (
    ("contact_loss", "impacts"),
    ("friction_loss", "dry friction"),
    ("damping_loss", "viscous friction"),
)


def turns(result: xr.Dataset) -> tuple[np.ndarray, ...]:
    """Return the turns of the crank in a trajectory: begin and end [s], mean speed [rad/s], amplitude [m].

    The amplitude is half the range of the position. Turns that are not completed are left out.
    """
    time, angle, x = (result[name].values for name in ("time", "crank_angle", "x"))
    number = np.floor(angle / (2 * np.pi)).astype(int)
    # the crank may turn back: a turn begins where it is reached for the first time
    first = np.maximum.accumulate(number)
    marks = np.flatnonzero(np.diff(first) > 0) + 1
    begins = np.array(
        [np.interp(2 * np.pi * first[k], angle[k - 1 : k + 1], time[k - 1 : k + 1]) for k in marks]
    )
    if begins.size < 2:
        return np.empty(0), np.empty(0), np.empty(0), np.empty(0)
    counts = np.diff(first[marks])
    half = np.array([np.ptp(x[a:b]) / 2 for a, b in pairwise(marks)])
    return begins[:-1], begins[1:], 2 * np.pi * counts / np.diff(begins), half


def history(result: xr.Dataset, title: str, caption: list[str], look: Look = DEFAULT) -> Figure:
    """Return speed of the crank, position of the body and power of the motor during the whole run."""
    page = Page(look, (style.DOUBLE_COLUMN, 120.0), 3, sharex=True)
    page.letter()
    time = result["time"].values
    names = {"crank_speed": "crank speed", "x": "position $x$", "motor_power": "power"}
    for ax, (name, label) in zip(page.axes, names.items(), strict=True):
        ax.plot(time, result[name].values, color=style.MOTION, linewidth=0.5)
        ax.set_ylabel(f"{label} ({unit(result[name])})")
        ax.set_xlim(time[0], time[-1])
    page.axes[-1].set_xlabel(axis_label(result["time"]))
    return page.finish(title, caption, [], columns=1)


def turn(result: xr.Dataset, title: str, caption: list[str], look: Look = DEFAULT) -> Figure:
    """Return the speed of the crank over its angle in the last turns, one upon the other."""
    page = Page(look, (style.DOUBLE_COLUMN, 70.0))
    (ax,) = page.axes
    angle, speed = result["crank_angle"].values, result["crank_speed"].values
    last = angle >= 2 * np.pi * (np.floor(angle[-1] / (2 * np.pi)) - _TURNS)
    degrees = np.degrees(np.mod(angle[last], 2 * np.pi))
    broken = np.where(np.diff(degrees, prepend=degrees[0]) < 0, np.nan, speed[last])
    ax.plot(degrees, broken, color=style.MOTION, linewidth=0.8)
    ax.set_xlim(0, 360)
    ax.set_xticks(range(0, 361, 60))
    ax.set_xlabel("crank angle (deg)")
    ax.set_ylabel(axis_label(result["crank_speed"]))
    return page.finish(title, [f"the last {_TURNS} turns", *caption], [], columns=1)


def shares(result: xr.Dataset) -> dict[str, float]:
    """Return the mean power over the window of a trajectory, and its parts [W]; what they leave is stored."""
    time = result["time"].values
    at = time >= time[-1] - float(result.attrs["window"])
    span = time[at][-1] - time[at][0]
    parts = {"motor": np.ptp(result["drive_work"].values[at]) / span}
    return parts | {label: np.ptp(result[name].values[at]) / span for name, label in _LOSSES}


def power(result: xr.Dataset, title: str, caption: list[str], look: Look = DEFAULT) -> Figure:
    """Return where the power of the motor goes: bars of the mean over the window."""
    page = Page(look, (style.DOUBLE_COLUMN, 50.0))
    (ax,) = page.axes
    parts = shares(result)
    names = list(parts)[::-1]
    hatches = dict(zip(parts, ("", "///", "...", "xx"), strict=True))
    for name in names:
        ax.barh(
            name,
            parts[name],
            color="white" if name != "motor" else "0.6",
            edgecolor="black",
            hatch=hatches[name],
        )
        ax.text(parts[name], name, f" {parts[name]:.4g} W", va="center", fontsize=7)
    ax.set_xlim(0, 1.18 * max(parts.values()))
    ax.set_xlabel("mean power (W)")
    text = f"the last {float(result.attrs['window']):.4g} {unit(result['time'])}"
    return page.finish(title, [text, *caption], [], columns=1)


def torque_of(motor: dict, speed: np.ndarray) -> np.ndarray | None:
    """Return the torque of a motor [N m] at a speed of the crank [rad/s]; None of one that has no line.

    `motor` is the table of the case. A current follows the speed at once.
    """
    match motor["law"]:
        case "linear":
            return motor["stall_torque"] * (1 - speed / motor["no_load_speed"])
        case "dc":
            current = (motor["voltage"] - motor["torque_constant"] * speed) / motor["resistance"]
            return motor["torque_constant"] * current
        case "kloss":
            slip, most = 1 - speed / motor["synchronous_speed"], motor["breakdown_slip"]
            return 2 * motor["breakdown_torque"] * slip * most / (slip**2 + most**2)
        case _:
            return None


def torque_lines(
    ax: Axes, result: xr.Dataset, parameter: str, name: Callable[[float], str], top: float
) -> Line2D:
    """Draw the torque of the motor over its speed for some values of a parameter of a file of branches.

    `name` is the text of a value, `top` the highest torque in the picture [N m].
    """
    line = {"color": "0.55", "linewidth": 0.7, "linestyle": "-"}
    motor, values = resolved_case(result)["motor"], result["parameter"].values
    low, high = ax.get_xlim()
    speed = np.linspace(low, high, 400)
    for value in np.linspace(values.min(), values.max(), _LINES):
        torque = torque_of(motor | {parameter.removeprefix("motor."): value}, speed)
        ax.plot(speed, torque, **line, zorder=1)
        seen = np.flatnonzero((torque >= 0) & (torque <= _LABELS * top))
        if seen.size:
            at = (speed[seen[0]], torque[seen[0]])
            ax.annotate(name(value), at, (3, 1), textcoords="offset points", fontsize=6, va="bottom")
    return Line2D([], [], **line, label="torque of the motor")


def mean_speed(result: xr.Dataset) -> np.ndarray:
    """Return the mean speed of the crank of every orbit in a file of branches [rad/s]."""
    return 2 * np.pi * result["period"].values / result["cycle_time"].values


def has_motor(result: xr.Dataset) -> bool:
    """Whether a result is of a machine with a motor."""
    return "motor" in resolved_case(result)


def natural_of(result: xr.Dataset) -> float:
    """Return the natural angular frequency of body and spring [rad/s]; 0 without a spring."""
    case = resolved_case(result)
    return float(np.sqrt(case["restoring"].get("stiffness", 0.0) / case["body"]["mass"]))


def mark_natural(ax: Axes, natural: float, upright: bool = False, colour: str = "0.6") -> Line2D:
    """Draw the natural frequency [rad/s] across a diagram of speeds, `upright` where they lie across."""
    line = {"color": colour, "linewidth": 0.7, "linestyle": (0, (1, 2))}
    (ax.axvline if upright else ax.axhline)(natural, **line)
    return Line2D([], [], **line, label="natural frequency")


def mark_speeds(grid: list[Axes], result: xr.Dataset, upright: bool, scale: float) -> list[Line2D]:
    """Mark natural frequency and mean speeds of the cycles in the panels of a map over the crank speed.

    `upright`: the speed lies across; `scale` is its unit over rad/s. The number beside a mark is the label.
    """
    found = []
    for ax in grid:
        limits = ax.get_xlim(), ax.get_ylim()
        ends = limits[0] if upright else limits[1]
        natural = natural_of(result) * scale
        if min(ends) < natural < max(ends):
            found = [mark_natural(ax, natural, upright, "black")]
        for label, speed in cycle_speeds(result):
            if not min(ends) < speed * scale < max(ends):
                continue
            mark = {"color": "black", "markersize": 5, "clip_on": False, "zorder": 6, "linestyle": ""}
            across = ax.get_xaxis_transform() if upright else ax.get_yaxis_transform()
            at = (speed * scale, 1.0) if upright else (1.0, speed * scale)
            ax.plot(*at, marker="v" if upright else "<", transform=across, **mark)
            side = {"xytext": (0, 4), "ha": "center"} if upright else {"xytext": (5, 0), "va": "center"}
            ax.annotate(str(label), at, xycoords=across, textcoords="offset points", fontsize=7, **side)
        ax.set_xlim(limits[0])
        ax.set_ylim(limits[1])
    return found


def cycle_speeds(result: xr.Dataset) -> list[tuple[int, float]]:
    """Return label and mean speed of the crank [rad/s] of each cycle in the catalogue of a map."""
    if "catalogue_cycle_time" not in result:
        return []
    columns = (result[f"catalogue_{name}"].values for name in ("attractor", "period", "cycle_time"))
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return sorted({(label, 2 * np.pi * period / time) for label, period, time in rows if time > 0})
