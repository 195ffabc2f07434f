# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the discovery does, in order: the list of stages, and the walk along it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from separatrix.discovery.decision.scoring import NOISE
from separatrix.discovery.decision.stages.character import character, has_gap
from separatrix.discovery.decision.stages.conclusions import few_segments, named, no_effect, not_all
from separatrix.discovery.decision.stages.cut_short import cut_short
from separatrix.discovery.decision.stages.filtered_sensor import filtered_sensor, may_be_filtered
from separatrix.discovery.decision.stages.function import function, function_alone, of_several, only_follows
from separatrix.discovery.decision.stages.function_of_name import (
    form_in_doubt,
    form_refuted,
    forms_alike,
    function_of_name,
    has_function,
    table_or_form,
)
from separatrix.discovery.decision.stages.hidden_state import can_be_hidden, hidden_state
from separatrix.discovery.decision.stages.in_part import effects_in_part, nearest
from separatrix.discovery.decision.stages.lagging_force import lagging_force, may_lag
from separatrix.discovery.decision.stages.one_effect import every_effect, one_effect
from separatrix.discovery.decision.stages.rig_imperfections import (
    beside_imperfections,
    hidden_by_imperfections,
    with_or_without,
)
from separatrix.discovery.decision.stages.several_effects import another_effect, noise_again, several_effects
from separatrix.discovery.decision.stages.table import table
from separatrix.discovery.decision.state import SearchState, Step
from separatrix.discovery.fitting.time_limit import OutOfTimeError

# the part of a run that the search is: records and base machine come before, figures after
_FIRST, _LAST = 0.1, 0.9


@dataclass(frozen=True)
class Stage:
    """One stage: its name, when it applies, what it does, why, its usual share of the work."""

    name: str
    applies: Callable[[SearchState], bool]
    run: Callable[[SearchState], SearchState]
    reason: str
    work: float = 1.0


def search(state: SearchState) -> SearchState:
    """Walk along the plan to its end or its time limit; a stage may send the search back to the first one."""
    position, done = 0, _FIRST
    while position < len(PLAN):
        stage = PLAN[position]
        position += 1
        if not stage.applies(state):
            continue
        left = sum(one.work for one in PLAN[position:])
        span = done, done + (_LAST - done) * stage.work / (stage.work + left)
        known = state.one is not None
        state = replace(state, context=replace(state.context, span=span, has_result=known))
        state.context.limit.work_counts = False
        try:
            state.context.report(f"{stage.name}: {stage.reason}")
            state = stage.run(state)
        except OutOfTimeError:
            return cut_short(state, stage.name)
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


def _carried_by_few(state: SearchState) -> bool:
    """Whether nothing is named, though an effect gains more than chance does."""
    one = state.one
    return not state.open and one is not None and one.best.gates["detect"] and not state.decision.accepted


def _is_one_function(state: SearchState) -> bool:
    """Whether a function closes the gap, of one effect or where no several are looked for."""
    one = state.function
    if not state.open or one is None:
        return False
    return state.most_effects < 2 or not of_several(state.context, one.best)


def _function_rather(state: SearchState) -> bool:
    """Whether a function closes the gap where several effects do not."""
    if not state.open or state.function is None or state.several_close:
        return False
    return not only_follows(state.context, state.function.best)


def _noise_may_change(state: SearchState) -> bool:
    """Whether several effects leave noise that was not measured with them."""
    if not state.open or state.several is None or state.noise_measured:
        return False
    return state.several.best.fitted.fit.like_noise(2)


def _suspects(state: SearchState) -> bool:
    """Whether a force is reported only if it closes the gap as a table."""
    return state.decision.suspected is not None


def _strict(state: SearchState, *outcomes: str) -> bool:
    """Whether a gap must be closed by names, and the outcome is one of these."""
    return not state.in_part and state.decision.outcome in outcomes


# fmt: off
PLAN = (
    # the strict search: until something is decided
    Stage("one effect", lambda state: state.open, one_effect,
        "every search begins so; the base is renewed where an effect shows a lower minimum of it", work=6),
    Stage("no effect", lambda state: state.open and not (state.one and state.one.detected), no_effect,
        "no effect is more than chance"),
    Stage("function alone",
        lambda state: not state.open and state.one is not None and state.decision.outcome != "none",
        function_alone, "a force would explain more, and no closed form of it is significant"),
    Stage("few segments", _carried_by_few, few_segments,
        "an effect is more than chance, but not in most segments"),
    Stage("function", _gap_left, function, "the best effect leaves a gap", work=3),
    Stage("every effect",
        lambda state: _gap_left(state) and state.function is None and not state.context.options.quick,
        every_effect, "the screen may have passed over the effect that closes the gap", work=3),
    Stage("another effect",
        lambda state: state.open and state.one.adequate and _may_miss_another(state),
        another_effect, "one effect may reproduce two where it was fitted"),
    Stage("name of one effect", lambda state: state.open and state.one.adequate,
        lambda state: named(state, state.one), "one effect closes the gap"),
    Stage("function again",
        lambda state: _gap_left(state) and state.function is None and state.one_in is not state.promised,
        function, "another effect leads since every effect was fitted"),
    Stage("name of a function", _is_one_function, lambda state: named(state, state.function),
        "a function closes the gap and is not the sum of several effects"),
    Stage("several effects", lambda state: state.open and state.most_effects > 1, several_effects,
        "no single effect closes the gap", work=4),
    Stage("name of one effect after several", lambda state: state.open and _beats_function(state),
        lambda state: named(state, state.after_several), "started from several effects, one closes the gap"),
    Stage("name of a function rather than several", _function_rather,
        lambda state: named(state, state.function),
        "a function closes the gap, also on held-out records, and several effects do not"),
    Stage("name of several effects", lambda state: state.open and state.several_close,
        lambda state: named(state, state.several), "several effects close the gap, and each is needed"),
    Stage("measured noise", _noise_may_change, noise_again,
        "several effects leave little more than noise, whose memory is seen only now"),
    Stage("no machine", lambda state: state.open, not_all,
        "effects are significant, and none closes the gap"),
    # what a decision may still turn into
    Stage("effects in part",
        lambda state: state.in_part and state.decision.outcome == "not-in-catalogue",
        effects_in_part, "names in part are asked for", work=3),
    Stage("rig imperfections",
        lambda state: not (state.in_part or state.without_imperfections) and hidden_by_imperfections(state),
        beside_imperfections, "imperfections of the rig explain much, and there is no name"),
    Stage("with or without imperfections", lambda state: state.without_imperfections is not None,
        with_or_without, "the search beside imperfections of the rig must find a name"),
    Stage("hidden state", lambda state: not state.in_part and can_be_hidden(state), hidden_state,
        "a function may reproduce a hidden state in part"),
    Stage("nearest effect", lambda state: _strict(state, "not-in-catalogue"), nearest,
        "one effect may pass every gate but the adequacy"),
    Stage("character", lambda state: _strict(state, "not-in-catalogue") and has_gap(state), character,
        "the gap has no name", work=2),
    Stage("table",
        lambda state: not state.in_part and (_strict(state, "characterised") or _suspects(state)),
        table, "it is known on what the missing force depends", work=2),
    Stage("function of the name", has_function, function_of_name,
        "an effect is part of the machine", work=2),
    Stage("table or form", lambda state: not state.in_part and form_refuted(state), table_or_form,
        "the function of the family has another form than the one that is named"),
    Stage("form in doubt", lambda state: not state.in_part and bool(forms_alike(state)), form_in_doubt,
        "another form of the family follows the records as well"),
    Stage("lagging force", may_lag, lagging_force,
        "friction that falls with the speed may be a force that lags"),
    Stage("filtered sensor", lambda state: not state.in_part and may_be_filtered(state), filtered_sensor,
        "a delay of the sensor may be a low pass"),
)
# fmt: on
"""Every stage in the order in which it is looked at."""
