# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where records and model disagree: the missing force in bins of time, phase, position, speed and impacts.

In each bin one constant force is fitted to the residual of the base machine, with starts and parameters
projected out. Its error comes from resampling blocks of segments. Flags are corrected for the number of bins
(Benjamini and Hochberg).
"""

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.joint_effects import effect_of
from separatrix.discovery.fitting.normal_equations import inverse_scaled, solve_scaled
from separatrix.discovery.fitting.regions import (
    IMPACT_SPEED,
    LOW,
    PHASE,
    PLANE,
    POSITION,
    SINCE,
    SPEED,
    Region,
)
from separatrix.discovery.fitting.screen import project
from separatrix.discovery.options import Options
from separatrix.discovery.policy import SEARCH
from separatrix.discovery.wording import units_of

# maps over the variable that a family of effects depends on
_OF_FAMILY = {
    "friction over speed": (SPEED, LOW),
    "friction before sliding": (LOW, PLANE),
    "friction over position": (PLANE,),
    "spring over extension": (POSITION,),
    "force over position": (POSITION,),
    "restitution over impact speed": (IMPACT_SPEED,),
    "contact over penetration": (IMPACT_SPEED, SINCE),
    "contact over position": (POSITION,),
    "drive over phase": (PHASE,),
}


@dataclass
class Map:
    """One map: edges of its bins, and in each the missing force, its error and its flag."""

    name: str
    unit: str
    force_unit: str
    edges: np.ndarray
    other_edges: np.ndarray | None
    force: np.ndarray
    error: np.ndarray
    flagged: np.ndarray


def where_maps(fitted: Fitted, mass: float, options: Options, named: Iterable[str] = ()) -> list[Map]:
    """Missing forces in the bins of all maps; of maps that explain as much, those of `named` effects."""
    units = units_of(fitted.model.parameters)
    regions = fitted.problem.regions(fitted.fit, mass, units)
    if not regions:
        return []
    columns = np.concatenate([one.columns for one in regions], axis=2)
    sizes = [one.columns.shape[2] for one in regions]
    force, error = _forces(fitted, columns, options)
    flags = benjamini_hochberg(2 * norm.sf(np.abs(force) / error), SEARCH.flag_level)
    flags &= ~_at_rest(regions)
    own = {name for effect in named for name in _OF_FAMILY.get(effect_of(effect).family, ())}
    flags &= np.repeat(_reported(regions, _gains(fitted, columns, sizes), own), sizes)
    ends = np.cumsum([0, *sizes])
    return [
        Map(
            one.name, one.unit, one.force_unit, one.edges, one.other_edges, force[a:b], error[a:b], flags[a:b]
        )
        for one, a, b in zip(regions, ends[:-1], ends[1:], strict=True)
    ]


def _at_rest(regions: list[Region]) -> np.ndarray:
    """Which bins hold hardly any speed: what friction holds at rest is not known."""
    slow = SEARCH.at_rest * max(
        (np.abs(one.edges).max() for one in regions if one.name == SPEED), default=0.0
    )
    found = []
    for one in regions:
        speeds = one.other_edges if one.name == PLANE else one.edges if one.name in (SPEED, LOW) else None
        if speeds is None:
            found.append(np.zeros(one.columns.shape[2], bool))
        else:
            rests = np.maximum(np.abs(speeds[1:]), np.abs(speeds[:-1])) < slow
            found.append(np.tile(rests, one.columns.shape[2] // rests.size))
    return np.concatenate(found)


def _forces(fitted: Fitted, columns: np.ndarray, options: Options) -> tuple[np.ndarray, np.ndarray]:
    """One force per column, each by itself, and its error by block bootstrap."""
    fit = fitted.fit
    evaluation = fit.evaluation
    base = evaluation.by_parameter[:, :, ~fit.at_bound]
    p = base.shape[2]
    reduced = fit.normal_equations(base, columns)
    diagonal = np.einsum("kii->ki", reduced.matrix)[:, p:]
    total, _ = reduced.total()
    # parameters of the base projected out, segment by segment, by the same combination of their columns
    mixture = inverse_scaled(total[:p, :p], np.diag(total)[:p] > 0, 1e-11) @ total[:p, p:]
    cross = reduced.matrix[:, p:, :p]
    size = (
        diagonal
        - 2 * np.einsum("kqp,pq->kq", cross, mixture)
        + np.einsum("pq,kpr,rq->kq", mixture, reduced.matrix[:, :p, :p], mixture, optimize=True)
    )
    score = reduced.gradient[:, p:] - reduced.gradient[:, :p] @ mixture
    whole_size = np.maximum(size.sum(axis=0), 1e-300)
    force = score.sum(axis=0) / whole_size
    random = np.random.default_rng([options.seed, 21])
    n = score.shape[0]
    blocks = -(-n // SEARCH.map_block)
    first = random.integers(0, n, (options.bootstraps, blocks))
    index = ((first[:, :, None] + np.arange(SEARCH.map_block)) % n).reshape(options.bootstraps, -1)
    influence = score - size * force
    spread = np.std(influence[index].sum(axis=1), axis=0) / whole_size
    formal = 1 / np.sqrt(whole_size)
    live = np.diag(total)[p:] > 0
    return np.where(live, force, 0.0), np.where(live, np.maximum(spread, formal), np.inf)


def _gains(fitted: Fitted, columns: np.ndarray, sizes: list[int]) -> np.ndarray:
    """What the bins of each map together explain of chi^2, beyond chance."""
    fit = fitted.fit
    p = fit.evaluation.by_parameter.shape[2]
    matrix, gradient = fit.normal_equations(fit.evaluation.by_parameter, columns).total()
    left, score = project(matrix, gradient, p, ~fit.at_bound)
    gains, edges = [], np.cumsum([0, *sizes])
    for first, last in itertools.pairwise(edges):
        part = slice(first, last)
        step = solve_scaled(left[part, part], score[part], np.ones(last - first, bool))
        gains.append(float(score[part] @ step) - (last - first))
    return np.array(gains)


def _reported(maps: list[Region], gains: np.ndarray, own: set[str]) -> np.ndarray:
    """Which maps are reported: the simplest of those that explain nearly as much as any other.

    In a periodic motion, position, speed and phase of a missing force are correlated. Then the maps of the
    variable that a named effect depends on, `own`, are reported if they explain most of it too.
    """
    if gains.max() <= 0:
        # nothing is missing, or the stated noise is too large
        return np.zeros(gains.size, bool)
    near = gains >= SEARCH.map_nearly * gains.max()
    mine = np.array([one.name in own for one in maps]) & (gains >= SEARCH.map_of_name * gains.max())
    if mine.any():
        near = mine
    bins = np.array([one.columns.shape[2] for one in maps])
    return near & (bins == bins[near].min())


def benjamini_hochberg(p: np.ndarray, level: float) -> np.ndarray:
    """Flags whose expected share of false ones is at most `level`."""
    order = np.argsort(p)
    passed = p[order] <= level * np.arange(1, p.size + 1) / p.size
    flags = np.zeros(p.size, bool)
    if passed.any():
        flags[order[: np.flatnonzero(passed)[-1] + 1]] = True
    return flags


def sentences(maps: list[Map], barriers: Mapping[str, float] | None = None) -> list[dict]:
    """Flagged regions in words and numbers, the clearest of each map first.

    Positions of `barriers` that yield, 'lower' and 'upper', let a region be where the body presses on one.
    """
    found = []
    for one in maps:
        for index in np.flatnonzero(one.flagged)[np.argsort(-np.abs(one.force / one.error)[one.flagged])][:3]:
            region = _region(one, int(index))
            region["text"] += _pressed(one, region, barriers or {})
            found.append(
                {
                    "map": one.name,
                    "region": region,
                    "force": float(one.force[index]),
                    "error": float(one.error[index]),
                    "unit": one.force_unit,
                    "text": f"a {quantity_of(one.name)} of {one.force[index]:.3g} +- {one.error[index]:.2g} "
                    f"{one.force_unit} is missing {region['text']}",
                }
            )
    return found


def _pressed(one: Map, region: dict, barriers: Mapping[str, float]) -> str:
    """On which barrier the body presses in most of a region of positions, as words; '' where on none."""
    if one.name not in (POSITION, PLANE):
        return ""
    ends = [np.atleast_1d(region[end])[0] for end in ("from", "to")]
    for side, sense in (("upper", 1), ("lower", -1)):
        if side in barriers and sense * (np.mean(ends) - barriers[side]) > 0:
            return f", where the body presses on the {side} barrier"
    return ""


def quantity_of(name: str) -> str:
    """The quantity that is missing in a map."""
    return "speed after impacts" if name == IMPACT_SPEED else "force"


def _region(one: Map, index: int) -> dict:
    if one.other_edges is None:
        low, high = float(one.edges[index]), float(one.edges[index + 1])
        return {
            "from": low,
            "to": high,
            "unit": one.unit,
            "text": f"at {one.name} {low:.3g} to {high:.3g} {one.unit}",
        }
    columns = one.other_edges.size - 1
    i, j = divmod(index, columns)
    x, v = one.edges[i : i + 2], one.other_edges[j : j + 2]
    of_x, of_v = one.unit.split(", ")
    return {
        "from": [float(x[0]), float(v[0])],
        "to": [float(x[1]), float(v[1])],
        "unit": one.unit,
        "text": f"at position {x[0]:.3g} to {x[1]:.3g} {of_x} and velocity {v[0]:.3g} to {v[1]:.3g} {of_v}",
    }
