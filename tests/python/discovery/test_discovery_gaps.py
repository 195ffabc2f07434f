# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is left where no name fits: tables, functions, and gaps that some segments alone carry."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from candidates import COUNT, OPTIONS, fit, fitted, scored
from separatrix.discovery.decision import flexible
from separatrix.discovery.decision.scoring import (
    ScoredCandidate,
    _together_clear,
)
from separatrix.discovery.decision.stages import conclusions, function
from separatrix.discovery.decision.state import Choice, Decision, SearchState
from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.machine import Free


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
