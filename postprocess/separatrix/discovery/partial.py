# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for effects of real machines, of which something always remains that no catalogue holds.

The strict decision names nothing while a gap remains. Asked for names in part, effects are added one by one as long as each
passes every gate but the adequacy, which here is not to be had; the verdict says that it is not complete.
"""

from dataclasses import replace

from separatrix.discovery.decide import Decision, leaders, over_base, pass_gates
from separatrix.discovery.judge import Judged, admissible
from separatrix.discovery.rounds import Bench, run_round


def name_in_part(bench: Bench, decision: Decision) -> Decision:
    """Return the decision with the effects that help wherever they are tested, though something else is missing too."""
    base = decision.rounds[0].base
    accepted: list[Judged] = []
    rounds = decision.rounds[:1]
    while len(accepted) < bench.options.most_effects:
        current = accepted[-1] if accepted else None
        if current is not None:
            done = len(accepted) / bench.options.most_effects
            rounds.append(run_round(bench, current.fitted, current.prediction, 0.9 + 0.1 * done, 0.9 + 0.1 * (done + 0.3)))
        best, rivals = leaders(bench, rounds[-1])
        pass_gates(bench, best, current.fitted if current else base, rivals, len(rounds[-1].judged))
        if not all(best.gates.values()):
            break
        accepted.append(best)
    if not accepted or not admissible(accepted[-1], base)[0]:
        return decision
    whole = over_base(bench, base, decision.foretold, accepted[-1])
    whole.gates = accepted[-1].gates
    whole.p = max(one.p for one in accepted)
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
