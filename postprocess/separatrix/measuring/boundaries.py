# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures of the boundaries of a map: entropy, uncertainty exponent, Wada."""

import math

import numpy as np

from separatrix.measuring import entropy, uncertainty, wada
from separatrix.measuring.maps import Slice
from separatrix.measuring.report import Measure
from separatrix.measuring.sampling import share_interval

#: Radii of the discs, in parts of the shortest side.
RADII = (1 / 20, 1 / 40, 1 / 80, 1 / 160)
#: Level of the test that a boundary is smooth.
LEVEL = 0.01
_NEEDS = "needs new starts"


def basin_entropy(found: Slice) -> list[Measure]:
    """Entropy of all discs and of those with two basins, over several radii."""
    definition = (
        "Sb: the mean over discs of -sum p ln p, p the shares of the basins among the starts drawn in a disc"
    )
    edge = "Sbb: the same over the discs in which more than one basin was found; above ln 2 it is fractal"
    names = ("basin_entropy", "boundary_basin_entropy")
    if found.machine is None:
        return [
            Measure(name, text, limits=(*found.limits, _NEEDS))
            for name, text in zip(names, (definition, edge), strict=True)
        ]
    size = float(found.region.size.min())
    radii = [size * part for part in RADII]
    results = [
        entropy.basin_entropy(found.machine.labels, found.region, radius, seed=found.seed) for radius in radii
    ]
    first = results[0]
    slope = entropy.exponent(results)
    curve = {
        "radii": radii,
        "mixed_discs": [one.mixed for one in results],
        "left_out": [one.left for one in results],
        "all_discs": [one.all_discs for one in results],
        "boundary": [one.boundary for one in results],
        "smooth": [one.smooth for one in results],
        "probability_if_smooth": [one.probability for one in results],
        "uncertainty_exponent": slope,
    }
    parameters = {
        "radius": first.radius,
        "unit": found.unit,
        "discs": first.discs,
        "starts_a_disc": first.starts,
    }
    limits = list(found.limits)
    if first.left:
        limits.append(
            f"{first.left} discs left out: {first.unknown} with a label not known, which the interval allows "
            f"for, {first.left - first.unknown} with no start there"
        )
    boundary_limits = [*limits, verdict(results)]
    return [
        Measure(
            names[0],
            definition,
            "1",
            None,
            *first.bounds(first.all_discs, first.discs),
            "95 %, Student over the discs",
            parameters,
            tuple(limits),
            curve,
        ),
        Measure(
            names[1],
            edge,
            "1",
            None,
            *first.bounds(first.boundary, first.mixed),
            "95 %, Student over the discs",
            {**parameters, "discs": first.mixed, "of_a_smooth_boundary": first.smooth},
            tuple(boundary_limits),
            curve,
        ),
    ]


def verdict(results: list[entropy.Entropy]) -> str:
    """Return what the test of smoothness finds; a Bonferroni bound over the radii."""
    probability = min(1.0, len(results) * min(one.probability for one in results))
    finest = results[-1]
    if any(one.unsure for one in results):
        return "too many discs have labels not known: whether the boundary is smooth is not known"
    if finest.mixed < 10:
        return "fewer than 10 discs of the smallest radius meet a boundary: whether it is smooth is not known"
    if probability < LEVEL:
        return (
            f"rougher than a smooth boundary, which would give so much with probability {probability:.2g}: "
            "fractal at these radii, or points where three basins meet"
        )
    return (
        f"as of a smooth boundary at these radii (probability {probability:.2g}, level {LEVEL:g}); "
        "finer structure is not excluded"
    )


def uncertainty_exponent(found: Slice) -> Measure:
    """Exponent of the share of uncertain starts over the decades of their uncertainty."""
    definition = (
        "alpha: the share of starts whose label differs at the distance eps goes as eps^alpha; 1 of "
        "a smooth "
        "boundary, its dimension is that of the window less alpha"
    )
    if found.machine is None:
        return Measure("uncertainty_exponent", definition, limits=(*found.limits, _NEEDS))
    one = uncertainty.uncertainty_exponent(found.machine.labels, found.region, seed=found.seed)
    limits = list(found.limits)
    if one.lost > 0:
        limits.append(f"{100 * one.lost:.3g} % of the starts have no known label and count as certain")
    size = float(found.region.size.min())
    limits.append("structure below the least eps is not resolved: 1e-10 of the shortest side of the window")
    if not math.isfinite(one.value):
        limits.append("no uncertain starts: no boundary was met")
    fitted = one.sizes[(one.sizes <= 1e-2 * size * (1 + 1e-9)) & (one.shares > 0)]
    slopes = one.slopes[np.isfinite(one.slopes)]
    parameters = {"eps": (float(one.sizes[0]), float(one.sizes[-1])), "unit": found.unit}
    if len(fitted) and len(slopes):
        parameters |= {
            "fitted_below": float(fitted[0]),
            "local_slopes": (float(slopes.min()), float(slopes.max())),
        }
    return Measure(
        "uncertainty_exponent",
        definition,
        "1",
        None,
        one.value,
        one.lower,
        one.upper,
        "95 %, jackknife over 8 runs",
        parameters,
        tuple(limits),
        {"eps": one.sizes, "shares": one.shares, "relative_errors": one.errors, "local_slopes": one.slopes},
    )


def wada_merging(found: Slice) -> Measure:
    """Share of boundary points of the map that are not on the boundary of every basin."""
    definition = (
        "share of the boundary points of the map that are farther than 2 points from the boundary "
        "of some basin "
        "against all others merged; 0 if all basins share one boundary"
    )
    basins = [label for label in np.unique(found.grid) if label > 0]
    if len(basins) < 3:
        return Measure(
            "wada_merging", definition, limits=(*found.limits, f"{len(basins)} basins: Wada needs three")
        )
    distances, shares = wada.merging(found.grid, tuple(np.isfinite(found.region.turns)))
    if not len(distances):
        limits = (*found.limits, "no two basins of the map are neighbours")
        return Measure("wada_merging", definition, limits=limits)
    value = float(shares[min(2, len(shares) - 1)])
    return Measure(
        "wada_merging",
        definition,
        "1",
        None,
        value,
        math.nan,
        math.nan,
        "",
        {"basins": tuple(map(int, basins)), "distance": "2 points"},
        (*found.limits, "resolution of the map: structure between its points is not resolved"),
        {"distances": distances, "shares_farther": shares, "largest_distance": float(distances[-1])},
    )


def wada_grid(found: Slice) -> Measure:
    """Share of the cells on boundaries that show all basins when refined."""
    definition = (
        "W_N: the share of the map's cells with corners of two labels that show all N basins once "
        "the segments "
        "between their corners are bisected with new starts; 1 indicates Wada, 0 that no cell shows all of "
        "them"
    )
    basins = [label for label in np.unique(found.grid) if label > 0]
    if len(basins) < 3:
        return Measure(
            "wada_grid", definition, limits=(*found.limits, f"{len(basins)} basins: Wada needs three")
        )
    if found.machine is None:
        return Measure("wada_grid", definition, limits=(*found.limits, _NEEDS))
    cells = wada.grid_method(found.machine.labels, found.grid, found.axes, seed=found.seed)
    steps = len(cells.shares) - 1
    total = int(cells.counts[-1].sum())
    if total == 0:
        return Measure("wada_grid", definition, limits=(*found.limits, "no cell has corners of two labels"))
    hits = int(cells.counts[-1][-1])
    return Measure(
        "wada_grid",
        definition,
        "1",
        None,
        hits / total,
        *share_interval(hits, total),
        "95 %, Clopper and Pearson over the cells",
        {"basins": cells.basins, "cells": total, "halvings": steps},
        (*found.limits, f"segments of 2^-{steps} of a cell; a share that goes to 1 proves nothing below"),
        {"cells_by_number_of_basins": cells.counts, "shares": cells.shares},
    )
