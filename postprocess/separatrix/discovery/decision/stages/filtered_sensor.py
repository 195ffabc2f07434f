# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor that shows the past: a delay, or the low pass of its amplifier, to first order the same."""

from dataclasses import replace

from separatrix.discovery.decision.scoring import ScoredCandidate
from separatrix.discovery.decision.stages.character import Character, best_of_hypothesis, has_gap, motions
from separatrix.discovery.decision.state import Decision, SearchState
from separatrix.discovery.fitting.late import DELAY
from separatrix.discovery.fitting.low_pass import low_pass
from separatrix.discovery.policy import SEARCH

FILTERED = "sensor_low_pass"
"""Name of a sensor with a low pass, which is no effect of the catalogue."""
_DELAYED = "sensor_delay"


def may_be_filtered(state: SearchState) -> bool:
    """Whether a delay of a position sensor is named, or helps most where nothing is."""
    best = _delayed(state)
    problem = state.round.base.problem
    if best is None or problem.exact or not problem.has_memories or state.context.options.quick:
        return False
    positions = all(one.record.has_position for one in problem.prepared)
    return positions and has_gap(state) and _delay(best) > 0


def filtered_sensor(state: SearchState) -> SearchState:
    """Doubt a delay that a low pass does not differ from; replace it where records show the low pass."""
    best, options = _delayed(state), state.context.options
    found = best_of_hypothesis(*motions(state.context, best.fitted, best.prediction), low_pass(_delay(best)))
    share, error = found.size
    clear = found.evidence > options.needed * options.separation
    if clear and share > 0.5:
        return state.decided(_as_low_pass(state, best, found))
    if not state.decision.accepted or clear or 1 - share > SEARCH.lag_sure * error:
        return state
    reason = (
        f"these records do not distinguish a delay of the sensor from a low pass of {_delay(best):.3g} s: a "
        "fast known motion, or another filter of the amplifier, separates them"
    )
    decision = state.decision.because(reason)
    alternatives = [*decision.alternatives, [FILTERED]]
    return state.decided(replace(decision, outcome="ambiguous", alternatives=alternatives))


def _delayed(state: SearchState) -> ScoredCandidate | None:
    """The named machine with a delay; where nothing is named, the best effect if it is one."""
    decision = state.decision
    if decision.accepted:
        one = decision.accepted[0]
        return one if _DELAYED in one.fitted.names and one.prediction is not None else None
    if decision.outcome not in ("not-in-catalogue", "characterised") or not state.round.scored:
        return None
    one = state.round.scored[0]
    return one if one.name == _DELAYED and one.settled and one.prediction is not None else None


def _delay(one: ScoredCandidate) -> float:
    values = zip(one.fitted.problem.free, one.fitted.fit.values, strict=True)
    return next(float(value) for free, value in values if free.path == DELAY)


def _as_low_pass(state: SearchState, best: ScoredCandidate, found: Character) -> Decision:
    """A sensor with a low pass in place of the delay, by what both together close of the gap."""
    decision = state.decision
    base = decision.rounds[0].base.fit, decision.predicted.fit
    left = best.fitted.fit, best.prediction.fit
    closed = [
        1 - (1 - share) * max(one.excess, 0.0) / max(before.excess, 1.0)
        for share, one, before in zip((found.closed, found.held_out_closed), left, base, strict=True)
    ]
    whole = replace(found, closed=closed[0], held_out_closed=closed[1], size=None)
    reason = (
        f"a low pass of the sensor explains more than its delay (log-likelihood {found.evidence:.3g}, "
        f"{found.size[0]:.2g} +- {found.size[1]:.1g} of the difference)"
    )
    return replace(
        decision,
        outcome="characterised",
        accepted=[],
        alternatives=[],
        rivals=[],
        equivalent=False,
        characters=[whole],
        added=None,
        function=None,
        not_added="nothing is added to the case: the simulator has no sensor with a low pass",
        reasons=[reason],
    )
