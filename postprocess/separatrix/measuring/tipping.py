# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the starts of each basin end up after the machine has changed (Kaszas and others 2019)."""

from dataclasses import dataclass

import numpy as np

from separatrix.measuring.sampling import share_interval


@dataclass(frozen=True)
class Tipping:
    """Shares of each basin before that lie in each basin after: rows before, columns after, both ascending.

    The last column, `lost`, has the starts whose label after is not known. `lower` and `upper`: as if the
    starts had been drawn at random (Clopper and Pearson).
    """

    before: tuple[int, ...]
    after: tuple[int, ...]
    counts: np.ndarray
    shares: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def tipping_matrix(before: np.ndarray, after: np.ndarray) -> Tipping:
    """Return the matrix of two arrays of labels of the same starts."""
    rows = tuple(int(label) for label in np.unique(before) if label > 0)
    columns = tuple(int(label) for label in np.unique(after) if label > 0)
    counts = np.array(
        [[np.sum((before == i) & (after == j)) for j in (*columns, 0)] for i in rows], int
    ).reshape(len(rows), len(columns) + 1)
    totals = counts.sum(axis=1, keepdims=True)
    ends = np.array(
        [[share_interval(hits, total) for hits in row] for row, (total,) in zip(counts, totals, strict=True)]
    ).reshape(*counts.shape, 2)
    shares = counts / np.maximum(totals, 1)
    return Tipping(rows, columns, counts, shares, ends[..., 0], ends[..., 1])
