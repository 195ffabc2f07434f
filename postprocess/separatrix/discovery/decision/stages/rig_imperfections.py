# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Repeats the search with fitted imperfections of the rig where these may hide what is missing.

A search compares every effect with imperfections that are linearised about a machine fitted without them.
Where they explain hundreds of times as much as an effect, the error of this linearisation hides the effect or
passes for another.
"""

from dataclasses import replace

import numpy as np

from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.scoring import ScoredCandidate
from separatrix.discovery.decision.state import Decision, SearchState
from separatrix.discovery.fitting.fit import Fit, minimise
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.rig import (
    as_nuisances,
    imperfections_of,
    weight_of_imperfections,
)
from separatrix.discovery.fitting.rig_columns import usual_acceleration
from separatrix.discovery.policy import FIT, SEARCH


def hidden_by_imperfections(state: SearchState) -> bool:
    """Whether there is no name and imperfections explain much of the residual in training."""
    base = state.round.base
    if _sure(state.decision) or state.context.options.quick or not base.problem.fits_imperfections:
        return False
    if not base.fit.good.any():
        return False
    weight, _ = weight_of_imperfections(base, None)
    return weight > max(SEARCH.hiding, SEARCH.hiding_share * 0.5 * base.fit.excess)


def beside_imperfections(state: SearchState) -> SearchState:
    """Begin the search again beside fitted imperfections of the rig; unchanged if their fit fails."""
    found = _with_imperfections(state.context, state.round.base, state.decision.predicted)
    if found is None:
        return state
    context, base = found
    return state.again(context=context, base=base, noise_measured=False, without_imperfections=state)


def with_or_without(state: SearchState) -> SearchState:
    """Keep the search beside imperfections if it found a name, else return to the one without them."""
    if _sure(state.decision) and _small(state.decision.accepted[0]):
        return replace(state, without_imperfections=None)
    return replace(state.without_imperfections, steps=state.steps)


def _sure(decision: Decision) -> bool:
    """Whether a decision is a name, or names of one motion or of one family of which nothing is in doubt."""
    if decision.outcome == "named" or decision.in_families:
        return True
    gates = decision.accepted[0].gates.items() if decision.accepted else ()
    return decision.equivalent and all(passed for gate, passed in gates if gate != "separate")


def _small(one: ScoredCandidate) -> bool:
    """Whether no fitted imperfection is at its largest size; a larger one is not an imperfection."""
    pairs: list[tuple[Likelihood, Fit]] = [(one.fitted.problem, one.fitted.fit)]
    if one.prediction is not None:
        pairs.append((one.prediction.problem, one.prediction.fit))
    return not any(
        held and free.is_imperfection
        for problem, fit in pairs
        for free, held in zip(problem.free, fit.at_bound, strict=True)
    )


def _with_imperfections(
    context: SearchContext, base: Fitted, prediction: Prediction | None
) -> tuple[SearchContext, Fitted] | None:
    """Records with imperfections of their rig, and the machine fitted beside these; None if the fit fails."""
    machine, values, followed = base.problem.free, base.fit.values, base.fit.good.sum()
    for turn in range(SEARCH.imperfect_rounds):
        usual = usual_acceleration(base.problem, base.fit)
        tables = imperfections_of(base.problem, base.fit, usual)
        training, held_out = context.training.with_imperfections(tables), context.held_out
        if held_out is not None:
            prediction = prediction if turn == 0 else context.predict(base, prediction)
            tables_ahead = imperfections_of(prediction.problem, prediction.fit, usual)
            held_out = held_out.with_imperfections(tables_ahead)
        problem = training.problem(base.model, training.last, [*machine, *as_nuisances(tables)])
        values = np.concatenate([values, np.zeros(len(problem.free) - values.size)])
        fit = minimise(problem, values, base.fit.starts, patient=True)
        if fit.good.sum() < followed:
            return None
        training.base_starts = fit.starts
        context = replace(context, training=training, held_out=held_out)
        base, values = replace(base, problem=problem, fit=fit), fit.values
    return context, base


def in_words(fitted: Fitted) -> list[str]:
    """The sizes of imperfections that were fitted beside a machine, in a sentence; none if none were."""
    sizes = {
        (one.path, one.record): FIT.imperfection_size * abs(value)
        for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True)
        if one.is_imperfection
    }
    if not sizes:
        return []
    sensor = max(size for (_, record), size in sizes.items() if record is not None)
    drive = max((size for (_, record), size in sizes.items() if record is None), default=0.0)
    of_drive = f", and harmonics of the drive of up to {drive:.2g} of the acceleration" if drive else ""
    return [
        f"small imperfections of the rig are fitted beside every machine, without which no effect stood out: "
        f"a sensor that is curved by up to {sensor:.2g} of the signal{of_drive}"
    ]
