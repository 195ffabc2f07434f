# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Members of a family of effects that are functions: values at knots instead of one built-in shape.

The number of knots is chosen by the evidence. Afterwards the closed forms of the family are held against the
function as it was found.
"""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.fitting.data import Data
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.problem import Problem
from separatrix.discovery.fitting.refit import Fitted, values_of
from separatrix.discovery.fitting.shapes import closed_forms, through
from separatrix.errors import SeparatrixError
from separatrix.library import effects

KNOTS = (3, 5, 8, 12)
"""Numbers of knots that are tried, one after the other."""
# impacts that a knot takes
_IMPACTS = 3
# share of the largest impact speed below which bounces die out and say little
_SLOW = 0.03
# share of the range in which knots lie evenly; the rest of them goes where the motion is
_EVEN = 0.5
# time over which a force is measured, in natural periods or seconds
_INSTANT = 1e-5


@dataclass(frozen=True)
class Member:
    """An effect that is a table: the key of its knots and those of its values."""

    effect: str
    knots: str
    values: tuple[str, ...]
    # what the function is of, in which unit, and what it gives
    variable: str
    unit: str
    quantity: str
    # free parameter of the machine that a constant in the table would only repeat
    anchor: str | None
    # parameters of the machine that the table takes the place of
    replaces: str | None
    # force that it explains, by the names of the ceiling
    explains: str

    @property
    def family(self) -> str:
        """The function that it is one shape of."""
        return effects()[self.effect].family


MEMBERS = (
    Member(
        "restitution_curve", "speed", ("change",), "impact speed", "m/s", "restitution",
        "contact.restitution", None, "impacts",
    ),
    Member(
        "friction_curve", "speed", ("upwards", "downwards"), "speed", "m/s", "friction (N)",
        None, "friction.", "speed",
    ),
)  # fmt: skip


@dataclass
class Part:
    """A function by its values at knots, with their covariance."""

    name: str
    at: np.ndarray
    value: np.ndarray
    covariance: np.ndarray

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the values."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0))


@dataclass
class Function:
    """A function as it was found, in one part or one for each direction, and the closed forms that fit it."""

    member: Member
    parts: list[Part]
    forms: dict[str, dict]


def fits_machine(member: Member, model) -> bool:
    """Whether a machine has what the table changes."""
    needs = effects()[member.effect].needs
    has = all(
        any(path == need or path.startswith(f"{need}.") for path in model.parameters)
        for need in (needs, member.anchor)
        if need
    )
    return has and not any(path.startswith(f"effect.{member.effect}.") for path in model.parameters)


def seen_values(member: Member, fitted: Fitted) -> np.ndarray:
    """Values of the variable in the fitted motion: speeds of its impacts, its speeds, its places."""
    fit = fitted.fit
    if member.effect == "restitution_curve":
        found = [
            np.abs(impacts[fit.good[np.flatnonzero(fitted.problem.segments.record == number)][rows], 2])
            for number, impacts in enumerate(fit.evaluation.impacts)
            if impacts is not None and len(impacts)
            for rows in [impacts[:, 0].astype(int)]
        ]
        speeds = np.sort(np.concatenate(found)) if found else np.zeros(0)
        return speeds[speeds > _SLOW * speeds.max(initial=0)]
    inside = fitted.problem.segments.inside & fit.good[:, None]
    return np.sort(np.abs(fit.evaluation.v[inside]))


def knots_at(member: Member, seen: np.ndarray, count: int) -> np.ndarray | None:
    """Knots over the seen values, half of the way from even ones to their quantiles; None for too few."""
    if seen.size < _IMPACTS * count or not seen[-1] > 1.05 * seen[0]:
        return None
    first = 0.0 if member.effect == "friction_curve" else seen[0]
    even = np.linspace(first, seen[-1], count)
    return _EVEN * even + (1 - _EVEN) * np.quantile(np.append(first, seen), np.linspace(0, 1, count))


def fit_member(
    data: Data, base: Fitted, member: Member, known: Fitted, knots: np.ndarray, alike: bool
) -> Fitted | None:
    """The base machine with a table in place of an effect, fitted from a `known` machine; None if none.

    Where the table has values of both directions and they are `alike`, they are fitted as one.
    """
    begun = _begun(member, base, known, knots)
    if begun is None:
        return None
    values = {f"{member.knots}[{i}]": float(one) for i, one in enumerate(knots, start=1)}
    values |= {f"{key}[{i}]": 0.0 for key in member.values for i in range(1, knots.size + 1)}
    try:
        extended = base.model.with_effect(member.effect, values)
    except SeparatrixError:
        return None
    free = [
        one for one in base.problem.free if not (member.replaces and one.path.startswith(member.replaces))
    ]
    added, start = _table(member, begun, alike)
    names = (*base.names, member.effect)
    place = tuple(range(len(free), len(free) + len(added)))
    values = values_of(known, [*free, *added])
    values[list(place)] = start
    paths = [one.path for one in free]
    if member.anchor:
        values[paths.index(member.anchor)] = begun[0][0]
    problem = Problem(extended, data.prepared, data.stages[data.last], [*free, *added])
    fit = minimise(problem, values, known.fit.starts, most=40, patient=True)
    return Fitted(names, extended, problem, fit, place)


def _table(member: Member, begun: list[np.ndarray], alike: bool) -> tuple[list[Free], list[float]]:
    """The free values of a table, and those to start from."""
    added, start = [], []
    bound = (-1.0, 1.0) if member.anchor else (-np.inf, np.inf)
    for key, whole in zip(member.values[:1] if alike else member.values, begun, strict=False):
        table, size = whole, 0.05 * max(float(np.max(np.abs(whole))), 1e-6)
        if member.anchor:
            table, size = whole - whole[0], 0.05
        for i in range(1 if member.anchor else 0, table.size):
            path = f"effect.{member.effect}.{key}[{i + 1}]"
            also = path.replace(f".{key}[", f".{member.values[1]}[") if alike else None
            added.append(Free(path, 0.0, *bound, size, also=also))
            start.append(float(table[i]))
    return added, start


def _begun(member: Member, base: Fitted, known: Fitted, knots: np.ndarray) -> list[np.ndarray] | None:
    """Functions to begin with, one for each direction: what the known machine does at the knots."""
    if member.effect == "restitution_curve":
        table = restitution_at(known.model, _values(known), knots)
        return None if table is None else [table]
    return [friction_at(known, knots, direction, base) for direction in (1.0, -1.0)]


def _through(part: Part, x: np.ndarray) -> np.ndarray:
    return through(part.at, part.value)(np.clip(x, part.at[0], part.at[-1]))


def _values(fitted: Fitted) -> dict[str, float]:
    """Values of the machine as fitted, nuisances aside."""
    return {
        path: one.physical(value)
        for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True)
        if not one.is_nuisance
        for path in one.paths
    }


def restitution_at(model, values: dict[str, float], speeds: np.ndarray) -> np.ndarray | None:
    """Restitution at speeds of impact: what the simulator does with a body just before its barrier."""
    there = {path: values.get(path, model.parameters[path].value) for path in model.parameters if path in
             ("contact.upper", "contact.lower")}  # fmt: skip
    side = 1.0 if abs(there.get("contact.upper", np.inf)) < 1e100 else -1.0
    barrier = there.get("contact.upper" if side > 0 else "contact.lower", np.inf)
    if abs(barrier) >= 1e100:
        return None
    time = _INSTANT / max(1.0, model.drive_frequency({}))
    start = np.column_stack([barrier - side * speeds * time, side * speeds, 0 * speeds])
    times = np.tile([0.0, 2 * time], speeds.size)
    flown = model.segments(
        list(values), np.array(list(values.values())), start, 2 * np.arange(speeds.size + 1), times,
        derivatives=False,
    )  # fmt: skip
    hit, first = np.unique(flown.impact.segment, return_index=True)
    if hit.size < speeds.size:
        return None
    return np.abs(flown.impact.speed_after[first] / flown.impact.speed_before[first])


def friction_at(
    known: Fitted, speeds: np.ndarray, direction: float, base: Fitted | None = None
) -> np.ndarray:
    """Friction [N] against the motion in a direction: what slows a body down in the simulator.

    That of the known machine beyond that of the base with the numbers of its case; without `base` all of it.
    """
    values = _values(known)
    model = known.model if base is None else base.model
    without = {path: value for path, value in values.items() if path in model.parameters}
    if base is None:
        without |= {path: 0.0 for path in model.parameters if _is_friction(path)}
    else:
        without = {path: value for path, value in without.items() if not _is_friction(path)}
    mass = values.get("body.mass", known.model.parameters["body.mass"].value)
    x = np.median(known.fit.evaluation.x[known.problem.segments.inside & known.fit.good[:, None]])
    # at rest there is no direction
    v = direction * np.maximum(speeds, 1e-3 * np.max(speeds))
    time = _INSTANT / max(1.0, known.model.drive_frequency({}))
    start = np.column_stack([np.full(v.size, x), v, 0 * v])
    first, times = 2 * np.arange(v.size + 1), np.tile([0.0, time], v.size)
    ends = [
        machine.segments(
            list(chosen), np.array(list(chosen.values())), start, first, times,
            derivatives=False, tolerance=1e-12,
        ).v[1::2]
        for machine, chosen in ((known.model, values), (model, without))
    ]  # fmt: skip
    return -direction * mass * (ends[0] - ends[1]) / time


def _is_friction(path: str) -> bool:
    """Whether a parameter is a size of friction over speed."""
    law = path.startswith("friction.") and path.endswith(("coefficient", "damping"))
    return law or path.startswith(("effect.friction_curve.upwards", "effect.friction_curve.downwards"))


def function_values(fitted: Fitted) -> tuple[Member, list[Part]] | None:
    """The table that a fitted machine holds, as the whole function with its covariance."""
    member = next((one for one in MEMBERS if one.effect in fitted.names), None)
    if member is None:
        return None
    parameters, paths = fitted.model.parameters, [one.path for one in fitted.problem.free]
    count = sum(path.startswith(f"effect.{member.effect}.{member.knots}[") for path in parameters)
    knots = np.array(
        [parameters[f"effect.{member.effect}.{member.knots}[{i}]"].value for i in range(1, count + 1)]
    )
    alike = any(fitted.problem.free[i].also for i in fitted.added)
    parts = []
    for key in member.values[:1] if alike else member.values:
        table = [f"effect.{member.effect}.{key}[{i}]" for i in range(1, count + 1)]
        places = [paths.index(path) for path in table if path in paths]
        if member.anchor:
            places = [paths.index(member.anchor), *places]
        value = fitted.fit.values[places]
        sums = np.eye(len(places))
        if member.anchor:
            # each value is the restitution at low speed and a change
            sums[1:, 0] = 1
        covariance = sums @ fitted.covariance[np.ix_(places, places)] @ sums.T
        if member.anchor:
            value = sums @ value
        else:
            value = friction_at(fitted, knots, -1.0 if key == "downwards" else 1.0)
        name = "" if len(member.values) == 1 or alike else key
        parts.append(Part(name, knots, value, covariance))
    finer = None if fitted.finer is None else function_values(fitted.finer)
    if finer is not None and len(finer[1]) == len(parts):
        # what more knots change beyond their own errors is an error of these
        for one, other in zip(parts, finer[1], strict=True):
            chance = np.interp(one.at, other.at, other.error) ** 2
            changed = (_through(other, one.at) - one.value) ** 2
            one.covariance = one.covariance + np.diag(np.maximum(0.0, changed - chance))
    return member, parts


def function_of(fitted: Fitted) -> Function | None:
    """The function that a fitted machine holds as a table, with the closed forms that fit it."""
    found = function_values(fitted)
    if found is None:
        return None
    member, parts = found
    whole = [closed_forms(member.effect, one.at, one.value, one.covariance) for one in parts]
    # with two directions a form must fit both
    forms = {
        name: one | {"fits": all(other[name]["fits"] for other in whole)} for name, one in whole[0].items()
    }
    return Function(member, parts, forms)
