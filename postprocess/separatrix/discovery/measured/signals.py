# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Noise and resolution of a sampled signal, from its values alone."""

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import norm

from separatrix.discovery.policy import RECORDS

# variance of fourth differences of white noise of variance 1: squares of 1, -4, 6, -4, 1
FOURTH = 70.0


def white_noise(x: np.ndarray) -> float:
    """Standard deviation of the white noise of a smooth, well sampled signal, from its fourth differences."""
    fourth = np.diff(x, 4)
    return float(1.4826 * np.median(np.abs(fourth - np.median(fourth))) / np.sqrt(FOURTH))


def usual_size(values: np.ndarray) -> float:
    """Standard deviation of accelerations, robustly; a share of the largest where a body mostly rests."""
    sizes = np.abs(values)
    moving = RECORDS.moving_share * float(np.quantile(sizes, RECORDS.in_motion))
    return max(float(np.median(sizes)) / 0.6745, moving)


def clipped_noise(x: np.ndarray) -> float:
    """The same from the mean square of those within some standard deviations: half of its variance.

    The median is spoiled by fewer samples, but it leaves 1 % of error to 30 000 samples, 2 % of their chi^2.
    """
    fourth, sigma = np.diff(x, 4), np.sqrt(FOURTH) * white_noise(x)
    bound = RECORDS.clipped_noise
    inside = fourth[np.abs(fourth) <= bound * sigma]
    # variance of a normal variable between these bounds
    kept = 1 - 2 * bound * norm.pdf(bound) / (1 - 2 * norm.sf(bound))
    return float(np.sqrt(np.mean(inside**2) / (kept * FOURTH))) if inside.size else 0.0


def resolution_of(x: np.ndarray) -> float:
    """The step of the grid that the values lie on, 0 if there is none."""
    levels = np.unique(x)
    if levels.size < 2:
        return 0.0
    steps = np.diff(levels)
    step = float(steps.min())
    if step <= 1e-12 * np.abs(x).max():
        return 0.0
    # of all single steps, because each may be rounded in the file
    step = float(np.mean(steps[steps < 1.5 * step]))
    multiple = steps / step
    off = np.abs(multiple - np.round(multiple))
    if levels.size <= 0.5 * x.size:
        return step if np.all(off < RECORDS.off_grid * np.maximum(1, multiple)) else 0.0
    return step if np.all(off < RECORDS.off_grid) and step > RECORDS.fine_grid * white_noise(x) else 0.0


def jumps(v: np.ndarray, noise: float) -> np.ndarray:
    """Samples after which a velocity jumps: its step is beyond the noise, and beyond those beside it."""
    steps = np.diff(v)
    steps = np.abs(steps - median_filter(steps, RECORDS.beside_jump))
    chance = RECORDS.jump * np.sqrt(2) * noise
    beside = np.zeros(steps.size)
    beside[1:] = steps[:-1]
    beside[:-1] = np.maximum(beside[:-1], steps[1:])
    return np.flatnonzero((steps > chance) & (steps > RECORDS.sudden * np.maximum(0, beside - chance)))


def runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """Runs of set flags, as (first, last + 1)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
