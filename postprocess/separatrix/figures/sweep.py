# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps: amplitude-frequency diagram with its regions, bifurcation diagram with impact speeds."""

from functools import partial

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from separatrix import style
from separatrix.derived import PREFIX, at_points, derived_names, short_name
from separatrix.figures import pair_sweep
from separatrix.figures.caption import caption_pieces, describe_case, resolved_case, version_text
from separatrix.figures.look import DEFAULT, UNITS, Look
from separatrix.figures.page import Figures, Page, show_all
from separatrix.figures.regions import Boundary, Region, boundaries, limit_texts, regions
from separatrix.labels import axis_label, count_text, plain, unit
from separatrix.open import table

_UP, _DOWN = 0, 1
# sizes of the texts above the axes, which are so many points apart
_NAME, _VALUE = 7.0, 6.0
# in mm: limits so close have their values turned, axes so narrow no room beside turned values
_CLOSE, _NARROW = 6.8, 100.0
_NOT_RUN = 0


def figures(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figures:
    """Return the figures of a sweep file by name."""
    look.require("sweep", "region", "units")
    # before a region is chosen: a slice is known by its number among all values
    starts = [at_points(result, name) for name in derived_names(result)]
    result = look.selected(result.assign({str(one.name): one for one in starts}))
    if "driven_mass" in resolved_case(result).get("body", {}):
        return Figures({"regimes": partial(pair_sweep.regimes, result, swept_axis(result), title, look)})
    return Figures(
        {
            "amplitude": partial(amplitude_diagram, result, title, look),
            "bifurcation": partial(bifurcation_diagram, result, title, look),
            **{
                str(key): partial(derived_diagram, result, str(key), title, look)
                for key in result.data_vars
                if str(key).startswith(PREFIX)
            },
        }
    )


def swept_axis(result: xr.Dataset) -> str:
    """Return the name of the swept parameter."""
    return next(name for name in result["x_max"].dims if name != "direction")


def amplitude_diagram(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return extreme positions against the swept parameter, both runs, with the regions of motion."""
    name = swept_axis(result)
    page = Page(look, (style.DOUBLE_COLUMN, 85.0))
    (ax,) = page.axes
    handles = _draw_branches(ax, result, name, "branch_x_max", "branch_x_min")
    handles += _draw_runs(ax, result, name)
    handles += _draw_barriers(ax, result)
    handles += _draw_regions(ax, result, name)
    ax.set_xlabel(axis_label(result[name]))
    ax.set_ylabel(rf"extreme positions $x_\mathrm{{max}}$, $x_\mathrm{{min}}$ ({unit(result['x_max'])})")
    caption = [*_caption(result, name, look), *_limits_caption(result), plain(version_text(result))]
    return page.finish(title, caption, handles, columns=5)


def derived_diagram(result: xr.Dataset, key: str, title: str, look: Look = DEFAULT) -> Figure:
    """Return a derived quantity against the swept parameter, both runs and the many starts."""
    name = swept_axis(result)
    page = Page(look, (style.DOUBLE_COLUMN, 70.0))
    (ax,) = page.axes
    values = result[name].values
    handles = _draw_branches(ax, result, name, f"branch_{key}")
    _draw_run_pair(ax, values, result[key].transpose("direction", name).values, result)
    show_all(ax, values)
    ax.set_xlabel(axis_label(result[name]))
    ax.set_ylabel(axis_label(result[key].assign_attrs(label=short_name(result[key]))))
    caption = [
        plain(str(result[key].attrs["long_name"])),
        *_caption(result, name, look),
        plain(version_text(result)),
    ]
    return page.finish(title, caption, [*handles, *_run_handles(result)], columns=5)


def bifurcation_diagram(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return stroboscopic positions and mean impact speeds against the swept parameter."""
    name = swept_axis(result)
    # a single one of the user is for the section
    panels = 1 if len(look.ax) == 1 else 2
    page = Page(look, (style.DOUBLE_COLUMN, 105.0), panels, sharex=True, height_ratios=(3, 2))
    top, bottom = page.axes[0], page.axes[1] if panels == 2 else None
    values = result[name].values
    section = result["section_x"].transpose("direction", name, "sample").values
    speed = result["mean_impact_speed"].transpose("direction", name).values
    runs = _directions(result)
    agree = _runs_agree(section) if len(runs) == 2 else np.zeros(values.size, bool)
    colours = {code: (style.RUN_UP, style.RUN_DOWN)[code] for _, code in runs}
    for index, code in runs:
        _thin_points(top, values, section[index], ~agree, colours[code])
    _thin_points(top, values, section[0], agree, style.BOTH_RUNS)
    _draw_barriers(top, result)
    top.set_ylabel(f"position $x$ ({unit(result['section_x'])})\nonce per drive period")
    if bottom:
        for index, code in runs:
            _thin_points(bottom, values, speed[index][:, np.newaxis], ~agree, colours[code])
        _thin_points(bottom, values, speed[0][:, np.newaxis], agree, style.BOTH_RUNS)
        bottom.set_ylabel(f"mean impact\nspeed ({unit(result['mean_impact_speed'])})")
        bottom.set_ylim(bottom=min(0.0, bottom.get_ylim()[0]))
    page.axes[-1].set_xlabel(axis_label(result[name]))
    for ax in page.axes:
        show_all(ax, values)
    page.letter()
    caption = [
        f"last {result.sizes['sample']} stroboscopic points of each hold",
        *_caption(result, name, look),
    ]
    caption.append(plain(version_text(result)))
    dots = [_dot(colour, ("run-up", "run-down")[code]) for code, colour in colours.items()]
    dots += [_dot(style.BOTH_RUNS, "both alike")] if agree.any() else []
    return page.finish(title, caption, [*dots, *_barrier_handles(result)], columns=4)


def _dot(colour: str, label: str) -> Line2D:
    return Line2D(
        [], [], linestyle="", marker="o", markersize=2.5, markeredgewidth=0, color=colour, label=label
    )


def _thin_points(ax: Axes, values: np.ndarray, points: np.ndarray, chosen: np.ndarray, colour: str) -> None:
    """Draw points so small that a band shows where the motion is often; where there are few, larger ones."""
    if not chosen.any():
        return
    along = np.broadcast_to(values[:, np.newaxis], points.shape)
    size = float(np.clip(250.0 / values.size, 0.25, 2.5))
    rasterized = points.size > 2000
    ax.scatter(along[chosen], points[chosen], s=size, c=colour, linewidths=0, rasterized=rasterized, zorder=3)


def _runs_agree(section: np.ndarray) -> np.ndarray:
    """Where both runs show the same motion: extremes of the points that differ by at most 5 % of all."""
    finite = np.isfinite(section)
    room = 0.05 * (np.ptp(section[finite]) if finite.any() else 0.0)
    low, high = section.min(axis=2), section.max(axis=2)
    with np.errstate(invalid="ignore"):
        return (np.abs(low[0] - low[1]) <= room) & (np.abs(high[0] - high[1]) <= room)


def _draw_branches(ax: Axes, result: xr.Dataset, name: str, *keys: str) -> list[Line2D]:
    if keys[0] not in result:
        return []
    for key in keys:
        values = result[key].transpose(name, "start").values
        along = np.broadcast_to(result[name].values[:, np.newaxis], values.shape)
        ax.scatter(
            along,
            values,
            s=2.2,
            c=style.BRANCH,
            marker="o",
            linewidths=0,
            rasterized=values.size > 2000,
            zorder=1,
        )
    label = f"brute force, {result.sizes['start']} starts"
    return [Line2D([], [], linestyle="", marker="o", markersize=2.2, color=style.BRANCH, label=label)]


def _draw_runs(ax: Axes, result: xr.Dataset, name: str) -> list[Line2D]:
    values = result[name].values
    for key in ("x_max", "x_min"):
        _draw_run_pair(ax, values, result[key].transpose("direction", name).values, result)
    show_all(ax, values)
    return _run_handles(result)


def _draw_run_pair(ax: Axes, values: np.ndarray, runs: np.ndarray, result: xr.Dataset) -> None:
    """Draw run-up as open circles and run-down as dots inside them: both stay visible where they agree."""
    for (index, code), handle in zip(_directions(result), _run_handles(result), strict=True):
        ax.plot(
            values,
            runs[index],
            linestyle="",
            marker=handle.get_marker(),
            markersize=handle.get_markersize(),
            markerfacecolor=handle.get_markerfacecolor(),
            markeredgecolor=handle.get_markeredgecolor(),
            markeredgewidth=handle.get_markeredgewidth(),
            zorder=3 + code,
        )


def _run_handles(result: xr.Dataset) -> list[Line2D]:
    common = {"linestyle": "", "marker": "o"}
    up = {
        "markersize": 3.4,
        "markerfacecolor": "none",
        "markeredgecolor": style.RUN_UP,
        "markeredgewidth": 0.6,
    }
    down = {"markersize": 1.5, "markerfacecolor": style.RUN_DOWN, "markeredgewidth": 0.0}
    handles = {_UP: ({**common, **up}, "run-up"), _DOWN: ({**common, **down}, "run-down")}
    return [Line2D([], [], **handles[code][0], label=handles[code][1]) for _, code in _directions(result)]


def _directions(result: xr.Dataset) -> list[tuple[int, int]]:
    """Return position and code of the directions that were run; a sweep may have been one-way."""
    done = (np.isfinite(result["x_max"]) & (result["reason"] != _NOT_RUN)).any(swept_axis(result)).values
    return [(index, int(code)) for index, code in enumerate(result["direction"].values) if done[index]]


def _barriers(result: xr.Dataset) -> list[float]:
    """Their positions in the unit of the result."""
    one = UNITS.get(unit(result["x_max"]), ("m", 1.0))[1]
    return [
        float(result.attrs[key]) / one for key in ("barrier_upper", "barrier_lower") if key in result.attrs
    ]


def _draw_barriers(ax: Axes, result: xr.Dataset) -> list[Line2D]:
    for level in _barriers(result):
        ax.axhline(level, color=style.BARRIER, linewidth=1.2, zorder=2)
    return _barrier_handles(result)


def _barrier_handles(result: xr.Dataset) -> list[Line2D]:
    label = "barrier" if len(_barriers(result)) == 1 else "barriers"
    return [Line2D([], [], color=style.BARRIER, linewidth=1.2, label=label)] if _barriers(result) else []


def _draw_regions(ax: Axes, result: xr.Dataset, name: str) -> list[Patch]:
    """Draw the bracketed limits as vertical lines and name the regions between them."""
    lines = boundaries(table(result, "limits"))
    low, high = ax.get_xlim()
    scale = ax.get_window_extent().width / ax.figure.dpi * 25.4 / (high - low)
    for line in lines:
        ax.axvspan(line.lower, line.upper, color="#999999", alpha=0.35, linewidth=0, zorder=0)
        ax.axvline(line.middle, color="black", linewidth=0.7, zorder=2)
    gaps = []
    for line in lines:
        others = [other.middle - line.middle for other in lines if other is not line]
        gaps.append(scale * min(others, key=abs, default=high - low))
        _name_limit(ax, line, gaps[-1])
    # names in narrow axes stand above turned values
    height = 22.0 if scale * (high - low) < _NARROW and min(map(abs, gaps), default=_CLOSE) < _CLOSE else 10.0
    for region in regions(result, name, lines):
        _name_region(ax, region, scale * (region.upper - region.lower), height)
    if not lines:
        return []
    return [Line2D([], [], color="black", linewidth=0.7, label="limit of a region")]


def _name_limit(ax: Axes, line: Boundary, gap: float) -> None:
    """Write the value of a limit above it, with as many digits as its bracket is worth.

    `gap` is the way to the nearest limit in mm; two close ones are turned and moved apart.
    """
    digits = int(np.clip(-np.floor(np.log10(max(line.upper - line.lower, 1e-6))), 0, 6))
    text = f"{line.middle:.{digits}f}"
    if abs(gap) > _CLOSE:
        _write_above(ax, line.middle, text, (0.0, 2.0), fontsize=_VALUE)
    else:
        _write_above(ax, line.middle, text, (-2.0 if gap > 0 else 5.0, 2.0), rotation=60, fontsize=_VALUE)


def _name_region(ax: Axes, region: Region, width: float, height: float) -> None:
    """Write the name of a region that is so many mm wide above it, `height` points up, if there is room."""
    if width < 1.4:
        return
    centre = (region.lower + region.upper) / 2
    if width > 11.0:
        text = region.text if width > 19.0 else region.text.replace(" ", "\n")
        _write_above(ax, centre, text, (0.0, height), fontsize=_NAME)
    else:
        # beyond the turned values of the limits on both sides
        _write_above(ax, centre, region.text.replace(" ", "\n"), (13.0, 22.0), rotation=60, fontsize=_NAME)


def _write_above(
    ax: Axes, x: float, text: str, offset: tuple[float, float], rotation: float = 0, **options: float
) -> None:
    """Write text `offset` points from x; turned text starts there instead of straddling it."""
    ax.annotate(
        text,
        (x, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=offset,
        textcoords="offset points",
        ha="left" if rotation else "center",
        va="bottom",
        rotation=rotation,
        rotation_mode="anchor",
        annotation_clip=False,
        **options,
    )


def _caption(result: xr.Dataset, name: str, look: Look) -> list[str]:
    return [
        *caption_pieces(result, look, describe_case(result)),
        f"{count_text(result.sizes[name])} values of the swept parameter",
    ]


def _limits_caption(result: xr.Dataset) -> list[str]:
    texts = limit_texts(table(result, "limits"))
    return ["limits: " + ", ".join(texts)] if texts else []
