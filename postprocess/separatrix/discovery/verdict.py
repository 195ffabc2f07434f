# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The verdict as a dictionary: what is written to verdict.json."""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.decide import Decision
from separatrix.discovery.refit import Fitted
from separatrix.discovery.rounds import Bench
from separatrix.version import __version__


@dataclass
class Findings:
    """Everything that was found, for the verdict, the files and the figures."""

    bench: Bench
    base: Fitted
    decision: Decision
    held_out_chosen: str


def verdict_of(findings: Findings) -> dict:
    """Return the content of verdict.json."""
    decision, bench = findings.decision, findings.bench
    first = decision.rounds[0]
    final = decision.accepted[0].fitted if decision.accepted else findings.base
    return {
        "outcome": decision.outcome,
        "effects": list(final.names),
        "alternatives": ["+".join(names) for names in decision.alternatives],
        "equivalent": decision.equivalent,
        "parameters": _parameters(final),
        "gap": _gap(findings),
        "gates": decision.accepted[0].gates if decision.accepted else {},
        "reasons": decision.reasons,
        "candidates": [
            {
                "effect": one.name,
                "training": one.training,
                "held_out": one.held_out,
                "evidence": one.evidence,
                "reduced_chi2": one.fitted.fit.reduced_chi2,
                "converged": one.fitted.fit.converged,
                "values": {path: float(one.fitted.fit.values[i]) for path, i in zip(one.fitted.paths, one.fitted.added, strict=True)},
            }
            for one in first.judged
        ],
        "d_prime": {
            name: float(np.max(np.abs(first.screened.step[name]) / first.screened.error[name], initial=0))
            for name in first.screened.names
        },
        "confusability": {"names": first.screened.names, "matrix": first.screened.cosines.tolist()},
        "not_tested": bench.absent,
        "ceiling": {one.name: {"gain": one.gain, "rank": one.rank, "p": one.p} for one in decision.base_ceiling.families},
        "warnings": [f"{one.record.name}: {note}" for data in (bench.training, bench.held_out) if data for one in data.prepared for note in one.notes],
        "seed": bench.options.seed,
        "version": __version__,
    }


def _parameters(fitted: Fitted) -> dict:
    errors = np.sqrt(np.diag(fitted.covariance))
    found = {}
    for one, value, error in zip(fitted.problem.free, fitted.fit.values, errors, strict=True):
        if one.is_nuisance and one.record is not None:
            continue
        parameter = fitted.model.parameters.get(one.path)
        found[one.path] = {
            "value": float(value),
            "standard_error": float(error),
            "interval_95": [float(value - 1.96 * error), float(value + 1.96 * error)],
            "unit": parameter.unit if parameter else "1",
        }
    return found


def _gap(findings: Findings) -> dict:
    decision = findings.decision
    best = decision.accepted[0] if decision.accepted else None
    gap = {"training": {"before": findings.base.fit.reduced_chi2, "noise_floor": 1.0}}
    gap["training"]["after"] = best.fitted.fit.reduced_chi2 if best else gap["training"]["before"]
    if decision.foretold is not None:
        before = decision.foretold.reduced_chi2
        gap["held_out"] = {"before": before, "noise_floor": 1.0}
        gap["held_out"]["after"] = best.prediction.reduced_chi2 if best else before
    return gap
