# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a hidden state explains more than the names do.

The catalogue has no hidden state, and a function of speed, position or phase reproduces it in part.
"""

from dataclasses import replace

from separatrix.discovery.decision.stages.character import best_of_hypothesis, characterised, has_gap, motions
from separatrix.discovery.decision.state import SearchState
from separatrix.discovery.fitting.hypotheses import memories
from separatrix.discovery.fitting.rig import evidence_of_imperfections


def can_be_hidden(state: SearchState) -> bool:
    """Whether there are names that a hidden state may pass for."""
    accepted = state.decision.accepted
    if not accepted or accepted[0].prediction is None or not has_gap(state):
        return False
    return state.round.base.problem.has_memories and not state.context.options.quick


def hidden_state(state: SearchState) -> SearchState:
    """Withdraw the names where a hidden state explains clearly more than they do.

    A right name leaves nothing to explain, so the state must explain more beside the names too, and more than
    imperfections of the rig.
    """
    context, decision = state.context, state.decision
    name = decision.accepted[0]
    training, held_out = motions(context, decision.rounds[0].base, decision.predicted)
    tried = (best_of_hypothesis(training, held_out, one) for one in memories(training))
    best = max(tried, key=lambda one: one.evidence)
    imperfections = evidence_of_imperfections(name.fitted, name.prediction)
    least = context.options.needed * context.options.separation
    ahead = best.evidence - name.own_evidence / max(1.0, name.fitted.fit.reduced_chi2) - imperfections
    if ahead < least:
        return state
    beside = best_of_hypothesis(*motions(context, name.fitted, name.prediction), best.hypothesis)
    if beside.evidence - imperfections < least:
        return state
    gap = replace(
        decision, outcome="not-in-catalogue", accepted=[], alternatives=[], rivals=[], equivalent=False
    )
    found = characterised(context, gap)
    if not found.characters or found.characters[0].hypothesis.depends_on != best.hypothesis.depends_on:
        return state
    names = " and ".join(name.fitted.names)
    reason = f"a hidden state explains more than {names} (log-likelihood {ahead:.3g})"
    return state.decided(replace(found, reasons=[reason]))
