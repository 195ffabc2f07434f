# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Members of a family of effects that are functions: values at knots instead of one closed form.

The number of knots is chosen by the evidence.
"""

from dataclasses import replace

import numpy as np

from separatrix.discovery.fitting.data import Data, polished
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.fitted import Fitted, beaten, values_of
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.members import MEMBERS, Member
from separatrix.discovery.fitting.shapes import through
from separatrix.discovery.policy import FIT
from separatrix.errors import SeparatrixError
from separatrix.library import effects


def fits_machine(member: Member, model) -> bool:
    """Whether a machine has what the table changes."""
    needs = effects()[member.effect].needs
    has = all(
        any(path == need or path.startswith(f"{need}.") for path in model.parameters)
        for need in (needs, member.anchor)
        if need
    )
    return has and not any(path.startswith(f"effect.{member.effect}.") for path in model.parameters)


def knots_at(member: Member, seen: np.ndarray, count: int) -> np.ndarray | None:
    """Knots over the seen values, half of the way from even ones to their quantiles; None for too few."""
    if seen.size < FIT.impacts_per_knot * count or not np.ptp(seen) > FIT.narrow * np.max(np.abs(seen)):
        return None
    return knots_over(member, seen, count)


def knots_over(member: Member, seen: np.ndarray, count: int) -> np.ndarray:
    """Knots over the seen values, however many these are."""
    if not member.knots:
        return np.arange(1.0, count + 1)
    if member.beside:
        # zero is implied
        return seen[-1] * np.arange(1, count + 1) / count
    first = 0.0 if member.from_zero else seen[0]
    even = np.linspace(first, seen[-1], count)
    return FIT.even_knots * even + (1 - FIT.even_knots) * np.quantile(
        np.append(first, seen), np.linspace(0, 1, count)
    )


def fit_member(
    data: Data,
    base: Fitted,
    member: Member,
    known: Fitted,
    knots: np.ndarray,
    alike: bool,
    ahead: Fitted | None = None,
) -> Fitted | None:
    """The base machine with a table in place of an effect, fitted from a `known` machine; None if impossible.

    Values of both directions that are `alike` are fitted as one. A fit that cannot come near a machine
    `ahead` any more is not continued.
    """
    begun = begun_at(member, known, base, knots)
    made = None if begun is None else with_table(data, base, member, known, knots, begun, alike)
    if made is None:
        return None
    model, problem, values = made
    beat = None if ahead is None else ahead.fit.total
    fit = minimise(problem, values, known.fit.starts, most=40, patient=True, beat=beat)
    added = [i for i, one in enumerate(problem.free) if one.path.startswith(f"effect.{member.effect}.")]
    found = Fitted((*base.names, member.effect), model, problem, fit, tuple(added))
    if ahead is not None and beaten(found, ahead):
        return found
    return replace(found, fit=polished(data, problem, fit, data.last, 40, rival=base.fit))


def begun_at(
    member: Member,
    known: Fitted,
    base: Fitted,
    knots: np.ndarray,
    table: list[tuple[np.ndarray, np.ndarray]] | None = None,
) -> list[np.ndarray] | None:
    """The function at the knots, for each of its values: of a `table`, of that of a machine, or of its law.

    None where that is no law of the family.
    """
    table = table_of(known, member) if table is None else table
    if table is None:
        return member.known(known, base, knots)
    begun = [drawn(member, at, value, knots) for at, value in table]
    return begun * len(member.values) if len(begun) == 1 else begun


def drawn(member: Member, at: np.ndarray, value: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """The curve of a table at other knots."""
    if member.beside:
        at, value = np.append(0.0, at), np.append(0.0, value)
    return through(at, value)(np.clip(knots, at[0], at[-1]))


def with_table(
    data: Data,
    base: Fitted,
    member: Member,
    known: Fitted,
    knots: np.ndarray,
    begun: list[np.ndarray],
    alike: bool,
) -> tuple[object, Likelihood, np.ndarray] | None:
    """The base machine with a table in place of an effect, its problem, and the values that it begins from.

    `begun`: the function at the knots, for each direction; None where there is no such machine.
    """
    if member.by_share and not begun[0][0] > 0:
        # there is no share of nothing
        return None
    values = {f"{member.knots}[{i}]": float(one) for i, one in enumerate(knots, start=1) if member.knots}
    values |= {f"{key}[{i}]": 0.0 for key in member.values for i in range(1, knots.size + 1)}
    if member.beside:
        # a barrier that does not push is none
        values |= {f"{member.values[0]}[{i}]": float(one) for i, one in enumerate(begun[0], start=1)}
        values[member.beside[0]] = 0.0
    try:
        extended = base.model.with_effect(member.effect, values)
    except SeparatrixError:
        return None
    free = [
        one for one in base.problem.free if not (member.replaces and one.path.startswith(member.replaces))
    ]
    added, start = _table(member, begun, alike, any(one.phase_known for one in data.prepared))
    if member.beside:
        key, of = member.beside
        added.append(Free(f"effect.{member.effect}.{key}", 0.0, 0.0, np.inf, max(of(known), 1e-6)))
        start.append(of(known))
    values = values_of(known, [*free, *added])
    values[len(free) :] = start
    if member.anchor:
        values[[one.path for one in free].index(member.anchor)] = begun[0][0]
    return extended, data.problem(extended, data.last, [*free, *added]), values


def member_of(fitted: Fitted) -> Member | None:
    """The function that the last effect of a fitted machine is, or that it is a closed form of."""
    last = fitted.names[-1] if fitted.names else ""
    family = effects()[last].family if last else ""
    return next((one for one in MEMBERS if one.effect == last), None) or next(
        (one for one in MEMBERS if one.family == family), None
    )


def table_of(fitted: Fitted, member: Member) -> list[tuple[np.ndarray, np.ndarray]] | None:
    """Knots and values of the table of a family that a fitted machine holds, by direction; None without one.

    Beside an anchor the whole function.
    """
    if member.effect not in fitted.names or not member.knots:
        return None
    parameters = fitted.model.parameters
    free = {one.path: value for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True)}
    count = sum(path.startswith(f"effect.{member.effect}.{member.knots}[") for path in parameters)
    numbers = range(1, count + 1)
    knots = np.array([parameters[f"effect.{member.effect}.{member.knots}[{i}]"].value for i in numbers])
    alike = any(one.also for one in fitted.problem.free if one.path.startswith(f"effect.{member.effect}."))
    found = []
    for key in member.values[:1] if alike else member.values:
        table = np.array([free.get(f"effect.{member.effect}.{key}[{i}]", 0.0) for i in numbers])
        if member.anchor:
            anchor = free[member.anchor]
            table = anchor * (1 + table) if member.by_share else anchor + table
        found.append((knots, table))
    return found


def _table(
    member: Member, begun: list[np.ndarray], alike: bool, turns: bool
) -> tuple[list[Free], list[float]]:
    """The free values of a table, and those to start from; `turns`: a crank angle is measured."""
    added, start = [], []
    bound = (-1.0, np.inf if member.by_share else 1.0) if member.anchor else (member.least, np.inf)
    for key, whole in zip(member.values[:1] if alike else member.values, begun, strict=False):
        # what the anchor, or scale and phase of the drive, would only repeat; a measured phase is not free
        first = 1 if member.anchor or not (member.knots or (turns and key == "sine")) else 0
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
