# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Forward selection: what may be named, what is indistinguishable, what the catalogue lacks."""

from dataclasses import dataclass, field, replace

import numpy as np

from separatrix.discovery.decision.flexible import flexible_member
from separatrix.discovery.decision.gates import (
    best_of,
    choice,
    pass_gates,
    score_ceiling,
    weigh_imperfections,
)
from separatrix.discovery.decision.misfit import MOST_IN_LOCAL_MINIMUM, missed, misses, predicted_chi2
from separatrix.discovery.decision.other_machine import other_units
from separatrix.discovery.decision.remains import closed_share
from separatrix.discovery.decision.rounds import Round, SearchContext, run_round
from separatrix.discovery.decision.scoring import NOISE, ScoredCandidate, admissible, equivalent, sizeable
from separatrix.discovery.decision.several import with_more
from separatrix.discovery.fitting.base import copy_noise, limit_noise, renew_noise
from separatrix.discovery.fitting.ceiling import Ceiling, ceiling
from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.fit import Fit, minimise, without_segments
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.joint_effects import effect_of
from separatrix.discovery.fitting.refit import Fitted, shared_values
from separatrix.discovery.fitting.rescue import suspicious
from separatrix.discovery.fitting.rig import cleaned_prediction
from separatrix.discovery.fitting.smooth import Function
from separatrix.discovery.options import Options

# refits of the base, number of leading candidates whose minima they start from, least fall of chi^2
_RENEWALS = 3
_LEADERS = 3
_LOWER = 1.0
_LOWER_SHARE = 0.01
# share of a gap of held-out records that another effect must close
_CLOSES = 0.5


@dataclass
class Decision:
    """The outcome and all that led to it."""

    outcome: str
    accepted: list[ScoredCandidate]
    alternatives: list[list[str]]
    # fits that are indistinguishable from the accepted one
    rivals: list[ScoredCandidate]
    rounds: list[Round]
    base_ceiling: Ceiling
    predicted: Prediction | None
    reasons: list[str] = field(default_factory=list)
    equivalent: bool = False
    # whether nothing is left to name
    complete: bool = True
    # of a gap without a name: on what the missing force depends, likeliest first
    characters: list = field(default_factory=list)
    # that force as a table of the simulator, which is no name; else why there is none
    added: ScoredCandidate | None = None
    # hypothesis that is reported only if it closes the gap as a table
    suspected: object | None = None
    not_added: str = ""
    # the last effect as a function, as far as the records determine it
    function: Function | None = None

    @property
    def in_families(self) -> list[str]:
        """Families that the best and all its rivals agree on, where nothing else is in doubt; else none.

        Forms of one family that fit alike are the same function within the information of the records.
        """
        best = self.accepted[0] if self.accepted else None
        if (
            best is None
            or not self.rivals
            or any(not ok for gate, ok in best.gates.items() if gate != "separate")
        ):
            return []
        found = [sorted(effect_of(name).family for name in one.fitted.names) for one in (best, *self.rivals)]
        return found[0] if self.outcome == "ambiguous" and all(one == found[0] for one in found) else []

    @property
    def corrected(self) -> ScoredCandidate | None:
        """The machine that goes on: with the effects of the verdict, or with a table that has no name."""
        return self.accepted[0] if self.accepted else self.added


def decide(context: SearchContext, base: Fitted, settled: bool = False) -> Decision:
    """Add effects until what is left is noise or nothing in the catalogue helps.

    With `settled` noise it is not measured again.
    """
    predicted = context.predict(base)
    first = _renewing(context, run_round(context, base, predicted, 0.2, 0.6), 0.6, settled)
    decision = _begun(context, first)
    if not first.scored:
        return _without_name(context, decision)
    best, rivals = _lead(context, first)
    found = first
    if not _detected(best):
        decision = _shape_alone(context, _without_name(context, decision), first)
        if best.gates["detect"] and not decision.accepted:
            decision.reasons.append(
                f"{best.name} gains more than chance does (p = {best.p:.1g}), but few segments carry that, "
                "which may be in a wrong minimum: longer records would decide"
            )
        return decision
    shaped = None if best.gates["adequate"] else _shaped(context, first)
    if shaped is None and not (best.gates["adequate"] or context.options.quick):
        # the linear screen may have passed over the effect that closes the gap
        whole = run_round(context, first.base, first.predicted, 0.75, 0.8, first, everything=True)
        whole = _renewing(context, whole, 0.8, settled, everything=True)
        better, others = _lead(context, whole)
        decision = _begun(context, whole)
        if _detected(better):
            best, rivals, found = better, others, whole
        elif whole.base is not first.base:
            # the base itself explains what the effect did
            return _without_name(context, decision)
    if best.gates["adequate"]:
        return conclude(context, decision, *_with_more_predicted(context, decision, best, rivals))
    if shaped is None and found is not first:
        shaped = _shaped(context, found, first)
    if shaped is not None and not (_of_several(context, shaped[0]) and context.options.most_effects > 1):
        return conclude(context, decision, *shaped)
    if context.options.most_effects < 2:
        return _give_up(context, decision, best)
    rounds = list(decision.rounds)
    before = list(rounds[0].scored)
    *more, closed = with_more(context, rounds, best)
    alone = None if closed else _alone_after_warm_start(context, rounds[0], before)
    if shaped is not None:
        # the set that it is compared with has them
        weigh_imperfections(context, shaped[0])
    if alone is not None and (shaped is None or alone[0].evidence > shaped[0].evidence):
        return conclude(context, decision, *alone)
    if shaped is not None:
        # two laws, of the speed and of the direction, may replace a table for each direction
        closed = closed and more[0].evidence > shaped[0].evidence
        if not closed and not _only_follows(context, shaped[0]):
            return conclude(context, decision, *shaped)
    decision.rounds = rounds
    if closed:
        return conclude(context, decision, *more)
    if not settled and more[0].fitted.fit.like_noise(2) and _noise_renewed(context, more[0]):
        # the memory of the noise is seen only where several effects together leave nothing else
        base = decision.rounds[0].base
        fit = minimise(base.problem, base.fit.values, base.fit.starts, patient=True)
        return decide(context, replace(base, fit=fit), settled=True)
    return _give_up(context, decision, best)


def _alone_after_warm_start(
    context: SearchContext, found: Round, before: list[ScoredCandidate]
) -> tuple[ScoredCandidate, list[ScoredCandidate]] | None:
    """A single effect that closes the gap after a warm start from several, and its rivals."""
    if all(any(one is other for other in before) for one in found.scored):
        return None
    best, rivals = _lead(context, found)
    return (best, rivals) if _detected(best) and best.gates["adequate"] else None


def _with_more_predicted(
    context: SearchContext, decision: Decision, best: ScoredCandidate, rivals: list[ScoredCandidate]
) -> tuple[ScoredCandidate, list[ScoredCandidate]]:
    """Add another effect to one that leaves noise where it was fitted but misses a held-out record.

    One effect may reproduce two at the drives that were fitted, but not at another drive.
    """
    prediction = best.prediction
    options = context.options
    if prediction is None or options.quick or options.most_effects < 2 or best.leaves != NOISE:
        return best, rivals
    if not _only_follows(context, best):
        return best, rivals
    rounds = list(decision.rounds)
    whole, others, closed = with_more(context, rounds, best)
    sure = closed and all(whole.gates.values())
    share = closed_share(prediction, whole.prediction)
    if not sure or share is None or share < _CLOSES:
        return best, rivals
    decision.rounds = rounds
    return whole, others


def _shape_alone(context: SearchContext, decision: Decision, found: Round) -> Decision:
    """A family as a function where neither its closed forms nor another effect are significant."""
    shaped = _shaped(context, found) if decision.outcome == "not-in-catalogue" else None
    if shaped is None or _only_follows(context, shaped[0]):
        return decision
    decision.reasons.clear()
    return conclude(context, decision, *shaped)


def _shaped(
    context: SearchContext, found: Round, earlier: Round | None = None
) -> tuple[ScoredCandidate, list[ScoredCandidate]] | None:
    """A family whose closed forms have the wrong shape and that closes the gap as a function.

    A function must improve the prediction of held-out records; else it only follows the fitted ones.
    """
    base = ceiling(found.base.problem, found.base.fit, context.scales.mass)
    member = flexible_member(context, found, base, earlier)
    if member is None:
        return None
    one, rivals = member
    pass_gates(context, one, found.base, rivals, found.screened.tests)
    if not _detected(one):
        return None
    score_ceiling(context, one)
    needed = [
        one.gates[gate] for gate in ("adequate", "admissible", "converged", "hold-out") if gate in one.gates
    ]
    return member if all(needed) else None


def _of_several(context: SearchContext, one: ScoredCandidate) -> bool:
    """Whether a function may be the sum of several effects.

    Two closed forms may replace a table of friction for each direction with fewer parameters. A function that
    follows the fitted but not the held-out records may have absorbed another effect.
    """
    if context.options.quick or one.prediction is None:
        return _of_two_directions(one)
    return _of_two_directions(one) or misses(one.prediction, one.fitted.fit, context.options)


def _only_follows(context: SearchContext, one: ScoredCandidate) -> bool:
    """Whether a machine follows fitted records, as a function has the freedom to, and misses held-out ones.

    What imperfections of a rig may explain of those is taken off.
    """
    prediction = one.prediction
    if prediction is None or not misses(prediction, one.fitted.fit, context.options):
        return False
    prediction = replace(prediction, fit=cleaned_prediction(one.fitted, prediction))
    return misses(prediction, one.fitted.fit, context.options)


def _of_two_directions(one: ScoredCandidate) -> bool:
    """Whether a fit has a table of friction for each direction of its own."""
    free = one.fitted.problem.free
    return one.name == "friction_curve" and not any(free[i].also for i in one.fitted.added)


def _begun(context: SearchContext, first: Round) -> Decision:
    """No name yet."""
    base = first.base
    gap = ceiling(base.problem, base.fit, context.scales.mass)
    return Decision("none", [], [], [], [first], gap, first.predicted)


def _renewing(
    context: SearchContext, found: Round, at: float, settled: bool, everything: bool = False
) -> Round:
    """Repeat the round as long as it shows that its base can be fitted better."""
    for _ in range(_RENEWALS):
        lower = renewed(context, found, settled)
        if lower is None:
            break
        predicted = context.predict(lower, found.predicted)
        found = run_round(context, lower, predicted, at, at + 0.1, found, everything)
    return found


def _lead(context: SearchContext, found: Round) -> tuple[ScoredCandidate, list[ScoredCandidate]]:
    """The best candidate of a round with its gates, and its rivals."""
    best, rivals = leaders(context, found)
    pass_gates(context, best, found.base, rivals, found.screened.tests)
    if _detected(best):
        score_ceiling(context, best)
    return best, rivals


def _detected(one: ScoredCandidate) -> bool:
    """Whether a gain is more than chance and what a few segments carry."""
    return one.gates["detect"] and one.gates["stable"]


def _noise_renewed(context: SearchContext, best: ScoredCandidate) -> bool:
    """Measure the noise of all records by a better machine; whether it changed."""
    changed = renew_noise(context.training, best.fitted.problem, best.fitted.fit, context.scales.mass)
    if context.held_out is not None and best.prediction is not None:
        if changed:
            held = best.prediction
            renew_noise(context.held_out, held.problem, held.fit, context.scales.mass)
            copy_noise(context.training, context.held_out)
        changed |= limit_noise(context.training, context.held_out)
    return changed


def renewed(context: SearchContext, first: Round, settled: bool = False) -> Fitted | None:
    """Refit the base where candidates show another noise or a lower minimum of the base.

    A candidate may have left a local minimum of the base; the fall of chi^2 that the base reaches from
    there is not a gain of the candidate.
    """
    base = first.base
    lowest_misfit = sorted(first.scored, key=lambda one: -one.training)[:_LEADERS]
    if not lowest_misfit:
        return None
    best = next((one for one in first.scored if one.settled), None)
    changed = best is not None and not settled and _noise_renewed(context, best)
    fits = [minimise(base.problem, base.fit.values, base.fit.starts, patient=True)]
    for one in lowest_misfit:
        values = shared_values(base, one.fitted)
        fits.append(minimise(base.problem, values, one.fitted.fit.starts))
    fits = [fit for fit in fits if fit.good.sum() >= fits[0].good.sum()]
    lowest = min(fits, key=lambda fit: fit.total)
    gain = (best or lowest_misfit[0]).training
    if not changed and lowest.total > base.fit.total - max(_LOWER, _LOWER_SHARE * 2 * gain):
        return None
    return Fitted(base.names, base.model, base.problem, lowest, base.added)


def leaders(context: SearchContext, found: Round) -> tuple[ScoredCandidate, list[ScoredCandidate]]:
    """The best candidate that converged, and those that it does not beat clearly."""
    able = [one for one in found.scored if admissible(one, found.base, context.options)[0]]
    chosen = choice(context, found.base, found.predicted, able or found.scored, best_of)
    found.rank()
    return chosen


def conclude(
    context: SearchContext, decision: Decision, best: ScoredCandidate, rivals: list[ScoredCandidate]
) -> Decision:
    """A name, if every gate is passed; else what it could be."""
    failed = [gate for gate, passed in best.gates.items() if not passed]
    decision.reasons += [f"gate '{gate}' was not passed" for gate in failed]
    if "predicted" in failed:
        size = predicted_chi2(best.prediction, best.fitted.fit)
        decision.reasons.append(
            f"held-out records are missed by more than the noise and what errors of the parameters would "
            f"explain: the reduced chi^2 left there is {size:.4g}"
        )
    # evidence of the fitted records alone may only be the distance of the base from its minimum
    proven = best.gates.get("hold-out", False) or decision.rounds[0].base.fit.converged
    if not (best.gates["admissible"] and best.gates["converged"] and proven):
        return _without_name(context, decision)
    decision.accepted = [best]
    decision.rivals = rivals
    decision.alternatives = [list(one.fitted.names) for one in rivals]
    odd = other_units(context.training, decision.rounds[0].base.model)
    decision.reasons += odd
    decision.outcome = "ambiguous" if failed or odd else "named"
    decision.equivalent = bool(rivals) and all(equivalent(best, one) for one in rivals)
    return decision


def _without_name(context: SearchContext, decision: Decision) -> Decision:
    """Nothing in the catalogue helps: either there is no gap, or the catalogue lacks what makes it."""
    left, wide = _gap_of_base(context, decision)
    if left:
        decision.outcome = "not-in-catalogue"
        decision.reasons.append(f"the base machine misses {', '.join(left)}, and no effect helps")
    elif decision.rounds[0].base.fit.sample_chi2 > context.options.adequate_chi2:
        decision.reasons.append(_no_gap(context, decision))
    if wide:
        decision.outcome = "not-in-catalogue"
        # with several bodies, forces at several locations explain a large gap
        several = isinstance(decision.rounds[0].base.problem, CoordinateProblem)
        name = "" if several else decision.base_ceiling.mostly
        what = f"forces that depend on {name}" if name else "free forces"
        decision.reasons.append(f"{what} would explain more, no effect does")
    return decision


def _no_gap(context: SearchContext, decision: Decision) -> str:
    """Why what the base machine leaves is more than noise and yet no gap, in words."""
    before, beside = decision.rounds[0].base.fit.sample_chi2, decision.base_ceiling.fit.sample_chi2
    if beside > context.options.adequate_chi2:
        return "a reduced chi^2 as large as that may be chance with so few samples"
    return (
        f"what the base machine leaves (reduced chi^2 {before:.3g}) may be small imperfections of the rig, "
        f"of some 1e-3 of the signal: beside them it is {beside:.3g}"
    )


def _give_up(context: SearchContext, decision: Decision, best: ScoredCandidate) -> Decision:
    """Effects are significant, but none explains all that is missing."""
    base = decision.rounds[0].base
    # over a base that is not at its minimum a gain may be its own
    clear = base.fit.converged and sizeable(2 * best.training, base.fit, context.options)
    if clear or any(_gap_of_base(context, decision)):
        decision.outcome = "not-in-catalogue"
        decision.reasons.append(
            "the best effects of the catalogue leave a gap that a flexible force would close"
        )
        return decision
    gap = decision.base_ceiling
    share = np.sqrt(max(gap.closable, 2 * best.training) / base.fit.samples)
    decision.reasons.append(
        "an effect stands out of chance, but is not all, and what is missing is small beside the noise: it "
        f"or a flexible force explains {share:.2g} of that of a sample (root mean square), p = {gap.p:.2g}"
    )
    return decision


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
    if 0 < in_local_minimum.size <= MOST_IN_LOCAL_MINIMUM:
        others = without_segments(base.fit, in_local_minimum)
        wide = _wide(ceiling(base.problem, others, context.scales.mass), others, context.options)
    return left, wide


def _wide(gap: Ceiling, fit: Fit, options: Options) -> bool:
    """Whether a flexible force explains more than chance, and a sizeable part."""
    significant = gap.p < options.gap_share * options.detection_level
    return significant and sizeable(gap.closable, fit, options)
