# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The best that is known when the time limit ends a search."""

from dataclasses import replace

from separatrix.discovery.decision.state import Choice, Decision, SearchState
from separatrix.errors import STOPPED, SeparatrixError


def cut_short(state: SearchState, stage: str) -> SearchState:
    """End before a stage: a name that was not tested to the end is in doubt.

    Where nothing may be named yet, there is no verdict.
    """
    limit = state.context.options.time_limit
    reason = f"the search ended at its time limit of {limit:g} s, before '{stage}'"
    decision = state.decision
    if decision is not None:
        outcome = "ambiguous" if decision.outcome == "named" else decision.outcome
        return _ended(state, replace(decision, outcome=outcome).because(reason), stage)
    choices = [one for one in (state.several, state.after_several, state.function, state.one) if one]
    able = [one for one in choices if one.detected and _may_be_named(one)]
    if not able:
        raise SeparatrixError(f"{reason}: no verdict, as no machine passes the gates yet", STOPPED)
    best, rivals = max(able, key=lambda one: one.best.evidence)
    failed = [f"gate '{gate}' was not passed" for gate, passed in best.gates.items() if not passed]
    found = replace(
        state.undecided,
        outcome="ambiguous",
        accepted=[best],
        rivals=rivals,
        alternatives=[list(one.fitted.names) for one in rivals],
        complete=best.gates.get("adequate", False),
    )
    return _ended(state, found.because(reason, *failed), stage)


def _may_be_named(one: Choice) -> bool:
    return one.best.gates["admissible"] and one.best.gates["converged"]


def _ended(state: SearchState, decision: Decision, stage: str) -> SearchState:
    return replace(state, decision=decision, stopped=stage)
