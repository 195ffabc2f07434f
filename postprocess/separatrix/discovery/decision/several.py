# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""More than one effect: found one by one, fitted jointly, and each held against leaving it out."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from separatrix.discovery.decision.gates import choice, foremost, judge_ceiling, pass_gates, weigh_faults
from separatrix.discovery.decision.judge import Judged, admissible, beyond_doubt, judged
from separatrix.discovery.decision.remains import closed_share
from separatrix.discovery.decision.rounds import Bench, Round, pair_gains, run_round
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.joint_effects import candidate_of, effect_of
from separatrix.discovery.fitting.machine import with_values
from separatrix.discovery.fitting.refit import Fitted, hopeless, led_by, refit
from separatrix.discovery.fitting.screen import screen, signature

_PAIRS = 6
# share of what is left of the gap that an effect must close for another one to be looked for on top of it
_CLOSES = 0.5
# share of the evidence of an effect alone from which on another of its family is tried in its place
_SHARE = 0.3


def with_more(bench: Bench, rounds: list[Round], best: Judged) -> tuple[Judged, list[Judged], bool]:
    """The best several effects, their rivals, and whether they close the gap together.

    On top of the best effect a second is tried, and the pairs that the screen finds; then a third, and so on,
    as long as each is needed and closes most of what was left. Each is held against others of its family in
    its place. The rounds are added to `rounds`.
    """
    first, found = rounds[0], best
    close: list[Judged] = []
    while len(found.fitted.names) < bench.options.most_effects:
        grown = [one for one in _grown(bench, rounds, found) if admissible(one, first.base, bench.options)[0]]
        if not grown:
            break
        larger, close = choice(bench, first.base, first.foretold, grown, foremost)
        swapped = [*_swapped(bench, first, larger, grown)]
        if swapped:
            larger, close = choice(bench, first.base, first.foretold, [*grown, *swapped], foremost)
        weigh_faults(bench, larger)
        pass_gates(bench, larger, first.base, close, rounds[-1].screened.tests)
        judge_ceiling(bench, larger)
        if larger.gates["adequate"]:
            found = _led_by(bench, first, larger, found)
        larger.gates["drop"] = _all_needed(bench, first, larger, found)
        if larger.gates["adequate"] and larger.gates["drop"]:
            return larger, close, True
        if not (larger.gates["drop"] and larger.settled and _closes_most(found, larger)):
            break
        found = larger
    return found, close, False


def _grown(bench: Bench, rounds: list[Round], found: Judged) -> list[Judged]:
    """Sets of effects with one more than `found`; pairs of any two as well."""
    first = rounds[0]
    limit = hopeless(first.base)
    # what comes nowhere near the records alone, as a soft barrier where impacts are hard, is no second effect
    lost = frozenset(one.name for one in first.judged if one.fitted.fit.far_off(limit))
    rounds.append(run_round(bench, found.fitted, found.prediction, 0.8, 0.9, without=lost))
    sets = [over_base(bench, first.base, first.foretold, one) for one in rounds[-1].judged]
    if len(found.fitted.names) > 1:
        return sets
    tried = {frozenset(one.fitted.names) for one in sets}
    for _, *pair in pair_gains(first)[:_PAIRS]:
        if frozenset(pair) not in tried and lost.isdisjoint(pair):
            made = fit_set(bench, first, pair)
            if made is not None:
                sets.append(over_base(bench, first.base, first.foretold, made))
                tried.add(frozenset(pair))
    return sets


def _swapped(bench: Bench, first: Round, whole: Judged, tried: list[Judged]) -> Iterator[Judged]:
    """The set with one effect in the place of another of its family, where nobody tried that."""
    known = {frozenset(one.fitted.names) for one in tried}
    alone = {one.name: one for one in first.judged}
    for name in whole.fitted.names:
        rest = [other for other in whole.fitted.names if other != name]
        least = _SHARE * alone[name].evidence if name in alone else -np.inf
        for one in first.judged:
            of_family = effect_of(one.name).family == effect_of(name).family
            if one.name in whole.fitted.names or not of_family or one.evidence < least:
                continue
            if frozenset([one.name, *rest]) in known:
                continue
            made = fit_set(bench, first, [one.name, *rest])
            swapped = None if made is None else over_base(bench, first.base, first.foretold, made)
            if swapped is not None and admissible(swapped, first.base, bench.options)[0]:
                yield swapped


def _closes_most(before: Judged, after: Judged) -> bool:
    """Whether most of what was left of the gap is closed, in training and on held-out records."""
    shares = [closed_share(before.fitted.fit, after.fitted.fit)]
    if before.prediction is not None and after.prediction is not None:
        shares.append(closed_share(before.prediction, after.prediction))
    return all(share is None or share > _CLOSES for share in shares)


def _led_by(bench: Bench, first: Round, whole: Judged, part: Judged) -> Judged:
    """Let each effect alone, and `part` of a set, follow the set that closes the gap; return that part.

    What a set is held against must not be in a minimum that the set left. Those alone are put into the round.
    """
    for place, one in enumerate(first.judged):
        if one.name in whole.fitted.names:
            first.judged[place] = _followed(bench, first, whole, one)
    first.rank()
    if len(part.fitted.names) > 1:
        return _followed(bench, first, whole, part)
    return next((one for one in first.judged if one.name == part.name), part)


def _followed(bench: Bench, first: Round, whole: Judged, one: Judged) -> Judged:
    """A part of a set from where the set ended, if there is more evidence of it."""
    better = led_by(bench.training, one.fitted, whole.fitted)
    if better is one.fitted:
        return one
    found = judged(first.base, first.foretold, better, bench.foretell(better, whole.prediction))
    if one.faults is not None:
        weigh_faults(bench, found)
    return found if found.evidence > one.evidence else one


def _all_needed(bench: Bench, first: Round, whole: Judged, part: Judged) -> bool:
    """Whether each effect of a set is worth it over the set without it, on held-out records too, as far as
    those say anything of it."""
    least = bench.options.needed * bench.options.separation
    for name in whole.fitted.names:
        if set(part.fitted.names) == {*whole.fitted.names} - {name}:
            other: Judged | None = part
        else:
            other = without(bench, first, name, whole.fitted.names)
            if other is not None and len(other.fitted.names) > 1 and whole.gates.get("adequate", False):
                other = _followed(bench, first, whole, other)
        if other is None:
            # it cannot be fitted
            continue
        # the gates of a part are those of what it foretold so far
        other = replace(other)
        weigh_faults(bench, other)
        if whole.evidence - other.evidence < least:
            return False
        if whole.prediction is not None and other.prediction is not None:
            over = over_base(bench, other.fitted, other.prediction, whole)
            foretold = over.held_out + whole.faults[1] - other.faults[1]
            if foretold <= 0 and not beyond_doubt(over, other.fitted, bench.options):
                return False
    return True


def without(bench: Bench, first: Round, name: str, names: Iterable[str]) -> Judged | None:
    """The machine with all effects but one; None where it cannot be fitted."""
    others = [other for other in names if other != name]
    if len(others) == 1:
        return next((one for one in first.judged if one.name == others[0]), None)
    fitted = fit_set(bench, first, others)
    return None if fitted is None else over_base(bench, first.base, first.foretold, fitted)


def over_base(bench: Bench, base: Fitted, foretold: Prediction | None, one: Judged | Fitted) -> Judged:
    """Evidence of several effects over the base, the parameters of all of them counted."""
    fitted = one.fitted if isinstance(one, Judged) else one
    prediction = one.prediction if isinstance(one, Judged) else bench.foretell(fitted)
    added = tuple(i for i, free in enumerate(fitted.problem.free) if _is_added(free.path, base))
    whole = Fitted(fitted.names, fitted.model, fitted.problem, fitted.fit, added, fitted.tries)
    return judged(base, foretold, whole, prediction)


def _is_added(path: str, base: Fitted) -> bool:
    nuisance = path.startswith("nuisance:")
    return not nuisance and all(path not in one.paths for one in base.problem.free)


def fit_set(bench: Bench, found: Round, names: Iterable[str]) -> Fitted | None:
    """Effects fitted one on top of the other, one that was fitted alone first; None where that cannot be."""
    names = list(names)
    singles = {one.name: one.fitted for one in found.judged}
    fitted = next((singles[name] for name in names if name in singles), None)
    for name in names if fitted is not None else ():
        if name in fitted.names:
            continue
        free = with_values(fitted.problem.free, fitted.fit.values)
        made = candidate_of(fitted.model, free, fitted.names, name, bench.scales)
        if isinstance(made, str):
            return None
        shown = signature(fitted.problem, fitted.fit, made)
        screened = None if shown is None else screen(fitted.fit, [shown])
        fitted = refit(bench.training, fitted, made, screened, quick=True)
    return fitted
