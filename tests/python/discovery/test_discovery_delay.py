# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A delayed position sensor beside a velocity without delay."""

import numpy as np
import pytest
from program import CASE
from separatrix.discovery.fitting.machine import base_parameters, drive_nuisances
from separatrix.discovery.fitting.one_body import BodyInMotion
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.measured.segments import padded
from separatrix.library import Model

RATE, LENGTH, PHASE = 200, 40, 0.4


def late_problem(delay: float) -> tuple[BodyInMotion, np.ndarray]:
    """A record of x that is late and v that is not, its machine, and where the body was a delay earlier."""
    model = Model.from_text(CASE)
    t = np.arange(4, 604) / RATE
    every = np.concatenate([[0.0], np.unique(np.concatenate([t, t - delay]))])
    start = np.array([(0.6, 2.0, PHASE)])
    body = model.segments([], np.zeros(0), start, [0, every.size], every, derivatives=False)
    x, v, v_then = (values[np.searchsorted(every, at)] for values, at in (
        (body.x, t - delay), (body.v, t), (body.v, t - delay)))  # fmt: skip
    frequency = model.drive_frequency({})
    head = {"phase": PHASE + frequency * t[0], "sensor_noise_sigma_m": 1e-3, "sensor_noise_sigma_m_s": 1e-2}
    record = make_record("late", {"t": t - t[0], "x": x, "v": v}, head)
    prepared = [prepare(record, model)]
    extended = model.with_effect("sensor_delay", {"delay": delay})
    first = np.arange(0, t.size, LENGTH)
    free = base_parameters(extended, measured_force=False) + drive_nuisances(extended, prepared)
    problem = BodyInMotion(extended, prepared, padded(np.zeros(first.size, int), first, first + LENGTH), free)
    return problem, np.column_stack([x[first], v_then[first]])


@pytest.mark.parametrize("delay", [0.0017, 0.012, -0.0017])
def test_only_the_position_is_delayed(library, delay):
    problem, starts = late_problem(delay)
    found = problem.evaluate(problem.values, starts)
    assert found.steady.sum() > 8
    # before its start a body goes on with the acceleration of its start
    rows = np.abs(found.residual[found.steady])
    assert rows[:, 1:LENGTH].max() < 1e-3
    assert rows[:, LENGTH + 1 :].max() < 1e-3
    assert rows[:, LENGTH].max() < 0.1


@pytest.mark.parametrize(("delay", "close"), [(0.0, 2e-3), (0.0017, 2e-3), (-0.0017, 1e-2)])
def test_derivatives_by_a_delay_are_differences(library, delay, close):
    problem, starts = late_problem(delay)
    found = problem.evaluate(problem.values, starts)
    index = [one.path for one in problem.free].index("effect.sensor_delay.delay")
    ends = []
    for step in (1e-6, 5e-7, -5e-7, -1e-6):
        values = problem.values.copy()
        values[index] += step
        ends.append(problem.evaluate(values, starts, derivatives=False).residual[found.steady])
    wanted, half = (ends[3] - ends[0]) / 2e-6, (ends[2] - ends[1]) / 1e-6
    size = np.abs(wanted).max()
    # but where an impact passes a sample meanwhile
    smooth = np.abs(wanted - half) < 1e-3 * size
    assert smooth.mean() > 0.99
    error = np.abs(found.by_parameter[found.steady][:, :, index] - wanted)[smooth]
    assert error.max() < close * size
