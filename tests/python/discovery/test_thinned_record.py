# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of several sensors that are sampled far faster than they move are fitted on fewer rows."""

import numpy as np
import pytest
from separatrix.discovery import Options
from separatrix.discovery.fitting.data import fit_stages
from separatrix.discovery.fitting.observations import observation_of
from separatrix.discovery.fitting.sensed import measure_sensors
from separatrix.discovery.measured.records import Record, make_record
from separatrix.discovery.measured.sensors import prepare_sensors
from separatrix.discovery.measured.signals import clipped_noise, white_noise
from separatrix.discovery.measured.thinned_record import (
    at_middle,
    block_length,
    means_of,
    smooth_rows,
    thinned_record,
)
from separatrix.library import Model

RATE, COUNT, SIGMA = 2000.0, 30_001, 1e-4
T = np.arange(COUNT) / RATE
CASE = """
body.first.mass = 1
drive.force = {law = "force", body = "first", amplitude = 4.1, frequency = 7}
run.duration = 20
[spring.frame]
between = ["first"]
stiffness = 41
damping = 0.28
"""


def record_of(x: np.ndarray, pieces: list[tuple[int, int]] | None = None) -> Record:
    return Record("r", T, x, pieces=pieces or [(0, COUNT)])


def motion(t: np.ndarray) -> np.ndarray:
    return 0.1 * np.sin(7 * t) + 0.02 * np.cos(31 * t + 0.4)


def test_rows_are_the_motion_at_the_middle_of_blocks_with_white_noise() -> None:
    size = 7
    clean = thinned_record(record_of(motion(T)), size)
    assert clean.t.size == COUNT // size
    np.testing.assert_allclose(clean.x, motion(clean.t), atol=5e-3 * SIGMA)
    noise = SIGMA * np.random.default_rng(3).standard_normal(COUNT)
    left = at_middle(means_of(record_of(noise), noise, size), size)
    assert np.std(left) == pytest.approx(SIGMA / np.sqrt(size), rel=0.05)
    assert abs(np.corrcoef(left[1:], left[:-1])[0, 1]) < 0.05


def test_the_noise_of_samples_is_known_better_than_by_a_median() -> None:
    samples = [np.random.default_rng([7, i]).standard_normal(COUNT) for i in range(60)]
    by_median, by_squares = (np.array([f(x) for x in samples]) for f in (white_noise, clipped_noise))
    assert np.mean(by_squares) == pytest.approx(1, abs=3e-3)
    assert np.std(by_squares) < 0.008 < np.std(by_median)
    jumping = samples[0] + 50 * (T > 7)
    assert clipped_noise(jumping) == pytest.approx(by_squares[0], rel=1e-3)


def test_a_jump_of_the_velocity_is_not_compared_and_fast_motion_keeps_its_samples() -> None:
    kinked = motion(T) + 0.8 * np.abs(T - 7.0)
    size = block_length(record_of(kinked), {"x": kinked}, {"x": SIGMA})
    assert size == 7
    smooth = smooth_rows(means_of(record_of(kinked), kinked, size), SIGMA / np.sqrt(size))
    at = int(7.0 * RATE) // size
    assert not smooth[at] and np.count_nonzero(~smooth) < 12
    fast = motion(T) + 0.05 * np.sin(2 * np.pi * 400 * T)
    assert block_length(record_of(fast), {"x": kinked, "v": fast}, {"x": SIGMA, "v": SIGMA}) == 1
    short = record_of(motion(T))
    short.t, short.pieces = T[:9000], [(0, 9000)]
    assert block_length(short, {"x": kinked[:9000]}, {"x": SIGMA}) == 1


def test_no_block_reaches_across_a_gap() -> None:
    thin = thinned_record(record_of(motion(T), [(0, 10), (10, 15_000), (15_500, COUNT)]), 7)
    assert thin.pieces == [(0, 1), (1, 2142), (2142, 4213)]
    np.testing.assert_allclose(thin.x[1:], motion(thin.t)[1:], atol=1e-2 * SIGMA)


@pytest.mark.usefixtures("library")
def test_a_record_of_several_bodies_is_thinned_with_its_noise() -> None:
    x = motion(T) + SIGMA * np.random.default_rng(3).standard_normal(COUNT)
    header = {"drive_frequency_rad_s": 7.0, "phase": 0.0, "units": "t s, x.first m"}
    prepared = prepare_sensors(make_record("r", {"t": T, "x.first": x}, header), Model.from_text(CASE))
    sensor = prepared.sensors[0]
    assert prepared.block == 7 and sensor.values.size == prepared.samples.t.size == COUNT // 7
    assert sensor.sigma == pytest.approx(SIGMA / np.sqrt(7), rel=0.1)
    # a poor fit would show a larger one
    assert sensor.stated
    assert "30001 samples, fitted as 4285 values, each of 7" in prepared.notes[-1]
    assert sensor.known.sum() > 0.999 * sensor.known.size
    prepared.leave_out(np.array([100]))
    assert not sensor.known[99:103].any() and sensor.known[98]


@pytest.mark.usefixtures("library")
def test_what_a_machine_misses_is_no_memory_of_noise_that_is_known() -> None:
    x = motion(T) + SIGMA * np.random.default_rng(3).standard_normal(COUNT)
    header = {"drive_frequency_rad_s": 7.0, "phase": 0.0, "units": "t s, x.first m"}
    observed = observation_of(Model.from_text(CASE), "motion")
    record = make_record("r", {"t": T, "x.first": x}, header)
    data = observed.gather([observed.prepare(record, None)], Options())
    free = data.unknowns(observed.model)
    problem, fit = fit_stages(
        data, observed.model, free, np.array([one.value for one in free]), stages=[data.last]
    )
    assert fit.reduced_chi2 > 10
    measure_sensors(data, problem, fit)
    assert data.prepared[0].memory == 0
