# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""More than one effect: found one by one, fitted jointly, and each compared with leaving it out."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from separatrix.discovery.decision.gates import (
    best_of,
    choice,
    pass_gates,
    score_ceiling,
    weigh_imperfections,
)
from separatrix.discovery.decision.remains import closed_share
from separatrix.discovery.decision.rounds import Round, SearchContext, pair_gains, run_round
from separatrix.discovery.decision.scoring import ScoredCandidate, admissible, beyond_doubt, scored
from separatrix.discovery.fitting.fitted import Fitted, hopeless
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.joint_effects import candidate_of, effect_of
from separatrix.discovery.fitting.machine import with_values
from separatrix.discovery.fitting.refit import refit, warm_started_by
from separatrix.discovery.fitting.screen import screen, signature
from separatrix.discovery.policy import SEARCH


def with_more(
    context: SearchContext, rounds: list[Round], best: ScoredCandidate
) -> tuple[ScoredCandidate, list[ScoredCandidate], bool]:
    """The best several effects, their rivals, and whether they close the gap together.

    A second effect is tried on top of the best one, and the pairs that the screen finds; then a third, and
    so on, as long as each is needed and closes most of the remainder. Others of its family are tried instead
    of each. The rounds are added to `rounds`.
    """
    first, found = rounds[0], best
    close: list[ScoredCandidate] = []
    while len(found.fitted.names) < context.options.most_effects:
        grown = [
            one for one in _grown(context, rounds, found) if admissible(one, first.base, context.options)[0]
        ]
        if not grown:
            break
        larger, close = choice(context, first.base, first.predicted, grown, best_of)
        swapped = [*_swapped(context, first, larger, grown)]
        if swapped:
            larger, close = choice(context, first.base, first.predicted, [*grown, *swapped], best_of)
        weigh_imperfections(context, larger)
        pass_gates(context, larger, first.base, close, rounds[-1].screened.tests)
        score_ceiling(context, larger)
        if larger.gates["adequate"]:
            found = _warm_started_by(context, first, larger, found)
        larger.gates["drop"] = _all_needed(context, first, larger, found)
        if larger.gates["adequate"] and larger.gates["drop"]:
            return larger, close, True
        if not (larger.gates["drop"] and larger.settled and _closes_most(found, larger)):
            break
        found = larger
    return found, close, False


def _grown(context: SearchContext, rounds: list[Round], found: ScoredCandidate) -> list[ScoredCandidate]:
    """Sets of effects with one more than `found`; pairs of any two as well."""
    first = rounds[0]
    limit = hopeless(first.base)
    # an effect that alone is far from the records, as a soft barrier for hard impacts, is no second effect
    lost = frozenset(one.name for one in first.scored if one.fitted.fit.far_off(limit))
    rounds.append(run_round(context, found.fitted, found.prediction, without=lost))
    sets = [over_base(context, first.base, first.predicted, one) for one in rounds[-1].scored]
    if len(found.fitted.names) > 1:
        return sets
    tried = {frozenset(one.fitted.names) for one in sets}
    for _, *pair in pair_gains(first)[: SEARCH.pairs]:
        if frozenset(pair) not in tried and lost.isdisjoint(pair):
            made = fit_set(context, first, pair)
            if made is not None:
                sets.append(over_base(context, first.base, first.predicted, made))
                tried.add(frozenset(pair))
    return sets


def _swapped(
    context: SearchContext, first: Round, whole: ScoredCandidate, tried: list[ScoredCandidate]
) -> Iterator[ScoredCandidate]:
    """The set with one effect replaced by another of its family, where that is untried."""
    known = {frozenset(one.fitted.names) for one in tried}
    alone = {one.name: one for one in first.scored}
    for name in whole.fitted.names:
        rest = [other for other in whole.fitted.names if other != name]
        least = SEARCH.swapped_share * alone[name].evidence if name in alone else -np.inf
        for one in first.scored:
            of_family = effect_of(one.name).family == effect_of(name).family
            if one.name in whole.fitted.names or not of_family or one.evidence < least:
                continue
            if frozenset([one.name, *rest]) in known:
                continue
            made = fit_set(context, first, [one.name, *rest])
            swapped = None if made is None else over_base(context, first.base, first.predicted, made)
            if swapped is not None and admissible(swapped, first.base, context.options)[0]:
                yield swapped


def _closes_most(before: ScoredCandidate, after: ScoredCandidate) -> bool:
    """Whether most of what was left of the gap is closed, in training and on held-out records."""
    shares = [closed_share(before.fitted.fit, after.fitted.fit)]
    if before.prediction is not None and after.prediction is not None:
        shares.append(closed_share(before.prediction, after.prediction))
    return all(share is None or share > SEARCH.closes_of_rest for share in shares)


def _warm_started_by(
    context: SearchContext, first: Round, whole: ScoredCandidate, part: ScoredCandidate
) -> ScoredCandidate:
    """Warm-start each single effect, and `part` of a set, from the set that closes the gap; return that part.

    A set must not be compared with a machine in a minimum that the set left. The single effects are put into
    the round.
    """
    for index, one in enumerate(first.scored):
        if one.name in whole.fitted.names:
            first.scored[index] = _followed(context, first, whole, one)
    first.rank()
    if len(part.fitted.names) > 1:
        return _followed(context, first, whole, part)
    return next((one for one in first.scored if one.name == part.name), part)


def _followed(
    context: SearchContext, first: Round, whole: ScoredCandidate, one: ScoredCandidate
) -> ScoredCandidate:
    """A part of a set fitted from the end of the set, if that has more evidence."""
    better = warm_started_by(context.training, one.fitted, whole.fitted)
    if better is one.fitted:
        return one
    found = scored(first.base, first.predicted, better, context.predict(better, whole.prediction))
    if one.imperfections is not None:
        weigh_imperfections(context, found)
    return found if found.evidence > one.evidence else one


def _all_needed(context: SearchContext, first: Round, whole: ScoredCandidate, part: ScoredCandidate) -> bool:
    """Whether each effect of a set is worth its addition, also on held-out records that depend on it."""
    least = context.options.needed * context.options.separation
    for name in whole.fitted.names:
        if set(part.fitted.names) == {*whole.fitted.names} - {name}:
            other: ScoredCandidate | None = part
        else:
            other = without(context, first, name, whole.fitted.names)
            if other is not None and len(other.fitted.names) > 1 and whole.gates.get("adequate", False):
                other = _followed(context, first, whole, other)
        if other is None:
            # it cannot be fitted
            continue
        # the gates of a part refer to its prediction so far
        other = replace(other)
        weigh_imperfections(context, other)
        if whole.evidence - other.evidence < least:
            return False
        if whole.prediction is not None and other.prediction is not None:
            over = over_base(context, other.fitted, other.prediction, whole)
            predicted = over.held_out + whole.imperfections[1] - other.imperfections[1]
            if predicted <= 0 and not beyond_doubt(over, other.fitted, context.options):
                return False
    return True


def without(context: SearchContext, first: Round, name: str, names: Iterable[str]) -> ScoredCandidate | None:
    """The machine with all effects but one; None where it cannot be fitted."""
    others = [other for other in names if other != name]
    if len(others) == 1:
        return next((one for one in first.scored if one.name == others[0]), None)
    fitted = fit_set(context, first, others)
    return None if fitted is None else over_base(context, first.base, first.predicted, fitted)


def over_base(
    context: SearchContext, base: Fitted, predicted: Prediction | None, one: ScoredCandidate | Fitted
) -> ScoredCandidate:
    """Evidence of several effects over the base, the parameters of all of them counted."""
    fitted = one.fitted if isinstance(one, ScoredCandidate) else one
    prediction = one.prediction if isinstance(one, ScoredCandidate) else context.predict(fitted)
    added = tuple(i for i, free in enumerate(fitted.problem.free) if _is_added(free.path, base))
    whole = Fitted(fitted.names, fitted.model, fitted.problem, fitted.fit, added, fitted.tries)
    return scored(base, predicted, whole, prediction)


def _is_added(path: str, base: Fitted) -> bool:
    nuisance = path.startswith("nuisance:")
    return not nuisance and all(path not in one.paths for one in base.problem.free)


def fit_set(context: SearchContext, found: Round, names: Iterable[str]) -> Fitted | None:
    """Effects fitted one on top of the other, one that was fitted alone first; None where that cannot be."""
    names = list(names)
    singles = {one.name: one.fitted for one in found.scored}
    fitted = next((singles[name] for name in names if name in singles), None)
    for name in names if fitted is not None else ():
        if name in fitted.names:
            continue
        free = with_values(fitted.problem.free, fitted.fit.values)
        made = candidate_of(fitted.model, free, fitted.names, name, context.scales)
        if isinstance(made, str):
            return None
        shown = signature(fitted.problem, fitted.fit, made)
        screened = None if shown is None else screen(fitted.fit, [shown])
        fitted = refit(context.training, fitted, made, screened, quick=True)
    return fitted
