# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Costs of the tiles of a map that is larger than the measured one."""

import math

import numpy as np


def spread_of(costs: np.ndarray) -> float:
    """The dearest tile over the cheapest."""
    return float(costs.max() / costs.min())


def with_spread(costs: np.ndarray, spread: float) -> np.ndarray:
    """Raise costs to the power that makes their spread this; their order stays."""
    if spread_of(costs) == 1:
        return np.ones_like(costs)
    return (costs / costs.min()) ** (math.log(spread) / math.log(spread_of(costs)))


def stretched(costs: np.ndarray, count: int) -> np.ndarray:
    """Costs of a map of `count` tiles in the order of the measured ones: costly tiles stay neighbours."""
    return costs[(np.arange(count) * len(costs)) // count]


def tiles_for(costs: np.ndarray, count: int, spread: float, mean: float) -> np.ndarray:
    """`count` tiles of a spread and a mean, seconds."""
    tiles = stretched(with_spread(costs, spread), count)
    return tiles * (mean / tiles.mean())
