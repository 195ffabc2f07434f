# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How large basins are: global integrity (GIM) of a window, basin stability under a density of starts."""

import itertools
from dataclasses import dataclass

import numpy as np

from separatrix.measuring.sampling import (
    NO_START,
    NOT_KNOWN,
    Labels,
    Region,
    generator,
    label_all,
    share_interval,
)


@dataclass(frozen=True)
class Share:
    """A share with its interval, how many starts it is from, and the share of labels not known."""

    value: float
    lower: float
    upper: float
    starts: int
    not_known: float
    drawn: bool = False
    """The interval is that of the points of a grid as if they had been drawn."""


def crossed_cells(grid: np.ndarray) -> np.ndarray:
    """Return which cells of a grid of labels have corners of more than one label."""
    low, high = _corners(grid)
    return low != high


def cells_of_two_basins(grid: np.ndarray) -> np.ndarray:
    """Return which cells have corners in two basins or more; labels that are no attractor's are left out."""
    low, high = _corners(np.where(grid > 0, grid, np.iinfo(int).max))[0], _corners(grid)[1]
    return (high > 0) & (low < high)


def _corners(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest label of the corners of each cell."""
    corners = [
        grid[tuple(slice(1, None) if bit else slice(None, -1) for bit in bits)]
        for bits in itertools.product((0, 1), repeat=grid.ndim)
    ]
    return np.minimum.reduce(corners), np.maximum.reduce(corners)


def in_cells(
    cells: np.ndarray, axes: list[np.ndarray], count: int, random: np.random.Generator
) -> np.ndarray:
    """Return starts drawn evenly from the cells chosen, whose sizes may differ."""
    corners = np.argwhere(cells)
    widths = [np.diff(axis) for axis in axes]
    sizes = np.prod([width[corners[:, k]] for k, width in enumerate(widths)], axis=0)
    chosen = corners[random.choice(len(corners), count, p=sizes / sizes.sum())]
    drawn = random.uniform(0, 1, chosen.shape)
    columns = [axes[k][chosen[:, k]] + widths[k][chosen[:, k]] * drawn[:, k] for k in range(len(axes))]
    return np.column_stack(columns)


def global_share(
    labels: Labels | None, grid: np.ndarray, axes: list[np.ndarray], own: int, starts: int, seed: int = 1
) -> Share:
    """Return the share of a window that one basin has.

    Cells whose corners are all alike count as their corners. With a labelling function `starts` are drawn in
    the other cells, and the interval is that of Clopper and Pearson times their share; without one it is
    from none to all of them, and the value counts points. Where there are no other cells, parts smaller than
    a cell may still be missed: the interval is that of the points as if they had been drawn.
    """
    widths = np.ones(())
    for axis in axes:
        widths = np.multiply.outer(widths, np.diff(axis))
    widths = widths / widths.sum()
    low, high = _corners(grid)
    whole = float(widths[(low == own) & (high == own)].sum())
    unknown = float(widths[(low == NOT_KNOWN) & (high == NOT_KNOWN)].sum())
    crossed = low != high
    rest = float(widths[crossed].sum())
    if not crossed.any():
        lowest, highest = share_interval(int(np.sum(grid == own)), grid.size)
        return Share(whole, min(whole, lowest), min(1.0, highest + unknown), 0, unknown, drawn=True)
    if labels is None or starts == 0:
        value = float(np.mean(grid == own))
        return Share(
            value, min(whole, value), max(whole + rest + unknown, value), 0, float(np.mean(grid == NOT_KNOWN))
        )
    found = label_all(labels, in_cells(crossed, axes, starts, generator(seed, 2)))
    hits, lost = int(np.sum(found == own)), int(np.sum(found == NOT_KNOWN))
    lowest, highest = share_interval(hits, starts)[0], share_interval(hits + lost, starts)[1]
    return Share(
        whole + rest * hits / starts,
        whole + rest * lowest,
        whole + rest * highest + unknown,
        starts,
        unknown + rest * lost / starts,
    )


def basin_stability(
    labels: Labels, own: int, draw: object, starts: int, seed: int = 1
) -> tuple[Share, float]:
    """Return the share of starts of a density that end in a basin, and the share of draws that are no starts.

    `draw(count, random)` gives points of the density. Draws that the machine has no start at are drawn anew:
    the density is that on the starts that there are. Labels that are not known widen the interval upwards.
    """
    random = generator(seed, 3)
    kept = np.empty(0, int)
    drawn = 0
    for _ in range(50):
        found = label_all(labels, draw(starts, random))
        drawn += len(found)
        kept = np.concatenate([kept, found[found != NO_START]])
        if len(kept) >= starts or not len(kept):
            break
    refused = 1 - len(kept) / drawn
    kept = kept[:starts]
    count = len(kept)
    hits, lost = int(np.sum(kept == own)), int(np.sum(kept == NOT_KNOWN))
    if not count:
        return Share(np.nan, 0.0, 1.0, 0, np.nan), refused
    ends = share_interval(hits, count)[0], share_interval(hits + lost, count)[1]
    return Share(hits / count, *ends, count, lost / count), refused


def uniform(region: Region) -> object:
    """Return the even density of a region."""
    return region.draw


def normal(mean: np.ndarray, deviation: np.ndarray) -> object:
    """Return the normal density about a point, its coordinates independent."""
    return lambda count, random: random.normal(mean, deviation, (count, np.size(mean)))
