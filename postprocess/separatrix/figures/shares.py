# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shares of the attractors over a parameter, and of starts drawn at random with their intervals."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from separatrix import style
from separatrix.classes import classes, recoloured
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures.caption import caption_pieces, describe_case, start_pieces, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Page
from separatrix.labels import axis_label, count_text, plain
from separatrix.open import table
from separatrix.variables import is_start


def diagram(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the share of each attractor over the one parameter of a map that varies, stacked to 100 %."""
    result = look.selected(result)
    labels = result["attractor"]
    varying = [name for name in labels.dims if not is_start(name) and result.sizes[name] > 1]
    if len(varying) != 1:
        raise SeparatrixError(
            f"shares: found {len(varying)} parameters that vary, allowed one; choose values of the others",
            USAGE,
        )
    name = varying[0]
    slices = labels.transpose(name, ...).values.reshape(result.sizes[name], -1)
    codes, numbers = np.unique(slices, return_counts=True)
    totals = dict(zip(codes.tolist(), numbers.tolist(), strict=True))
    entries = recoloured(classes(result, "attractor", totals), look.colours)
    parts = [np.isin(slices, entry.codes).mean(axis=1) for entry in entries]
    page = Page(look, (style.SINGLE_COLUMN, 50.0))
    (ax,) = page.axes
    values = result[name].values
    below = np.zeros(values.size)
    for entry, part in zip(entries, parts, strict=True):
        # A value stands for its surroundings: steps, not slopes that nobody has computed.
        ax.fill_between(
            values, 100 * below, 100 * (below + part), step="mid", color=entry.colour, linewidth=0
        )
        below = below + part
    ax.set_xlim(values.min(), values.max())
    ax.set_ylim(0, 100)
    ax.set_xlabel(axis_label(result[name]))
    ax.set_ylabel("share of the starts (%)")
    handles = [
        Patch(facecolor=entry.colour, edgecolor="#555555", linewidth=0.3, label=entry.text)
        for entry in entries
    ]
    caption = caption_pieces(result, look, [*describe_case(result), *start_pieces(result)])
    caption += [
        f"{count_text(slices.shape[1])} starts at each of {values.size} values",
        plain(version_text(result)),
    ]
    return page.finish(title, caption, handles)


def sampled(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return the shares of the attractors of starts drawn at random, with intervals of 95 % confidence.

    Over the one parameter that varies, or one beside the other.
    """
    labels, catalogue = result["attractor"], table(result, "catalogue")
    varying = [name for name in labels.dims if not is_start(name)]
    if len(varying) > 1:
        raise SeparatrixError(f"shares: found {len(varying)} parameters, allowed one", USAGE)
    codes, numbers = np.unique(labels.values, return_counts=True)
    totals = dict(zip(codes.tolist(), numbers.tolist(), strict=True))
    entries = recoloured(classes(result, "attractor", totals), look.colours)
    positions = result[varying[0]].values if varying else np.array([0.0])
    page = Page(look, (style.SINGLE_COLUMN, 50.0))
    (ax,) = page.axes
    columns = {
        name: catalogue[name].values for name in ("slice", "attractor", "share", "share_lower", "share_upper")
    }
    for number, entry in enumerate(entries):
        mine = np.isin(columns["attractor"], entry.codes)
        if not mine.any():
            continue
        at = positions[columns["slice"][mine]] if varying else np.full(mine.sum(), number)
        share, low, high = (100 * columns[name][mine] for name in ("share", "share_lower", "share_upper"))
        ax.errorbar(
            at, share, np.abs([share - low, high - share]), color=entry.colour, marker="o", markersize=3,
            capsize=2, linewidth=0.8, linestyle="-" if varying else "none",
        )  # fmt: skip
    ax.set_ylim(-3, 103)
    ax.set_ylabel("share of the starts (%)")
    if varying:
        ax.set_xlabel(axis_label(result[varying[0]]))
    else:
        ax.set_xlim(-0.5, len(entries) - 0.5)
        ax.set_xticks(range(len(entries)), [entry.text.split(":")[0] for entry in entries])
    handles = [
        Patch(facecolor=entry.colour, edgecolor="#555555", linewidth=0.3, label=entry.text)
        for entry in entries
    ]
    drawn = [name for name in result.data_vars if is_start(name) and name != "sample"]
    caption = caption_pieces(result, look, [*describe_case(result)])
    caption += [
        f"{count_text(result.sizes['sample'])} starts drawn at random over "
        f"{', '.join(plain(name) for name in drawn)}; bars: 95 % confidence",
        plain(version_text(result)),
    ]
    return page.finish(title, caption, handles)
