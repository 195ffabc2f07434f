# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of docs/validation.md on measures of basins: sets with known answers, and peers' maps."""

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import separatrix as sx
from evidence_rows import Row, show
from separatrix.measuring import balls, entropy, uncertainty, wada
from separatrix.measuring.maps import slice_of
from separatrix.measuring.sampling import Region

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "python"))
import synthetic_sets as sets  # noqa: E402

KNOWN = "sets with known values"
PEERS = "Attractors.jl and Basins.jl, tests"
GREBOGI = "C. Grebogi, S. W. McDonald, E. Ott, J. A. Yorke, Phys. Lett. A 99 (1983)"


def rows() -> list[Row]:
    """All rows, computed."""
    found = [*exponents(), *spheres(), *entropies(), *boxes(), *duffing(), *pendulum()]
    return [replace(row, digits=6) for row in found]


def exponents() -> list[Row]:
    """Uncertainty exponents."""

    def alpha(labels: Callable, region: Region, starts: int = 4000, batches: int = 16) -> float:
        return uncertainty.uncertainty_exponent(labels, region, starts=starts, batches=batches).value

    unit, turn = Region.of((0, 0), (1, 1)), Region.of((0.0, -0.5), (2 * math.pi, 0.5))
    third, hole = math.log(3), math.log(8)
    return [
        Row(KNOWN, "Cantor stripes: exponent", 1 - math.log(2) / third, alpha(sets.cantor, unit), 5e-3),
        Row(KNOWN, "Sierpinski carpet: exponent", 2 - hole / third, alpha(sets.carpet, unit), 5e-3),
        Row(KNOWN, "straight line: exponent", 1, alpha(sets.half_plane((0.6, 0.8), 0.7), unit), 0.02),
        Row(GREBOGI, "their map, J0 = 0.3: exponent", 0.2, alpha(sets.grebogi, turn, 1000, 8), 0.05),
        Row(
            PEERS,
            "Newton's method for z^3 = 1: exponent, 0.55 to 0.65",
            0.6,
            alpha(sets.newton, Region.of((-1, -1), (1, 1)), 1000, 8),
            0.05,
        ),
    ]


def spheres() -> list[Row]:
    """Largest balls."""

    def radius(labels: Callable, centre: tuple[float, float]) -> float:
        return balls.largest_ball(labels, np.array(centre), 1, 3.0).inner

    wide = Region.of((-1.2, -1.2), (1.2, 1.2))
    ring = sets.annulus(0.4, 1.0)
    grid, axes = sets.grid_of(ring, wide.lower, wide.upper, 121)
    largest, _ = balls.inscribed_ball(ring, grid, axes, 1, wide)
    return [
        Row(KNOWN, "ellipse: LIM, its minor semi-axis", 0.3, radius(sets.ellipse((0.7, 0.3)), (0, 0)), 1e-9),
        Row(KNOWN, "half plane: LIM", 0.5, radius(sets.half_plane((0.6, 0.8), 0.5), (0, 0)), 1e-9),
        Row(KNOWN, "annulus: IF, its half width", 0.3, largest.inner, 1e-5),
        Row(
            PEERS,
            "Newton's method for z^3 = 1: smallest perturbation out of the basin of 1",
            0.622,
            radius(sets.newton, (1, 0)),
            5e-4,
        ),
    ]


def entropies() -> list[Row]:
    """Entropies of discs on a smooth boundary, and how often one is called rough."""
    found = [
        Row(
            KNOWN,
            f"smooth boundary, {d}-D: Sbb",
            value,
            entropy.smooth_entropy(None, d),
            5e-6,
        )
        for d, value in ((1, 0.5), (2, 0.43951), (3, 0.39609))
    ]
    line = entropy.basin_entropy(
        sets.half_plane((1.0, 0.1), 0.55), Region.of((0, 0), (1, 1)), 0.2, 24000, 500
    )
    drawn = line.boundary[0] - line.smooth + entropy.smooth_entropy(None, 2)
    found.append(
        Row(KNOWN, "two dimensions, 100000 discs, corrected for 200 starts in each", 0.43951, drawn, 2e-3)
    )
    random, false = np.random.default_rng(3), 0
    for seed in range(1000):
        smooth = sets.half_plane((1.0, random.uniform(-0.4, 0.4)), random.uniform(-0.2, 0.2))
        one = entropy.basin_entropy(smooth, Region.of((-1, -1), (1, 1)), 0.05, 1000, 20, seed)
        false += one.probability < 0.05
    # 99.9 % of binomial draws
    found.append(
        Row(
            KNOWN,
            "1000 smooth boundaries: share classified as rough at the level 0.05",
            0.05,
            false / 1000,
            0.0227,
        )
    )
    return found


def boxes() -> list[Row]:
    """Square boxes on a grid, as they count: a check of the labels, not of an estimator of ours."""
    grid, _ = sets.grid_of(sets.grebogi, (0.0, -0.5), (2 * math.pi, 0.5), 300)
    each = _box_entropies(grid, 6)
    return [
        Row(PEERS, "map of Grebogi, 300^2, boxes of 6: Sb, 0.40 to 0.42", 0.41, float(each.mean()), 0.01),
        Row(PEERS, "the same: Sbb, 0.60 to 0.61", 0.605, float(each[each > 0].mean()), 0.005),
    ]


def _box_entropies(grid: np.ndarray, side: int) -> np.ndarray:
    """Entropies of the square boxes of `side` points a side that fit into a grid of labels."""
    count = len(grid) // side
    inside = grid[: count * side, : count * side]
    tiles = inside.reshape(count, side, count, side).swapaxes(1, 2).reshape(count**2, side**2)
    shares = np.stack([(tiles == label).mean(axis=1) for label in np.unique(grid)])
    with np.errstate(divide="ignore", invalid="ignore"):
        return -np.nansum(np.where(shares > 0, shares * np.log(shares), 0), axis=0)


def duffing() -> list[Row]:
    """Two potential wells, d = 0.15, F = 0.2, w = 1: basins of two motions, mirror images of each other."""
    wells = {"stiffness": -1, "cubic": 1, "damping": 0.15}
    case = sx.Case.from_dict(
        {
            "body": {"bob": {"mass": 1}}, "watch": {"body": "bob"}, "run": {"duration": 600.0},
            "spring": {"wells": {"between": ["bob"], "law": "polynomial"} | wells},
            "drive": {"push": {"law": "force", "body": "bob", "amplitude": 0.2, "frequency": 1}},
        }
    )  # fmt: skip
    result = sx.basin(case, x0=(-2.2, 2.2, 150), v0=(-2.2, 2.2, 150), progress=False)
    grid = np.squeeze(result["attractor"].values)
    each = _box_entropies(grid, 20)
    what = "two wells of Duffing, 150^2"
    return [
        Row(
            PEERS,
            f"{what}: share of the smaller basin, 0.492 to 0.5",
            0.496,
            float(min((grid == label).mean() for label in (1, 2))),
            0.004,
        ),
        Row(PEERS, "the same, boxes of 20: Sb", 0.663, float(each.mean()), 0.005),
        Row(PEERS, "the same: Sbb", 0.663, float(each[each > 0].mean()), 0.005),
    ]


def pendulum() -> list[Row]:
    """The pendulum with Wada basins of Nusse and Yorke, by the program and the library."""
    samples = 200
    torque = [1.66 * math.cos(2 * math.pi * k / samples) for k in range(samples)]
    drive = {"law": "measured_force", "interval": 2 * math.pi / samples, "force": torque, "periodic": 1}
    case = sx.Case.from_dict(
        {
            "body": {"mass": 1}, "restoring": {"law": "pendulum", "moment": 1},
            "friction": {"law": "viscous", "damping": 0.2}, "drive": drive, "run": {"duration": 400.0},
        }
    )  # fmt: skip
    result = sx.basin(case, x0=(-math.pi, math.pi * 0.98, 100), v0=(-2.0, 4.0, 100), progress=False)
    found = slice_of(result)
    distances, _ = wada.merging(found.grid, (True, False))
    cells = wada.grid_method(found.machine.labels, found.grid, found.axes, 24, 100)
    return [
        Row(
            PEERS,
            "pendulum, d = 0.2, F = 1.66, 100^2: basins",
            3,
            len(np.unique(found.grid[found.grid > 0])),
            0,
        ),
        Row(PEERS, "the same: largest distance of merged boundaries", 6, float(distances[-1]), 1),
        Row(
            PEERS,
            "the same: W_3 of 100 cells, at least 0.9",
            1,
            cells.shares[-1][0],
            0.1,
        ),
    ]


if __name__ == "__main__":
    sys.exit(show(rows(), "--json" in sys.argv))
