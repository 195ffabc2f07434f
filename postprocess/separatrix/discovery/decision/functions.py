# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The function that the effect of a verdict is, and a named closed form held against it.

What a form leaves may be no more than noise of a sample and yet show beyond doubt that the law has another
form: then it is the family that is named.
"""

from dataclasses import replace

from scipy.stats import chi2

from separatrix.discovery.decision.decide import Decision, conclude
from separatrix.discovery.decision.flexible import best_table
from separatrix.discovery.decision.gates import judge_ceiling, pass_gates, weigh_faults
from separatrix.discovery.decision.judge import clear_of, lead
from separatrix.discovery.decision.rounds import Bench
from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.rig import share_beside_faults
from separatrix.discovery.fitting.shapes import FORM_OF, LIKELY
from separatrix.discovery.fitting.smooth import function_of


def with_function(bench: Bench, decision: Decision) -> Decision:
    """The decision with what the records tell of the function of its last effect.

    A closed form that this refutes yields to the table of its family, or is in doubt: then the one of more
    evidence leads.
    """
    fitted = decision.corrected.fitted if decision.corrected else None
    if fitted is None or isinstance(fitted.problem, CoordinateProblem):
        return decision
    bases = [one.base for one in decision.rounds if one.base.names == fitted.names[:-1]]
    if bases:
        decision.function = function_of(bench.training, bases[-1], fitted)
    return decision if bench.options.partial else _held_against_it(bench, decision)


def _held_against_it(bench: Bench, decision: Decision) -> Decision:
    """The decision with a closed form alone held against its function."""
    best, function = decision.accepted[0] if decision.accepted else None, decision.function
    sure = decision.outcome == "named" or bool(decision.in_families)
    if best is None or function is None or not sure or len(best.fitted.names) != 1:
        return decision
    form = function.forms.get(FORM_OF.get(best.name, ""))
    if form is None or form["fits"]:
        return decision
    found = decision.rounds[0]
    said = f"the function of {function.member.family} has another form than {best.name} (p = {form['p']:.1g})"
    table = next(best_table(bench, found, function.member), None)
    if table is None:
        return replace(decision, outcome="ambiguous", reasons=[*decision.reasons, said])
    if best.faults is not None:
        weigh_faults(bench, table)
    pass_gates(bench, table, found.base, [], found.screened.tests)
    judge_ceiling(bench, table)
    passes = all(table.gates.values())
    if passes and clear_of(table, best, bench.options):
        bare = replace(decision, accepted=[], rivals=[], alternatives=[], reasons=[], function=None)
        return with_function(bench, conclude(bench, bare, table, []))
    # small faults of the rig bend a function, too
    own = share_beside_faults(table.fitted, best.fitted) * function.gain
    if chi2.sf(own, table.parameters) > LIKELY:
        return decision
    first = table if passes and lead(table, best) > 0 else best
    every = {one.name: one for one in (best, *decision.rivals, table)}
    rivals = [one for name, one in every.items() if name != first.name]
    return replace(
        decision,
        outcome="ambiguous",
        accepted=[first],
        rivals=rivals,
        alternatives=[list(one.fitted.names) for one in rivals],
        reasons=[*decision.reasons, said],
        equivalent=False,
    )
