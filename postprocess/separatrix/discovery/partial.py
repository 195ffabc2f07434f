# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for effects of real machines, of which something always remains that no catalogue holds.

The strict decision names nothing while a gap remains. Asked for names in part, effects are added one by
one (the first two together, if only that helps) as long as each passes every gate but the adequacy, which
here is not to be had; the verdict says that it is not complete.
"""

from dataclasses import replace

import numpy as np

from separatrix.discovery.decide import Decision, fit_pair, foremost, leaders, over_base, pass_gates
from separatrix.discovery.judge import Judged, admissible
from separatrix.discovery.rounds import Bench, Round, pair_gains, run_round

_PAIRS = 12


def name_in_part(bench: Bench, decision: Decision) -> Decision:
    """Return the decision with the effects that help on every record, though more is missing."""
    base = decision.rounds[0].base
    rounds = decision.rounds[:1]
    accepted = _next(bench, rounds[0])
    if accepted is None:
        accepted = _pair(bench, rounds[0])
    last = None
    while accepted is not None:
        last = accepted
        if len(last.fitted.names) >= bench.options.most_effects:
            break
        rounds.append(run_round(bench, last.fitted, last.prediction, 0.9, 0.98))
        accepted = _next(bench, rounds[-1])
    if last is None:
        return decision
    whole = over_base(bench, base, rounds[0].foretold, last)
    whole.gates, whole.p = last.gates, last.p
    return replace(
        decision,
        outcome="named",
        complete=False,
        accepted=[whole],
        alternatives=[],
        rivals=[],
        rounds=rounds,
        reasons=[*decision.reasons, "named in part: what is left is not in the catalogue"],
    )


def _next(bench: Bench, found: Round) -> Judged | None:
    """The best candidate of a round, if it passes every gate."""
    if not found.judged:
        return None
    best, rivals = leaders(bench, found)
    pass_gates(bench, best, found.base, rivals, found.screened.tests)
    return best if all(best.gates.values()) else None


def _pair(bench: Bench, found: Round) -> Judged | None:
    """Two effects that pass only together: each alone drives the base to where it should not be."""
    pairs = []
    for _, one, other in pair_gains(found)[:_PAIRS]:
        fitted = fit_pair(bench, found, one, other)
        if fitted is not None:
            pairs.append(over_base(bench, found.base, found.foretold, fitted))
    pairs = [one for one in pairs if _both_clear(one, found)]
    if not pairs:
        return None
    best, close = foremost(pairs, bench.options.separation)
    pass_gates(bench, best, found.base, close, len(pairs))
    return best if all(best.gates.values()) else None


def _both_clear(pair: Judged, found: Round) -> bool:
    """Whether every parameter of both effects is inside its bounds and differs from nothing."""
    fit = pair.fitted.fit
    errors = np.sqrt(np.diag(pair.fitted.covariance))
    clear = [not fit.at_bound[i] and abs(fit.values[i]) > 1.96 * errors[i] for i in pair.fitted.added]
    return all(clear) and admissible(pair, found.base)[0]
