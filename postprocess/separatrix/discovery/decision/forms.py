# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A named closed form held against the function that the records tell of its family.

What a form leaves may be no more than noise of a sample and yet show beyond doubt that the law has another
form: then it is the family that is named.
"""

from dataclasses import replace

from scipy.stats import chi2

from separatrix.discovery.decision.decide import Decision, conclude
from separatrix.discovery.decision.flexible import best_table
from separatrix.discovery.decision.gates import judge_ceiling, pass_gates
from separatrix.discovery.decision.judge import clear_of
from separatrix.discovery.decision.rounds import Bench
from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.curves import fits_machine, named_member
from separatrix.discovery.fitting.rig import share_beside_faults
from separatrix.discovery.fitting.shapes import FORM_OF, LIKELY
from separatrix.discovery.fitting.smooth import function_of


def with_form(bench: Bench, decision: Decision) -> Decision:
    """The decision with a table in place of a closed form that is refuted, or with the form in doubt."""
    best = decision.accepted[0] if decision.accepted else None
    sure = decision.outcome == "named" or bool(decision.in_families)
    if best is None or not sure or len(best.fitted.names) != 1 or best.name not in FORM_OF:
        return decision
    if isinstance(best.fitted.problem, CoordinateProblem):
        return decision
    found, member = decision.rounds[0], named_member(best.fitted)
    if member is None or not fits_machine(member, found.base.model):
        return decision
    decision.function = function_of(bench.training, found.base, best.fitted, member)
    form = None if decision.function is None else decision.function.forms.get(FORM_OF[best.name])
    if form is None or form["fits"]:
        return decision
    said = f"the function of {member.family} has another form than {best.name} (p = {form['p']:.1g})"
    table = next(best_table(bench, found, member), None)
    if table is None:
        return replace(decision, outcome="ambiguous", reasons=[*decision.reasons, said])
    pass_gates(bench, table, found.base, [], found.screened.tests)
    judge_ceiling(bench, table)
    if all(table.gates.values()) and clear_of(table, best, bench.options):
        bare = replace(decision, accepted=[], rivals=[], alternatives=[], reasons=[], function=None)
        return conclude(bench, bare, table, [])
    # small faults of the rig bend a function, too
    own = share_beside_faults(table.fitted, best.fitted) * decision.function.gain
    if chi2.sf(own, table.parameters) > LIKELY:
        return decision
    rivals = [*decision.rivals, *(one for one in [table] if one.name not in _names(decision))]
    return replace(
        decision,
        outcome="ambiguous",
        rivals=rivals,
        alternatives=[list(one.fitted.names) for one in rivals],
        reasons=[*decision.reasons, said],
        equivalent=False,
    )


def _names(decision: Decision) -> list[str]:
    return [one.name for one in decision.rivals]
