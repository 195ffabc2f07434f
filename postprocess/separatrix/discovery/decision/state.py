# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a search knows between two stages of its plan, and what it decides at last."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from separatrix.discovery.decision.rounds import Round, SearchContext
from separatrix.discovery.decision.scoring import ScoredCandidate
from separatrix.discovery.fitting.ceiling import Ceiling
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.joint_effects import effect_of
from separatrix.discovery.fitting.smooth import Function


@dataclass(frozen=True)
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
    reasons: Sequence[str] = ()
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

    def because(self, *reasons: str) -> "Decision":
        """The same with more reasons."""
        return replace(self, reasons=[*self.reasons, *reasons])


class Choice(NamedTuple):
    """A machine that may be named, and those that it does not beat clearly."""

    best: ScoredCandidate
    rivals: list[ScoredCandidate]

    @property
    def detected(self) -> bool:
        """Whether a gain is more than chance and what a few segments carry."""
        return self.best.gates["detect"] and self.best.gates["stable"]

    @property
    def adequate(self) -> bool:
        """Whether nothing is left that a flexible force would explain."""
        return self.best.gates["adequate"]


class Step(NamedTuple):
    """A stage that was run, why, and what it came to."""

    stage: str
    reason: str
    found: str


@dataclass(frozen=True)
class SearchState:
    """The search between two stages."""

    context: SearchContext
    # the machine of the case, fitted: every effect is added to it
    base: Fitted
    # whether the noise was measured by a machine with several effects
    noise_measured: bool = False
    # effects over the base: those that the screen promises, and those that decide (every effect, if tried)
    promised: Round | None = None
    round: Round | None = None
    # what free forces explain of what the base of that round leaves
    gap: Ceiling | None = None
    # the best single effect and the round that it was found in, a family as a function, several effects
    one: Choice | None = None
    one_in: Round | None = None
    function: Choice | None = None
    several: Choice | None = None
    # whether several effects close the gap, the rounds with those, and one effect warm-started from them
    closed: bool = False
    rounds_of_several: tuple[Round, ...] = ()
    after_several: Choice | None = None
    decision: Decision | None = None
    # the search without fitted imperfections of the rig, while one beside these goes on
    without_imperfections: "SearchState | None" = None
    # whether the plan begins again from its first stage
    begins_again: bool = False
    steps: tuple[Step, ...] = ()
    # the stage before which the time limit ended the search; '' for a whole one
    stopped: str = ""

    @property
    def open(self) -> bool:
        """Whether nothing is decided."""
        return self.decision is None

    @property
    def in_part(self) -> bool:
        """Whether effects are named though a gap remains."""
        return self.context.options.partial

    @property
    def most_effects(self) -> int:
        """Number of effects that the strict search looks for; of names in part it looks for the first."""
        return 1 if self.in_part else self.context.options.most_effects

    @property
    def several_close(self) -> bool:
        """Whether several effects close the gap and have more evidence than a function."""
        function = self.function
        return self.closed and (function is None or self.several.best.evidence > function.best.evidence)

    @property
    def undecided(self) -> Decision:
        """A decision without a name, from which the outcome follows."""
        rounds = [self.round, *self.rounds_of_several]
        return Decision("none", [], [], [], rounds, self.gap, self.round.predicted)

    def decided(self, decision: Decision) -> "SearchState":
        """The same with a decision."""
        return replace(self, decision=decision)

    def again(self, **changes: object) -> "SearchState":
        """The search from its first stage, with changes of what it begins from."""
        found = (
            "promised",
            "round",
            "gap",
            "one",
            "one_in",
            "function",
            "several",
            "after_several",
            "decision",
        )
        return replace(
            self, **dict.fromkeys(found), closed=False, rounds_of_several=(), begins_again=True, **changes
        )

    def in_words(self) -> str:
        """What was found so far."""
        if self.decision is not None:
            names = [" and ".join(one.fitted.names) for one in self.decision.accepted]
            return ": ".join([self.decision.outcome, *names])
        best = self.several or self.function or self.one
        return "no effect" if best is None else f"best: {' and '.join(best.best.fitted.names)}"
