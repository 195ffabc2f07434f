# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The effect of a verdict as a function, and the comparison of a named closed form with it.

The residual of a form may be within the noise of a sample and still prove that the law has another form. Then
the family is named.
"""

from dataclasses import replace

from scipy.stats import chi2

from separatrix.discovery.decision.decide import Decision, conclude
from separatrix.discovery.decision.flexible import best_table
from separatrix.discovery.decision.gates import pass_gates, score_ceiling, weigh_imperfections
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.scoring import clear_of, lead
from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.rig import share_with_imperfections
from separatrix.discovery.fitting.shapes import FORM_OF, LIKELY
from separatrix.discovery.fitting.smooth import function_of


def with_function(context: SearchContext, decision: Decision) -> Decision:
    """The decision with the function of its last effect, as far as the records determine it.

    A closed form that the function refutes is replaced by the table of its family, or is in doubt; then the
    one with more evidence is first.
    """
    fitted = decision.corrected.fitted if decision.corrected else None
    if fitted is None or isinstance(fitted.problem, CoordinateProblem):
        return decision
    bases = [one.base for one in decision.rounds if one.base.names == fitted.names[:-1]]
    if bases:
        decision.function = function_of(context.training, bases[-1], fitted)
    return decision if context.options.partial else _compared_with_function(context, decision)


def _compared_with_function(context: SearchContext, decision: Decision) -> Decision:
    """The decision after the comparison of a single closed form with its function."""
    best, function = decision.accepted[0] if decision.accepted else None, decision.function
    sure = decision.outcome == "named" or bool(decision.in_families)
    if best is None or function is None or not sure or len(best.fitted.names) != 1:
        return decision
    form = function.forms.get(FORM_OF.get(best.name, ""))
    if form is None or form["fits"]:
        return decision
    found = decision.rounds[0]
    reason = (
        f"the function of {function.member.family} has another form than {best.name} (p = {form['p']:.1g})"
    )
    table = next(best_table(context, found, function.member), None)
    if table is None:
        return replace(decision, outcome="ambiguous", reasons=[*decision.reasons, reason])
    if best.imperfections is not None:
        weigh_imperfections(context, table)
    pass_gates(context, table, found.base, [], found.screened.tests)
    score_ceiling(context, table)
    passes = all(table.gates.values())
    if passes and clear_of(table, best, context.options):
        bare = replace(decision, accepted=[], rivals=[], alternatives=[], reasons=[], function=None)
        return with_function(context, conclude(context, bare, table, []))
    # small imperfections of the rig bend a function, too
    own = share_with_imperfections(table.fitted, best.fitted) * function.gain
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
        reasons=[*decision.reasons, reason],
        equivalent=False,
    )
