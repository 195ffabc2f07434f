# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether three basins or more share their boundary (Wada): by merging, and by refining cells."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from separatrix.measuring.areas import cells_of_two_basins
from separatrix.measuring.sampling import Labels, generator, label_all, share_interval


def merging(grid: np.ndarray, turning: tuple[bool, ...] | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances [points] between the boundaries of merged basins, and their shares (Daza 2018).

    For each basin all others are merged; the boundary points of that map are those that have a neighbour of
    the other kind. For every boundary point of one merged map the farthest that it is from the boundary of
    another is taken; returned are distances r = 0, 1, 2, ... and the share of boundary points farther than r.
    Boundaries that are one have share 0 from a small r on. Points without a label are left out.
    """
    basins = [label for label in np.unique(grid) if label > 0]
    if len(basins) < 3:
        return np.empty(0), np.empty(0)
    known = grid > 0
    edges = [_edges(grid == label, known, turning) for label in basins]
    farthest = np.zeros(grid.shape)
    for edge in edges:
        farthest = np.maximum(farthest, _distances(edge, turning) if edge.any() else np.inf)
    boundary = np.logical_or.reduce(edges)
    if not boundary.any():
        return np.empty(0), np.empty(0)
    values = farthest[boundary]
    top = values[np.isfinite(values)].max(initial=0.0)
    distances = np.arange(0, int(np.ceil(top)) + 1)
    return distances, np.array([np.mean(values > r) for r in distances])


def _distances(edge: np.ndarray, turning: tuple[bool, ...] | None) -> np.ndarray:
    """Distance [points] of every point to the nearest of an edge; axes that turn are on a circle."""
    pad = [(n // 2, n // 2) if turns else (0, 0) for n, turns in zip(edge.shape, turning or (), strict=False)]
    pad += [(0, 0)] * (edge.ndim - len(pad))
    away = distance_transform_edt(~np.pad(edge, pad, mode="wrap"))
    return away[tuple(slice(a, a + n) for (a, _), n in zip(pad, edge.shape, strict=True))]


def _edges(own: np.ndarray, known: np.ndarray, turning: tuple[bool, ...] | None) -> np.ndarray:
    """Points beside which a known one of the other kind stands."""
    found = np.zeros(own.shape, bool)
    for axis in range(own.ndim):
        one = [slice(None)] * own.ndim
        two = [slice(None)] * own.ndim
        one[axis], two[axis] = slice(1, None), slice(None, -1)
        pairs = [(tuple(one), tuple(two))]
        if turning is not None and turning[axis]:
            one[axis], two[axis] = slice(0, 1), slice(-1, None)
            pairs.append((tuple(one), tuple(two)))
        for a, b in pairs:
            differs = (own[a] != own[b]) & known[a] & known[b]
            found[a] |= differs
            found[b] |= differs
    return found


@dataclass(frozen=True)
class Cells:
    """Of the cells looked at: how many show 1, 2, ... N basins after each step; rows are steps from 0."""

    basins: tuple[int, ...]
    counts: np.ndarray
    shares: tuple[tuple[float, float, float], ...]


def grid_method(
    labels: Labels,
    grid: np.ndarray,
    axes: list[np.ndarray],
    steps: int = 24,
    most: int = 2000,
    seed: int = 1,
) -> Cells:
    """Return how many cells with two basins show all of them when refined (after Daza and others 2015).

    Up to `most` of the cells with corners in two basins are taken. In each, segments between corners of
    different labels are bisected with new starts, `steps` times; of the halves those with different ends go
    on, one for each pair of labels. `shares` are the cells with all N basins after each step, with intervals
    (Clopper and Pearson). A share that goes to 1 indicates the Wada property down to 2^-steps of a cell; at
    smaller distances nothing is shown.
    """
    basins = tuple(int(label) for label in np.unique(grid) if label > 0)
    cells = np.argwhere(cells_of_two_basins(grid))
    random = generator(seed, 6)
    if len(cells) > most:
        cells = cells[np.sort(random.choice(len(cells), most, replace=False))]
    seen = np.zeros((len(cells), len(basins)), bool)
    segments = _first_segments(grid, axes, cells, basins, seen)
    counts = [_numbers(seen, len(basins))]
    for _ in range(steps):
        owner, low, high, low_label, high_label = segments
        if not len(owner):
            counts.append(counts[-1])
            continue
        middle = (low + high) / 2
        found = label_all(labels, middle)
        for column, label in enumerate(basins):
            seen[owner[found == label], column] = True
        known = found > 0
        halves = [
            (owner, low, middle, low_label, found),
            (owner, middle, high, found, high_label),
        ]
        kept = [tuple(part[known & (half[3] != half[4])] for part in half) for half in halves]
        segments = _one_of_each(*(np.concatenate(parts) for parts in zip(*kept, strict=True)))
        counts.append(_numbers(seen, len(basins)))
    counts = np.array(counts)
    full = [(int(row[-1]), int(row.sum())) for row in counts]
    shares = tuple((hits / max(1, total), *share_interval(hits, total)) for hits, total in full)
    return Cells(basins, counts, shares)


def _first_segments(
    grid: np.ndarray, axes: list[np.ndarray], cells: np.ndarray, basins: tuple[int, ...], seen: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Between the corners of each cell that have different labels, one for each pair of labels."""
    d = grid.ndim
    corners = np.array(np.meshgrid(*[[0, 1]] * d, indexing="ij")).reshape(d, -1).T
    indices = cells[:, None, :] + corners[None]
    found = grid[tuple(np.moveaxis(indices, -1, 0))]
    points = np.stack([axes[k][indices[..., k]] for k in range(d)], axis=-1)
    for column, label in enumerate(basins):
        seen[:, column] = (found == label).any(axis=1)
    parts = []
    for a in range(len(corners)):
        for b in range(a + 1, len(corners)):
            at = np.flatnonzero((found[:, a] != found[:, b]) & (found[:, a] > 0) & (found[:, b] > 0))
            parts.append((at, points[at, a], points[at, b], found[at, a], found[at, b]))
    return _one_of_each(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _one_of_each(
    owner: np.ndarray, low: np.ndarray, high: np.ndarray, first: np.ndarray, last: np.ndarray
) -> tuple[np.ndarray, ...]:
    """The first segment of each cell and pair of labels."""
    keys = np.column_stack([owner, np.minimum(first, last), np.maximum(first, last)])
    _, at = np.unique(keys, axis=0, return_index=True)
    at.sort()
    return owner[at], low[at], high[at], first[at], last[at]


def _numbers(seen: np.ndarray, basins: int) -> np.ndarray:
    """How many cells show 1, 2, ... basins."""
    return np.bincount(seen.sum(axis=1), minlength=basins + 1)[1:]
