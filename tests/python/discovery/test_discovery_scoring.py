# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a name needs: to pay in most resamplings, to beat its rivals, and a fit that is at its end."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.decision import flexible, scoring, several
from separatrix.discovery.decision.gates import best_of
from separatrix.discovery.decision.scoring import (
    ScoredCandidate,
    _together_clear,
    beyond_doubt,
    held_out_bounds,
    predicts,
    sliding_speed,
    stable,
)
from separatrix.discovery.decision.stages import conclusions, function, one_effect
from separatrix.discovery.decision.state import Choice, Decision, SearchState
from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.refit import Fitted
from separatrix.discovery.options import Options

COUNT = 20
OPTIONS = Options()


def fit(chi2: np.ndarray, decrement: float = 0.0) -> Fit:
    """One parameter, inside its bounds."""
    ones = np.ones(chi2.size)
    flown = SimpleNamespace(steady=ones > 0, failed=ones < 0)
    starts, open_ = np.zeros((chi2.size, 2)), np.zeros(1, bool)
    reduced = SimpleNamespace(matrix=ones[:, None, None])
    return Fit(np.ones(1), starts, flown, reduced, chi2, 50 * ones, decrement, 1, open_, ~open_)


def fitted(name: str, chi2: np.ndarray) -> Fitted:
    problem = SimpleNamespace(free=[Free(f"effect.{name}.force", 1.0)], locates=False)
    return Fitted((name,) if name else (), None, problem, fit(chi2), (0,))


def scored(gains: np.ndarray, held_out: np.ndarray) -> ScoredCandidate:
    """A candidate that gains so much log-likelihood by segment over a base with chi^2 of 100 in each."""
    one = fitted("coulomb", 100 - 2 * gains)
    prediction = SimpleNamespace(misfit=1.0)
    return ScoredCandidate(one, prediction, float(gains.sum()), float(held_out.sum()), held_out, 1)


def test_an_effect_that_a_few_segments_carry_needs_the_held_out_record():
    base = fitted("", np.full(COUNT, 100.0))
    few, even = np.zeros(COUNT), np.full(COUNT, 2.0)
    few[0] = 40.0
    assert stable(scored(even, 0 * even), base, OPTIONS) > OPTIONS.inclusion
    assert stable(scored(few, 0 * even), base, OPTIONS) < OPTIONS.inclusion
    assert stable(scored(few, even), base, OPTIONS) > OPTIONS.inclusion
    # a record that was never fitted makes no name by itself
    assert stable(scored(0.05 * few, even), base, OPTIONS) < OPTIONS.inclusion


def test_an_effect_that_few_segments_can_show_pays_without_the_best_of_them():
    """Break-away shows where the body starts: three of 20 segments, which a resampling may all leave out."""
    base = fitted("", np.full(COUNT, 100.0))
    for gains, holds in (([9.0, 8.0, 7.0], True), ([30.0, 0.5, 0.2], False)):
        parts, information = np.zeros(COUNT), np.full(COUNT, 1e-6)
        parts[:3], information[:3] = gains, 1.0
        one = scored(parts, np.zeros(COUNT))
        one.fitted.fit.reduced.matrix = information[:, None, None]
        assert (stable(one, base, OPTIONS) > OPTIONS.inclusion) == holds
        # what is by chance gained elsewhere is no second one
        parts[3:] = 0.2
        one = scored(parts, np.zeros(COUNT))
        one.fitted.fit.reduced.matrix = information[:, None, None]
        assert (stable(one, base, OPTIONS) > OPTIONS.inclusion) == holds


def test_a_held_out_record_supports_an_effect_by_the_odds_of_a_name():
    """However much its segments differ: the bounds of so few by resampling are wide."""
    uneven = np.array([2.24, 2.17, 1.86, 1.37, 0.9, 0.4, 0.36, -0.37, -0.62, -0.79, -1.61, -1.66])
    assert held_out_bounds(predicted(uneven, np.ones(12)), OPTIONS)[0][0] < 0
    assert predicts(predicted(uneven, np.ones(12)), OPTIONS)
    assert not predicts(predicted(uneven - 0.2, np.ones(12)), OPTIONS)
    # two that are followed by neither machine, and ten that agree
    apart = np.array([70.43, 7.58, 6.23, 5.86, 5.12, 4.71, 4.52, 3.97, 2.66, 2.62, 0.78, -62.82])
    assert held_out_bounds(predicted(apart, np.ones(12)), OPTIONS)[0][0] < 0
    assert predicts(predicted(apart, np.ones(12)), OPTIONS)
    # one segment alone may be one of a wrong minimum
    alone = np.array([7.0, *11 * [-0.1]])
    assert not predicts(predicted(alone, np.ones(12)), OPTIONS)
    # impacts of one speed have no information on a fall of restitution; a doubtful effect is not proven so
    silent, base = predicted(np.full(12, 0.1), np.ones(12)), fitted("", np.full(COUNT, 100.0))
    assert beyond_doubt(silent, base, OPTIONS)
    assert not beyond_doubt(silent, replace(base, fit=fit(np.full(COUNT, 100.0), decrement=50.0)), OPTIONS)
    assert not beyond_doubt(predicted(np.zeros(12), np.ones(12)), base, OPTIONS)
    silent.training = 5.0
    assert not beyond_doubt(silent, base, OPTIONS)
    # with and without noise as the only difference of two machines that should predict alike
    noise = np.array([*6 * [1.0], *6 * [-1.0]])
    for offset, information, holds in ((0.0, 1e-3, True), (0.0, 1e3, False), (-0.5, 1e-3, False)):
        one = predicted(noise + offset, np.full(12, information))
        assert beyond_doubt(one, base, OPTIONS) == holds


def predicted(gains: np.ndarray, information: np.ndarray) -> ScoredCandidate:
    """A candidate that gains so much by held-out segment, each with so much information on it."""
    one = scored(np.full(COUNT, 2.0), gains)
    one.prediction.record = np.zeros(gains.size, int)
    one.prediction.fit = SimpleNamespace(reduced=SimpleNamespace(matrix=information[:, None, None]))
    return one


def test_segments_without_information_on_an_effect_do_not_spoil_its_bounds():
    everywhere, ones = np.repeat([4.0, 6.0], 8), np.ones(16)
    low, high = held_out_bounds(predicted(everywhere, ones), OPTIONS)[0]
    assert 64 <= low < 80 < high <= 96
    # without an impact restitution cannot show; a segment that the base cannot follow was not compared
    quiet = np.concatenate([everywhere, np.full(10, 1e-4)])
    silent = np.concatenate([ones, np.full(10, 1e-9)])
    assert held_out_bounds(predicted(quiet, silent), OPTIONS)[0] == (low, high)
    lost = np.concatenate([everywhere, np.zeros(10)])
    assert held_out_bounds(predicted(lost, np.ones(26)), OPTIONS)[0] == (low, high)
    # one informative segment of many: odds of 20 to 1, either way
    for gain, helps in ((50.0, True), (2.9, False), (-50.0, False)):
        one = np.array([gain, *12 * [0.0]])
        low, high = held_out_bounds(predicted(one, np.ones(13)), OPTIONS)[0]
        assert (low > 0) == helps
        assert (high > OPTIONS.harm) == (gain > -6)


def contender(name: str, evidence: float) -> ScoredCandidate:
    one = fitted(name, np.full(COUNT, 47.0))
    return ScoredCandidate(one, None, evidence + 1, 0.0, np.zeros(0), 1)


@pytest.mark.parametrize(("other", "behind", "own", "rivals"), [
    ("stribeck", 2.9, 1.0, ["stribeck"]),
    ("stribeck", 3.1, 1.0, []),
    ("asymmetric_friction", 5.9, 1.0, ["asymmetric_friction"]),
    ("asymmetric_friction", 6.1, 1.0, []),
    # small imperfections of a rig explain most of the difference
    ("stribeck", 20.0, 0.1, ["stribeck"]),
    ("stribeck", 40.0, 0.1, []),
])  # fmt: skip
def test_two_names_of_one_motion_need_more_to_be_distinguished(monkeypatch, other, behind, own, rivals):
    monkeypatch.setattr(scoring, "share_with_imperfections", lambda *_: own)
    pool = [contender("offset_force", 50.0), contender(other, 50.0 - behind)]
    best, close = best_of(pool, OPTIONS)
    assert best.name == "offset_force"
    assert [one.name for one in close] == rivals


@pytest.mark.parametrize(("decrement", "exhausted", "converged"), [
    (0.1, False, True),
    (2.0, False, False),
    (2.0, True, True),
    (5.0, True, False),
    (np.nan, True, False),
])  # fmt: skip
def test_a_kink_ends_a_fit_within_two_standard_errors(decrement, exhausted, converged):
    """Chi^2 is that of the noise, so that one standard error is 1."""
    one = replace(fit(np.full(COUNT, 47.0), decrement), exhausted=exhausted)
    assert one.reduced_chi2 == pytest.approx(1, abs=0.05)
    assert one.converged == converged


def test_a_table_is_something_though_each_of_its_values_could_be_zero():
    """Three values that are known but for a constant; and one that is nothing."""
    shape = np.array([0.5, -0.2, -0.4])
    covariance = 1e-4 * np.eye(3) + np.ones((3, 3))
    free = [SimpleNamespace(positive=False)] * 3

    def clear(values: np.ndarray) -> bool:
        fit = SimpleNamespace(values=values)
        fitted = SimpleNamespace(fit=fit, covariance=covariance, problem=SimpleNamespace(free=free))
        return _together_clear(fitted, [0, 1, 2])

    assert np.all(np.abs(shape) < 1.96 * np.sqrt(np.diag(covariance)))
    assert clear(shape)
    assert not clear(np.array([0.01, -0.01, 0.0]) + 0.8)


@pytest.mark.parametrize(("closable", "p", "gain", "misses", "outcome"), [
    (2.0, 1e-6, 1.5, [], "none"),
    (3.0, 1e-6, 1.5, [], "not-in-catalogue"),
    (3.0, 1e-2, 1.5, [], "none"),
    (2.0, 1e-2, 1.5, ["first (reduced chi^2 4)"], "not-in-catalogue"),
    (2.0, 1e-2, 3.0, [], "not-in-catalogue"),
])  # fmt: skip
def test_an_effect_that_is_not_all_is_a_gap_only_where_something_of_some_size_is_missing(
    monkeypatch, closable, p, gain, misses, outcome
):
    """20 segments of 50 samples: 0.05 of the noise of a sample is a chi^2 of 2.5."""
    base = fitted("", np.full(COUNT, 100.0))
    found = SimpleNamespace(base=base)
    context = SimpleNamespace(training=None, held_out=None, options=OPTIONS)
    monkeypatch.setattr(conclusions, "missed", lambda data, fit, options: misses)
    gap = SimpleNamespace(closable=closable, p=p, mostly="velocity", fit=base.fit)
    effect = SimpleNamespace(training=gain / 2)
    given = conclusions.give_up(context, Decision("none", [], [], [], [found], gap, None), effect)
    assert given.outcome == outcome
    # the same gap of the base, and no effect that stands out
    other = conclusions.without_name(context, Decision("none", [], [], [], [found], gap, None))
    assert other.outcome == ("none" if gain > 2.5 else outcome)
    (reason,) = given.reasons
    text = f"{np.sqrt(closable / 1000):.2g} of that of a sample (root mean square), p = {p:.2g}"
    assert (text in reason) == (outcome == "none")


@pytest.mark.parametrize(("name", "also", "two"), [
    ("friction_curve", None, True),
    ("friction_curve", "effect.friction_curve.backward_1", False),
    ("restitution_curve", None, False),
])  # fmt: skip
def test_a_table_of_friction_is_of_two_directions_unless_its_values_are_shared(name, also, two):
    one = fitted(name, np.full(COUNT, 47.0))
    one.problem.free = [Free(f"effect.{name}.force_1", 1.0, also=also)]
    assert function._of_two_directions(ScoredCandidate(one, None, 0.0, 0.0, np.zeros(0), 1)) == two


@pytest.mark.parametrize("predicts", [True, False])
def test_a_function_that_helps_no_held_out_record_is_no_name(monkeypatch, predicts):
    one = scored(np.full(COUNT, 2.0), np.full(COUNT, 2.0 if predicts else -2.0))

    def pass_gates(_, best, *__):
        best.gates = dict.fromkeys(("detect", "stable", "converged", "admissible"), True)
        best.gates["hold-out"] = bool(best.held_out > 0)

    monkeypatch.setattr(function, "flexible_member", lambda *_: (one, []))
    monkeypatch.setattr(function, "pass_gates", pass_gates)
    monkeypatch.setattr(function, "score_ceiling", lambda _, best: best.gates.update(adequate=True))
    found = SimpleNamespace(base=one.fitted, screened=SimpleNamespace(tests=1.0))
    state = SearchState(SimpleNamespace(), one.fitted, one_in=found)
    assert (function.as_function(state) is not None) == predicts


@pytest.mark.parametrize(("left", "named"), [
    ((1.0, 1.0), True),
    # small imperfections of the rig explain what it leaves
    ((1.3, 1.0), True),
    ((1.3, 1.2), False),
])  # fmt: skip
def test_a_function_that_misses_held_out_records_is_no_name(monkeypatch, left, named):
    """It has the freedom to follow the fitted ones where the missing force is no function at all."""
    one = scored(np.full(COUNT, 5.0), np.ones(COUNT))
    prediction = Prediction(None, None, None, None, left[0], 1.0, None)
    one = replace(one, prediction=prediction)
    monkeypatch.setattr(function, "extrapolates", lambda *_: False)
    monkeypatch.setattr(function, "cleaned_prediction", lambda *_: left[1])
    monkeypatch.setattr(function, "misses", lambda prediction, *_: prediction.fit > 1.1)
    monkeypatch.setattr(function, "as_function", lambda *_: Choice(one, []))
    monkeypatch.setattr(
        function, "conclude", lambda context, decision, best, rivals: replace(decision, accepted=[best])
    )
    gap = Decision("not-in-catalogue", [], [], [], [], None, None)
    state = SearchState(SimpleNamespace(options=OPTIONS), one.fitted, decision=gap)
    assert bool(function.function_alone(state).decision.accepted) == named


def excess(size: float) -> SimpleNamespace:
    """A fit of a table, and no finer one."""
    return SimpleNamespace(fitted=SimpleNamespace(fit=SimpleNamespace(excess=size), finer=None))


def test_a_table_that_left_most_of_a_gap_is_not_fitted_again():
    tables = [("friction_curve", None, True, excess(80.0)), ("spring_curve", None, True, excess(20.0))]
    # one that did not converge may do so beside another base
    tables.append(("force_curve", None, True, None))
    found = SimpleNamespace(base=SimpleNamespace(fit=SimpleNamespace(excess=100.0)), tables=tables)
    assert flexible._far_tables(found) == {"friction_curve"}
    tables[0][3].fitted.finer = SimpleNamespace(fit=SimpleNamespace(excess=30.0))
    assert flexible._far_tables(found) == set()


@pytest.mark.parametrize("lost", [COUNT, COUNT // 2, 0])
def test_a_table_that_cannot_follow_what_the_base_can_is_no_finer_one(monkeypatch, lost):
    """Squares of segments that it lost would pass for a gain, and its values mean nothing."""
    base, few = (fitted(name, np.full(COUNT, size)) for name, size in (("", 100.0), ("friction_curve", 60.0)))
    more = fitted("friction_curve", np.full(COUNT, 59.9))
    more.fit.evaluation.failed[:lost] = True
    made = iter([few, more, None])
    monkeypatch.setattr(flexible, "knots_at", lambda member, seen, count: np.arange(count))
    monkeypatch.setattr(flexible, "fit_member", lambda *_: next(made))
    member = SimpleNamespace(seen=lambda _: None, values=("force",), knots="", effect="friction_curve")
    found = SimpleNamespace(base=base, scored=[], predicted=None, tables=[])
    found.score = lambda one, _: ScoredCandidate(
        one, None, base.fit.total - one.fit.total, 0.0, np.zeros(0), 3
    )
    context = SimpleNamespace(options=OPTIONS, training=None, predict=lambda *_: None, report=lambda _: None)
    best = flexible._fit_table(context, found, member, base, True)
    assert best.fitted is few
    assert (few.finer is more) == (lost == 0)


def test_more_knots_end_sooner_where_a_closed_form_is_far_ahead():
    few, more = (fitted("friction_curve", np.full(COUNT, size)) for size in (200.0, 150.0))
    ahead, near = (fitted("coulomb", np.full(COUNT, size)) for size in (50.0, 149.0))
    assert flexible._pointless(few, more, ahead)
    assert not flexible._pointless(few, more, near)
    assert not flexible._pointless(few, more, None)


@pytest.mark.parametrize(("carried", "outcome"), [(True, "none"), (False, "not-in-catalogue")])
def test_a_gap_that_a_segment_in_a_wrong_minimum_carries_is_none(monkeypatch, carried, outcome):
    """As of a body that sticks, where the base machine follows one segment far worse than all others."""
    chi2 = np.full(COUNT, 50.0)
    chi2[3] = 400.0
    gap = SimpleNamespace(p=1e-10, closable=90.0, fit=None)
    left = {COUNT: gap, COUNT - 1: SimpleNamespace(p=0.1, closable=20.0) if carried else gap}
    monkeypatch.setattr(conclusions, "ceiling", lambda problem, fit_, mass: left[int(fit_.good.sum())])
    monkeypatch.setattr(conclusions, "missed", lambda *_: [])
    table, no = np.zeros((COUNT, 1)), np.zeros(COUNT, bool)
    flown = Evaluation(table, table, no, ~no, table, table, [], np.zeros(COUNT, int))
    base = replace(fitted("", chi2), fit=replace(fit(chi2, decrement=40.0), evaluation=flown))
    context = SimpleNamespace(options=OPTIONS, training=None, held_out=None, scales=SimpleNamespace(mass=1.0))
    decision = Decision("none", [], [], [], [SimpleNamespace(base=base)], gap, None)
    best = scored(np.full(COUNT, 1.0), np.zeros(COUNT))
    assert conclusions.give_up(context, decision, best).outcome == outcome


@pytest.mark.parametrize("gained", [0.5, 30.0])
def test_the_base_is_fitted_again_from_a_lower_minimum_though_no_candidate_converged(monkeypatch, gained):
    base = fitted("", np.full(COUNT, 100.0))
    one = scored(np.full(COUNT, gained / COUNT), np.zeros(COUNT))
    one.fitted.fit.decrement = 100.0
    lower = fit(np.full(COUNT, 100.0 - 2 * gained / COUNT))
    fits = iter([base.fit, lower])
    monkeypatch.setattr(one_effect, "shared_values", lambda *_: None)
    monkeypatch.setattr(one_effect, "minimise", lambda *_, **__: next(fits))
    found = one_effect.renewed(SimpleNamespace(), SimpleNamespace(base=base, scored=[one]))
    assert (found is not None and found.fit is lower) == (gained > 1)


@pytest.mark.parametrize(("decrement", "exhausted", "gain", "settled"), [
    (12.0, True, 1000.0, True),
    (12.0, True, 100.0, False),
    (12.0, False, 1000.0, False),
    (0.1, False, 1.0, True),
])  # fmt: skip
def test_a_kink_from_where_little_of_the_gain_is_missing_is_the_end_of_a_fit(
    decrement, exhausted, gain, settled
):
    """As Stribeck friction that gains 1300 and of which steps of no length gain the 12 that one promises."""
    one = scored(np.full(COUNT, gain / COUNT), np.zeros(COUNT))
    one.fitted.fit.decrement, one.fitted.fit.exhausted = decrement, exhausted
    assert one.settled == settled
    one.fitted.fit.in_local_minimum = True
    assert not one.settled


@pytest.mark.parametrize(("training", "rivals"), [(-10.0, ["viscous"]), (-2.0, []), (5.0, [])])
def test_a_name_that_the_fitted_records_clearly_contradict_is_not_distinguished(
    monkeypatch, training, rivals
):
    """As of two drags of which one is 10 ahead where it was fitted, the other 20 where it was predicted."""
    monkeypatch.setattr(scoring, "share_with_imperfections", lambda *_: 1.0)
    monkeypatch.setattr(scoring, "ahead", lambda one, other: 20.0)
    pool = [contender("quadratic_drag", 1000.0), contender("viscous", 1000.0)]
    pool[0].training += training
    for one, held_out in zip(pool, (20.0, 0.0), strict=True):
        one.prediction, one.held_out = SimpleNamespace(), held_out
    best, close = best_of(pool, OPTIONS)
    assert best.name == "quadratic_drag"
    assert [one.name for one in close] == rivals


@pytest.mark.parametrize("better", [80.0, 20.0])
def test_an_effect_alone_follows_the_set_that_closes_the_gap(monkeypatch, better):
    """A set must not be compared with a machine in a minimum that the set left."""
    alone = [contender("second_barrier", 50.0), contender("sensor_gain", 40.0), contender("viscous", 30.0)]
    led = contender("second_barrier", better)
    names = ("second_barrier", "sensor_gain")
    whole = replace(alone[0], fitted=replace(alone[0].fitted, names=names))
    first = SimpleNamespace(base=None, predicted=None, scored=list(alone), rank=lambda: None)
    asked = []

    def warm_started_by(data, one, other):
        asked.append(one.names)
        return led.fitted if one.names == led.fitted.names else one

    monkeypatch.setattr(several, "warm_started_by", warm_started_by)
    monkeypatch.setattr(several, "scored", lambda *_: led)
    context = SimpleNamespace(training=None, predict=lambda *_: None)
    part = several._warm_started_by(context, first, whole, alone[0])
    assert asked == [("second_barrier",), ("sensor_gain",)]
    assert part is (led if better > 50 else alone[0])
    assert first.scored == [part, *alone[1:]]


@pytest.mark.parametrize(("information", "imperfections", "needed"), [
    (1e-3, 0.0, True),
    (1e3, 0.0, False),
    # imperfections of the rig explain what it does
    (1e-3, 79.0, False),
])  # fmt: skip
def test_an_effect_of_a_set_is_needed_where_held_out_records_have_no_information(
    monkeypatch, information, imperfections, needed
):
    """As of restitution in impacts of one speed, which noise makes 0.5 worse there."""

    def one(*names, evidence):
        return ScoredCandidate(
            replace(base, names=names), SimpleNamespace(), evidence + 1, 0.0, np.zeros(0), 1
        )

    def weigh(context, one):
        if one.imperfections is None:
            one.imperfections = (imperfections, 0.0)

    base = fitted("", np.full(COUNT, 100.0))
    whole = one("quadratic_drag", "restitution_slope", evidence=100.0)
    whole.imperfections = (0.0, 0.0)
    parts = {name: one(name, evidence=20.0) for name in whole.fitted.names}
    over = {
        "restitution_slope": predicted(np.ones(12), np.ones(12)),
        "quadratic_drag": predicted(np.array([*6 * [0.95], *6 * [-1.0]]), np.full(12, information)),
    }
    monkeypatch.setattr(several, "without", lambda *_: parts["restitution_slope"])
    monkeypatch.setattr(several, "weigh_imperfections", weigh)
    monkeypatch.setattr(several, "over_base", lambda context, base, *_: over[base.names[0]])
    context = SimpleNamespace(options=OPTIONS)
    assert several._all_needed(context, None, whole, parts["quadratic_drag"]) == needed


def test_each_of_several_effects_is_held_against_its_family(monkeypatch):
    """Where an effect of the family has nearly as much evidence alone and nobody tried it in the set."""

    def named(*names):
        return replace(contender(names[-1], 10.0), fitted=replace(fitted(names[-1], np.ones(2)), names=names))

    alone = [contender(name, size) for name, size in (("viscous", 100.0), ("quadratic_drag", 90.0),
                                                      ("stribeck", 5.0), ("offset_force", 95.0),
                                                      ("cubic_spring", 80.0))]  # fmt: skip
    tried = []

    def fit_set(context, first, names):
        tried.append(tuple(names))
        return names

    monkeypatch.setattr(several, "fit_set", fit_set)
    monkeypatch.setattr(several, "over_base", lambda context, base, predicted, made: made)
    monkeypatch.setattr(several, "admissible", lambda *_: (True, ""))
    first = SimpleNamespace(scored=alone, base=None, predicted=None)
    context = SimpleNamespace(options=OPTIONS)
    whole = named("viscous", "cubic_spring")
    assert list(several._swapped(context, first, whole, [whole])) == [["quadratic_drag", "cubic_spring"]]
    assert tried == [("quadratic_drag", "cubic_spring")]
    known = [whole, named("cubic_spring", "quadratic_drag")]
    assert list(several._swapped(context, first, whole, known)) == []


@pytest.mark.parametrize(("decrement", "predicts", "outcome"), [
    (100.0, False, "none"),
    (100.0, True, "named"),
    (0.0, False, "ambiguous"),
])  # fmt: skip
def test_a_name_over_a_base_that_is_not_at_its_minimum_needs_the_held_out_record(
    monkeypatch, decrement, predicts, outcome
):
    """As a contact that is as stiff as a rigid one, from where the base left a wrong minimum."""
    monkeypatch.setattr(conclusions, "_gap_of_base", lambda *_: ([], False))
    base = fitted("", np.full(COUNT, 60.0))
    base.fit.decrement = decrement
    best = scored(np.full(COUNT, 5.0), np.zeros(COUNT))
    best.gates = {"hold-out": predicts, "admissible": True, "converged": True}
    decision = Decision("none", [], [], [], [SimpleNamespace(base=base)], None, None)
    options, data = replace(OPTIONS, adequate_chi2=2.0), SimpleNamespace(prepared=[])
    context = SimpleNamespace(options=options, training=data)
    assert conclusions.conclude(context, decision, best, []).outcome == outcome


def test_forms_of_one_family_leave_the_family_in_no_doubt():
    def one(*names: str, **gates: bool) -> SimpleNamespace:
        return SimpleNamespace(fitted=SimpleNamespace(names=names), gates={"separate": False} | gates)

    def families(best, *rivals, outcome="ambiguous") -> list[str]:
        return Decision(outcome, [best], [], list(rivals), [], None, None).in_families

    drag = one("quadratic_drag", adequate=True)
    assert families(drag, one("viscous"), one("friction_curve")) == ["friction over speed"]
    assert families(drag, one("viscous"), one("offset_force")) == []
    # without a rival something else is in doubt, as where another gate failed
    assert families(drag) == families(one("quadratic_drag", stable=False), one("viscous")) == []
    pair = one("cubic_spring", "viscous")
    both = ["friction over speed", "spring over extension"]
    assert families(pair, one("quadratic_drag", "cubic_spring")) == both
    assert families(pair, one("quadratic_drag")) == []


def test_rest_does_not_lower_the_speed_that_a_stribeck_velocity_is_compared_with():
    """Nor do samples beside a short segment, or segments that are not followed."""
    v = np.array([[0.3, 0.0, -0.3, 0.0], [0.3, 0.3, 7.0, 7.0], [9.0, 9.0, 9.0, 9.0]])
    inside = np.array([[True] * 4, [True, True, False, False], [True] * 4])
    evaluation = SimpleNamespace(v=v)
    moving = SimpleNamespace(
        fit=SimpleNamespace(evaluation=evaluation, good=np.array([True, True, False])),
        problem=SimpleNamespace(segments=SimpleNamespace(inside=inside)),
    )
    assert sliding_speed(moving) == pytest.approx(0.3)
    evaluation.v = np.zeros_like(v)
    assert sliding_speed(moving) == 0
