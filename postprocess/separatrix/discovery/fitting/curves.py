# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Members of a family of effects that are functions: values at knots instead of one built-in shape.

The number of knots is chosen by the evidence. Afterwards the closed forms of the family are held against the
function as it was found.
"""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.fitting.data import Data, polished
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.members import MEMBERS, Member, friction_at
from separatrix.discovery.fitting.refit import Fitted, values_of
from separatrix.discovery.fitting.shapes import closed_forms, through
from separatrix.discovery.measured.bodies import is_structure
from separatrix.errors import SeparatrixError
from separatrix.library import effects

KNOTS = (3, 5, 8, 12)
"""Numbers of knots that are tried, one after the other."""
# impacts that a knot takes
_IMPACTS = 3
# least range of the variable beside its largest value
_NARROW = 0.05
# places at which a series is drawn
_TURN = 49
# share of the range in which knots lie evenly; the rest of them goes where the motion is
_EVEN = 0.5


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
    if is_structure(model):
        # its joints have no tables
        return False
    needs = effects()[member.effect].needs
    has = all(
        any(path == need or path.startswith(f"{need}.") for path in model.parameters)
        for need in (needs, member.anchor)
        if need
    )
    return has and not any(path.startswith(f"effect.{member.effect}.") for path in model.parameters)


def knots_at(member: Member, seen: np.ndarray, count: int) -> np.ndarray | None:
    """Knots over the seen values, half of the way from even ones to their quantiles; None for too few."""
    if seen.size < _IMPACTS * count or not np.ptp(seen) > _NARROW * np.max(np.abs(seen)):
        return None
    if not member.knots:
        return np.arange(1.0, count + 1)
    if member.beside:
        # zero is implied
        return seen[-1] * np.arange(1, count + 1) / count
    first = 0.0 if member.from_zero else seen[0]
    even = np.linspace(first, seen[-1], count)
    return _EVEN * even + (1 - _EVEN) * np.quantile(np.append(first, seen), np.linspace(0, 1, count))


def fit_member(
    data: Data, base: Fitted, member: Member, known: Fitted, knots: np.ndarray, alike: bool
) -> Fitted | None:
    """The base machine with a table in place of an effect, fitted from a `known` machine; None if none.

    Where the table has values of both directions and they are `alike`, they are fitted as one.
    """
    begun = member.known(known, base, knots)
    if begun is None:
        return None
    values = {f"{member.knots}[{i}]": float(one) for i, one in enumerate(knots, start=1) if member.knots}
    values |= {f"{key}[{i}]": 0.0 for key in member.values for i in range(1, knots.size + 1)}
    if member.beside:
        values[member.beside[0]] = 0.0
    try:
        extended = base.model.with_effect(member.effect, values)
    except SeparatrixError:
        return None
    free = [
        one for one in base.problem.free if not (member.replaces and one.path.startswith(member.replaces))
    ]
    added, start = _table(member, begun, alike)
    if member.beside:
        key, of = member.beside
        added.append(Free(f"effect.{member.effect}.{key}", 0.0, 0.0, np.inf, max(of(known), 1e-6)))
        start.append(of(known))
    names = (*base.names, member.effect)
    place = tuple(range(len(free), len(free) + len(added)))
    values = values_of(known, [*free, *added])
    values[list(place)] = start
    paths = [one.path for one in free]
    if member.anchor:
        values[paths.index(member.anchor)] = begun[0][0]
    problem = data.problem(extended, data.last, [*free, *added])
    fit = minimise(problem, values, known.fit.starts, most=40, patient=True)
    fit = polished(data, problem, fit, data.last, 40, rival=base.fit)
    return Fitted(names, extended, problem, fit, place)


def _table(member: Member, begun: list[np.ndarray], alike: bool) -> tuple[list[Free], list[float]]:
    """The free values of a table, and those to start from."""
    added, start = [], []
    bound = (-1.0, np.inf if member.by_share else 1.0) if member.anchor else (member.least, np.inf)
    # what the anchor, or scale and phase of the drive, would only repeat
    first = 1 if member.anchor or not member.knots else 0
    for key, whole in zip(member.values[:1] if alike else member.values, begun, strict=False):
        table, size = whole, 0.05 * max(float(np.max(np.abs(whole))), 1e-6)
        if member.anchor:
            table, size = whole - whole[0], 0.05
        if member.by_share:
            table = table / whole[0]
        for i in range(first, table.size):
            path = f"effect.{member.effect}.{key}[{i + 1}]"
            also = path.replace(f".{key}[", f".{member.values[1]}[") if alike else None
            added.append(Free(path, 0.0, *bound, size, also=also))
            start.append(float(table[i]))
    return added, start


def _through(part: Part, x: np.ndarray) -> np.ndarray:
    return through(part.at, part.value)(np.clip(x, part.at[0], part.at[-1]))


def function_values(fitted: Fitted) -> tuple[Member, list[Part]] | None:
    """The table that a fitted machine holds, as the whole function with its covariance."""
    member = next((one for one in MEMBERS if one.effect in fitted.names), None)
    if member is None:
        return None
    parameters, paths = fitted.model.parameters, [one.path for one in fitted.problem.free]
    if not member.knots:
        return member, [_series(fitted, member)]
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
        slopes = np.eye(len(places))
        if member.by_share:
            anchor, shares = value[0], np.append(1.0, 1 + value[1:])
            slopes = np.diag(np.append(1.0, np.full(value.size - 1, anchor)))
            slopes[:, 0] = shares
            value = anchor * shares
        elif member.anchor:
            slopes[1:, 0] = 1
            value = slopes @ value
        elif member.effect == "friction_curve":
            # all of it: the law of the machine is in it
            value = friction_at(fitted, knots, -1.0 if key == "downwards" else 1.0)
        covariance = slopes @ fitted.covariance[np.ix_(places, places)] @ slopes.T
        name = "" if len(member.values) == 1 or alike else key
        parts.append(Part(name, knots, value, covariance))
    finer = None if fitted.finer is None else function_values(fitted.finer)
    if finer is not None and len(finer[1]) == len(parts):
        # few knots know too much: their errors are at least those of more, and what these change beyond them
        for one, other in zip(parts, finer[1], strict=True):
            chance = np.interp(one.at, other.at, other.error) ** 2
            changed = (_through(other, one.at) - one.value) ** 2
            wanted = np.maximum(0.0, chance - one.error**2) + np.maximum(0.0, changed - chance)
            one.covariance = one.covariance + np.diag(wanted)
    return member, parts


def _series(fitted: Fitted, member: Member) -> Part:
    """A series of harmonics by its values over a turn."""
    at = np.linspace(0, 2 * np.pi, _TURN)
    paths = [one.path for one in fitted.problem.free]
    columns, places = [], []
    for key, wave in zip(member.values, (np.cos, np.sin), strict=True):
        for place, path in enumerate(paths):
            if path.startswith(f"effect.{member.effect}.{key}["):
                places.append(place)
                columns.append(wave(int(path.split("[")[1][:-1]) * at))
    basis = np.column_stack(columns)
    covariance = basis @ fitted.covariance[np.ix_(places, places)] @ basis.T
    return Part("", at, basis @ fitted.fit.values[places], covariance)


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
