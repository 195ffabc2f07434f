# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Laws of the numerics of the discovery workflow that need no simulator."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import savgol_filter
from separatrix.discovery.decision import plan, rounds
from separatrix.discovery.decision.scoring import ScoredCandidate
from separatrix.discovery.decision.stages import (
    conclusions,
    function,
    in_part,
    one_effect,
    several_effects,
)
from separatrix.discovery.decision.state import Choice, SearchState
from separatrix.discovery.decision.where import benjamini_hochberg
from separatrix.discovery.fitting import base as base_module
from separatrix.discovery.fitting import fit as fit_module
from separatrix.discovery.fitting import screen as screen_module
from separatrix.discovery.fitting.base import measure_noise
from separatrix.discovery.fitting.catalogue import names_of_body
from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.fit import blocking, minimise
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.noise import Noise
from separatrix.discovery.fitting.normal_equations import (
    blocks_of,
    eliminate,
    gauss_newton_step,
    inverse_scaled,
)
from separatrix.discovery.fitting.screen import project
from separatrix.discovery.measured.signals import white_noise
from separatrix.discovery.measured.smoother import impact_table, smooth
from separatrix.discovery.options import Options
from separatrix.discovery.policy import FIT

SEGMENTS, SAMPLES, PARAMETERS = 7, 12, 4


@pytest.fixture
def table() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Random derivatives and residuals of segments, some samples without weight."""
    random = np.random.default_rng(5)
    by_start = random.standard_normal((SEGMENTS, SAMPLES, 2))
    by_parameter = random.standard_normal((SEGMENTS, SAMPLES, PARAMETERS))
    residual = random.standard_normal((SEGMENTS, SAMPLES))
    weights = (random.random((SEGMENTS, SAMPLES)) < 0.8).astype(float)
    return by_start, by_parameter, residual, weights


def dense(by_start, by_parameter, weights):
    """The whole matrix, starts first."""
    matrix = np.zeros((SEGMENTS * SAMPLES, 2 * SEGMENTS + PARAMETERS))
    for k in range(SEGMENTS):
        rows = slice(k * SAMPLES, (k + 1) * SAMPLES)
        matrix[rows, 2 * k : 2 * k + 2] = by_start[k]
        matrix[rows, 2 * SEGMENTS :] = by_parameter[k]
    return matrix * np.sqrt(weights).ravel()[:, None]


def test_block_elimination_is_the_dense_least_squares_step(table):
    by_start, by_parameter, residual, weights = table
    blocks = blocks_of(by_start, by_parameter, residual, weights)
    starts, step, promised = gauss_newton_step(blocks, np.ones(PARAMETERS, bool))
    matrix = dense(by_start, by_parameter, weights)
    right = (np.sqrt(weights) * residual).ravel()
    wanted, left, *_ = np.linalg.lstsq(matrix, right, rcond=None)
    assert starts.ravel() == pytest.approx(wanted[: 2 * SEGMENTS], abs=1e-10)
    assert step == pytest.approx(wanted[2 * SEGMENTS :], abs=1e-10)
    assert promised == pytest.approx(right @ right - left[0], rel=1e-10)


def test_a_closed_parameter_stays(table):
    by_start, by_parameter, residual, weights = table
    open_ = np.array([True, False, True, True])
    _, step, _ = gauss_newton_step(blocks_of(by_start, by_parameter, residual, weights), open_)
    _, other, _ = gauss_newton_step(
        blocks_of(by_start, by_parameter[:, :, open_], residual, weights), open_[open_]
    )
    assert step[1] == 0
    assert step[open_] == pytest.approx(other, abs=1e-12)


def test_a_step_that_would_leave_a_bound_ends_there_and_the_others_go_on_from_it(table):
    """Clipped alone, it leaves the others a step that belongs to another one, and a fit creeps to a bound."""
    by_start, by_parameter, residual, weights = table
    blocks, open_ = blocks_of(by_start, by_parameter, residual, weights), np.ones(PARAMETERS, bool)
    _, free, _ = gauss_newton_step(blocks, open_)
    room = -np.full(PARAMETERS, np.inf), np.full(PARAMETERS, np.inf)
    side = 0 if free[1] < 0 else 1
    room[side][1] = 0.1 * free[1]
    starts, step, promised = gauss_newton_step(blocks, open_, room=room)
    assert step[1] == pytest.approx(0.1 * free[1])
    kept = np.array([True, False, True, True])
    left = residual - by_parameter[:, :, 1] * step[1]
    _, others, _ = gauss_newton_step(
        blocks_of(by_start, by_parameter[:, :, kept], left, weights), open_[kept]
    )
    assert step[kept] == pytest.approx(others, abs=1e-12)
    ends = residual - np.einsum("klq,kq->kl", by_start, starts) - by_parameter @ step
    assert promised == pytest.approx(np.sum(weights * (residual**2 - ends**2)), rel=1e-9)


def test_an_inverse_does_not_depend_on_the_units_and_leaves_out_what_is_not_known():
    random = np.random.default_rng(5)
    table = random.standard_normal((20, 5))
    # one unknown without information, one the sum of two others, in units as of stiffness and of time
    table[:, 1] = 0
    table[:, 4] = table[:, 2] + table[:, 3]
    known = np.array([True, False, True, True, True])
    matrix = table.T @ table
    inverse = inverse_scaled(matrix, known)
    assert (inverse[1] == 0).all()
    assert (inverse[:, 1] == 0).all()
    # it is the covariance of what the data determine: the sum of both is known, each by itself is not
    assert np.allclose(matrix @ inverse @ matrix, matrix)
    units = np.array([1e-9, 1.0, 1e7, 1e7, 1e7])
    other = inverse_scaled(matrix * np.outer(units, units), known)
    assert np.allclose(other * np.outer(units, units), inverse)


def test_projection_leaves_what_a_regression_leaves(table):
    """The score of the last column, others projected out, is that of its residual regression."""
    by_start, by_parameter, residual, weights = table
    matrix, gradient = eliminate(blocks_of(by_start, by_parameter, residual, weights))[0].total()
    left, score = project(matrix, gradient, PARAMETERS - 1, np.ones(PARAMETERS - 1, bool))
    whole = dense(by_start, by_parameter, weights)
    right = (np.sqrt(weights) * residual).ravel()
    others, last = whole[:, :-1], whole[:, -1]
    clean = last - others @ np.linalg.lstsq(others, last, rcond=None)[0]
    assert left[0, 0] == pytest.approx(clean @ clean, rel=1e-9)
    assert score[0] == pytest.approx(clean @ right, rel=1e-9)


def bouncing(noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A ball that is thrown against a wall at x = 0 every 0.5 s: times, noisy positions, speeds."""
    t = np.arange(0, 4, 0.005)
    # impacts fall between samples
    phase = np.mod(t + 0.0025, 0.5)
    x, v = -2 * phase + 4 * phase**2, -2 + 8 * phase
    return t, x + noise * np.random.default_rng(3).standard_normal(t.size), v


def test_smoother_beats_a_moving_polynomial_through_impacts():
    t, x, v = bouncing(2e-3)
    smoothed = smooth(t, x, 2e-3, 100)
    inner = slice(20, -20)
    error = np.sqrt(np.mean((smoothed.v - v)[inner] ** 2))
    best = min(
        np.sqrt(np.mean((savgol_filter(x, window, 2, deriv=1, delta=0.005) - v)[inner] ** 2))
        for window in (5, 7, 9, 11, 15, 21, 31)
    )
    assert error < 0.8 * best


def test_impacts_come_back_with_their_speeds_within_their_errors():
    t, x, _ = bouncing(2e-3)
    found = impact_table(smooth(t, x, 2e-3, 100))
    assert found[:, 0] == pytest.approx(np.arange(0.5, 4, 0.5), abs=0.005)
    assert np.abs(found[:, 1]).max() < 0.01
    assert np.all(np.abs(found[:, 2] - 2) < 4 * found[:, 4])
    assert np.all(np.abs(found[:, 3] + 2) < 4 * found[:, 5])


def test_no_impact_is_seen_in_a_smooth_motion():
    t = np.arange(0, 10, 0.01)
    x = np.sin(2 * np.pi * t) + 1e-3 * np.random.default_rng(1).standard_normal(t.size)
    assert smooth(t, x, 1e-3, 100).impacts.size == 0


def test_noise_is_measured():
    t = np.arange(0, 10, 0.002)
    x = np.sin(2 * np.pi * t) + 1e-3 * np.random.default_rng(2).standard_normal(t.size)
    assert white_noise(x) == pytest.approx(1e-3, rel=0.05)


def test_false_flags_are_rare():
    """Of maps without any gap, at most one in a hundred has a flag."""
    random = np.random.default_rng(8)
    assert sum(benjamini_hochberg(random.random(60), 0.01).any() for _ in range(1000)) < 25
    assert benjamini_hochberg(np.array([1e-9, 0.5, 0.7]), 0.01).tolist() == [True, False, False]


def test_what_was_not_tested_is_in_the_order_of_the_catalogue(monkeypatch):
    names = ["viscous", "dahl", "cubic_spring", "offset_force", "sensor_delay"]
    fits = SimpleNamespace(values=[], reduced_chi2=1.0, like_noise=lambda _: False)
    monkeypatch.setattr(
        rounds,
        "candidate_of",
        lambda *words: "the machine has no friction" if words[3] == "dahl" else object(),
    )
    monkeypatch.setattr(rounds, "signature", lambda *_: None)
    monkeypatch.setattr(rounds, "screen", lambda *_: None)
    monkeypatch.setattr(rounds, "choose", lambda *_: [])
    context = rounds.SearchContext(None, None, None, Options(candidates=tuple(reversed(names))))
    problem = SimpleNamespace(free=[], effects=names_of_body, cannot_show=lambda _: "")
    base = SimpleNamespace(names=(), model=SimpleNamespace(parameters={}), problem=problem, fit=fits)
    found = rounds.run_round(context, base, None)
    assert list(found.absent) == names
    assert found.absent["dahl"] == "the machine has no friction"


def test_signatures_that_vanish_do_not_stop_the_screen():
    # of two signatures one is rounding: its square is nothing, its products with the other are not
    left = np.array([[4.0, 1e-17], [1e-17, 0.0]])
    tests = screen_module._independent_tests(left, np.array([0, 1, 2]), [np.array([[0.5]]), np.zeros((0, 1))])
    assert 1 <= tests <= 2


def test_a_candidate_without_a_prediction_is_clearly_behind():
    far = SimpleNamespace(prediction=None)
    assert in_part._clearly(SimpleNamespace(prediction=object()), far, None)


class Residuals:
    """One segment with residuals that depend on one value, and what is taken for minus their slope."""

    def __init__(self, of, slope) -> None:
        self.free, self.of, self.slope = [Free("effect.viscous.damping", 0.0)], of, slope

    def evaluate(self, values, starts, derivatives=True):
        residual = self.of(values[0])[None, :]
        no, by_start = np.zeros(1, bool), np.zeros((1, residual.size, 2))
        # the start belongs to two samples that nothing else touches
        by_start[0, [0, 1], [0, 1]] = 1
        slope = self.slope(values[0])[None, :, None]
        used = np.ones_like(residual)
        return Evaluation(residual, used, no, ~no, residual, residual, [], 0, by_start, slope)

    def left_over(self) -> tuple[np.ndarray, np.ndarray]:
        """No condensed blocks."""
        return np.zeros(1), np.zeros(1)


def test_a_fit_ends_at_a_kink_only_after_steps_of_every_length():
    """Chi^2 is least where the slope changes its sign, so that a step promises what no length delivers."""
    random = np.random.default_rng(8)
    left, along = random.standard_normal(60), np.zeros(60)
    left[:2] = 0
    along[2:] = left[2:] / np.linalg.norm(left)
    kink = Residuals(
        lambda value: left + (abs(value) - np.linalg.norm(left) + 1.3) * along,
        lambda value: along * (-1 if value >= 0 else 1),
    )
    fit = minimise(kink, np.array([0.7]), np.zeros((1, 2)))
    assert fit.values[0] == pytest.approx(0, abs=0.05)
    assert 1 < fit.decrement < 4
    assert fit.exhausted
    assert fit.converged
    smooth = Residuals(lambda value: left + value * along, lambda _: -along)
    fit = minimise(smooth, np.array([0.7]), np.zeros((1, 2)))
    assert not fit.exhausted
    assert fit.converged
    # a slope that is wrong throughout ends nowhere near
    lost = Residuals(lambda value: left + value * along, lambda _: along)
    fit = minimise(lost, np.array([0.7]), np.zeros((1, 2)))
    assert fit.exhausted
    assert not fit.converged


class Valley:
    """Two values: their difference from a curve counts a hundred times as much as the position along it."""

    free = (Free("effect.stribeck.excess", 0.0), Free("effect.stribeck.velocity", 0.0))

    def evaluate(self, values, starts, derivatives=True):
        a, b = values
        across, along = np.linspace(1, 3, 60) * 300, np.linspace(-1, 1, 60)
        across[:2] = along[:2] = 0
        residual = ((b - np.sin(4 * a) - a**2) * across + 20 * (a - 3) * along)[None]
        slope = -np.stack([(-4 * np.cos(4 * a) - 2 * a) * across + 20 * along, across], axis=1)[None]
        no, by_start = np.zeros(1, bool), np.zeros((1, 60, 2))
        by_start[0, [0, 1], [0, 1]] = 1
        return Evaluation(
            residual, np.ones_like(residual), no, ~no, residual, residual, [], 0, by_start, slope
        )

    def left_over(self) -> tuple[np.ndarray, np.ndarray]:
        """No condensed blocks."""
        return np.zeros(1), np.zeros(1)


def test_a_step_follows_a_bent_valley(monkeypatch):
    """Of laws of friction that nearly imitate each other the straight steps only creep."""
    begin = np.array([0.0, 0.0])
    found = minimise(Valley(), begin, np.zeros((1, 2)), most=200, patient=True)
    assert found.converged
    assert found.values == pytest.approx([3, 9 + np.sin(12)], abs=0.01)
    monkeypatch.setattr(fit_module, "FIT", replace(FIT, fit_curved_most=0.0))
    straight = minimise(Valley(), begin, np.zeros((1, 2)), most=found.iterations, patient=True)
    assert not straight.converged


def test_derivatives_are_kept_while_steps_gain_what_they_promise():
    """A bent line is fitted with fewer derivatives than steps; the last ones are those of the end."""
    random = np.random.default_rng(9)
    noise, along = random.standard_normal(60), np.linspace(0.5, 1.5, 60)
    noise[:2] = along[:2] = 0
    asked = []

    def bent(value: float) -> np.ndarray:
        return value + 0.02 * value**2

    class Counted(Residuals):
        def evaluate(self, values, starts, derivatives=True):
            asked.append(derivatives)
            return super().evaluate(values, starts, derivatives)

    problem = Counted(
        lambda value: noise + 40 * bent(value) * along, lambda value: -40 * (1 + 0.04 * value) * along
    )
    fit = minimise(problem, np.array([3.0]), np.zeros((1, 2)), tolerance=1e-6)
    best = -(noise @ along) / (40 * along @ along)
    assert bent(fit.values[0]) == pytest.approx(best, abs=1e-4)
    assert fit.converged
    slope = fit.evaluation.by_parameter[0, :, 0]
    np.testing.assert_array_equal(slope, -40 * (1 + 0.04 * fit.values[0]) * along)
    assert asked.count(True) < asked.count(False)


def test_a_fit_that_cannot_come_near_another_is_given_up():
    random = np.random.default_rng(10)
    left = 5 * random.standard_normal(60)
    hard = Residuals(
        lambda value: left + 0.1 * np.tanh(value + np.arange(60)), lambda value: np.full(60, -0.01)
    )
    begin = np.array([0.7])
    whole = minimise(hard, begin, np.zeros((1, 2)), patient=True, most=40)
    short = minimise(hard, begin, np.zeros((1, 2)), patient=True, most=40, beat=60.0)
    assert whole.total > 60 + 100
    assert short.iterations <= min(4, whole.iterations)


def test_a_segment_that_cannot_be_flown_is_followed_badly():
    one = minimise(
        Residuals(lambda _: np.full(60, 1.0), lambda _: np.zeros(60)), np.zeros(1), np.zeros((1, 2)), most=0
    )
    assert not one.far_off(4.0)
    one.evaluation.failed[0] = True
    assert one.far_off(4.0)


class Jumping(Residuals):
    """Three segments that a straight line follows; the last may jump or fail beyond a value."""

    def __init__(self, jump: float, fails: bool) -> None:
        self.free, self.jump, self.fails = [Free("effect.viscous.damping", 0.0)], jump, fails

    def evaluate(self, values, starts, derivatives=True):
        residual = np.full((3, 20), float(values[0]))
        # the start belongs to two samples that nothing else touches
        residual[:, :2] = 0
        by_start = np.zeros((3, 20, 2))
        by_start[:, [0, 1], [0, 1]] = 1
        slope = -np.where(np.arange(20) < 2, 0.0, np.ones((3, 20)))[:, :, None]
        failed = np.zeros(3, bool)
        if values[0] < 1:
            residual[2, 2:] += self.jump
            failed[2] = self.fails
        used = np.ones_like(residual)
        return Evaluation(
            residual, used, failed, ~np.zeros(3, bool), residual, residual, [], 0, by_start, slope
        )


@pytest.mark.parametrize(("jump", "fails", "barred"), [
    (0.0, False, []),
    # from 18*2**2 in each of three segments: a segment alone loses more than all gain, or less
    (4.5, False, [2]),
    (2.5, False, []),
    (0.0, True, [2]),
])  # fmt: skip
def test_a_segment_bars_the_way_of_a_step_where_it_loses_more_than_all_gain(jump, fails, barred):
    found = blocking(Jumping(jump, fails), np.array([2.0]), np.zeros((3, 2)))
    np.testing.assert_array_equal(found, barred)


@pytest.mark.parametrize(("channels", "of_v"), [(2, 0.2), (1, 0.1)])
def test_the_noise_of_the_velocity_leaves_that_of_the_position(monkeypatch, channels, of_v):
    """Only the quiet record has v; the memory of the noise is kept, because the machine misses nothing.

    Where the force is compared its noise is none of the velocity.
    """
    answers = {0: Noise({0: 1.0, 1: 1.0}, 0.5), 1: Noise({0: 2.0}, 0.0)}
    monkeypatch.setattr(base_module, "noise_of", lambda _problem, _fit, channel, *_: answers[channel])
    prepared = [
        SimpleNamespace(
            sigma=sigma,
            sigma_stated=False,
            resolution=0.0,
            velocity_sigma=0.1,
            velocity_sigma_stated=False,
            memory=0.0,
            record=SimpleNamespace(v=v),
        )
        for sigma, v in ((1e-3, np.zeros(3)), (1e-2, None))
    ]
    data = SimpleNamespace(prepared=prepared, measured_by_sensor=lambda *_: False)
    measure_noise(data, SimpleNamespace(channels=channels), SimpleNamespace(reduced_chi2=1.0), 1.0)
    assert [one.memory for one in prepared] == [0.5, 0.5]
    assert [one.velocity_sigma for one in prepared] == [of_v, 0.1]


@pytest.mark.parametrize("renewed", [False, True])
def test_fits_stand_as_long_as_their_base(monkeypatch, renewed):
    """Fits of an earlier round on the very same base are kept and the others follow; else all are redone."""
    fitted_now = []

    def fit_one(data, base, one, screened, rival, quick, known):
        fitted_now.append((one.names[-1], known is not None))
        return SimpleNamespace(names=one.names, fit=SimpleNamespace(converged=True), gain=1.0)

    def score_one(base, predicted, one, prediction):
        return ScoredCandidate(one, prediction, one.gain, 0.0, np.zeros(0), 0)

    monkeypatch.setattr(
        rounds, "candidate_of", lambda model, free, names, name, _: SimpleNamespace(names=(*names, name))
    )
    gain = {"dahl": 1.0, "viscous": 2.0}
    seen = SimpleNamespace(seen=lambda name: True, names=list(gain), gain=gain)
    monkeypatch.setattr(rounds, "signature", lambda *_: SimpleNamespace())
    monkeypatch.setattr(rounds, "screen", lambda *_: seen)
    monkeypatch.setattr(rounds, "refit", fit_one)
    monkeypatch.setattr(rounds, "scored", score_one)
    monkeypatch.setattr(rounds, "gain_over", lambda one, other: (one.gain - other.gain, None))
    monkeypatch.setattr(rounds, "_far_behind", lambda *_: False)
    monkeypatch.setattr(rounds, "_simplest", lambda context, found, one: one)
    for step in ("_carry_on", "_cross", "_fair"):
        monkeypatch.setattr(rounds, step, lambda *_: None)
    fits = SimpleNamespace(values=[], reduced_chi2=1.0, like_noise=lambda _: False)
    base = SimpleNamespace(
        names=(),
        model=SimpleNamespace(parameters={}),
        problem=SimpleNamespace(free=[], effects=names_of_body, cannot_show=lambda _: ""),
        fit=fits,
    )
    context = rounds.SearchContext(None, None, None, Options(candidates=("dahl", "viscous")))
    monkeypatch.setattr(rounds, "choose", lambda *_: ["viscous"])
    earlier = rounds.run_round(context, base, None)
    assert fitted_now == [("viscous", False)]
    fitted_now.clear()
    monkeypatch.setattr(rounds, "choose", lambda *_: ["viscous", "dahl"])
    again = SimpleNamespace(**vars(base)) if renewed else base
    found = rounds.run_round(context, again, None, earlier, everything=True)
    assert {one.name for one in found.scored} == {"dahl", "viscous"}
    assert fitted_now == ([("viscous", True), ("dahl", False)] if renewed else [("dahl", False)])


def test_the_noise_is_measured_again_where_several_effects_leave_nothing_else(monkeypatch):
    """Its memory passes for a gap as long as no single effect comes near it; the search then begins anew."""
    measured, closed = [], iter([False, True])
    gates = {"adequate": False, "detect": True, "stable": True}
    pair = SimpleNamespace(fitted=SimpleNamespace(names=("a", "b"), fit=SimpleNamespace(like_noise=bool)))
    single = SimpleNamespace(gates=gates, fitted=SimpleNamespace(names=("a",)))
    base = Fitted((), None, SimpleNamespace(), SimpleNamespace(values=None, starts=None), ())

    def renewing(context, found, known, everything=False):
        measured.append(known)
        return found

    def run_round(context, base, *_):
        return SimpleNamespace(base=base, scored=[single], predicted=None)

    monkeypatch.setattr(one_effect, "run_round", run_round)
    monkeypatch.setattr(one_effect, "_renewing", renewing)
    monkeypatch.setattr(one_effect, "_gap", lambda *_: None)
    monkeypatch.setattr(one_effect, "lead", lambda *_: Choice(single, []))
    monkeypatch.setattr(function, "as_function", lambda *_: None)
    monkeypatch.setattr(several_effects, "with_more", lambda *_: (pair, [], next(closed)))
    monkeypatch.setattr(several_effects, "noise_renewed", lambda *_: True)
    monkeypatch.setattr(several_effects, "minimise", lambda *_, **__: "fitted again")
    monkeypatch.setattr(
        conclusions, "conclude", lambda _, decision, best, rivals: replace(decision, accepted=[best])
    )
    upto = [one.name for one in plan.PLAN].index("no machine")
    monkeypatch.setattr(plan, "PLAN", plan.PLAN[: upto + 1])
    context = rounds.SearchContext(None, None, None, Options(quick=True))
    found = plan.search(SearchState(context, base))
    assert (found.decision.accepted, measured) == ([pair], [False, True])
    assert found.decision.rounds[0].base.fit == "fitted again"
