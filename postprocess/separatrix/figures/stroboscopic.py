# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stroboscopic (Poincare) section of a motion: one point in each drive period."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from separatrix import style
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures.caption import caption_pieces, describe_case, resolved_case, version_text
from separatrix.figures.look import DEFAULT, Look
from separatrix.figures.page import Page
from separatrix.labels import axis_label, count_text, plain

# Drive periods from which the section is among the figures of a motion without a request.
LONG = 200
# of a drive period, up to which a sample is at a phase
_AT_PHASE = 1e-6
_RASTER = 5000


def periods(result: xr.Dataset) -> int:
    """Return how many whole drive periods a motion has; 0 without a drive."""
    period = float(result.attrs.get("drive_period", 0.0))
    undriven = resolved_case(result).get("drive", {}).get("law") == "none"
    if period <= 0 or undriven or not result.attrs.get("driven", 1):
        return 0
    return int((1 + _AT_PHASE) * float(result["time"].values[-1]) / period)


def points(result: xr.Dataset, look: Look = DEFAULT) -> tuple[np.ndarray, float]:
    """Return which samples are on the section behind the transient, and its phase [rad].

    The phase is that of the samples in a drive period which is nearest to the one asked for.
    """
    turns = result["time"].values / float(result.attrs["drive_period"])
    start = float(resolved_case(result).get("start", {}).get("crank_angle", 0.0)) / (2 * np.pi)
    offset = 0.0
    if look.crank_angle is not None:
        sampled = turns[turns < 1 - _AT_PHASE]
        away = np.abs((sampled + start - look.crank_angle / (2 * np.pi) + 0.5) % 1 - 0.5)
        offset = float(sampled[away.argmin()])
    first = turns[-1] / 2 if look.transient is None else float(look.transient)
    on_section = np.abs((turns - offset + 0.5) % 1 - 0.5) < _AT_PHASE
    chosen = np.flatnonzero(on_section & (turns >= first - _AT_PHASE))
    # the end of a motion may be a sample beside one
    chosen = chosen[np.unique(np.rint(turns[chosen] - offset), return_index=True)[1]]
    if chosen.size == 0:
        found = f"{turns[-1]:g} drive periods, {first:g} of them transient"
        raise SeparatrixError(f"section: found {found}; no sample is left at its phase", USAGE)
    return chosen, float((offset + start) % 1 * 2 * np.pi)


def section(result: xr.Dataset, title: str, look: Look = DEFAULT) -> Figure:
    """Return velocity over position once in each drive period, without the transient."""
    chosen, angle = points(result, look)
    position, velocity = result["x"].values[chosen], result["v"].values[chosen]
    if "turn" in result.attrs:
        turn = float(result.attrs["turn"])
        position = (position + turn / 2) % turn - turn / 2
    page = Page(look, (style.SINGLE_COLUMN, 68.0))
    (ax,) = page.axes
    size = float(np.clip(60.0 / np.sqrt(chosen.size), 0.5, 3.0))
    ax.plot(
        position, velocity, "o", markersize=size, markeredgewidth=0, color=style.MOTION,
        rasterized=chosen.size > _RASTER,
    )  # fmt: skip
    ax.locator_params(axis="x", nbins=6)
    ax.set_xlabel(axis_label(result["x"]))
    ax.set_ylabel(axis_label(result["v"]))
    left_out = float(result["time"].values[chosen[0]]) / float(result.attrs["drive_period"])
    caption = [
        f"{count_text(chosen.size)} points, one in each drive period at crank angle {angle:.4g} rad",
        f"without the first {left_out:.6g} periods",
        *caption_pieces(result, look, describe_case(result)),
        plain(version_text(result)),
    ]
    return page.finish(title, caption)
