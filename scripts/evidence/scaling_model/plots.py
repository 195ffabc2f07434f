# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of docs/scaling.md."""

from pathlib import Path

import numpy as np
from runs import RATIOS, Run
from separatrix import style
from separatrix.save import save
from simulation import BAR_SPREAD, MANY_RANKS, RANKS, SPREADS, TILES_PER_RANK, USUAL, Simulated

MARKERS = ("o", "s", "^", "D")
FORMATS = ("png",)


def draw(folder: Path, simulated: Simulated, run: Run, ratios: int, bar: float) -> None:
    """Write both figures."""
    with style.context():
        save(efficiencies(simulated, bar), folder / "scaling_simulated", FORMATS, style.PNG_DPI)
        save(tile_costs(run, ratios), folder / "scaling_costs", FORMATS, style.PNG_DPI)


def efficiencies(simulated: Simulated, bar: float):
    """Efficiency against ranks, and against tiles per rank."""
    figure = style.new_figure(style.DOUBLE_COLUMN, 62)
    left, right = figure.subplots(1, 2, sharey=True)
    for spread, marker, colour in zip(SPREADS, MARKERS, style.OKABE_ITO, strict=False):
        look = {"marker": marker, "color": colour, "markersize": 3.2, "label": f"{spread}:1"}
        left.plot(RANKS, simulated.by_ranks[spread], **look)
        right.plot(TILES_PER_RANK, simulated.by_tiles[spread], **look)
    label = f"{BAR_SPREAD}:1, neighbours"
    left.plot(RANKS, simulated.neighbours, "--", color=style.OTHER, marker="x", markersize=3.2, label=label)
    left.set(xlabel="ranks", ylabel="efficiency", title=f"{USUAL} tiles per rank")
    right.set(xlabel="tiles per rank", title=f"{MANY_RANKS} ranks")
    for axes in (left, right):
        axes.set(xscale="log", ylim=(0, 1.03))
        axes.axhline(bar, color=style.BRANCH, linewidth=0.6, zorder=0)
    left.legend(title="cost spread", loc="lower left", title_fontsize=6.5)
    figure.set_layout_engine("constrained")
    return figure


def tile_costs(run: Run, ratios: int):
    """Measured time of each tile against the frequency ratio."""
    figure = style.new_figure(style.SINGLE_COLUMN, 55)
    axes = figure.subplots()
    ratio = np.repeat(np.linspace(*RATIOS, ratios), len(run.costs) // ratios)
    axes.plot(ratio, 1000 * run.costs, ".", color=style.MOTION, markersize=2.5)
    axes.set(yscale="log", xlabel="drive frequency over natural frequency", ylabel="time of a tile [ms]")
    figure.set_layout_engine("constrained")
    return figure
