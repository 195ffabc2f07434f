# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The effect of a verdict as a function, and the comparison of a named closed form with it.

The residual of a form may be within the noise of a sample and still prove that the law has another form. Then
the family is named.
"""

from dataclasses import replace

from scipy.stats import chi2

from separatrix.discovery.decision.flexible import best_table
from separatrix.discovery.decision.gates import pass_gates, score_ceiling, weigh_imperfections
from separatrix.discovery.decision.scoring import clear_of, lead
from separatrix.discovery.decision.stages.conclusions import conclude
from separatrix.discovery.decision.state import SearchState
from separatrix.discovery.fitting.rig import share_with_imperfections
from separatrix.discovery.fitting.shapes import FORM_OF, UNNAMED_FORMS
from separatrix.discovery.fitting.smooth import function_of
from separatrix.discovery.policy import FIT


def has_function(state: SearchState) -> bool:
    """Whether the machine that goes on is of one body and has an effect."""
    corrected = state.decision.corrected
    return corrected is not None and corrected.fitted.problem.has_tables


def function_of_name(state: SearchState) -> SearchState:
    """Add the function of the last effect, as far as the records determine it."""
    decision, fitted = state.decision, state.decision.corrected.fitted
    bases = [one.base for one in decision.rounds if one.base.names == fitted.names[:-1]]
    if not bases:
        return state
    return state.decided(replace(decision, function=function_of(state.context.training, bases[-1], fitted)))


def form_refuted(state: SearchState) -> bool:
    """Whether a single closed form was named that the function of its family refutes."""
    decision, function = state.decision, state.decision.function
    best = decision.accepted[0] if decision.accepted else None
    sure = decision.outcome == "named" or bool(decision.in_families)
    if best is None or function is None or not sure or len(best.fitted.names) != 1:
        return False
    form = function.forms.get(FORM_OF.get(best.name, ""))
    return form is not None and not form["fits"]


def table_or_form(state: SearchState) -> SearchState:
    """Replace a closed form that its function refutes by the table of its family, or put it in doubt.

    In doubt, the one with more evidence is first.
    """
    context, decision = state.context, state.decision
    best, function = decision.accepted[0], decision.function
    form, found = function.forms[FORM_OF[best.name]], decision.rounds[0]
    reason = (
        f"the function of {function.member.family} has another form than {best.name} (p = {form['p']:.1g})"
    )
    table = next(best_table(context, found, function.member), None)
    if table is None:
        return state.decided(replace(decision, outcome="ambiguous").because(reason))
    if best.imperfections is not None:
        weigh_imperfections(context, table)
    pass_gates(context, table, found.base, [], found.screened.tests)
    score_ceiling(context, table)
    passes = all(table.gates.values())
    if passes and clear_of(table, best, context.options):
        bare = replace(decision, accepted=[], rivals=[], alternatives=[], reasons=(), function=None)
        found = state.decided(conclude(context, bare, table, []))
        return function_of_name(found) if has_function(found) else found
    # small imperfections of the rig bend a function, too
    own = share_with_imperfections(table.fitted, best.fitted) * function.gain
    if chi2.sf(own, table.parameters) > FIT.form_p:
        return state
    first = table if passes and lead(table, best) > 0 else best
    every = {one.name: one for one in (best, *decision.rivals, table)}
    rivals = [one for name, one in every.items() if name != first.name]
    doubtful = replace(
        decision.because(reason),
        outcome="ambiguous",
        accepted=[first],
        rivals=rivals,
        alternatives=[list(one.fitted.names) for one in rivals],
        equivalent=False,
    )
    return state.decided(doubtful)


def forms_alike(state: SearchState) -> list[str]:
    """Closed forms without a name that follow the function of a single named one as well as its own does.

    They are behind it by less than the log-likelihood by which a name must lead.
    """
    decision, function = state.decision, state.decision.function
    best = decision.accepted[0] if decision.accepted else None
    if best is None or function is None or decision.outcome != "named" or len(best.fitted.names) != 1:
        return []
    own = function.forms.get(FORM_OF.get(best.name, ""))
    if own is None or not own["fits"]:
        return []
    within = 2 * state.context.options.separation
    others = {
        name: function.forms[name] for name in UNNAMED_FORMS.get(best.name, ()) if name in function.forms
    }
    return [name for name, one in others.items() if one["fits"] and one["misfit"] < own["misfit"] + within]


def form_in_doubt(state: SearchState) -> SearchState:
    """State the other forms beside the name."""
    best, others = state.decision.accepted[0], " or ".join(forms_alike(state))
    reason = (
        f"the records do not distinguish the {FORM_OF[best.name]} {state.decision.function.member.family} of "
        f"{best.name} from the {others} form: the family is known, the form is not"
    )
    return state.decided(state.decision.because(reason))
