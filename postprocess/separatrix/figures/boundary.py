# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Boundaries between basins as curves, over the map that they were found from where it is at hand."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.errors import SeparatrixError
from separatrix.figures import basin
from separatrix.figures.caption import (
    caption_pieces,
    describe_case,
    resolved_case,
    start_pieces,
    version_text,
)
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Figures, Page
from separatrix.labels import axis_label, count_text, plain, symbol
from separatrix.open import decode_flags, decode_word, open_result

# Text of the legend and line of each name of a piece.
_LINES = {
    "stable_set": ("boundary: stable set of saddle", "-"),
    "recurrent": ("boundary: recurrent edge state", "-"),
    "graze": ("boundary: edge of a graze", "--"),
    "stick": ("boundary: edge of a set of sticking states", "--"),
    "chatter": ("boundary: edge of a completed chatter", "--"),
    "other_event": ("boundary: edge at another event", "--"),
    "not_known": ("boundary: edge state not known", "-."),
    "edge": ("edge of the unlabelled region", ":"),
}
_SADDLES = ("black", "#56B4E9", "#F0E442", "#CC79A7", "#009E73", "#D55E00")
# Lines of the saddles when the colours begin anew.
_AGAIN = ("-", (0, (3, 1)), (0, (1, 1)))
# Saddles that a caption describes.
_MOST_LISTED = 4
_OURS = ("region", "slice", "inset", "axes", "units", "shade", "colours")


def figures(
    path: str | Path | None,
    result: xr.Dataset,
    title: str,
    look: Look = DEFAULT,
    over: xr.Dataset | None = None,
) -> Figures:
    """Return the figure of a file of boundaries by name.

    `over`: the map to draw them over; else that which the file names, if it lies beside the file at `path`.
    """
    look.require("file of boundaries", *_OURS)
    if over is not None:
        _check_map(result, over)
    return Figures({"boundary": lambda: _figure(path, result, title, look, over)})


def _figure(
    path: str | Path | None, result: xr.Dataset, title: str, look: Look, over: xr.Dataset | None
) -> Figure:
    if over is not None:
        return _over(None, over, result, title, look)
    beside = None if path is None else Path(path).parent / str(result.attrs["map"])
    if beside is not None and beside.is_file():
        with open_result(beside) as found:
            if _is_map(result, found):
                return _over(beside, found, result, title, look)
    return _alone(result, title, look)


def _is_map(result: xr.Dataset, other: xr.Dataset) -> bool:
    """Whether another result is the map that the boundaries were found from."""
    identity = other.attrs.get("provenance_case_identity")
    return other.attrs.get("kind") == "basin" and result.attrs.get("map_identity") == identity


def _check_map(result: xr.Dataset, other: xr.Dataset) -> None:
    if other.attrs.get("kind") != "basin" or not set(axes_of(result)) <= set(other.dims):
        raise SeparatrixError("over: these boundaries are not of this map")


def axes_of(result: xr.Dataset) -> tuple[str, str]:
    """Return the names of the two axes of the boundaries, in the order of the map."""
    first, second = str(result.attrs["axes"]).split()
    return first, second


def _over(path: Path | None, found: xr.Dataset, result: xr.Dataset, title: str, look: Look) -> Figure:
    """Draw the map of the attractors and the boundaries over it."""
    down, across = basin.plane_axes(found, look)
    if {down, across} != set(axes_of(result)):
        raise SeparatrixError(f"axes: the boundaries are those over {' and '.join(axes_of(result))}")

    def curves(grid: Sequence[Axes], panels: Sequence[dict[str, float]]) -> list[Line2D]:
        handles: list[Line2D] = []
        for ax, fixed in zip(grid, panels, strict=True):
            limits = ax.get_xlim(), ax.get_ylim()
            handles = _merged(handles, draw(ax, result, across, str(down), look, fixed))
            ax.set_xlim(limits[0])
            ax.set_ylim(limits[1])
        return handles

    return basin.basin_map(path, found, "attractor", title, look, curves=curves, notes=_notes(result, look))


def _alone(result: xr.Dataset, title: str, look: Look) -> Figure:
    """Draw the boundaries without their map."""
    first, second = axes_of(result)
    across, down = ("x0", "v0") if {first, second} == {"x0", "v0"} else (first, second)
    if look.axes is not None:
        across, down = (name.replace(".", "_") for name in look.axes)
        if {across, down} != {first, second}:
            raise SeparatrixError(f"axes: the boundaries are those over {first} and {second}")
    page = Page(look, (style.SINGLE_COLUMN, 62.0))
    (ax,) = page.axes
    handles = draw(ax, result, across, down, look, {})
    ax.set_xlabel(axis_label(look.in_units(result[[across]])[across]))
    ax.set_ylabel(axis_label(look.in_units(result[[down]])[down]))
    for name, (low, high) in look.region.items():
        factor = look.scale(result, name.replace(".", "_"))[0]
        (ax.set_xlim if name == across else ax.set_ylim)(factor * low, factor * high)
    caption = [
        *caption_pieces(result, look, [*describe_case(result), *start_pieces(result)]),
        *_notes(result, look),
        plain(version_text(result)),
    ]
    return page.finish(title, caption, handles)


def _notes(result: xr.Dataset, look: Look) -> list[str]:
    """The pieces of a caption on the boundaries."""
    number = int((result["across"].values >= 0).sum())
    if number == 0:
        return ["no boundary: all points have the same label"]
    notes = [f"{count_text(number)} boundary points, half of them known to {_errors_text(result, look)}"]
    rows = zip(
        result["saddles_period"].values,
        result["saddles_event_word"].values,
        result["saddles_multipliers"].values + 1j * result["saddles_multipliers_imag"].values,
        result["saddles_boundary_points"].values,
        strict=True,
    )
    listed = [
        f"saddle {k}: period {period}, {decode_word(word)}, multipliers {_multipliers_text(values)}"
        for k, (period, word, values, reached) in enumerate(rows, 1)
        if reached > 0
    ]
    if "saddles_section" in result and listed:
        notes.append("saddles are not marked: they have more coordinates than the picture")
    return notes + listed[:_MOST_LISTED]


def _errors_text(result: xr.Dataset, look: Look) -> str:
    """Return the median error of the points found along each axis, in the unit of the axis."""
    texts = []
    for number, name in enumerate(axes_of(result)):
        errors = result["error"].values[result["across"].values == number]
        if errors.size:
            factor, shown = look.scale(result, name)
            size = f"{np.median(errors) * factor:.1g} {'' if shown == '1' else shown}".rstrip()
            texts.append(f"{size} along {symbol(result[name])}")
    return ", ".join(texts)


def _multipliers_text(values: np.ndarray) -> str:
    """List multipliers, of a structure the two of largest modulus alone."""
    shown = [f"{value.real:.4g}" if value.imag == 0 else f"{value:.4g}" for value in values[:2]]
    return " and ".join(shown) if values.size == 2 else ", ".join([*shown, "..."])


def draw(
    ax: Axes, result: xr.Dataset, across: str, down: str, look: Look, fixed: dict[str, float]
) -> list[Line2D]:
    """Draw the pieces and the saddles of one panel; return what the legend needs."""
    handles: dict[str, Line2D] = {}
    factors = [look.scale(result, name)[0] for name in (across, down)]
    x, y = (result[name].values * factor for name, factor in zip((across, down), factors, strict=True))
    names = decode_flags(result["piece_name"]).values
    known = (result["label_one"].values != 0) & (result["label_two"].values != 0)
    for piece in range(result.sizes["piece"]):
        if not _belongs(result, "piece_", piece, fixed, look):
            continue
        chosen = np.arange(result["points"].values[piece]) + result["first"].values[piece]
        if result["closed"].values[piece]:
            chosen = np.append(chosen, chosen[0])
        name = names[piece] if known[piece] else "edge"
        (text, line), colour = _LINES[name], style.BOUNDARIES[name]
        saddle = int(result["piece_saddle"].values[piece])
        if saddle and known[piece]:
            again, number = divmod(saddle - 1, len(_SADDLES))
            text, colour, line = f"{text} {saddle}", _SADDLES[number], _AGAIN[again % len(_AGAIN)]
        ax.plot(x[chosen], y[chosen], "-", color="white", linewidth=1.8, zorder=3)
        ax.plot(x[chosen], y[chosen], linestyle=line, color=colour, linewidth=0.8, zorder=4)
        handles.setdefault(text, Line2D([], [], color=colour, linestyle=line, label=text))
    handles = dict(sorted(handles.items(), key=lambda item: _rank(item[0])))
    if (across, down) in (("x0", "v0"), ("v0", "x0")) and _on_section(result, fixed):
        handles |= _draw_sets(ax, result, across, factors, fixed, look)
        handles |= _draw_saddles(ax, result, across, factors, fixed, look)
    return list(handles.values())


def _rank(text: str) -> tuple[int, int]:
    """Where a line stands in the legend: the saddles by number, then the others as they came."""
    number = text.rpartition(" ")[2]
    return (0, int(number)) if number.isdecimal() else (1, 0)


def _draw_sets(
    ax: Axes, result: xr.Dataset, across: str, factors: list[float], fixed: dict[str, float], look: Look
) -> dict[str, Line2D]:
    """Draw the stable and unstable sets of the saddles: thin lines that end at cuts."""
    handles: dict[str, Line2D] = {}
    curve, part = result["sets_curve"].values, result["sets_part"].values
    points = [result[f"sets_{name}"].values for name in ("x", "v")]
    across_points, down_points = points if across == "x0" else points[::-1]
    breaks = np.flatnonzero((np.diff(curve) != 0) | (np.diff(part) != 0)) + 1
    for side in range(result.sizes["side"]):
        if not _belongs(result, "saddles_", int(result["sets_saddle"].values[side]) - 1, fixed, look):
            continue
        stable = bool(result["sets_stable"].values[side])
        text = "stable set of a saddle" if stable else "unstable set of a saddle"
        colour, line = (style.OKABE_ITO[5], "-") if stable else (style.OKABE_ITO[0], "-")
        mine = np.flatnonzero(curve == side)
        cuts = np.searchsorted(mine, breaks[(breaks > mine[0]) & (breaks <= mine[-1])])
        x, y = (np.insert(values[mine], cuts, np.nan) for values in (across_points, down_points))
        limits = ax.get_xlim(), ax.get_ylim()
        ax.plot(x * factors[0], y * factors[1], line, color=colour, linewidth=0.6, zorder=3.5)
        ax.set_xlim(limits[0])
        ax.set_ylim(limits[1])
        handles.setdefault(text, Line2D([], [], color=colour, linestyle=line, linewidth=0.8, label=text))
    return handles


def _draw_saddles(
    ax: Axes, result: xr.Dataset, across: str, factors: list[float], fixed: dict[str, float], look: Look
) -> dict[str, Line2D]:
    """Mark the saddles that the boundary leads to, and those within a basin."""
    handles: dict[str, Line2D] = {}
    owner = result["saddles_saddle"].values - 1
    reached = result["saddles_boundary_points"].values > 0
    x, v = result["saddles_x"].values, result["saddles_v"].values
    points = (x, v) if across == "x0" else (v, x)
    for on_boundary, text in ((True, "saddle"), (False, "saddle within a basin")):
        chosen = reached[owner] == on_boundary
        chosen &= [_belongs(result, "saddles_", int(one), fixed, look) for one in owner]
        if not chosen.any():
            continue
        drawn = {"marker": "X", "markersize": 5.0, "markeredgecolor": "black", "linestyle": ""}
        drawn |= {"markerfacecolor": "white" if on_boundary else "0.6", "markeredgewidth": 0.6, "zorder": 6}
        limits = ax.get_xlim(), ax.get_ylim()
        ax.plot(points[0][chosen] * factors[0], points[1][chosen] * factors[1], **drawn)
        ax.set_xlim(limits[0])
        ax.set_ylim(limits[1])
        handles[text] = Line2D([], [], **drawn, label=text)
    return handles


def _on_section(result: xr.Dataset, fixed: dict[str, float]) -> bool:
    """Whether the starts of a panel are on the section at crank angle 0, where the saddles are given."""
    if "saddles_section" in result:
        # in 2n dimensions: nothing puts them into the slice
        return False
    start = resolved_case(result).get("start", {})
    angle = fixed.get("crank_angle", start.get("crank_angle", 0.0) if isinstance(start, dict) else 0.0)
    return bool(np.isclose(np.sin(float(angle) / 2), 0, atol=1e-12))


def _belongs(result: xr.Dataset, prefix: str, row: int, fixed: dict[str, float], look: Look) -> bool:
    """Whether a piece or a saddle is of the slice of the map that a panel shows."""
    for name, value in fixed.items():
        variable = result[f"{prefix}{name}"]
        mine = variable.values[row] * look.scale(result, f"{prefix}{name}")[0]
        if not np.isclose(mine, value, rtol=1e-12, atol=0):
            return False
    return True


def _merged(handles: list[Line2D], more: list[Line2D]) -> list[Line2D]:
    texts = [handle.get_label() for handle in handles]
    return handles + [handle for handle in more if handle.get_label() not in texts]
