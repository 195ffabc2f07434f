# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a search ends: with a name, without one, or with a gap that nothing closes."""

from dataclasses import replace

import numpy as np

from separatrix.discovery.decision.misfit import missed, predicted_chi2
from separatrix.discovery.decision.other_machine import other_units
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.scoring import ScoredCandidate, equivalent, sizeable
from separatrix.discovery.decision.state import Choice, Decision, SearchState
from separatrix.discovery.fitting.ceiling import Ceiling, ceiling
from separatrix.discovery.fitting.fit import Fit, without_segments
from separatrix.discovery.fitting.rescue import suspicious
from separatrix.discovery.fitting.rig import cleaned_prediction
from separatrix.discovery.options import Options
from separatrix.discovery.policy import SEARCH


def no_effect(state: SearchState) -> SearchState:
    """Decide that no effect of the catalogue helps."""
    return state.decided(without_name(state.context, state.undecided))


def not_all(state: SearchState) -> SearchState:
    """Decide that effects help and none closes the gap."""
    return state.decided(give_up(state.context, state.undecided, state.one.best))


def named(state: SearchState, choice: Choice) -> SearchState:
    """Decide for a machine, if it passes every gate."""
    return state.decided(conclude(state.context, state.undecided, *choice))


def few_segments(state: SearchState) -> SearchState:
    """Report an effect whose gain few segments carry."""
    best = state.one.best
    return state.decided(
        state.decision.because(
            f"{best.name} gains more than chance does (p = {best.p:.1g}), but few segments carry that, "
            "which may be in a wrong minimum: longer records would decide"
        )
    )


def conclude(
    context: SearchContext, decision: Decision, best: ScoredCandidate, rivals: list[ScoredCandidate]
) -> Decision:
    """A name, if every gate is passed; else what it could be."""
    failed = [gate for gate, passed in best.gates.items() if not passed]
    decision = decision.because(*(f"gate '{gate}' was not passed" for gate in failed))
    if "predicted" in failed:
        size = predicted_chi2(best.prediction, best.fitted.fit)
        decision = decision.because(
            f"held-out records are missed by more than the noise and what errors of the parameters would "
            f"explain: the reduced chi^2 left there is {size:.4g}"
        )
    # evidence of the fitted records alone may only be the distance of the base from its minimum
    proven = best.gates.get("hold-out", False) or decision.rounds[0].base.fit.converged
    if not (best.gates["admissible"] and best.gates["converged"] and proven):
        return without_name(context, decision)
    odd = other_units(context.training, decision.rounds[0].base.model)
    return replace(
        decision.because(*odd),
        outcome="ambiguous" if failed or odd else "named",
        accepted=[best],
        rivals=rivals,
        alternatives=[list(one.fitted.names) for one in rivals],
        equivalent=bool(rivals) and all(equivalent(best, one) for one in rivals),
    )


def without_name(context: SearchContext, decision: Decision) -> Decision:
    """Nothing in the catalogue helps: either there is no gap, or the catalogue lacks what makes it."""
    left, wide = _gap_of_base(context, decision)
    if left:
        decision = decision.because(f"the base machine misses {', '.join(left)}, and no effect helps")
    elif decision.rounds[0].base.fit.sample_chi2 > context.options.adequate_chi2:
        decision = decision.because(_no_gap(context, decision))
    if wide:
        # with several bodies, forces at several locations explain a large gap
        name = "" if decision.rounds[0].base.problem.locates else decision.base_ceiling.mostly
        what = f"forces that depend on {name}" if name else "free forces"
        decision = decision.because(f"{what} would explain more, no effect does")
    return replace(decision, outcome="not-in-catalogue") if left or wide else decision


def _no_gap(context: SearchContext, decision: Decision) -> str:
    """Why what the base machine leaves is more than noise and yet no gap, in words."""
    before, beside = decision.rounds[0].base.fit.sample_chi2, decision.base_ceiling.fit.sample_chi2
    if beside > context.options.adequate_chi2:
        return "a reduced chi^2 as large as that may be chance with so few samples"
    return (
        f"what the base machine leaves (reduced chi^2 {before:.3g}) may be small imperfections of the rig, "
        f"of some 1e-3 of the signal: beside them it is {beside:.3g}"
    )


def give_up(context: SearchContext, decision: Decision, best: ScoredCandidate) -> Decision:
    """Effects are significant, but none explains all that is missing."""
    base = decision.rounds[0].base
    # over a base that is not at its minimum a gain may be its own
    clear = base.fit.converged and sizeable(2 * best.training, base.fit, context.options)
    if clear or any(_gap_of_base(context, decision)):
        return replace(decision, outcome="not-in-catalogue").because(
            "the best effects of the catalogue leave a gap that a flexible force would close"
        )
    gap = decision.base_ceiling
    share = np.sqrt(max(gap.closable, 2 * best.training) / base.fit.samples)
    return decision.because(
        "an effect stands out of chance, but is not all, and what is missing is small beside the noise: it "
        f"or a flexible force explains {share:.2g} of that of a sample (root mean square), p = {gap.p:.2g}"
    )


def _gap_of_base(context: SearchContext, decision: Decision) -> tuple[list[str], bool]:
    """The records that the base machine misses, and whether a flexible force explains a sizeable part.

    Small imperfections of a rig count as noise. A gap of few segments that are followed far worse than the
    others may be a wrong minimum of these.
    """
    base = decision.rounds[0].base
    fits = [(context.training, decision.base_ceiling.fit)]
    if context.held_out is not None and decision.predicted is not None:
        fits.append((context.held_out, cleaned_prediction(base, decision.predicted)))
    left = [one for data, fit in fits for one in missed(data, fit, context.options)]
    wide = _wide(decision.base_ceiling, base.fit, context.options)
    in_local_minimum = suspicious(base.fit) if wide else np.zeros(0, int)
    if 0 < in_local_minimum.size <= SEARCH.most_in_local_minimum:
        others = without_segments(base.fit, in_local_minimum)
        wide = _wide(ceiling(base.problem, others, context.scales.mass), others, context.options)
    return left, wide


def _wide(gap: Ceiling, fit: Fit, options: Options) -> bool:
    """Whether a flexible force explains more than chance, and a sizeable part."""
    significant = gap.p < options.gap_share * options.detection_level
    return significant and sizeable(gap.closable, fit, options)
