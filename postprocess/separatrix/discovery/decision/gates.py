# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice among candidates and the gates that the chosen one has to pass."""

from collections.abc import Callable
from typing import NamedTuple

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
    extrapolates,
    held_out_bounds,
    predicts,
    scored,
    sizeable,
    stable,
)
from separatrix.discovery.fitting.ceiling import ceiling
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.heldout import Prediction, gained_together
from separatrix.discovery.fitting.rig import (
    share_with_imperfections,
    shares_with_imperfections,
    weight_of_imperfections,
)
from separatrix.discovery.options import Options
from separatrix.discovery.policy import SEARCH


class Trial(NamedTuple):
    """A candidate before the gates: the machine without it, candidates that it does not beat clearly."""

    best: ScoredCandidate
    base: Fitted
    rivals: list[ScoredCandidate]
    options: Options


class Gate(NamedTuple):
    """A condition of a name: when it is passed in words, and its test; None where it does not apply."""

    name: str
    sentence: str
    test: Callable[[Trial], object]


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
    near = [one for one in able if one.evidence > SEARCH.weighed_share * best.evidence]
    return [best, *sorted(near, key=lambda one: -one.evidence)[: SEARCH.weighed]]


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
    if best.prediction is None or best.predicted is None:
        best.own = share_with_imperfections(best.fitted, base)
    else:
        predictions = (best.prediction, best.predicted)
        best.own, best.own_predicted = shares_with_imperfections((best.fitted, base), predictions)
    best.p = detection(best, tested, max(1.0, best.fitted.fit.reduced_chi2))
    _pass(GATES, Trial(best, base, rivals, context.options))


def _within_imperfections(best: ScoredCandidate) -> bool:
    """Whether imperfections of a rig explain a gain within the error of their linearisation."""
    gained = best.training + best.held_out
    own = best.own * best.training + best.own_predicted * best.held_out
    return own < SEARCH.linear_error * (gained - own)


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
    _pass(GATES_OF_REST, Trial(one, one.fitted, [], context.options))


def _pass(gates: tuple[Gate, ...], trial: Trial) -> None:
    """Set those of the gates that apply."""
    passed = {gate.name: gate.test(trial) for gate in gates}
    trial.best.gates |= {name: bool(one) for name, one in passed.items() if one is not None}


def _detected(trial: Trial) -> bool:
    best, options = trial.best, trial.options
    return (
        best.p < options.detection_level and _of_some_size(best, options) and not _within_imperfections(best)
    )


def _holds_out(trial: Trial) -> bool | None:
    best, options = trial.best, trial.options
    if best.prediction is None:
        return None
    bounds = held_out_bounds(best, options).values()
    helps = any(low > 0 for low, _ in bounds) or predicts(best, options)
    helps |= beyond_doubt(best, trial.base, options)
    return helps and all(high > options.harm for _, high in bounds)


def _predicted(trial: Trial) -> bool | None:
    best = trial.best
    if best.prediction is None:
        return None
    little = best.leaves == LITTLE or extrapolates(best, trial.options)
    return little or not refuted(best.prediction, best.fitted.fit, trial.options)


GATES = (
    Gate("converged", "the fit has reached its minimum", lambda trial: trial.best.settled),
    Gate(
        "detect",
        "the effect has some size, and its gain exceeds chance and instrument imperfections",
        _detected,
    ),
    Gate(
        "hold-out",
        "a held-out record is predicted better, and none is predicted clearly worse",
        _holds_out,
    ),
    Gate(
        "separate",
        "the evidence clearly exceeds that of every other candidate",
        lambda trial: not trial.rivals,
    ),
    Gate(
        "admissible",
        "the parameters have admissible values that differ from zero",
        lambda trial: admissible(trial.best, trial.base, trial.options)[0],
    ),
    Gate(
        "stable",
        "the effect pays for its parameters in 90 % of block bootstraps",
        lambda trial: stable(trial.best, trial.base, trial.options) >= trial.options.inclusion,
    ),
)
"""Gates of every candidate."""
GATES_OF_REST = (
    Gate(
        "adequate", "only noise remains, or at most a hundredth of the gap", lambda trial: trial.best.leaves
    ),
    Gate("predicted", "held-out records are matched nearly as well as training records", _predicted),
)
"""Gates of a detected candidate: what it leaves."""
DROP = "drop", "for sets: every effect of the set is needed"
"""The gate of several effects, set by `several` and `in_part`."""
