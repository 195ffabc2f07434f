# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where records and model disagree: the missing force in bins of time, phase, position, speed and impacts.

In each bin one constant force is fitted to the residual of the base machine, with starts and parameters
projected out. Its error comes from resampling blocks of segments. Flags are corrected for the number of bins
(Benjamini and Hochberg).
"""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.joint_effects import effect_of
from separatrix.discovery.fitting.joint_response import columns_of
from separatrix.discovery.fitting.motions import after_impacts, impacts_at, scaled_motion
from separatrix.discovery.fitting.normal_equations import inverse_scaled, solve_scaled
from separatrix.discovery.fitting.refit import Fitted
from separatrix.discovery.fitting.response import force_columns, kick_columns
from separatrix.discovery.fitting.screen import project
from separatrix.discovery.options import Options
from separatrix.discovery.policy import SEARCH
from separatrix.discovery.wording import Units, units_of

IMPACT_SPEED = "impact speed"
_LOW, _SINCE = "low speed", "time since the last impact"
# maps over the variable that a family of effects depends on
_SPEED, _POSITION, _PLANE, _PHASE = "velocity", "position", "position and velocity", "drive phase"
_OF_FAMILY = {
    "friction over speed": (_SPEED, _LOW),
    "friction before sliding": (_LOW, _PLANE),
    "friction over position": (_PLANE,),
    "spring over extension": (_POSITION,),
    "force over position": (_POSITION,),
    "restitution over impact speed": (IMPACT_SPEED,),
    "contact over penetration": (IMPACT_SPEED, _SINCE),
    "contact over position": (_POSITION,),
    "drive over phase": (_PHASE,),
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
    if isinstance(fitted.problem, CoordinateProblem):
        return _maps_at_locations(fitted, options)
    problem, fit = fitted.problem, fitted.fit
    state = scaled_motion(problem, fit)
    evaluation = fit.evaluation
    x, v = evaluation.x, evaluation.v
    inside = problem.segments.inside & fit.good[:, None]
    units = units_of(fitted.model.parameters)
    maps = [
        *_times(problem, inside),
        _bins(_POSITION, units.position, x, inside, 10),
        _bins(_SPEED, units.velocity, v, inside, 10),
        _bins(_LOW, units.velocity, np.where(np.abs(v) < 0.2 * state["speed"], v, np.nan), inside, 6),
    ]
    if state["phase"] is not None:
        maps.append(_bins(_PHASE, "rad", np.mod(state["phase"], 2 * np.pi), inside, 12))
    since = after_impacts(problem, fit)
    if np.isfinite(since).any():
        maps.append(_bins(_SINCE, "s", since, inside, 6))
    maps.append(_plane(x, v, inside, 5, units))
    maps = [one for one in maps if one is not None]
    tables = [member for _, _, _, _, member in maps]
    columns = force_columns(problem, fit, np.concatenate(tables, axis=2), mass)
    impacts = _impacts(problem, fit, units)
    if impacts is not None:
        maps.append(impacts)
        tables.append(impacts[4])
        columns = np.concatenate([columns, kick_columns(problem, fit, impacts[4])], axis=2)
    force, error = _forces(fitted, columns, options)
    flags = benjamini_hochberg(2 * norm.sf(np.abs(force) / error), SEARCH.flag_level)
    own = {name for effect in named for name in _OF_FAMILY.get(effect_of(effect).family, ())}
    gains = _gains(fitted, columns, [member.shape[2] for member in tables])
    flags &= np.repeat(_reported(maps, gains, own), [member.shape[2] for member in tables])
    found, first = [], 0
    for name, unit, edges, other, member in maps:
        part = slice(first, first + member.shape[2])
        first = part.stop
        of = units.velocity if name == IMPACT_SPEED else units.force
        found.append(Map(name, unit, of, edges, other, force[part], error[part], flags[part]))
    return found


def _maps_at_locations(fitted: Fitted, options: Options) -> list[Map]:
    """Missing forces at every location of several bodies, over its extension and its speed."""
    problem, fit = fitted.problem, fitted.fit
    inside, n = problem.segments.inside & fit.good[:, None], problem.structure.n
    motion = fit.evaluation.motion
    maps, columns = [], []
    for location in problem.structure.locations:
        of_location = (
            (_POSITION, "m", motion[:, :, :n] @ location.row),
            (_SPEED, "m/s", motion[:, :, n:] @ location.row),
        )
        for name, unit, values in of_location:
            one = _bins(f"{name} of {location.name}", unit, values, inside, 8)
            if one is not None:
                maps.append(one)
                columns.append(columns_of(problem, fit, one[4], location.row))
    if not maps:
        return []
    whole = np.concatenate(columns, axis=2)
    force, error = _forces(fitted, whole, options)
    sizes = [one[4].shape[2] for one in maps]
    flags = benjamini_hochberg(2 * norm.sf(np.abs(force) / error), SEARCH.flag_level)
    flags &= np.repeat(_reported(maps, _gains(fitted, whole, sizes), set()), sizes)
    ends = np.cumsum([0, *sizes])
    return [
        Map(name, unit, "N", edges, other, force[a:b], error[a:b], flags[a:b])
        for (name, unit, edges, other, _), a, b in zip(maps, ends[:-1], ends[1:], strict=True)
    ]


def _times(problem, inside: np.ndarray) -> list[tuple | None]:
    """Bins of time for each record by itself, as records may be of different days."""
    found = []
    count = max(4, 12 // len(problem.prepared))
    for number, prepared in enumerate(problem.prepared):
        rows = problem.segments.record == number
        seconds = np.zeros(inside.shape)
        seconds[rows] = prepared.samples.t[problem.segments.index[rows]] - prepared.record.t[0]
        name = "time" if len(problem.prepared) == 1 else f"time in {prepared.record.name}"
        found.append(_bins(name, "s", seconds, inside & rows[:, None], count))
    return found


def _bins(name: str, unit: str, values: np.ndarray, inside: np.ndarray, count: int) -> tuple | None:
    """Bins of equal numbers of samples."""
    usable = inside & np.isfinite(values)
    if usable.sum() < 10 * count:
        return None
    edges = np.unique(np.quantile(values[usable], np.linspace(0, 1, count + 1)))
    if edges.size < 3:
        return None
    index = np.clip(
        np.searchsorted(edges, np.where(usable, values, edges[0]), side="right") - 1, 0, edges.size - 2
    )
    member = ((index[:, :, None] == np.arange(edges.size - 1)) & usable[:, :, None]).astype(float)
    return name, unit, edges, None, member


def _plane(x: np.ndarray, v: np.ndarray, inside: np.ndarray, count: int, units: Units) -> tuple | None:
    one, other = _bins("", "", x, inside, count), _bins("", "", v, inside, count)
    if one is None or other is None:
        return None
    member = (one[4][:, :, :, None] * other[4][:, :, None, :]).reshape(*x.shape, -1)
    return _PLANE, f"{units.position}, {units.velocity}", one[2], other[2], member


def _impacts(problem, fit, units: Units) -> tuple | None:
    """Bins of the speed before an impact, in which the speed after it is changed."""
    before, at = impacts_at(problem, fit)
    at = at * fit.good[:, None]
    hit = at != 0
    if hit.sum() < SEARCH.impacts_per_bin * SEARCH.impact_bins:
        return None
    edges = np.unique(np.quantile(before[hit], np.linspace(0, 1, SEARCH.impact_bins + 1)))
    if edges.size < 3:
        return None
    index = np.clip(np.searchsorted(edges, before, side="right") - 1, 0, edges.size - 2)
    member = (index[:, :, None] == np.arange(edges.size - 1)) * at[:, :, None]
    return IMPACT_SPEED, units.velocity, edges, None, member


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


def _reported(maps: list[tuple], gains: np.ndarray, own: set[str]) -> np.ndarray:
    """Which maps are reported: the simplest of those that explain nearly as much as any other.

    In a periodic motion, position, speed and phase of a missing force are correlated. Then the maps of the
    variable that a named effect depends on, `own`, are reported if they explain most of it too.
    """
    if gains.max() <= 0:
        # nothing is missing, or the stated noise is too large
        return np.zeros(gains.size, bool)
    near = gains >= SEARCH.map_nearly * gains.max()
    mine = np.array([one[0] in own for one in maps]) & (gains >= SEARCH.map_of_name * gains.max())
    if mine.any():
        near = mine
    bins = np.array([one[4].shape[2] for one in maps])
    return near & (bins == bins[near].min())


def benjamini_hochberg(p: np.ndarray, level: float) -> np.ndarray:
    """Flags whose expected share of false ones is at most `level`."""
    order = np.argsort(p)
    passed = p[order] <= level * np.arange(1, p.size + 1) / p.size
    flags = np.zeros(p.size, bool)
    if passed.any():
        flags[order[: np.flatnonzero(passed)[-1] + 1]] = True
    return flags


def sentences(maps: list[Map]) -> list[dict]:
    """Flagged regions in words and numbers, the clearest of each map first."""
    found = []
    for one in maps:
        for index in np.flatnonzero(one.flagged)[np.argsort(-np.abs(one.force / one.error)[one.flagged])][:3]:
            region = _region(one, int(index))
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
