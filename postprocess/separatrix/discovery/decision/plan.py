# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the discovery does, in order: the list of stages, and the walk along it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from separatrix.discovery.decision.scoring import NOISE
from separatrix.discovery.decision.stages.character import character, has_gap
from separatrix.discovery.decision.stages.conclusions import few_segments, named, no_effect, not_all
from separatrix.discovery.decision.stages.function import function, function_alone, of_several, only_follows
from separatrix.discovery.decision.stages.function_of_name import (
    form_refuted,
    function_of_name,
    has_function,
    table_or_form,
)
from separatrix.discovery.decision.stages.hidden_state import can_be_hidden, hidden_state
from separatrix.discovery.decision.stages.in_part import effects_in_part, nearest
from separatrix.discovery.decision.stages.one_effect import every_effect, one_effect
from separatrix.discovery.decision.stages.rig_imperfections import (
    beside_imperfections,
    hidden_by_imperfections,
    with_or_without,
)
from separatrix.discovery.decision.stages.several_effects import another_effect, noise_again, several_effects
from separatrix.discovery.decision.stages.table import table
from separatrix.discovery.decision.state import SearchState, Step

# the part of a run that the search is: records and base machine come before, figures after
_FIRST, _LAST = 0.1, 0.9


@dataclass(frozen=True)
class Stage:
    """One stage: its name, when it applies, why that is, what it does, its usual share of the work."""

    name: str
    applies: Callable[[SearchState], bool]
    reason: str
    run: Callable[[SearchState], SearchState]
    work: float = 1.0


def search(state: SearchState) -> SearchState:
    """Walk along the plan to its end; a stage may send the search back to the first one."""
    position, done = 0, _FIRST
    while position < len(PLAN):
        stage = PLAN[position]
        position += 1
        if not stage.applies(state):
            continue
        left = sum(one.work for one in PLAN[position:])
        span = done, done + (_LAST - done) * stage.work / (stage.work + left)
        state = replace(state, context=replace(state.context, span=span))
        state.context.report(f"{stage.name}: {stage.reason}")
        state = stage.run(state)
        state = replace(state, steps=(*state.steps, Step(stage.name, stage.reason, state.in_words())))
        done = span[1]
        if state.begins_again:
            position, state = 0, replace(state, begins_again=False)
    return state


def _gap_left(state: SearchState) -> bool:
    """Whether an effect is significant and a gap remains."""
    return state.open and not state.one.adequate


def _beats_function(state: SearchState) -> bool:
    one, other = state.after_several, state.function
    return one is not None and (other is None or one.best.evidence > other.best.evidence)


def _may_miss_another(state: SearchState) -> bool:
    """Whether one effect leaves noise, and a held-out record may show another."""
    best, quick = state.one.best, state.context.options.quick
    return best.prediction is not None and best.leaves == NOISE and not quick and state.most_effects > 1


def _strict(state: SearchState, *outcomes: str) -> bool:
    """Whether a gap must be closed by names, and the outcome is one of these."""
    return not state.in_part and state.decision.outcome in outcomes


PLAN = (
    Stage(
        "one effect",
        lambda state: state.open,
        "every search begins so; the base is renewed where an effect shows a lower minimum of it",
        one_effect,
        work=6,
    ),
    Stage(
        "no effect",
        lambda state: state.open and not (state.one and state.one.detected),
        "no effect is more than chance",
        no_effect,
    ),
    Stage(
        "function alone",
        lambda state: not state.open and state.one is not None and state.decision.outcome != "none",
        "a force would explain more, and no closed form of it is significant",
        function_alone,
    ),
    Stage(
        "few segments",
        lambda state: (
            not state.open
            and state.one is not None
            and state.one.best.gates["detect"]
            and not state.decision.accepted
        ),
        "an effect is more than chance, but not in most segments",
        few_segments,
    ),
    Stage(
        "function",
        _gap_left,
        "the best effect leaves a gap",
        function,
        work=3,
    ),
    Stage(
        "every effect",
        lambda state: _gap_left(state) and state.function is None and not state.context.options.quick,
        "the screen may have passed over the effect that closes the gap",
        every_effect,
        work=3,
    ),
    Stage(
        "another effect",
        lambda state: state.open and state.one.adequate and _may_miss_another(state),
        "one effect may reproduce two where it was fitted",
        another_effect,
    ),
    Stage(
        "name of one effect",
        lambda state: state.open and state.one.adequate,
        "one effect closes the gap",
        lambda state: named(state, state.one),
    ),
    Stage(
        "function again",
        lambda state: _gap_left(state) and state.function is None and state.one_in is not state.promised,
        "another effect leads since every effect was fitted",
        function,
    ),
    Stage(
        "name of a function",
        lambda state: (
            state.open
            and state.function is not None
            and not (of_several(state.context, state.function.best) and state.most_effects > 1)
        ),
        "a function closes the gap and is not the sum of several effects",
        lambda state: named(state, state.function),
    ),
    Stage(
        "several effects",
        lambda state: state.open and state.most_effects > 1,
        "no single effect closes the gap",
        several_effects,
        work=4,
    ),
    Stage(
        "name of one effect after several",
        lambda state: state.open and _beats_function(state),
        "started from several effects, one closes the gap",
        lambda state: named(state, state.after_several),
    ),
    Stage(
        "name of a function rather than several",
        lambda state: (
            state.open
            and state.function is not None
            and not state.several_close
            and not only_follows(state.context, state.function.best)
        ),
        "a function closes the gap, also on held-out records, and several effects do not",
        lambda state: named(state, state.function),
    ),
    Stage(
        "name of several effects",
        lambda state: state.open and state.several_close,
        "several effects close the gap, and each is needed",
        lambda state: named(state, state.several),
    ),
    Stage(
        "measured noise",
        lambda state: (
            state.open
            and state.several is not None
            and not state.noise_measured
            and state.several.best.fitted.fit.like_noise(2)
        ),
        "several effects leave little more than noise, whose memory is seen only now",
        noise_again,
    ),
    Stage(
        "no machine",
        lambda state: state.open,
        "effects are significant, and none closes the gap",
        not_all,
    ),
    Stage(
        "effects in part",
        lambda state: state.in_part and state.decision.outcome == "not-in-catalogue",
        "names in part are asked for",
        effects_in_part,
        work=3,
    ),
    Stage(
        "rig imperfections",
        lambda state: (
            not state.in_part and state.without_imperfections is None and hidden_by_imperfections(state)
        ),
        "imperfections of the rig explain much, and there is no name",
        beside_imperfections,
    ),
    Stage(
        "with or without imperfections",
        lambda state: state.without_imperfections is not None,
        "the search beside imperfections of the rig must find a name",
        with_or_without,
    ),
    Stage(
        "hidden state",
        lambda state: not state.in_part and can_be_hidden(state),
        "a function may reproduce a hidden state in part",
        hidden_state,
    ),
    Stage(
        "nearest effect",
        lambda state: _strict(state, "not-in-catalogue"),
        "one effect may pass every gate but the adequacy",
        nearest,
    ),
    Stage(
        "character",
        lambda state: _strict(state, "not-in-catalogue") and has_gap(state),
        "the gap has no name",
        character,
        work=2,
    ),
    Stage(
        "table",
        lambda state: (
            _strict(state, "characterised") or (not state.in_part and state.decision.suspected is not None)
        ),
        "it is known on what the missing force depends",
        table,
        work=2,
    ),
    Stage(
        "function of the name",
        has_function,
        "an effect is part of the machine",
        function_of_name,
        work=2,
    ),
    Stage(
        "table or form",
        lambda state: not state.in_part and form_refuted(state),
        "the function of the family has another form than the one that is named",
        table_or_form,
    ),
)
"""Every stage in the order in which it is looked at."""
