# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two machines compared on held-out records, and the choice among machines that are all wrong."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm
from separatrix.discovery.decision.misfit import predicted_chi2, refuted
from separatrix.discovery.decision.scoring import ScoredCandidate
from separatrix.discovery.decision.stages.in_part import preferred
from separatrix.discovery.fitting.heldout import Prediction, _records_own, ahead, gained, gained_together
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.options import Options

SEGMENTS = 40


def prediction(chi2, score, misfit):
    """A prediction of segments with these squared errors and scores."""
    chi2 = np.asarray(chi2, float)
    every = np.ones(chi2.size, bool)
    fit = SimpleNamespace(chi2=chi2, counts=np.full(chi2.size, 50), good=every, converged=True)
    problem = SimpleNamespace(free=[], model=SimpleNamespace(parameters={}))
    return Prediction(
        np.asarray(score, float), every, np.zeros(chi2.size, int), problem, fit, misfit, np.zeros((0, 0))
    )


def candidate(predicted, parameters, training):
    """A candidate with nothing but what the choice needs."""
    count = predicted.good.size
    fit = SimpleNamespace(
        reduced_chi2=predicted.misfit,
        chi2=np.full(count, -2 * training / count),
        good=predicted.good,
        counts=predicted.fit.counts,
        at_bound=np.zeros(parameters, bool),
        evaluation=SimpleNamespace(failed=~predicted.good, steady=predicted.good),
    )
    free = [SimpleNamespace(record=None, positive=True) for _ in range(parameters)]
    fitted = SimpleNamespace(fit=fit, added=tuple(range(parameters)), problem=SimpleNamespace(free=free))
    # every segment has as much information
    predicted.fit.reduced = SimpleNamespace(matrix=np.tile(np.eye(parameters), (count, 1, 1)))
    return ScoredCandidate(fitted, predicted, training, 0.0, np.zeros(count), parameters)


def test_of_two_wrong_machines_the_one_with_smaller_errors_wins_however_uncertain_the_other():
    worse, better = prediction([900.0], [-10.0], 500.0), prediction([400.0], [-30.0], 80.0)
    assert gained(better, worse) == pytest.approx([250.0])
    assert gained(worse, better) == pytest.approx([-250.0])


@pytest.mark.parametrize("misfit", [1.0, 1.4])
def test_a_machine_near_the_noise_is_scored_by_its_predictive_density(misfit):
    wrong, right = prediction([90.0], [-40.0], 1.3), prediction([50.0], [-27.0], misfit)
    assert gained(right, wrong) == pytest.approx([13.0])


def test_candidates_over_one_base_are_ranked_as_against_each_other():
    """The density of a wrong base, its parameters hardly known, hides what a right machine gains over it."""
    base = prediction([9000.0], [-300.0], 600.0)
    wrong, right = prediction([900.0], [-100.0], 30.0), prediction([50.0], [-27.0], 1.0)
    assert gained(right, base) - gained(wrong, base) == pytest.approx(gained(right, wrong))
    assert gained(right, wrong) > 0


def test_segments_that_one_machine_cannot_fly_count_for_neither():
    one, other = prediction([4.0, 5.0], [-2.0, -2.5], 9.0), prediction([8.0, 9.0], [-4.0, -4.5], 9.0)
    one.good = np.array([True, False])
    assert gained(one, other) == pytest.approx([2.0, 0.0])


@pytest.mark.parametrize(("lead", "chosen"), [(0.0, 1), (40.0, 2)])
def test_more_parameters_are_taken_only_if_they_predict_better_beyond_chance(lead, chosen):
    scatter = np.random.default_rng(3).normal(0, 20, SEGMENTS)
    simple = candidate(prediction(np.full(SEGMENTS, 400.0), np.zeros(SEGMENTS), 8.0), 1, 5000.0)
    rich = candidate(prediction(400.0 - lead + scatter, np.zeros(SEGMENTS), 8.0), 2, 6000.0)
    best, rivals = preferred([simple, rich], Options())
    assert best.parameters == chosen
    assert rivals == []


def test_an_unknown_parameter_counts_once_however_many_segments_it_moves():
    """Residuals r = c p + noise, p known up to a spread: their density is that of a dense covariance."""
    random = np.random.default_rng(6)
    columns, spread = random.standard_normal((SEGMENTS, 50)), 0.3
    residual = columns * spread + random.standard_normal((SEGMENTS, 50))
    one = prediction((residual**2).sum(axis=1), np.zeros(SEGMENTS), 1.0)
    one.covariance = np.array([[spread**2]])
    one.fit.reduced = SimpleNamespace(
        matrix=(columns**2).sum(axis=1)[:, None, None], gradient=(columns * residual).sum(axis=1)[:, None]
    )
    exact = prediction(((residual - columns * spread) ** 2).sum(axis=1), np.zeros(SEGMENTS), 1.0)
    exact.fit.reduced = SimpleNamespace(matrix=np.zeros((SEGMENTS, 0, 0)), gradient=np.zeros((SEGMENTS, 0)))
    whole = np.eye(residual.size) + spread**2 * np.outer(columns.ravel(), columns.ravel())
    density = multivariate_normal(np.zeros(residual.size), whole).logpdf(residual.ravel())
    known = norm.logpdf(residual - columns * spread).sum()
    assert ahead(exact, one) == pytest.approx(known - density, rel=1e-9)
    assert 0 < ahead(exact, one) < 10


def test_a_record_without_information_does_not_pay_for_one_with_much():
    """Shared information of the segments of one record counts once and leaves the other record unaffected."""
    random, spread = np.random.default_rng(6), 0.3
    # the parameter moves the second record alone
    columns = random.standard_normal((2 * SEGMENTS, 50)) * (np.arange(2 * SEGMENTS) >= SEGMENTS)[:, None]
    residual = columns * spread + random.standard_normal(columns.shape)
    one = prediction((residual**2).sum(axis=1), np.zeros(len(columns)), 1.0)
    one.record = (np.arange(len(columns)) >= SEGMENTS).astype(int)
    exact = prediction(((residual - columns * spread) ** 2).sum(axis=1), np.full(len(columns), 1e-9), 1.0)
    exact.record = one.record
    one.covariance = np.array([[spread**2]])
    one.fit.reduced = SimpleNamespace(
        matrix=(columns**2).sum(axis=1)[:, None, None], gradient=(columns * residual).sum(axis=1)[:, None]
    )
    exact.fit.reduced = SimpleNamespace(
        matrix=np.zeros((len(columns), 0, 0)), gradient=np.zeros((len(columns), 0))
    )
    parts = gained_together(exact, one)
    assert parts.sum() == pytest.approx(ahead(exact, one))
    first, second = (parts[one.record == number].sum() for number in (0, 1))
    assert first == pytest.approx(0.0, abs=1e-6)
    assert second == pytest.approx(ahead(exact, one))
    assert second > 1


def test_wrong_machines_are_held_against_each_other_by_their_errors():
    worse, better = prediction([900.0], [-10.0], 500.0), prediction([400.0], [-30.0], 1.0)
    assert ahead(better, worse) == pytest.approx(250.0)
    assert ahead(worse, better) == pytest.approx(-250.0)


def test_what_a_base_may_still_gain_is_no_gain_of_a_candidate():
    """As of a base whose clock was not at its minimum on the held-out record."""
    base, one = prediction([90.0, 80.0], [0.0, 0.0], 2.0), prediction([50.0, 70.0], [0.0, 0.0], 2.0)
    assert gained_together(one, base) == pytest.approx([20.0, 5.0])
    base.fit.converged, base.fit.decrement = False, 30.0
    assert gained_together(one, base) == pytest.approx([12.5, -2.5])
    base.fit.decrement = 1000.0
    assert gained_together(one, base).sum() == pytest.approx(0.0)
    # one that is behind stays there
    base.fit.converged, one.fit.converged, one.fit.decrement = True, False, 1000.0
    assert gained_together(base, one).sum() == pytest.approx(-25.0)


def test_a_guess_gives_crank_and_clock_of_the_record():
    guess = prediction([1.0], [0.0], 1.0)
    guess.problem.free = [Free("restoring.stiffness", 9.0), Free("nuisance:clock", 0.0, record=0)]
    guess.fit.values = np.array([8.0, 1e-4])
    own = [Free("nuisance:phase", 0.0, record=0), Free("nuisance:clock", 0.0, record=0)]
    assert _records_own(guess, own, np.array([0.3, 0.0])).tolist() == [0.3, 1e-4]


def predicted(chi2: np.ndarray, gradient: float, information: float, error: float) -> Prediction:
    """A prediction with one parameter of a machine, known to `error`."""
    one = prediction(chi2, np.zeros(chi2.size), 1.0)
    one.fit.unknowns, one.fit.evaluation = 2, SimpleNamespace(failed=np.zeros(chi2.size, bool))
    one.fit.reduced = SimpleNamespace(
        matrix=np.full((chi2.size, 1, 1), information), gradient=np.full((chi2.size, 1), gradient)
    )
    return replace(one, covariance=np.array([[error**2]]))


def test_a_machine_that_leaves_noise_in_training_is_refuted_by_a_held_out_record_that_it_misses():
    fitted, options = SimpleNamespace(reduced_chi2=0.98), Options()
    noise = np.full(SEGMENTS, 48.0)
    assert not refuted(predicted(noise, 0.0, 1.0, 0.1), fitted, options)
    far = predicted(2238 * noise, 0.0, 1.0, 0.1)
    assert refuted(far, fitted, options)
    assert predicted_chi2(far, fitted) == pytest.approx(2238)
    # a few segments may be in a wrong minimum
    misfit = noise.copy()
    misfit[:3] *= 2238
    assert not refuted(predicted(misfit, 0.0, 1.0, 0.1), fitted, options)
    misfit[:6] *= 2238
    assert refuted(predicted(misfit, 0.0, 1.0, 0.1), fitted, options)
    # noise that is larger than stated in training is so here
    assert not refuted(predicted(3 * noise, 0.0, 1.0, 0.1), SimpleNamespace(reduced_chi2=1.7), options)


def test_what_an_error_of_the_parameters_explains_refutes_no_machine():
    """A parameter that is off by two of its errors has a large effect on a record of much information."""
    fitted, options, information, off = SimpleNamespace(reduced_chi2=1.0), Options(), 100.0, 2.0
    chi2 = np.full(SEGMENTS, 48.0) + information * off**2
    missing = predicted(chi2, information * off, information, 1.0)
    assert chi2.sum() / (48.0 * SEGMENTS) > 9
    assert not refuted(missing, fitted, options)
    assert refuted(replace(missing, covariance=np.array([[1e-4]])), fitted, options)
