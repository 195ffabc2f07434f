# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""An unnamed gap whose dependence is known, added to the case as a tabulated law of the simulator."""

from dataclasses import replace

from separatrix.discovery.decision.flexible import best_table
from separatrix.discovery.decision.remains import closed_share
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.scoring import ScoredCandidate
from separatrix.discovery.decision.stages.character import Character
from separatrix.discovery.decision.state import Decision, SearchState
from separatrix.discovery.fitting.curves import fits_machine
from separatrix.discovery.fitting.members import MEMBERS


def table(state: SearchState) -> SearchState:
    """Add a characterised force to the case as a table, or the reason why the simulator has none.

    The table must close as much of the gap as a characterised force, on fitted and on held-out records.
    """
    return state.decided(with_law(state.context, state.decision))


def with_law(context: SearchContext, decision: Decision) -> Decision:
    """The decision with that table or that reason."""
    if decision.suspected is not None:
        found = _law(context, decision, decision.suspected)
        if not isinstance(found, ScoredCandidate):
            return decision
        return replace(decision, outcome="characterised", characters=[decision.suspected], added=found)
    if not decision.rounds[0].base.problem.has_tables:
        return replace(decision, not_added="nothing is added to the case: tables are laws of one body")
    reasons = []
    for character in decision.characters:
        found = _law(context, decision, character)
        if isinstance(found, ScoredCandidate):
            return replace(decision, added=found, not_added="")
        reasons.append(found)
    return replace(decision, not_added=f"nothing is added to the case: {'; '.join(reasons)}")


def _law(context: SearchContext, decision: Decision, character: Character) -> ScoredCandidate | str:
    """The table that a character is, fitted; or why there is none."""
    base, depends_on = decision.rounds[0].base, character.hypothesis.depends_on
    what = " and ".join(depends_on)
    members = [one for one in MEMBERS if one.depends_on == depends_on]
    if not members:
        return f"the simulator has no law of a force that depends on {what}{_elsewhere(character)}"
    member = next((one for one in members if fits_machine(one, base.model)), None)
    if member is None:
        return f"this machine does not allow effect.{members[0].effect}, a force that depends on {what}"
    best = next(best_table(context, decision.rounds[0], member, strict=False), None)
    if best is None:
        return f"effect.{member.effect} could not be fitted to these records"
    shares = [closed_share(base.fit, best.fitted.fit)]
    if best.prediction is not None:
        shares.append(closed_share(decision.predicted, best.prediction))
    lowest = min((share for share in shares if share is not None), default=0.0)
    if lowest <= context.options.characterised:
        return f"effect.{member.effect}, over {member.variable}, closes only {100 * lowest:.0f} % of the gap"
    return best


def _elsewhere(character: Character) -> str:
    """Where a hidden state is known to be that of a body or a spring of its own, and which."""
    if "way since it turned" in character.hypothesis.depends_on:
        return (
            "; friction with a spring or a play in series has such a memory: elastic_coulomb of a structure "
            "(docs/case-file.md)"
        )
    if character.size is None or "(z - x)" not in character.hypothesis.formula:
        return ""
    stiffness = character.size[0]
    mass = stiffness / character.constant**2
    return (
        f"; a further body of {mass:.3g} kg on a spring of {stiffness:.3g} N/m has such a state: that is a "
        "structure (docs/case-file.md), which can be a base machine itself (docs/discovery-bodies.md)"
    )
