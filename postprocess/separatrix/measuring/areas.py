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


def missed_pieces(grid: np.ndarray, own: int) -> tuple[float, float]:
    """Return which share of cells of the basin may be of others, and of other cells which may be of it.

    The map of every second point shows what lies between the points: of those that it leaves out, so many in
    its cells of one label have another. These are the upper ends of Clopper and Pearson; on the
    finer grid less is missed.
    """
    odd = grid[tuple(slice(0, size - (size + 1) % 2) for size in grid.shape)]
    if min(odd.shape) < 3:
        return 1.0, 1.0
    low, high = _corners(odd[(slice(None, None, 2),) * grid.ndim])
    lost = gained = in_own = in_others = 0
    for bits in itertools.product((0, 1), repeat=grid.ndim):
        if not any(bits):
            continue
        left_out = odd[tuple(slice(bit, -1, 2) for bit in bits)]
        of_own, of_others = left_out[(low == own) & (high == own)], left_out[(low == high) & (low != own)]
        lost, in_own = lost + np.sum(of_own != own), in_own + of_own.size
        gained += np.sum((of_others == own) | (of_others == NOT_KNOWN))
        in_others += of_others.size
    return share_interval(lost, in_own)[1], share_interval(gained, in_others)[1]


def global_share(
    labels: Labels | None, grid: np.ndarray, axes: list[np.ndarray], own: int, starts: int, seed: int = 1
) -> Share:
    """Return the share of a window that one basin has.

    With a labelling function `starts` are drawn in the cells whose corners differ, and half as many each in
    those of the basin and in those of others. The share is that of stratified sampling. The interval adds the
    ends of Clopper and Pearson of the parts; for cells whose corners are alike it takes `missed_pieces` where
    that is narrower. Without one cells with unlike corners count from none to all, and the value counts
    points.
    """
    widths = np.ones(())
    for axis in axes:
        widths = np.multiply.outer(widths, np.diff(axis))
    widths = widths / widths.sum()
    low, high = _corners(grid)
    kinds = {"crossed": low != high, "own": (low == own) & (high == own)}
    without = (low == NOT_KNOWN) & (high == NOT_KNOWN)
    kinds["others"] = ~(kinds["crossed"] | kinds["own"] | without)
    size = {kind: float(widths[cells].sum()) for kind, cells in kinds.items()}
    unknown = float(widths[without].sum())
    lost, gained = missed_pieces(grid, own)
    if labels is None or starts == 0:
        value = float(np.mean(grid == own))
        least = size["own"] * (1 - lost)
        most = size["own"] + size["others"] * gained + size["crossed"] + unknown
        return Share(value, min(least, value), max(most, value), 0, float(np.mean(grid == NOT_KNOWN)))
    total = np.array([0.0, 0.0, unknown])
    drawn = 0
    counts = {"crossed": starts, "own": starts // 2, "others": starts // 2}
    for purpose, (kind, count) in enumerate(counts.items()):
        if not size[kind] > 0 or count == 0:
            continue
        found = label_all(labels, in_cells(kinds[kind], axes, count, generator(seed, 2, purpose)))
        hits, not_known = int(np.sum(found == own)), int(np.sum(found == NOT_KNOWN))
        lowest, highest = share_interval(hits, count)[0], share_interval(hits + not_known, count)[1]
        if kind == "own":
            lowest = min(max(lowest, 1 - lost), hits / count)
        elif kind == "others":
            highest = max(min(highest, gained), (hits + not_known) / count)
        total += size[kind] * np.array([hits / count, lowest, highest])
        unknown += size[kind] * not_known / count
        drawn += count
    return Share(*map(float, total), drawn, unknown)


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
