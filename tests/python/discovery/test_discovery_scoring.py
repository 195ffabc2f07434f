# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a name needs: to pay in most resamplings, to beat its rivals, and a fit that is at its end."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from candidates import COUNT, OPTIONS, contender, fit, fitted, scored
from separatrix.discovery.decision import scoring, several
from separatrix.discovery.decision.gates import best_of
from separatrix.discovery.decision.scoring import (
    ScoredCandidate,
    beyond_doubt,
    held_out_bounds,
    predicts,
    sliding_speed,
    stable,
)
from separatrix.discovery.decision.stages import conclusions, one_effect
from separatrix.discovery.decision.state import Decision


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
