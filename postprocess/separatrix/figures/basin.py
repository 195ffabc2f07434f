# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Basin maps: which motion each starting point leads to."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path

import h5py
import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from separatrix import style
from separatrix.classes import CLASS_FIELDS, Class, class_counts, class_index, classes, recoloured
from separatrix.derived import at_points, derived_names
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures import inset, marks, motor, section, shares
from separatrix.figures.caption import caption_pieces, describe_case, start_pieces, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Figures, Page, label
from separatrix.labels import axis_label, count_text, plain, share_texts, value_label
from separatrix.locks import lock_options
from separatrix.open import table
from separatrix.reduce import Plane, Strip, majority_plane, scalar_plane

MOST_PANELS = 12
_PANEL = 42.0  # mm, height of a panel where three stand side by side


@dataclass
class _Panel:
    """One slice of the map: its position on the other axes and what was read of it."""

    heading: str
    plane: Plane
    # of rows and columns of the image
    edges: tuple[np.ndarray, np.ndarray]
    settle_time: np.ndarray | None = None


def figures(
    path: str | Path | None, result: xr.Dataset, field: str | None, title: str, look: Look = DEFAULT
) -> Figures:
    """Return the maps of a basin file by name: attractor and regime, or the one field that is asked for.

    Without any label there is no map of the attractors, unless it is asked for; "shares" is their share over
    the parameter of a stack of maps. `path`: the file, which is read by slabs; None: the result is in memory.
    """
    served = ("region", "slice", "inset", "axes", "units", "shade", "colours", "colour_map", "limits")
    look.require("map", *served)
    if look.inset and (field == "shares" or "sample" in result["regime"].dims):
        raise SeparatrixError("inset: not served by the figure of shares", USAGE)
    if "sample" in result["regime"].dims and field in (None, "shares"):
        return Figures({"shares": partial(shares.sampled, result, title, look)})
    if field == "shares":
        return Figures({"shares": partial(shares.diagram, result, title, look)})
    if field and field in derived_names(result):
        path, result = None, result.assign({field: at_points(result, field)})
    names = [field] if field else [*(["attractor"] if _labelled(result) else []), "regime"]
    for name in names:
        if name not in result or result[name].dims != result["regime"].dims:
            fields = [key for key, var in result.data_vars.items() if var.dims == result["regime"].dims]
            known = ", ".join([*fields, *derived_names(result)])
            where = "" if path is None else f"{path}: "
            raise SeparatrixError(f"{where}no field '{name}'; known fields: {known}, shares", USAGE)
    return Figures({name: partial(basin_map, path, result, name, title, look) for name in names})


def basin_map(
    path: str | Path | None,
    result: xr.Dataset,
    field: str,
    title: str,
    look: Look = DEFAULT,
    totals: dict[int, int] | None = None,
    over: str | None = None,
    curves: Callable[[list[Axes], list[dict[str, float]]], list[Line2D]] | None = None,
    notes: Sequence[str] = (),
) -> Figure:
    """Return the map of one field over the initial conditions, one panel per value of the other axes.

    `totals`: the points of each class in the legend, where it is to be that of more than is drawn. `over`: a
    variable of 0 and 1, black where it is 1. `curves` draws more into the panels, given their values on the
    other axes, and returns what the legend needs of it; `notes` are for the caption.
    """
    whole, result = result, look.selected(result)
    path = path if look.whole else None
    down, across = plane_axes(result, look)
    others = [name for name in result[field].dims if name not in (down, across)]
    slices = list(product(*(range(result.sizes[name]) for name in others)))
    chosen = _spread(slices, MOST_PANELS)
    axes, shaded = (down, across), look.shade and field in CLASS_FIELDS and "settle_time" in result
    panels = _read_panels(path, result, field, axes, others, chosen, shaded)
    part = inset.enlarged(whole, axes, len(panels), look) if look.inset else None
    page = _page(len(panels), 62.0 if down else 22.0, look)
    grid = page.axes
    # the inset is one more panel, which does not count
    drawn = panels
    if part is not None:
        drawn = panels + _read_panels(None, part, field, axes, others, [(0,) * len(others)], shaded)
    caption = caption_pieces(result, look, [*describe_case(result), *start_pieces(result)])
    handles = []
    if field in CLASS_FIELDS:
        handles = _draw_classes(grid, result, field, panels, drawn, look, totals)
    else:
        _draw_scalar(grid, result, field, panels, drawn, look)
    _label(grid[: len(panels)], result, axes)
    if part is not None:
        inset.frame(*grid, part, axes)
    if look.attractors and field in ("attractor", "regime", "settle_time") and {down, across} == {"x0", "v0"}:
        chosen_slices = chosen + chosen[: len(grid) - len(panels)]
        marked, lacking = marks.draw(grid, whole, result, across, others, chosen_slices, look)
        handles = [marks.on_legend(handle, marked) for handle in handles]
        caption += ["markers: points of the attractors on the section", *lacking] if marked else []
        if section.coordinates(result) > 2:
            caption.append("attractors are not marked: they have more coordinates than the picture")
    if motor.SPEED in axes and len(slices) == 1:
        upright = across == motor.SPEED
        handles += motor.mark_speeds(grid[: len(panels)], whole, upright, look.scale(whole, motor.SPEED)[0])
        caption.append("arrows: mean speeds of the cycles, with their labels")
    caption += _count_caption(result, field, panels, len(slices), look)
    if part is not None:
        caption.append(f"right: the part framed, {count_text(part[field].size)} points")
    if over is not None:
        black = _read_panels(None, result, over, axes, others, chosen)
        closer = [] if part is None else _read_panels(None, part, over, axes, others, [(0,) * len(others)])
        handles.append(_draw_over(grid, black, closer))
    if curves is not None:
        chosen_slices = chosen + chosen[: len(grid) - len(panels)]
        at = [
            {name: float(result[name].values[k]) for name, k in zip(others, index, strict=True)}
            for index in chosen_slices
        ]
        handles += curves(grid, at)
    caption += notes
    return page.finish(title, [*caption, plain(version_text(result))], handles)


def plane_axes(result: xr.Dataset, look: Look = DEFAULT) -> tuple[str | None, str]:
    """Return the axes of the image, vertical and horizontal: v0 over x0, or else the first two that vary.

    A map with one axis has no vertical one: it is returned as (None, axis).
    """
    dims = list(result["regime"].dims)
    if look.axes is not None:
        asked = [name.replace(".", "_") for name in look.axes]
        if len(set(asked)) != 2 or not set(asked) <= set(dims):
            raise SeparatrixError(
                f"axes: found {', '.join(look.axes)}, allowed two of {', '.join(dims)}", USAGE
            )
        return asked[1], asked[0]
    varying = [name for name in dims if result.sizes[name] > 1]
    if {"x0", "v0"} <= set(varying):
        return "v0", "x0"
    candidates = varying + [name for name in dims if name not in varying]
    return (candidates[1], candidates[0]) if len(candidates) > 1 else (None, candidates[0])


def cell_edges(centres: np.ndarray) -> np.ndarray:
    """Return the edges of cells around points: half way between neighbours, as far beyond the ends."""
    centres = np.asarray(centres, dtype=np.float64)
    if centres.size == 1:
        return centres[0] + np.array([-0.5, 0.5])
    middle = (centres[1:] + centres[:-1]) / 2
    return np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])


def _labelled(result: xr.Dataset) -> bool:
    """Whether the catalogue has an attractor that captured a point."""
    catalogue = table(result, "catalogue")
    return "count" in catalogue and bool(catalogue["count"].values.any())


def _read_panels(
    path: str | Path | None,
    result: xr.Dataset,
    field: str,
    axes: tuple,
    others: list[str],
    slices: list[tuple],
    shaded: bool = False,
) -> list[_Panel]:
    """Read a field at indices of the other axes, with the settling time where the map is shaded by it."""
    dims = result[field].dims
    panels = []
    with _source(path, result, field) as dataset:
        if axes[0] is None:
            dataset = Strip(dataset)
        plane = (dims.index(axes[0]), dims.index(axes[1])) if axes[0] else (1, 0)
        for index in slices:
            heading = ", ".join(
                value_label(result[name], float(result[name].values[k]))
                for name, k in zip(others, index, strict=True)
            )
            if field in (*CLASS_FIELDS, "differs"):
                data = majority_plane(dataset, plane, index)
            else:
                data = scalar_plane(dataset, plane, index, smallest=field == "grazing_margin")
            panels.append(_Panel(heading, data, _edges(result, axes, data)))
    if shaded:
        for panel, times in zip(
            panels, _read_panels(path, result, "settle_time", axes, others, slices), strict=True
        ):
            panel.settle_time = times.plane.image
    return panels


def _edges(result: xr.Dataset, axes: tuple, plane: Plane) -> tuple[np.ndarray, np.ndarray]:
    """Edges of rows and columns of an image, each cell centred on its point."""
    found = []
    for name, starts in zip(axes, (plane.row_starts, plane.column_starts), strict=True):
        whole = cell_edges(result[name].values) if name else np.array([0.0, 1.0])
        found.append(np.append(whole[starts], whole[-1]))
    return found[0], found[1]


@contextmanager
def _source(path: str | Path | None, result: xr.Dataset, field: str) -> Iterator[h5py.Dataset | np.ndarray]:
    """The field in its file, which is read by slabs, or without a path in memory."""
    if path is None:
        yield result[field].values
    else:
        with h5py.File(path, "r", **lock_options(path)) as file:
            yield file[field]


def _spread(items: list, most: int) -> list:
    """Return at most `most` items, evenly spread, first and last among them."""
    if len(items) <= most:
        return items
    return [items[k] for k in np.linspace(0, len(items) - 1, most).round().astype(int)]


def _page(number: int, height: float, look: Look) -> Page:
    """Return axes for so many panels; a single one has the given height in mm, as its inset."""
    if number == 1 and look.inset:
        return Page(look, (style.DOUBLE_COLUMN, height), 2, columns=2)
    if number == 1:
        return Page(look, (style.SINGLE_COLUMN, height))
    columns = min(number, 2 if number in (2, 4) else 3)
    height = (_PANEL if columns == 3 else 1.4 * _PANEL) * -(-number // columns) + 8.0
    return Page(look, (style.DOUBLE_COLUMN, height), number, columns, sharex=True, sharey=True)


def _draw_classes(
    grid: list[Axes],
    result: xr.Dataset,
    field: str,
    panels: list[_Panel],
    drawn: list[_Panel],
    look: Look,
    totals: dict[int, int] | None,
) -> list[Patch]:
    if totals is None:
        totals = {}
        for panel in panels:
            for code, count in panel.plane.counts.items():
                totals[code] = totals.get(code, 0) + count
    entries = recoloured(classes(result, field, totals), look.colours)
    colours = ListedColormap([entry.colour for entry in entries])
    first = drawn[0]
    by = None
    if len(drawn) > len(panels) and first.settle_time is not None:
        by = class_index(first.plane.image, entries), first.settle_time
    for ax, panel in zip(grid, drawn, strict=True):
        index = class_index(panel.plane.image, entries)
        if panel.settle_time is not None:
            _draw_image(ax, panel, marks.shaded(index, entries, panel.settle_time, by))
        else:
            image = _draw_image(ax, panel, index)
            image.set_cmap(colours)
            image.set_clim(-0.5, len(entries) - 0.5)
        if len(panels) > 1:
            shares = share_texts(class_counts(entries, panel.plane.counts))
            ax.set_title(f"{panel.heading}\n{_short_shares(shares)}", linespacing=1.3)
    shares = share_texts(class_counts(entries, totals))
    return [_patch(entry, share) for entry, share in zip(entries, shares, strict=True)]


def _draw_over(grid: list[Axes], panels: list[_Panel], closer: list[_Panel]) -> Patch:
    for ax, panel in zip(grid, panels + closer, strict=True):
        image = _draw_image(ax, panel, np.ma.masked_equal(panel.plane.image, 0))
        image.set_cmap(ListedColormap(["black"]))
    counts = [sum(panel.plane.counts.get(code, 0) for panel in panels) for code in (0, 1)]
    return Patch(facecolor="black", label=f"another motion ({100 * counts[1] / sum(counts):.3g} %)")


def _short_shares(shares: list[str]) -> str:
    """Shares in the order of the legend; many of them do not fit over a panel."""
    return " / ".join(share.removesuffix(" %") for share in shares) + " %" if len(shares) <= 4 else ""


def _patch(entry: Class, share: str) -> Patch:
    return Patch(facecolor=entry.colour, edgecolor="#555555", linewidth=0.3, label=f"{entry.text} ({share})")


def _draw_scalar(
    grid: list[Axes],
    result: xr.Dataset,
    field: str,
    panels: list[_Panel],
    drawn: list[_Panel],
    look: Look,
) -> None:
    values = np.concatenate([panel.plane.image.ravel() for panel in panels])
    values = values[np.isfinite(values)]
    low, high = np.quantile(values, [0.005, 0.995]) if values.size else (0.0, 1.0)
    if not low < high:
        low, high = low - 0.5, high + 0.5
    low, high = look.limits or (low, high)
    colour_map = _colour_map(look)
    norm = Normalize(low, high)
    for ax, panel in zip(grid, drawn, strict=True):
        image = _draw_image(ax, panel, np.ma.masked_invalid(panel.plane.image))
        image.set_cmap(colour_map)
        image.set_norm(norm)
        ax.set_facecolor(style.NOTHING)
        if len(panels) > 1:
            ax.set_title(panel.heading)
    below = values.size > 0 and values.min() < low
    above = values.size > 0 and values.max() > high
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get((below, above), "neither")
    mappable = ScalarMappable(norm, colour_map)
    grid[0].figure.colorbar(mappable, ax=grid, label=axis_label(result[field]), extend=extend, pad=0.02)


def _colour_map(look: Look) -> str:
    name = look.colour_map or style.SCALAR_MAP
    if name not in matplotlib.colormaps:
        raise SeparatrixError(f"colour map: found '{name}', which matplotlib does not have", USAGE)
    return name


def _draw_image(ax: Axes, panel: _Panel, image: np.ndarray) -> object:
    """Draw an image over the axes of the map, ascending."""
    edges = []
    for dimension, edge in enumerate(panel.edges):
        if edge[0] > edge[-1]:
            edge, image = edge[::-1], np.flip(image, dimension)
        edges.append(edge)
    drawn = ax.pcolorfast(edges[1], edges[0], image)
    # also in axes of another style: a class between two others is not in the file
    drawn.set_interpolation("nearest")
    return drawn


def _label(grid: list[Axes], result: xr.Dataset, axes: tuple) -> None:
    down, across = axes
    for ax in grid:
        ax.xaxis.set_major_locator(MaxNLocator(6 if len(grid) == 1 else 5))
        label(ax, axis_label(result[across]), axis_label(result[down]) if down else "")
        if down is None:
            ax.set_yticks([])


def _count_caption(
    result: xr.Dataset, field: str, panels: list[_Panel], slices: int, look: Look
) -> list[str]:
    rows, columns = panels[0].plane.factors
    headings = [panels[0].heading] if len(panels) == 1 and panels[0].heading else []
    number = result[field].size // slices
    pieces = [*headings, f"$N$ = {count_text(number)} points" + (" per panel" if len(panels) > 1 else "")]
    if len(panels) < slices:
        pieces.append(f"{len(panels)} of {slices} slices shown")
    if len(panels) > 1 and field in CLASS_FIELDS:
        pieces.append("shares over the panels in the order of the legend")
    if rows * columns > 1:
        what = "most frequent class" if field in CLASS_FIELDS else "mean"
        what = "smallest value" if field == "grazing_margin" else what
        pieces.append(f"a pixel shows the {what} of {columns} by {rows} points, shares count all points")
    if field not in CLASS_FIELDS:
        pieces.append("grey: no value")
    elif look.shade and "settle_time" in result:
        pieces.append("light: settles early, dark: late, by rank in each basin")
    return pieces
