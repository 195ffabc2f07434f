# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A family as a function, where no closed form of the catalogue closes the gap."""

from dataclasses import replace

from separatrix.discovery.decision.flexible import flexible_member
from separatrix.discovery.decision.gates import pass_gates, score_ceiling
from separatrix.discovery.decision.misfit import misses
from separatrix.discovery.decision.rounds import Round, SearchContext
from separatrix.discovery.decision.scoring import ScoredCandidate, extrapolates
from separatrix.discovery.decision.stages.conclusions import conclude
from separatrix.discovery.decision.state import Choice, SearchState
from separatrix.discovery.fitting.rig import cleaned_prediction


def function(state: SearchState) -> SearchState:
    """Fit families as functions over the round of the best effect."""
    earlier = None if state.one_in is state.promised else state.promised
    return replace(state, function=as_function(state, earlier))


def function_alone(state: SearchState) -> SearchState:
    """Name a function though no closed form is significant, unless it only follows the fitted records."""
    found = as_function(state)
    if found is None or only_follows(state.context, found.best):
        return state
    bare = replace(state.decision, reasons=())
    return state.decided(conclude(state.context, bare, *found))


def as_function(state: SearchState, earlier: Round | None = None) -> Choice | None:
    """A family whose closed forms have the wrong shape and that closes the gap as a function.

    A function must improve the prediction of held-out records; else it only follows the fitted ones.
    """
    context, found = state.context, state.one_in
    member = flexible_member(context, found, state.gap, earlier)
    if member is None:
        return None
    one, rivals = member
    pass_gates(context, one, found.base, rivals, found.screened.tests)
    chosen = Choice(one, rivals)
    if not chosen.detected:
        return None
    score_ceiling(context, one)
    needed = [
        one.gates[gate] for gate in ("adequate", "admissible", "converged", "hold-out") if gate in one.gates
    ]
    return chosen if all(needed) else None


def of_several(context: SearchContext, one: ScoredCandidate) -> bool:
    """Whether a function may be the sum of several effects.

    Two closed forms may replace a table of friction for each direction with fewer parameters. A function that
    follows the fitted but not the held-out records may have absorbed another effect.
    """
    if context.options.quick or one.prediction is None or extrapolates(one, context.options):
        return _of_two_directions(one)
    return _of_two_directions(one) or misses(one.prediction, one.fitted.fit, context.options)


def only_follows(context: SearchContext, one: ScoredCandidate) -> bool:
    """Whether a machine follows fitted records, as a function has the freedom to, and misses held-out ones.

    What imperfections of a rig may explain of those is taken off.
    """
    prediction = one.prediction
    if prediction is None or not misses(prediction, one.fitted.fit, context.options):
        return False
    if extrapolates(one, context.options):
        return False
    prediction = replace(prediction, fit=cleaned_prediction(one.fitted, prediction))
    return misses(prediction, one.fitted.fit, context.options)


def _of_two_directions(one: ScoredCandidate) -> bool:
    """Whether a fit has a table of friction for each direction of its own."""
    free = one.fitted.problem.free
    return one.name == "friction_curve" and not any(free[i].also for i in one.fitted.added)
