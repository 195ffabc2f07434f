# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Basins whose measures are known: labels of points, as the estimators take them."""

from collections.abc import Callable

import numpy as np

#: Levels of the fractals: 3^-32 is beyond what is looked at, and double precision still holds it.
LEVELS = 30


def cantor(points: np.ndarray) -> np.ndarray:
    """Stripes over the first coordinate (0 to 1), removed from the middle-thirds Cantor set; by parity."""
    return 1 + _removed(points[:, :1]) % 2


def carpet(points: np.ndarray) -> np.ndarray:
    """The holes of Sierpinski's carpet over the unit square, by the parity of their generation."""
    return 1 + _removed(points) % 2


def _removed(points: np.ndarray) -> np.ndarray:
    """The generation in which a point is removed: all its ternary digits are 1.

    What is left after LEVELS has a parity by chance, as generations beyond have, from the bits of the point.
    """
    left = points.copy()
    mixed = np.ascontiguousarray(points).view(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed = np.bitwise_xor.reduce(mixed ^ (mixed >> np.uint64(29)), axis=1) * np.uint64(0xBF58476D1CE4E5B9)
    found = LEVELS + ((mixed >> np.uint64(40)) % np.uint64(2)).astype(int)
    for level in range(LEVELS):
        left = left * 3
        digits = np.floor(left)
        left -= digits
        middle = np.all(digits == 1, axis=1) & (found >= LEVELS)
        found[middle] = level
    return found


def half_plane(normal: np.ndarray, offset: float) -> Callable[[np.ndarray], np.ndarray]:
    """Basin 1 where normal . x < offset, else 2."""
    return lambda points: np.where(points @ np.asarray(normal) < offset, 1, 2)


def ellipse(
    axes: tuple[float, ...], centre: tuple[float, ...] = (0.0, 0.0)
) -> Callable[[np.ndarray], np.ndarray]:
    """Basin 1 within an ellipse, else 2."""
    return lambda points: np.where(np.sum(((points - centre) / axes) ** 2, axis=1) < 1, 1, 2)


def annulus(inner: float, outer: float) -> Callable[[np.ndarray], np.ndarray]:
    """Basin 1 between two circles about the origin, else 2."""

    def labels(points: np.ndarray) -> np.ndarray:
        radius = np.linalg.norm(points, axis=1)
        return np.where((radius > inner) & (radius < outer), 1, 2)

    return labels


def newton(points: np.ndarray) -> np.ndarray:
    """The root of z^3 = 1 to which Newton's method goes: 1 for 1, 2 and 3 for the others, 0 for none."""
    z = points[:, 0] + 1j * points[:, 1]
    with np.errstate(all="ignore"):
        for _ in range(120):
            z = z - (z**3 - 1) / (3 * z**2)
        roots = np.exp(2j * np.pi * np.arange(3) / 3)
        apart = np.abs(z[:, None] - roots[None])
        nearest = np.argmin(np.nan_to_num(apart, nan=9.0), axis=1)
        return np.where(apart[np.arange(len(z)), nearest] < 1e-6, nearest + 1, 0)


def grebogi(points: np.ndarray) -> np.ndarray:
    """The map of Grebogi and others (1983), a = 1.32, b = 0.9, J0 = 0.3: fixed points at angle 0 and pi."""
    angle, x = points[:, 0].copy(), points[:, 1].copy()
    for _ in range(200):
        angle, x = (
            np.mod(angle + 1.32 * np.sin(2 * angle) - 0.9 * np.sin(4 * angle) - x * np.sin(angle), 2 * np.pi),
            -0.3 * np.cos(angle),
        )
    at_zero = np.cos(angle) > 0.999999
    at_pi = np.cos(angle) < -0.999999
    return np.where(at_zero, 1, np.where(at_pi, 2, 0))


def grid_of(
    labels: Callable[[np.ndarray], np.ndarray], lower: tuple, upper: tuple, count: int
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Labels over a grid, and its axes."""
    axes = [np.linspace(a, b, count) for a, b in zip(lower, upper, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    return labels(points).reshape([count] * len(axes)), axes
