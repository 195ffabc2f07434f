# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice among candidates and the gates that the chosen one has to pass."""

from collections.abc import Callable

from separatrix.discovery.decision.misfit import refuted
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.scoring import (
    LITTLE,
    ScoredCandidate,
    adequate,
    admissible,
    beyond_doubt,
    clear_of,
    detection,
    held_out_bounds,
    predicts,
    scored,
    sizeable,
    stable,
)
from separatrix.discovery.fitting.ceiling import ceiling
from separatrix.discovery.fitting.heldout import Prediction, gained_together
from separatrix.discovery.fitting.refit import Fitted
from separatrix.discovery.fitting.rig import (
    share_with_imperfections,
    shares_with_imperfections,
    weight_of_imperfections,
)
from separatrix.discovery.options import Options

# share of the evidence of the best from which on imperfections of a rig are weighed beside a candidate, and
# beside how many
_SHARE = 0.2
_WEIGHED = 8
# relative error of what imperfections of a rig explain, from their linearisation
_UNSURE = 0.1


def choice(
    context: SearchContext,
    base: Fitted,
    predicted: Prediction | None,
    pool: list[ScoredCandidate],
    choose: Callable,
) -> tuple[ScoredCandidate, list[ScoredCandidate]]:
    """What `choose` takes from a pool, and its rivals.

    A chosen candidate without a prediction predicts now. If the best leaves more than noise or has rivals,
    the leading candidates are weighed with imperfections of a rig, and the choice is repeated.
    """
    pool = list(pool)
    while True:
        best, rivals = choose(pool, context.options)
        if best.prediction is None and predicted is not None:
            index = next(i for i, one in enumerate(pool) if one is best)
            pool[index] = scored(base, predicted, best.fitted, context.predict(best.fitted, predicted))
            continue
        leading = _leading(pool, best, predicted is not None)
        weighed = [one.imperfections is not None for one in leading]
        matters = any(weighed) or rivals or not best.fitted.fit.like_noise(2)
        if all(weighed) or not matters:
            return best, rivals
        for one in leading:
            weigh_imperfections(context, one)


def weigh_imperfections(context: SearchContext, one: ScoredCandidate) -> None:
    """Fit imperfections of the rig beside a candidate, unless that was done.

    Held-out records are predicted by the parameters as fitted beside the imperfections, if these parameters
    alone predict better too.
    """
    if one.imperfections is not None:
        return
    one.imperfections = weight_of_imperfections(one.fitted, one.prediction)
    if one.prediction is None or one.imperfections[0] <= 0:
        return
    prediction = context.predict_with_imperfections(one.fitted, one.prediction)
    parts = gained_together(prediction, one.predicted)
    if parts.sum() > one.held_out:
        one.prediction, one.held_out_parts, one.held_out = prediction, parts, float(parts.sum())
        one.imperfections = weight_of_imperfections(one.fitted, prediction)


def _leading(pool: list[ScoredCandidate], best: ScoredCandidate, predicted: bool) -> list[ScoredCandidate]:
    """Those that imperfections of a rig may have put behind the best, and itself."""
    able = [one for one in pool if one.prediction is not None or not predicted]
    near = [one for one in able if one.evidence > _SHARE * best.evidence]
    return [best, *sorted(near, key=lambda one: -one.evidence)[:_WEIGHED]]


def best_of(pool: list[ScoredCandidate], options: Options) -> tuple[ScoredCandidate, list[ScoredCandidate]]:
    """Return the settled candidate of most evidence, and all that it does not beat clearly for its misfit.

    A fit that has not converged may not be named, but its gain so far counts against a name.
    """
    order = sorted(pool, key=lambda one: -one.evidence)
    best = next((one for one in order if one.settled), order[0])
    return best, [one for one in order if one is not best and not clear_of(best, one, options)]


def pass_gates(
    context: SearchContext, best: ScoredCandidate, base: Fitted, rivals: list[ScoredCandidate], tested: float
) -> None:
    """Set the p value of a candidate and every gate but the adequacy."""
    options = context.options
    if best.prediction is None or best.predicted is None:
        best.own = share_with_imperfections(best.fitted, base)
    else:
        predictions = (best.prediction, best.predicted)
        best.own, best.own_predicted = shares_with_imperfections((best.fitted, base), predictions)
    best.p = detection(best, tested, max(1.0, best.fitted.fit.reduced_chi2))
    best.gates["converged"] = best.settled
    best.gates["detect"] = (
        best.p < options.detection_level and _of_some_size(best, options) and not _within_imperfections(best)
    )
    if best.prediction is not None:
        bounds = held_out_bounds(best, options).values()
        helps = any(low > 0 for low, _ in bounds) or predicts(best, options)
        helps |= beyond_doubt(best, base, options)
        best.gates["hold-out"] = bool(helps and all(high > options.harm for _, high in bounds))
    best.gates["separate"] = not rivals
    best.gates["admissible"] = admissible(best, base, options)[0]
    best.gates["stable"] = stable(best, base, options) >= options.inclusion


def _within_imperfections(best: ScoredCandidate) -> bool:
    """Whether imperfections of a rig explain a gain within the error of their linearisation."""
    gained = best.training + best.held_out
    own = best.own * best.training + best.own_predicted * best.held_out
    return own < _UNSURE * (gained - own)


def _of_some_size(best: ScoredCandidate, options: Options) -> bool:
    """Whether an effect explains more than imperfections of a rig, where it was fitted or predicted."""
    seen = sizeable(2 * best.own * best.training, best.fitted.fit, options, options.least_effect)
    if best.prediction is None:
        return seen
    predicted = 2 * best.own_predicted * best.held_out
    return seen or sizeable(predicted, best.prediction.fit, options, options.least_effect)


def score_ceiling(context: SearchContext, one: ScoredCandidate) -> None:
    """Set the gate of the adequacy: what a flexible machine would still explain."""
    one.ceiling = ceiling(one.fitted.problem, one.fitted.fit, context.scales.mass)
    one.leaves = adequate(one, context.options)
    one.gates["adequate"] = bool(one.leaves)
    if one.prediction is not None:
        closed = one.leaves == LITTLE
        one.gates["predicted"] = closed or not refuted(one.prediction, one.fitted.fit, context.options)
