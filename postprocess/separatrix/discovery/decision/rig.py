# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The search again where small faults of the rig hide what is missing: with those fitted as well.

A search holds every effect against faults that are linear beside the machine as it was fitted without them.
Where they explain hundreds of times what an effect does, the error of that hides it, or is taken for another.
"""

from dataclasses import replace

import numpy as np

from separatrix.discovery.decision.decide import Decision, decide
from separatrix.discovery.decision.rounds import Bench
from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.refit import Fitted
from separatrix.discovery.fitting.rig import as_nuisances, faults_of, weight_of_faults

# log-likelihood from which on faults of a rig may hide an effect
_HIDING = 10.0
# how often the motion that they act along is that of the machine beside them
_TIMES = 2


def decide_beside_faults(bench: Bench, base: Fitted) -> tuple[Bench, Decision]:
    """Decide, and again with the faults of the rig fitted where that gave no name and they explain much.

    The second answer stands if it is a name; what it was asked on comes with it.
    """
    first = decide(bench, base)
    if not _may_hide(bench, first):
        return bench, first
    bench.options.progress("searching beside faults of the rig", 0.85)
    beside, machine = _with_faults(bench, first.rounds[0].base, first.foretold)
    second = decide(beside, machine)
    return (beside, second) if _sure(second) else (bench, first)


def _sure(decision: Decision) -> bool:
    """Whether a decision is a name, or names of one motion or of one family."""
    return decision.outcome == "named" or decision.equivalent or bool(decision.in_families)


def _may_hide(bench: Bench, decision: Decision) -> bool:
    base = decision.rounds[0].base
    if _sure(decision) or bench.options.quick or isinstance(base.problem, CoordinateProblem):
        return False
    if base.problem.in_force or not base.fit.good.any():
        return False
    return weight_of_faults(base, decision.foretold)[0] > _HIDING


def _with_faults(bench: Bench, base: Fitted, told: Prediction | None) -> tuple[Bench, Fitted]:
    """Records with faults of their rig, and the machine fitted to them beside those."""
    machine = base.problem.free
    values = np.concatenate([base.fit.values, np.zeros(len(faults_of(base.problem, base.fit)))])
    for _ in range(_TIMES):
        tables = faults_of(base.problem, base.fit)
        training, held_out = bench.training.with_faults(tables), bench.held_out
        if held_out is not None:
            held_out = held_out.with_faults(faults_of(told.problem, told.fit))
        bench = replace(bench, training=training, held_out=held_out)
        problem = training.problem(base.model, training.last, [*machine, *as_nuisances(tables)])
        fit = minimise(problem, values, base.fit.starts, patient=True)
        base, values = replace(base, problem=problem, fit=fit), fit.values
        told = bench.foretell(base, told)
    return bench, base
