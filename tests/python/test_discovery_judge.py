# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a name needs: to pay in most resamplings, to beat its rivals, and a fit that is at its end."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.decision import decide
from separatrix.discovery.decision.gates import foremost
from separatrix.discovery.decision.judge import Judged, _together_clear, held_out_bounds, stable
from separatrix.discovery.fitting.fit import Fit
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
    return Fit(np.ones(1), starts, flown, None, chi2, 50 * ones, decrement, 1, open_, ~open_)


def fitted(name: str, chi2: np.ndarray) -> Fitted:
    problem = SimpleNamespace(free=[Free(f"effect.{name}.force", 1.0)])
    return Fitted((name,) if name else (), None, problem, fit(chi2), (0,))


def judged(gains: np.ndarray, held_out: np.ndarray) -> Judged:
    """A candidate that gains so much log-likelihood by segment over a base with chi^2 of 100 in each."""
    one = fitted("coulomb", 100 - 2 * gains)
    prediction = SimpleNamespace(misfit=1.0)
    return Judged(one, prediction, float(gains.sum()), float(held_out.sum()), held_out, 1)


def test_an_effect_that_a_few_segments_carry_needs_the_held_out_record():
    base = fitted("", np.full(COUNT, 100.0))
    few, even = np.zeros(COUNT), np.full(COUNT, 2.0)
    few[0] = 40.0
    assert stable(judged(even, 0 * even), base, OPTIONS) > OPTIONS.inclusion
    assert stable(judged(few, 0 * even), base, OPTIONS) < OPTIONS.inclusion
    assert stable(judged(few, even), base, OPTIONS) > OPTIONS.inclusion
    # a record that was never fitted makes no name by itself
    assert stable(judged(0.05 * few, even), base, OPTIONS) < OPTIONS.inclusion


def foretold(gains: np.ndarray, information: np.ndarray) -> Judged:
    """A candidate that gains so much by held-out segment, each with so much information on it."""
    one = judged(np.full(COUNT, 2.0), gains)
    one.prediction.record = np.zeros(gains.size, int)
    one.prediction.fit = SimpleNamespace(reduced=SimpleNamespace(matrix=information[:, None, None]))
    return one


def test_segments_that_say_nothing_of_an_effect_do_not_spoil_its_bounds():
    everywhere, ones = np.repeat([4.0, 6.0], 8), np.ones(16)
    low, high = held_out_bounds(foretold(everywhere, ones), OPTIONS)[0]
    assert 64 <= low < 80 < high <= 96
    # without an impact restitution cannot show; a segment that the base cannot follow was not compared
    quiet = np.concatenate([everywhere, np.full(10, 1e-4)])
    silent = np.concatenate([ones, np.full(10, 1e-9)])
    assert held_out_bounds(foretold(quiet, silent), OPTIONS)[0] == (low, high)
    lost = np.concatenate([everywhere, np.zeros(10)])
    assert held_out_bounds(foretold(lost, np.ones(26)), OPTIONS)[0] == (low, high)
    # one segment that tells, of many: odds of 20 to 1, either way
    for gain, helps in ((50.0, True), (2.9, False), (-50.0, False)):
        one = np.array([gain, *12 * [0.0]])
        low, high = held_out_bounds(foretold(one, np.ones(13)), OPTIONS)[0]
        assert (low > 0) == helps
        assert (high > OPTIONS.harm) == (gain > -6)


def contender(name: str, evidence: float) -> Judged:
    one = fitted(name, np.full(COUNT, 47.0))
    return Judged(one, None, evidence + 1, 0.0, np.zeros(0), 1)


@pytest.mark.parametrize(("other", "behind", "rivals"), [
    ("stribeck", 2.9, ["stribeck"]),
    ("stribeck", 3.1, []),
    ("asymmetric_friction", 5.9, ["asymmetric_friction"]),
    ("asymmetric_friction", 6.1, []),
])  # fmt: skip
def test_two_names_of_one_motion_need_more_to_be_told_apart(other, behind, rivals):
    pool = [contender("offset_force", 50.0), contender(other, 50.0 - behind)]
    best, close = foremost(pool, OPTIONS)
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
    bench = SimpleNamespace(training=None, held_out=None, options=OPTIONS)
    monkeypatch.setattr(decide, "missed", lambda data, fit, options: misses)
    gap = SimpleNamespace(closable=closable, p=p, best=SimpleNamespace(name="velocity"))
    effect = SimpleNamespace(training=gain / 2)
    given = decide._give_up(bench, decide.Decision("none", [], [], [], [found], gap, None), effect)
    assert given.outcome == outcome
    # the same gap of the base, and no effect that stands out
    other = decide._without_name(bench, decide.Decision("none", [], [], [], [found], gap, None))
    assert other.outcome == ("none" if gain > 2.5 else outcome)
    (reason,) = given.reasons
    told = f"{np.sqrt(closable / 1000):.2g} of that of a sample (root mean square), p = {p:.2g}"
    assert (told in reason) == (outcome == "none")


@pytest.mark.parametrize(("name", "also", "two"), [
    ("friction_curve", None, True),
    ("friction_curve", "effect.friction_curve.backward_1", False),
    ("restitution_curve", None, False),
])  # fmt: skip
def test_a_table_of_friction_is_of_two_directions_unless_its_values_are_shared(name, also, two):
    one = fitted(name, np.full(COUNT, 47.0))
    one.problem.free = [Free(f"effect.{name}.force_1", 1.0, also=also)]
    assert decide._of_two_directions(Judged(one, None, 0.0, 0.0, np.zeros(0), 1)) == two
