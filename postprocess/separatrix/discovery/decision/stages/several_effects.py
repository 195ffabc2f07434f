# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Several effects together, where one leaves a gap or misses a held-out record."""

from dataclasses import replace

from separatrix.discovery.decision.gates import weigh_imperfections
from separatrix.discovery.decision.remains import closed_share
from separatrix.discovery.decision.several import with_more
from separatrix.discovery.decision.stages.function import only_follows
from separatrix.discovery.decision.stages.one_effect import lead, noise_renewed
from separatrix.discovery.decision.state import Choice, SearchState
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.policy import SEARCH


def another_effect(state: SearchState) -> SearchState:
    """Add another effect to one that leaves noise where it was fitted but misses a held-out record.

    One effect may reproduce two at the drives that were fitted, but not at another drive.
    """
    best = state.one.best
    if not only_follows(state.context, best):
        return state
    rounds = [state.round]
    whole, others, closed = with_more(state.context, rounds, best)
    share = closed_share(best.prediction, whole.prediction) if closed and all(whole.gates.values()) else None
    if share is None or share < SEARCH.closes_held_out:
        return state
    return replace(state, one=Choice(whole, others), rounds_of_several=tuple(rounds[1:]))


def several_effects(state: SearchState) -> SearchState:
    """Add effects to the best one as long as each is needed and closes most of the remainder.

    A single effect that is warm-started from them may close the gap after all.
    """
    context = state.context
    rounds, before = [state.round], list(state.round.scored)
    *more, closed = with_more(context, rounds, state.one.best)
    alone = None if closed or _same(before, state.round.scored) else lead(context, state.round)
    if alone is not None and not (alone.detected and alone.adequate):
        alone = None
    if state.function is not None:
        # the set that it is compared with has them
        weigh_imperfections(context, state.function.best)
    return replace(
        state, several=Choice(*more), closed=closed, rounds_of_several=tuple(rounds[1:]), after_several=alone
    )


def noise_again(state: SearchState) -> SearchState:
    """Measure the noise again: its memory is seen only where several effects together leave nothing else."""
    if not noise_renewed(state.context, state.several.best):
        return state
    base = state.round.base
    fit = minimise(base.problem, base.fit.values, base.fit.starts, patient=True)
    return state.again(base=replace(base, fit=fit), noise_measured=True)


def _same(before: list, after: list) -> bool:
    """Whether the candidates of a round are those of before."""
    return all(any(one is other for other in before) for one in after)
