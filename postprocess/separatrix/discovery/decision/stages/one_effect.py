# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One effect: those that the screen promises, later every one, fitted over a base that is at its minimum."""

from dataclasses import replace

from separatrix.discovery.decision.gates import best_of, choice, pass_gates, score_ceiling
from separatrix.discovery.decision.rounds import Round, SearchContext, run_round
from separatrix.discovery.decision.scoring import ScoredCandidate, admissible
from separatrix.discovery.decision.stages.conclusions import without_name
from separatrix.discovery.decision.state import Choice, SearchState
from separatrix.discovery.fitting.base import copy_noise, limit_noise, renew_noise
from separatrix.discovery.fitting.ceiling import Ceiling, ceiling
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.fitted import Fitted, shared_values
from separatrix.discovery.policy import SEARCH


def one_effect(state: SearchState) -> SearchState:
    """Fit the effects that the screen promises, each beside all parameters of the machine."""
    context = state.context
    found = run_round(context, state.base, context.predict(state.base))
    found = _renewing(context, found, state.noise_measured)
    best = lead(context, found) if found.scored else None
    return replace(state, promised=found, round=found, gap=_gap(context, found), one=best, one_in=found)


def every_effect(state: SearchState) -> SearchState:
    """Fit every effect: the linear screen may have passed over the one that closes the gap."""
    context, first = state.context, state.promised
    whole = run_round(context, first.base, first.predicted, first, everything=True)
    whole = _renewing(context, whole, state.noise_measured, everything=True)
    best = lead(context, whole)
    found = replace(state, round=whole, gap=_gap(context, whole))
    if best.detected:
        return replace(found, one=best, one_in=whole)
    if whole.base is first.base:
        return found
    # the base itself explains what the effect did
    return found.decided(without_name(context, found.undecided))


def lead(context: SearchContext, found: Round) -> Choice:
    """The best candidate of a round with its gates, and its rivals."""
    best, rivals = leaders(context, found)
    pass_gates(context, best, found.base, rivals, found.screened.tests)
    chosen = Choice(best, rivals)
    if chosen.detected:
        score_ceiling(context, best)
    return chosen


def leaders(context: SearchContext, found: Round) -> tuple[ScoredCandidate, list[ScoredCandidate]]:
    """The best candidate that converged, and those that it does not beat clearly."""
    able = [one for one in found.scored if admissible(one, found.base, context.options)[0]]
    chosen = choice(context, found.base, found.predicted, able or found.scored, best_of)
    found.rank()
    return chosen


def _gap(context: SearchContext, found: Round) -> Ceiling:
    return ceiling(found.base.problem, found.base.fit, context.scales.mass)


def _renewing(context: SearchContext, found: Round, measured: bool, everything: bool = False) -> Round:
    """Repeat the round as long as it shows that its base can be fitted better."""
    for _ in range(SEARCH.renewals):
        if context.late:
            break
        lower = renewed(context, found, measured)
        if lower is None:
            break
        predicted = context.predict(lower, found.predicted)
        found = run_round(context, lower, predicted, found, everything)
    return found


def renewed(context: SearchContext, first: Round, measured: bool = False) -> Fitted | None:
    """Refit the base where candidates show another noise or a lower minimum of the base.

    A candidate may have left a local minimum of the base; the fall of chi^2 that the base reaches from
    there is not a gain of the candidate.
    """
    base = first.base
    lowest_misfit = sorted(first.scored, key=lambda one: -one.training)[: SEARCH.renewing_leaders]
    if not lowest_misfit:
        return None
    best = next((one for one in first.scored if one.settled), None)
    changed = best is not None and not measured and noise_renewed(context, best)
    fits = [minimise(base.problem, base.fit.values, base.fit.starts, patient=True)]
    for one in lowest_misfit:
        values = shared_values(base, one.fitted)
        fits.append(minimise(base.problem, values, one.fitted.fit.starts))
    fits = [fit for fit in fits if fit.good.sum() >= fits[0].good.sum()]
    lowest = min(fits, key=lambda fit: fit.total)
    gain = (best or lowest_misfit[0]).training
    if not changed and lowest.total > base.fit.total - max(
        SEARCH.lower_base, SEARCH.lower_base_share * 2 * gain
    ):
        return None
    return Fitted(base.names, base.model, base.problem, lowest, base.added)


def noise_renewed(context: SearchContext, best: ScoredCandidate) -> bool:
    """Measure the noise of all records by a better machine; whether it changed."""
    changed = renew_noise(context.training, best.fitted.problem, best.fitted.fit, context.scales.mass)
    if context.held_out is not None and best.prediction is not None:
        if changed:
            held = best.prediction
            renew_noise(context.held_out, held.problem, held.fit, context.scales.mass)
            copy_noise(context.training, context.held_out)
        changed |= limit_noise(context.training, context.held_out)
    return changed
