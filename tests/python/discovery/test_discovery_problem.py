# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Derivatives of the short-segment likelihood are those of its residuals."""

from dataclasses import replace

import numpy as np
import pytest
from program import CASE
from separatrix.discovery.decision.where import where_maps
from separatrix.discovery.fitting.ceiling import ceiling
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.machine import (
    base_parameters,
    drive_nuisances,
    on_other_records,
    sensor_zeros,
)
from separatrix.discovery.fitting.one_body import BodyInMotion, flight_tolerance
from separatrix.discovery.measured.preflight import Prepared, prepare
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.measured.segments import padded
from separatrix.discovery.options import Options
from separatrix.library import Model

RATE, LENGTH = 200, 60
# zero of the sensor, and by how much the second record has another one
BIAS, SHIFT = 0.02, 0.004
SOFT = """[body]
mass = 1.0
[restoring]
law = "linear"
stiffness = 88.8
[friction]
law = "viscous"
damping = 0.6
[contact]
law = "newton"
restitution = 0.62
upper = 0.55
"""


@pytest.fixture
def flown(library) -> tuple[BodyInMotion, np.ndarray, np.ndarray]:
    """Two records with v at different drives, all free; values off those of the case, and starts."""
    model = Model.from_text(f"{CASE}\n[effect.sensor_bias]\nbias = {BIAS}\n")
    t = np.arange(1200) / RATE
    prepared = []
    for number, (ratio, scale) in enumerate(((0.9, 1.2), (1.2, 0.95))):
        values = {"drive.ratio": ratio}
        values |= {
            path: scale * one.value
            for path, one in model.parameters.items()
            if path.startswith(("drive.cosine", "drive.sine"))
        }
        start = np.array([(0.6, 2.0, 0.4 + number)])
        motion = model.segments(list(values), np.array(list(values.values())), start, [0, t.size], t)
        head = {"drive_ratio": ratio, "drive_scale": scale, "phase": 0.4 + number}
        head |= {"sensor_noise_sigma_m": 1e-3, "sensor_noise_sigma_m_s": 1e-2}
        x = motion.x + SHIFT * number
        prepared.append(prepare(make_record(f"r{number}", {"t": t, "x": x, "v": motion.v}, head), model))
        prepared[-1].memory = 0.3 * number
    first = np.tile(np.arange(0, t.size, LENGTH), 2)
    record = np.repeat([0, 1], first.size // 2)
    free = base_parameters(model, measured_force=False) + drive_nuisances(model, prepared)
    free += sensor_zeros(free, 2)
    problem = BodyInMotion(model, prepared, padded(record, first, first + LENGTH), free)
    off = {"nuisance:drive_scale": 1.03, "nuisance:clock": 0.015, "nuisance:phase": 0.02}
    values = np.array([off.get(one.path, 1.01 * one.value) for one in free])
    starts = np.array(
        [
            (prepared[r].record.x[k] - BIAS - SHIFT * r, prepared[r].record.v[k])
            for r, k in zip(record, first, strict=True)
        ]
    )
    return problem, values, starts


def test_flights_of_a_small_motion_far_from_the_origin_stay_below_its_noise():
    t = np.arange(200) / RATE
    motion = np.sin(20 * t)

    def tolerance(size: float, away: float, noise: float) -> float:
        head = {"sensor_noise_sigma_m": noise}
        record = make_record("r", {"t": t, "x": away + size * motion}, head)
        return flight_tolerance(Prepared(record, noise, np.inf, 0.0))

    assert tolerance(1.0, 0.0, 1e-3) == tolerance(1e-6, 0.0, 1e-9) == 1e-8
    assert tolerance(1e-6, 1.0, 1e-9) == pytest.approx(1e-11, rel=1e-5)
    assert tolerance(1e-6, -1.0, 1e-9) == pytest.approx(1e-11, rel=1e-5)
    assert tolerance(1e-6, 1.0, 1e-15) == 1e-14


def test_derivatives_by_a_table_of_contact_forces_are_no_noise(library):
    """What one value of a long table does is far less than what a flight with steps of its own may err by."""
    knots = np.linspace(0.004, 0.06, 15)
    table = {f"penetration[{i}]": one for i, one in enumerate(knots, start=1)}
    table |= {f"force[{i}]": 20000 * one**1.5 for i, one in enumerate(knots, start=1)} | {"damping": 0.3}
    model = Model.from_text(SOFT).with_effect("contact_curve", table)
    random = np.random.default_rng(1)
    start = np.column_stack([random.uniform(*ends, 40) for ends in ((0.3, 0.54), (2, 5), (0, 6))])
    flight = (start, 60 * np.arange(41), np.tile(np.linspace(0, 0.6, 60), 40))
    paths = [f"effect.contact_curve.force[{i}]" for i in (1, 4, 8)]
    values = np.array([model.parameters[path].value for path in paths])
    found = model.segments(paths, values, *flight).jacobian[:, 0, : len(paths)]
    for index, value in enumerate(values):
        ends = [
            model.segments(
                paths, values + step * (np.arange(3) == index), *flight, derivatives=False, tolerance=1e-12
            ).x
            for step in (1e-3 * value, -1e-3 * value)
        ]
        right = (ends[0] - ends[1]) / (2e-3 * value)
        assert np.linalg.norm(found[:, index] - right) < 0.01 * np.linalg.norm(right)


def test_derivatives_are_central_differences(flown):
    problem, values, starts = flown
    found = problem.evaluate(values, starts)
    good = found.steady & ~found.failed
    # samples next to impacts and a channel of velocities take part
    assert (found.hits[good] > 0).sum() >= 5
    assert found.residual.shape[1] == 2 * LENGTH
    names = [one.path for one in problem.free]
    own = {"nuisance:phase", "nuisance:clock", "nuisance:sensor_zero"}
    assert own | {"nuisance:drive_scale", "restoring.stiffness"} <= set(names)

    def slope(by_values: np.ndarray, by_starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Central difference of minus the residuals, and where no impact passes a sample meanwhile."""
        ends = [
            problem.evaluate(values + s * by_values, starts + s * by_starts, derivatives=False).residual[good]
            for s in (1, 0.5, -0.5, -1)
        ]
        whole, half = -(ends[0] - ends[3]) / 2, -(ends[1] - ends[2])
        return whole, np.abs(whole - half) < 1e-3 * np.abs(whole).max() + 1e-9

    for j, one in enumerate(problem.free):
        step = np.zeros(values.size)
        step[j] = 1e-6 * (abs(values[j]) if abs(values[j]) > 0.1 else 1.0)
        wanted, smooth = slope(step, 0 * starts)
        wanted /= step[j]
        assert smooth.mean() > 0.999, one
        size = np.abs(wanted).max()
        assert size > 0, one
        assert np.abs(found.by_parameter[good, :, j] - wanted)[smooth].max() < 2e-4 * size, one
    for k in range(2):
        step = np.zeros(2)
        step[k] = 1e-7
        wanted, smooth = slope(0 * values, step)
        wanted /= 1e-7
        assert smooth.mean() > 0.999
        assert np.abs(found.by_start[good, :, k] - wanted)[smooth].max() < 2e-4 * np.abs(wanted).max()


def test_each_record_has_its_own_zero(flown):
    problem, values, starts = flown
    paths = [one.path for one in problem.free]
    right = np.where([path.startswith("nuisance:") for path in paths], 0.0, values / 1.01)
    right[paths.index("nuisance:drive_scale")] = 1.0
    fit = minimise(problem, right, starts)
    assert fit.values[paths.index("nuisance:sensor_zero")] == pytest.approx(SHIFT, rel=1e-3)
    biases = [problem.machine_values(number, fit.values)["effect.sensor_bias.bias"] for number in (0, 1)]
    assert biases[1] - biases[0] == pytest.approx(SHIFT, rel=1e-3)
    # held-out records bring zeros of their own, but not the end of a record that was fitted, nor beside a
    # bias that is a candidate
    held_out = [one.path for one in on_other_records(problem.free, problem.prepared)]
    assert held_out.count("nuisance:sensor_zero") == 2
    problem.prepared[1].record.part = ", the last 30 %"
    held_out = [one.path for one in on_other_records(problem.free, problem.prepared)]
    assert held_out.count("nuisance:sensor_zero") == 1
    added = [replace(one, varies=False) for one in problem.free if one.path == "effect.sensor_bias.bias"]
    assert len(on_other_records(added, problem.prepared)) == 1 + 2 * 2


def test_kicks_at_impacts_are_among_what_is_tried(flown):
    """The barrier is an upper one: the speed falls at its impacts."""
    problem, values, starts = flown
    fit = minimise(problem, values, starts, most=0)
    found = {one.name: one for one in ceiling(problem, fit, 1.0).families}
    # constant, with speed, its square and cube, and with time and its square
    assert found["impacts"].rank == 6


def test_missing_forces_over_time_are_those_of_each_record(flown):
    """The second record is the shorter one."""
    problem, values, starts = flown
    rows = np.flatnonzero((problem.segments.record == 0) | (problem.segments.first < 600))
    second = problem.prepared[1].record
    for name in ("t", "x", "v"):
        setattr(second, name, getattr(second, name)[:600])
    problem = problem.of_segments(rows)
    fit = minimise(problem, values, starts[rows], most=0)
    maps = {one.name: one for one in where_maps(Fitted((), problem.model, problem, fit, ()), 1.0, Options())}
    assert maps["time in r0"].edges[-1] == pytest.approx(6.0, abs=0.5)
    assert maps["time in r1"].edges[-1] == pytest.approx(3.0, abs=0.5)
