# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a discovery report, from verdict.json and details.h5; None where there is nothing to show."""

import h5py
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from separatrix import style
from separatrix.discovery.fitting.shapes import through
from separatrix.discovery.options import Options
from separatrix.discovery.wording import number, words

BEFORE = style.OKABE_ITO[0]
AFTER = style.OKABE_ITO[1]
MEASURED = style.OTHER
LINE = "#BBBBBB"
_MOST_RECORDS = 4


def gap(verdict: dict) -> Figure:
    """Reduced chi^2 before and after, training and held out, over the noise floor."""
    uses = list(verdict["gap"])
    figure = style.new_figure(style.SINGLE_COLUMN, 14.0 + 12.0 * len(uses))
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    for row, use in enumerate(uses):
        found = verdict["gap"][use]
        ax.plot([found["before"], found["after"]], [row, row], color=LINE, linewidth=2.5, zorder=1)
        ax.plot(found["before"], row, "D", color=BEFORE, markersize=5, zorder=2)
        ax.plot(found["after"], row, "o", color=AFTER, markersize=5, zorder=3)
        for key, side in (("before", 1), ("after", -1)):
            ax.annotate(
                number(found[key]),
                (found[key], row),
                (4, 7 * side),
                textcoords="offset points",
                ha="left",
                va="center",
                fontsize=6,
            )
    floor = verdict["gap"][uses[0]]["noise_floor"]
    ax.axvline(floor, color="black", linestyle=":", linewidth=0.8, zorder=0)
    values = [floor, *[verdict["gap"][use][key] for use in uses for key in ("before", "after")]]
    low, high = min(values), max(values)
    if high > 20 * low:
        ax.set_xscale("log")
        ax.set_xlim(low / 2, high * (high / low) ** 0.25)
    else:
        room = 0.15 * max(high - low, 0.1)
        ax.set_xlim(low - room, high + 1.5 * room)
    ax.set_yticks(range(len(uses)), [use.replace("_", " ") for use in uses])
    ax.set_ylim(len(uses) - 0.4, -0.6)
    ax.set_xlabel(r"reduced $\chi^2$")
    handles = [
        Line2D([], [], linestyle="", marker="D", color=BEFORE, label="base machine"),
        Line2D([], [], linestyle="", marker="o", color=AFTER, label="extended machine"),
        Line2D([], [], linestyle=":", color="black", label="noise"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def function(found: dict) -> Figure:
    """The function that an effect is, with its band and the closed forms that fit it."""
    figure = style.new_figure(style.SINGLE_COLUMN, 52.0)
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    for part, colour in zip(found["parts"], (AFTER, BEFORE), strict=False):
        at, value = np.array(part["at"]), np.array(part["value"])
        low, high = (np.array(one) for one in part["band_95"])
        fine = np.linspace(at[0], at[-1], 200)
        ax.fill_between(
            fine, through(at, low)(fine), through(at, high)(fine), color=colour, alpha=0.25, linewidth=0
        )
        ax.plot(fine, through(at, value)(fine), color=colour, linewidth=1.2, label=part["direction"] or None)
    for table, colour in zip(found["tables"], (AFTER, BEFORE), strict=False):
        ax.plot(table["at"], table["value"], "o", color=colour, markersize=3)
    fitting = [(name, one) for name, one in found["closed_forms"].items() if one["fits"]]
    for (name, one), colour in zip(fitting[:3], style.OKABE_ITO[2:], strict=False):
        ax.plot(one["at"], one["curve"], "--", color=colour, linewidth=0.9, label=name)
    if ax.get_legend_handles_labels()[1]:
        ax.legend(loc="best", fontsize=6)
    ax.set_xlabel(f"{found['variable']} ({found['unit']})")
    ax.set_ylabel(found["quantity"])
    return figure


def ranking(verdict: dict) -> Figure | None:
    """Size of each effect in standard errors, and what each refitted candidate gained."""
    d_prime = verdict["d_prime"]
    if not d_prime:
        return None
    gained = {one["effect"]: one for one in verdict["candidates"]}
    order = sorted(d_prime, key=lambda name: (gained.get(name, {}).get("evidence", -np.inf), d_prime[name]))
    figure = style.new_figure(style.DOUBLE_COLUMN, max(45.0, 18.0 + 4.0 * len(order)))
    figure.set_layout_engine("constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    rows = np.arange(len(order))
    colours = [AFTER if name in verdict["effects"] else LINE for name in order]
    sizes = np.maximum([d_prime[name] for name in order], 0.1)
    left.barh(rows, sizes - 0.1, left=0.1, color=colours, height=0.7)
    visible = Options().visible
    left.axvline(visible, color="black", linestyle=":", linewidth=0.8)
    left.set_xscale("log")
    left.set_xlim(0.1, 1.5 * max(2 * visible, sizes.max()))
    left.set_xlabel("size in standard errors $d'$")
    left.set_yticks(rows, [words(name) for name in order])
    left.set_ylim(-0.6, len(order) - 0.4)
    for row, name in enumerate(order):
        if name in gained:
            one = gained[name]
            right.plot(one["training"], row, "s", color=AFTER, markersize=3.5, markerfacecolor="none")
            right.plot(one["held_out"], row, "o", color=BEFORE, markersize=3)
        right.axhline(row, color="#EEEEEE", linewidth=0.5, zorder=0)
    gains = [0.0, *(one[key] for one in verdict["candidates"] for key in ("training", "held_out"))]
    _symlog(right, "x", 10, max(np.abs(gains)))
    right.set_xlim(5 * min(gains) - 5, 5 * max(gains) + 5)
    right.axvline(0, color=LINE, linewidth=0.6, zorder=0)
    right.set_xlabel("log-likelihood gained over the base machine")
    handles = [
        Line2D([], [], linestyle="", marker="s", color=AFTER, markerfacecolor="none", label="training"),
        Line2D([], [], linestyle="", marker="o", color=BEFORE, markersize=3, label="held out"),
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=2)
    for letter, ax in zip("ab", (left, right), strict=True):
        ax.set_title(f"{letter})", loc="left")
    return figure


def confusability(verdict: dict) -> Figure | None:
    """Cosines between the signatures of the effects, the base machine refitted."""
    names = verdict["confusability"]["names"]
    if len(names) < 2:
        return None
    matrix = np.abs(np.array(verdict["confusability"]["matrix"], float))
    figure = style.new_figure(style.DOUBLE_COLUMN, 45.0 + 6.0 * len(names))
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    image = ax.imshow(matrix, vmin=0, vmax=1, cmap=style.SCALAR_MAP)
    for i, j in np.ndindex(*matrix.shape):
        if i != j:
            ax.text(
                j,
                i,
                f"{matrix[i, j]:.2f}",
                ha="center",
                va="center",
                fontsize=5.0,
                color="black" if matrix[i, j] > 0.5 else "white",
            )
    texts = [words(name) for name in names]
    ax.set_xticks(range(len(names)), texts, rotation=60, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(names)), texts)
    figure.colorbar(image, ax=ax, shrink=0.7, label="cosine of the signatures")
    return figure


def _symlog(ax: Axes, name: str, threshold: float, largest: float, most: int = 3) -> None:
    """A scale that is logarithmic beyond a threshold, with about `most` labels on each side."""
    getattr(ax, f"set_{name}scale")("symlog", linthresh=threshold, linscale=0.8)
    decades = np.log10(max(largest / threshold, 1))
    step = max(1, int(np.ceil(decades / most)))
    # many decades: the first label is so far from 0 as from the next
    lowest = np.ceil(np.log10(threshold)) + step - 1
    powers = np.arange(lowest, np.log10(max(largest, 1.0)) + 1e-9, step)
    ticks = 10.0**powers
    getattr(ax, f"set_{name}ticks")([*-ticks[::-1], 0, *ticks], minor=False)
    getattr(ax, f"{name}axis").set_minor_locator(NullLocator())


def _records(details: h5py.File, use: str) -> list[str]:
    return list(details[use]) if use in details else []


def residuals(details: h5py.File) -> Figure | None:
    """What is left in each record, over time and as a distribution, before and after."""
    rows = [(use, name) for use in ("training", "held_out") for name in _records(details, use)]
    rows = rows[: _MOST_RECORDS - 1] + rows[-1:] if len(rows) > _MOST_RECORDS else rows
    if not rows:
        return None
    figure = style.new_figure(style.DOUBLE_COLUMN, 14.0 + 34.0 * len(rows))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(len(rows), 3, width_ratios=(5, 3, 3), squeeze=False)
    labels = {}
    for (use, name), (ax, means, beside) in zip(rows, axes, strict=True):
        parts = _residuals_of(details, use, name)
        if not parts:
            continue
        largest = max(float(np.abs(residual).max()) for *_, residual in parts)
        edges = _edges(largest)
        for stage, t, segment, residual in parts:
            colour = BEFORE if stage == "before" else AFTER
            ax.plot(t, residual, ".", markersize=1.2, color=colour, markeredgewidth=0, rasterized=True)
            count = np.bincount(segment)
            mean = np.sqrt(np.bincount(segment, residual**2) / np.maximum(count, 1))
            shown = np.flatnonzero(count)
            means.plot(shown, mean[shown], "D" if stage == "before" else "o", markersize=2.2, color=colour)
            share = np.histogram(residual, edges)[0] / np.diff(edges) / residual.size
            beside.stairs(share, edges, color=colour, linewidth=1.0)
            labels[stage] = colour
        between = np.linspace(max(-largest, -5), min(largest, 5), 101)
        beside.plot(between, np.exp(-0.5 * between**2) / np.sqrt(2 * np.pi), color="black", linestyle=":")
        beside.set_yscale("log")
        floor = 0.3 / max(residual.size * np.diff(edges).max() for *_, residual in parts)
        beside.set_ylim(max(floor, 1e-9), 1.0)
        if largest > 30:
            _symlog(ax, "y", 5, largest)
            _symlog(beside, "x", 5, largest, 1)
        ax.set_title(f"{name}, {use.replace('_', ' ')}", loc="left")
        ax.set_ylabel("residual / noise")
        means.axhline(1, color="black", linestyle=":")
        means.set_yscale("log")
        means.set_ylabel("rms / noise")
    axes[-1, 0].set_xlabel("time (s)")
    axes[-1, 1].set_xlabel("segment")
    axes[-1, 2].set_xlabel("residual / noise")
    texts = {"before": "base machine", "after": "extended machine"}
    handles = [
        Line2D([], [], linestyle="", marker="o", markersize=3, color=colour, label=texts[stage])
        for stage, colour in labels.items()
    ]
    handles.append(Line2D([], [], color="black", linestyle=":", label="noise alone"))
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def _edges(largest: float) -> np.ndarray:
    if largest <= 30:
        return np.linspace(-largest, largest, 61)
    tail = np.geomspace(5, largest, 15)
    return np.concatenate([-tail[::-1], np.linspace(-5, 5, 21)[1:-1], tail])


def _residuals_of(details: h5py.File, use: str, name: str) -> list[tuple]:
    """Stage, times, segments and residuals of the segments that were used."""
    found = []
    for stage in ("before", "after"):
        if stage in details[use][name]:
            group = details[use][name][stage]
            segment = group["segment"][:]
            good = group["good"][:].astype(bool)[segment]
            if good.any():
                found.append((stage, group["t"][:][good], segment[good], group["residual"][:][good]))
    return found


def impact_map(details: h5py.File) -> Figure | None:
    """Speed after over speed before each impact: as measured, and of both fitted machines."""
    measured = [
        np.abs(group["impacts"][:, 2:]) for group in details["records"].values() if group["impacts"].size
    ]
    fitted = {stage: _fitted_impacts(details, stage) for stage in ("before", "after")}
    if not measured and not any(one.size for one in fitted.values()):
        return None
    figure = style.new_figure(style.SINGLE_COLUMN, 70.0)
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    handles = []
    if measured:
        table = np.concatenate(measured)
        handles.append(
            ax.errorbar(
                table[:, 0], table[:, 1], table[:, 3], table[:, 2], linestyle="", marker="o", markersize=3,
                color=MEASURED, markerfacecolor="white", elinewidth=0.5, label="measured", zorder=1,
            )
        )  # fmt: skip
    for stage, marker, colour, label in (
        ("before", "x", BEFORE, "base machine"),
        ("after", "+", AFTER, "extended machine"),
    ):
        if fitted[stage].size:
            handles += ax.plot(
                fitted[stage][:, 0], fitted[stage][:, 1], linestyle="", marker=marker, color=colour,
                markersize=4, markeredgewidth=0.7, label=label, zorder=2,
            )  # fmt: skip
    ax.set_xlim(left=0)
    ax.set_ylim(bottom=0)
    unit = details.attrs["velocity_unit"]
    ax.set_xlabel(f"speed before the impact ({unit})")
    ax.set_ylabel(f"speed after the impact ({unit})")
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def _fitted_impacts(details: h5py.File, stage: str) -> np.ndarray:
    tables = [
        np.abs(details[use][name][stage]["impacts"][:, 2:4])
        for use in ("training", "held_out")
        for name in _records(details, use)
        if stage in details[use][name]
    ]
    return np.concatenate(tables) if tables else np.zeros((0, 2))


def held_out(details: h5py.File) -> Figure | None:
    """A held-out record beside both machines, where the base machine misses it most."""
    names = _records(details, "held_out")
    if not names:
        return None
    name = max(names, key=lambda one: float(np.std(details["held_out"][one]["before"]["residual"][:])))
    group = details["held_out"][name]
    before = group["before"]
    segment, residual = before["segment"][:], before["residual"][:]
    good = before["good"][:].astype(bool)
    misses = np.bincount(segment, residual**2 * good[segment], minlength=good.size)
    worst = int(np.argmax(misses))
    window = np.abs(segment - worst) <= 1
    times = before["t"][:][window]
    record = details["records"][name]
    compared = "force" if details.attrs["compared"] == "force" else "x"
    t, x = record["t"][:], record[compared][:]
    inside = (t >= times.min()) & (t <= times.max())
    figure = style.new_figure(style.DOUBLE_COLUMN, 88.0)
    figure.set_layout_engine("constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    step = max(1, int(inside.sum() // 150))
    handles = top.plot(
        t[inside][::step], x[inside][::step], linestyle="", marker="o", markersize=2.4, color=MEASURED,
        markerfacecolor="white", markeredgewidth=0.5, label=f"{name}, measured",
    )  # fmt: skip
    largest = 0.0
    for stage, dash, label in (("before", "--", "base machine"), ("after", "-", "extended machine")):
        if stage not in group:
            continue
        colour = BEFORE if stage == "before" else AFTER
        part = group[stage]
        near = (part["t"][:] >= times.min()) & (part["t"][:] <= times.max())
        along = part["t"][:][near]
        number = part["segment"][:][near]
        breaks = np.flatnonzero(np.diff(number)) + 1
        shown = [np.insert(column[:][near], breaks, np.nan) for column in (part[compared], part["residual"])]
        along = np.insert(along, breaks, np.nan)
        handles += top.plot(along, shown[0], color=colour, linestyle=dash, label=label)
        bottom.plot(along, shown[1], linestyle="", marker=".", markersize=2, markeredgewidth=0, color=colour)
        largest = max(largest, float(np.nanmax(np.abs(shown[1]))))
    bottom.axhspan(-1.96, 1.96, color="#E5E5E5", zorder=0)
    if largest > 30:
        _symlog(bottom, "y", 5, largest)
    bottom.set_ylabel("residual / noise")
    bottom.set_xlabel("time (s)")
    if compared == "force":
        top.set_ylabel(f"force ({details.attrs['force_unit']})")
    else:
        top.set_ylabel(f"position $x$ ({details.attrs['position_unit']})")
    for letter, ax in zip("ab", (top, bottom), strict=True):
        ax.set_title(f"{letter})", loc="left")
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure
