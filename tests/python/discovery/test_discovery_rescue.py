# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A segment that was fitted with one impact too few is found with it, however close to grazing."""

from types import SimpleNamespace

import numpy as np
import pytest
from program import CASE
from separatrix.discovery.fitting.machine import base_parameters
from separatrix.discovery.fitting.one_body import BodyInMotion
from separatrix.discovery.fitting.rescue import rescued, solve_starts
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.measured.segments import padded
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")

NOISE = 3e-3
# standard errors of a start as the smoother finds it
SPREAD = np.array([[0.5 * NOISE, 0.04]])
TIMES = np.arange(100) / 250


def flown(model: Model, speed: float):
    """From 0.8 m, upwards."""
    start = np.array([[0.8, speed, 0.0]])
    return model.segments([], np.zeros(0), start, np.array([0, TIMES.size]), TIMES, derivatives=False)


def grazing_speed(model: Model) -> float:
    """Speed at the start from which the barrier is just reached."""
    low, high = 1.0, 4.0
    assert flown(model, low).impacts[0] == 0
    assert flown(model, high).impacts[0] > 0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if flown(model, middle).impacts[0] else (middle, high)
    return high


def problem_of(model: Model, speed: float) -> BodyInMotion:
    """A record of that motion with noise, and the segment in question; the machine is right."""
    x = flown(model, speed).x + NOISE * np.random.default_rng(3).standard_normal(TIMES.size)
    # what follows belongs to no segment
    rest = x[-1] + 1e-9 * np.arange(500)
    head = {"drive_ratio": 1.2, "phase": 0.0, "sensor_noise_sigma_m": NOISE}
    record = make_record("record", {"t": np.arange(600) / 250, "x": np.concatenate([x, rest])}, head)
    free = base_parameters(model, measured_force=False)
    return BodyInMotion(model, [prepare(record, model)], padded(*np.array([[0], [0], [TIMES.size]])), free)


def chi2_and_hits(problem: BodyInMotion, starts: np.ndarray) -> tuple[float, int]:
    found = problem.evaluate(problem.values, starts, derivatives=False)
    return float(np.sum(found.residual**2)), int(found.hits[0])


@pytest.mark.parametrize("beyond", [1e-3, 3e-3, 1e-2])
def test_an_impact_next_to_a_graze_is_found(beyond: float) -> None:
    """From the best start without it, and a guess of the smoother."""
    model = Model.from_text(CASE)
    speed = (1 + beyond) * grazing_speed(model)
    problem = problem_of(model, speed)
    missed, cost = solve_starts(problem, problem.values, np.array([[0.79, 0.97 * speed]]))
    assert chi2_and_hits(problem, missed)[1] == 0
    assert cost[0] > 1.7 * TIMES.size
    fit = SimpleNamespace(values=problem.values, starts=missed, chi2=cost, good=np.array([True]))
    starts, improved = rescued(problem, fit, np.array([0]), [np.array([[0.8, speed]]) + SPREAD], SPREAD)
    assert improved[0]
    chi2, hits = chi2_and_hits(problem, starts)
    assert hits == 1
    assert chi2 < 1.3 * TIMES.size
    assert starts[0] == pytest.approx([0.8, speed], abs=0.05)


@pytest.mark.parametrize("beyond", [1e-3, 3e-3, 1e-2])
def test_a_start_with_an_impact_keeps_it(beyond: float) -> None:
    """Without it chi^2 has another minimum, which the first step from outside would reach."""
    model = Model.from_text(CASE)
    speed = (1 + beyond) * grazing_speed(model)
    problem = problem_of(model, speed)
    wide = np.array([(i, j) for i in (-6, -3, 0, 3, 6) for j in (-3, 0, 3)]) * SPREAD + [0.8, speed]
    tried = [one[None, :] for one in wide if chi2_and_hits(problem, one[None, :])[1] == 1]
    assert len(tried) > 3
    for begin in tried:
        found, cost = solve_starts(problem, problem.values, begin)
        assert chi2_and_hits(problem, found)[1] == 1
        assert cost[0] < 1.5 * TIMES.size
