# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Branches of orbits and equilibria over a parameter: stable full, unstable broken, with bifurcations."""

from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.figures import motor
from separatrix.figures.caption import caption_pieces, describe_case, resolved_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Figures, Page
from separatrix.labels import axis_label, plain, unit
from separatrix.open import decode_flags

# Label in the file, marker, and text of the legend.
_MARKS = {
    "SN": ("o", "fold (SN)"),
    "PD": ("s", "period doubling (PD)"),
    "NS": ("*", "Neimark-Sacker (NS)"),
    "BP": ("P", "branch point (BP)"),
    "GR": ("^", "graze (GR)"),
    "GR-fold": ("v", "graze with a fold (GR-fold)"),
    "stick_onset": ("D", "stick onset"),
    "chatter_onset": ("X", "chatter onset"),
    "stiction_end": ("h", "stiction end"),
    "release": ("<", "release"),
    "HB": ("H", "Hopf point (HB)"),
    "BE": (">", "equilibrium at a stop (BE)"),
    "homoclinic_contact": ("d", "homoclinic contact"),
    "boundary_crisis": ("p", "boundary crisis"),
    "not_known": ("x", "end not known"),
    "many_impacts": ("1", "impacts too many to go on"),
    "too_long": ("|", "points too many to go on"),
}

# Colour and line of a curve in two parameters.
_LINES = {"SN": ("C0", "-"), "PD": ("C1", "--"), "GR": ("C2", "-."), "stick_onset": ("C3", ":")}


def figures(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figures:
    """Return the figure of a file of branches by name."""
    look.require("file of branches", "units")
    makers = {"branches": partial(diagram, result, title, look)}
    if motor.has_motor(result) and "cycle_time" in result:
        makers["speed"] = partial(speeds, result, title, look)
        if str(result.attrs["parameter"]).startswith("motor.") and _torques(result) is not None:
            makers["torque"] = partial(torques, result, title, look)
    if result.sizes.get("curve_point"):
        makers["curves"] = partial(chart, result, title, look)
    return Figures(makers)


def chart(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the curves of labelled points over both parameters, with their points of codimension two."""
    result = look.selected(result)
    page = Page(look, (style.DOUBLE_COLUMN, 85.0))
    (ax,) = page.axes
    number, across, up = (result[name].values for name in ("curve", "curve_parameter", "curve_free"))
    labels, second = (decode_flags(result[name]).values for name in ("curve_label", "curve_second"))
    handles = {}
    for curve in np.unique(number):
        chosen = number == curve
        name = str(labels[chosen][0])
        colour, line = _LINES[name]
        ax.plot(across[chosen], up[chosen], line, color=colour, linewidth=1.2)
        handles[name] = Line2D([], [], color=colour, linestyle=line, label=_MARKS[name][1])
    double = second != "none"
    if double.any():
        ax.plot(across[double], up[double], "o", color="black", markersize=4)
        handles["double"] = Line2D(
            [], [], marker="o", color="black", linestyle="none", markersize=4, label="codimension two"
        )
    for name, set_text in (("parameter", ax.set_xlabel), ("free", ax.set_ylabel)):
        _set_label(result[f"curve_{name}"].copy(), str(result.attrs[name]), set_text)
    caption = [
        *caption_pieces(result, look, describe_case(result)),
        f"{np.unique(number).size} curves of labelled points; there may be others",
        plain(version_text(result)),
    ]
    return page.finish(title, caption, list(handles.values()), columns=4)


def _set_label(axis: xr.DataArray, parameter: str, set_text: Callable[[str], object]) -> None:
    """Label an axis with the parameter that it is."""
    axis.name = parameter.replace(".", "_")
    axis.attrs["long_name"] = parameter.replace(".", " ").replace("_", " ")
    set_text(axis_label(axis))


# So large a share of orbits that touch both stops have one and the same amplitude: it would show little.
_TOUCH_BOTH = 0.25


def height(result: xr.Dataset, look: Look = DEFAULT) -> tuple[np.ndarray, str]:
    """Return what is drawn over the parameter, in the units asked for, and its name; `result` is in SI units.

    The amplitude; between two stops, where that of all that touches both is the play, a point on the section.
    In a file of equilibria or rest sets alone it is their position.
    """
    if "x_max" not in result:
        position = "equilibrium_x" if "equilibrium_x" in result else "rest_x_low"
        return np.empty(0), f"position at rest ({look.unit(unit(result[position]))})"
    amplitude = (result["x_max"].values - result["x_min"].values) / 2
    factor, lengths = look.factor(unit(result["x_max"])), look.unit(unit(result["x_max"]))
    both = np.zeros(amplitude.shape, bool)
    for play in _plays(result):
        both |= np.isclose(amplitude, play / 2, rtol=1e-9, atol=0)
    if both.mean() < _TOUCH_BOTH:
        return factor * amplitude, rf"amplitude $(x_\mathrm{{max}} - x_\mathrm{{min}})/2$ ({lengths})"
    return factor * result[
        "x"
    ].values, f"{result['x'].attrs.get('long_name', 'position on the section')} ({lengths})"


def _plays(result: xr.Dataset) -> list[np.ndarray]:
    """Return the distance of the stops of every contact with two, at each orbit."""
    contact = resolved_case(result).get("contact", {})
    named = {f"contact.{name}": table for name, table in contact.items() if isinstance(table, dict)}
    parameter, values = str(result.attrs.get("parameter", "")), result["parameter"].values
    found = []
    for path, table in (named or {"contact": contact}).items():
        if {"lower", "upper"} <= set(table):
            lower, upper = (
                values if parameter == f"{path}.{end}" else np.full(values.shape, float(table[end]))
                for end in ("lower", "upper")
            )
            found.append(upper - lower)
    return found


def diagram(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the amplitude of every orbit, or a point on its section, over the parameter."""
    page = Page(look, (style.DOUBLE_COLUMN, 85.0))
    (ax,) = page.axes
    handles = draw(ax, result, look)
    name = height(result, look)[1]
    result = look.selected(result)
    parameters = ("parameter", "equilibrium_parameter", "rest_parameter")
    across = result[next(name for name in parameters if name in result)].copy()
    _set_label(across, str(result.attrs["parameter"]), ax.set_xlabel)
    ax.set_ylabel(name)
    counts = []
    if "branch" in result:
        number, seeds = int(result["branch"].max()), int(result.attrs["seeds"])
        several = "branch" if number == 1 else "branches", "seed" if seeds == 1 else "seeds"
        counts.append(f"{number} {several[0]} from {seeds} {several[1]}")
    if "equilibrium_branch" in result:
        counts.append(f"{int(result['equilibrium_branch'].max())} of equilibria")
    if not counts:
        counts.append(
            f"no orbits; dry friction holds {plain(str(result.attrs['rest_joints']).split('; ')[0])}"
        )
        if not np.isfinite(result["rest_x_low"].values).any():
            ax.text(0.5, 0.5, "between which positions is not known", ha="center", transform=ax.transAxes)
    caption = [
        *caption_pieces(result, look, describe_case(result)),
        f"{', '.join(counts)}; there may be others",
        plain(version_text(result)),
    ]
    return page.finish(title, caption, handles, columns=4)


def speeds(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the mean speed of the crank on every orbit over the parameter, of a machine with a motor."""
    page = Page(look, (style.DOUBLE_COLUMN, 85.0))
    (ax,) = page.axes
    handles = draw(ax, result, look, motor.mean_speed(result))
    handles.append(motor.mark_natural(ax, motor.natural_of(result)))
    across = look.selected(result)["parameter"].copy()
    _set_label(across, str(result.attrs["parameter"]), ax.set_xlabel)
    ax.set_ylabel("mean speed of the crank (rad/s)")
    caption = [*caption_pieces(result, look, describe_case(result)), plain(version_text(result))]
    return page.finish(title, caption, handles, columns=4)


def _torques(result: xr.Dataset) -> np.ndarray | None:
    """Return the torque of the motor at the mean speed of every orbit [N m]; None without a line."""
    name = str(result.attrs["parameter"]).removeprefix("motor.")
    law = resolved_case(result)["motor"] | {name: result["parameter"].values}
    return motor.torque_of(law, motor.mean_speed(result))


def torques(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the torque that the machine takes over the mean speed, with lines of the motor across it.

    The orbits of a value of the parameter are where its line crosses the torque of the machine.
    """
    page = Page(look, (style.DOUBLE_COLUMN, 85.0))
    (ax,) = page.axes
    torque, parameter = _torques(result), str(result.attrs["parameter"])
    over_speed = result.assign(parameter=(result["parameter"].dims, motor.mean_speed(result)))
    handles = draw(ax, over_speed, look, torque)
    top = 1.1 * float(torque.max())
    ax.set_ylim(0, top)
    shown = look.selected(result)["parameter"]
    factor = shown.values[0] / result["parameter"].values[0] if result["parameter"].values[0] else 1.0
    unit_of = unit(shown)
    handles.append(
        motor.torque_lines(ax, result, parameter, lambda value: f"{factor * value:.3g} {unit_of}", top)
    )
    handles.append(motor.mark_natural(ax, motor.natural_of(result), upright=True))
    ax.set_xlabel("mean speed of the crank (rad/s)")
    ax.set_ylabel("mean torque (N m)")
    name = parameter.replace("motor.", "").replace("_", " ")
    text = f"grey: the motor at values of its {name}; black: what the machine takes"
    caption = [*caption_pieces(result, look, describe_case(result)), text, plain(version_text(result))]
    return page.finish(title, caption, handles, columns=4)


def draw(
    ax: Axes, result: xr.Dataset, look: Look = DEFAULT, values: np.ndarray | None = None
) -> list[Line2D]:
    """Draw the branches of orbits and equilibria and their labelled points; return what the legend needs.

    `values` of the orbits replace their amplitudes.
    """
    up, name = height(result, look)
    up = up if values is None else values
    result = look.selected(result)
    labels = []
    if "branch" in result:
        labels.append(_draw_lines(ax, result, "", up, ("black", "0.45")))
    if "equilibrium_branch" in result:
        # An equilibrium has no amplitude.
        rest = result["equilibrium_x"].values * (0 if name.startswith("amplitude") else 1)
        labels.append(_draw_lines(ax, result, "equilibrium_", rest, ("C0", "C0")))
    if "rest_parameter" in result and not name.startswith("amplitude"):
        ends = (result[f"rest_{which}"].values for which in ("parameter", "x_low", "x_high"))
        ax.vlines(*ends, color="C4", linewidth=3)
    ax.autoscale_view()
    handles = []
    if "branch" in result:
        handles += [
            Line2D([], [], color="black", linestyle="-", label="stable"),
            Line2D([], [], color="0.45", linestyle="--", label="unstable"),
        ]
    if "equilibrium_branch" in result:
        handles += [Line2D([], [], color="C0", linestyle="-", label="equilibrium (broken: unstable)")]
    if "rest_parameter" in result and not name.startswith("amplitude"):
        handles.append(Line2D([], [], color="C4", linewidth=3, label="friction holds: rest set"))
    for number, (name, (marker, text)) in enumerate(_MARKS.items()):
        marked = [points[chosen == name] for points, chosen in labels if (chosen == name).any()]
        if not marked:
            continue
        colour = f"C{number % 10}"
        ax.plot(*np.concatenate(marked).T, marker, color=colour, markersize=4, linestyle="none")
        handles.append(
            Line2D([], [], marker=marker, color=colour, linestyle="none", markersize=4, label=text)
        )
    return handles


def _draw_lines(
    ax: Axes, result: xr.Dataset, prefix: str, up: np.ndarray, colours: tuple[str, str]
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the lines of orbits or equilibria; return all points, and the label of each."""
    across = result[f"{prefix}parameter"].values
    stable, branch = result[f"{prefix}stable"].values == 1, result[f"{prefix}branch"].values
    for look, colour in zip(("-", "--"), colours, strict=True):
        # A piece between two points is stable where both are.
        joined = (branch[1:] == branch[:-1]) & (
            stable[1:] & stable[:-1] if look == "-" else ~(stable[1:] & stable[:-1])
        )
        # Whole curves: a dash is longer than a piece.
        ends = np.flatnonzero(np.diff(np.concatenate([[0], joined.astype(int), [0]]))).reshape(-1, 2)
        lines = [np.column_stack([across[first : last + 1], up[first : last + 1]]) for first, last in ends]
        ax.add_collection(
            LineCollection(lines, colors=colour, linestyles=look, linewidths=1.2 if look == "-" else 0.9)
        )
    return np.column_stack([across, up]), decode_flags(result[f"{prefix}label"]).values
