# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drive and force of a record are taken at the right time: also after a gap, and in a part of a record."""

import numpy as np
import pytest
from program import CASE
from separatrix.discovery.fitting.observations import OfMotion
from separatrix.discovery.fitting.one_body import BodyInMotion
from separatrix.discovery.measured.preflight import check_velocity, prepare
from separatrix.discovery.measured.records import Record, make_record
from separatrix.discovery.measured.segments import padded
from separatrix.discovery.measured.smoother import in_intervals, smooth, stick_intervals
from separatrix.discovery.workflow import _split, discover
from separatrix.errors import SeparatrixError
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")

PUSHED = """\
[body]
mass = 2
[restoring]
law = "none"
[drive]
law = "measured_force"
interval = 1
force = [0, 0]
"""
RATE, START = 9.9, 0.7


def driven(t: np.ndarray, **header) -> Record:
    """A record of the size of the machine with its measured crank angle, turned back to 0 to 2 pi."""
    x = 0.8 + 0.2 * np.cos(RATE * t)
    phi = np.mod(START + RATE * t, 2 * np.pi)
    return make_record("driven", {"t": t, "x": x, "phi": phi}, {"sensor_noise_sigma_m": 1e-4, **header})


def test_a_measured_crank_angle_counts_from_the_rows_that_it_is_fitted_to():
    model = Model.from_text(CASE)
    record = driven(np.arange(800) / 100, phase=START)
    training, held_out, _ = _split([record], [], OfMotion(model))
    for part in (*training, *held_out):
        prepared = prepare(part, model)
        angle = prepared.phase + prepared.frequency * (part.t - prepared.origin)
        assert np.cos(angle - START - RATE * part.t) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize(("periods", "share"), [(12.3, 30), (5.7, 36), (4.2, 49)])
def test_the_end_that_is_held_out_has_two_drive_periods(periods, share):
    model = Model.from_text(CASE)
    t = np.arange(0, periods * 2 * np.pi / RATE, 0.005)
    training, held_out, chosen = _split([driven(t, phase=START)], [], OfMotion(model))
    assert chosen == f"the last {share} % of the only record"
    assert training[0].t.size + held_out[0].t.size == t.size
    for part in (*training, *held_out):
        prepare(part, model)


def test_a_record_too_short_to_hold_out_its_end_is_refused_with_its_part():
    model = Model.from_text(CASE)
    t = np.arange(0, 3 * 2 * np.pi / RATE, 0.005)
    training, held_out, _ = _split([driven(t, phase=START)], [], OfMotion(model))
    with pytest.raises(SeparatrixError, match=r"driven, the last 50 %, which are held out: 1\.5\d? drive"):
        prepare(held_out[0], model)
    with pytest.raises(SeparatrixError, match=r"driven, all but the last 50 %, which are held out: 1\."):
        prepare(training[0], model)


def test_a_gap_is_reported_once_where_the_end_of_a_record_is_held_out():
    t = np.arange(800) / 100
    t[200:] += 0.5
    training, held_out, _ = _split([driven(t)], [], OfMotion(Model.from_text(CASE)))
    assert sum("gap of" in text for text in training[0].notes) == 1
    assert held_out[0].notes == []


def test_a_record_at_rest_that_moves_is_refused_as_such():
    model = Model.from_text(CASE)
    record, moving = driven(np.arange(800) / 100), driven(np.arange(800) / 100)
    moving.file = "rest.csv"
    with pytest.raises(SeparatrixError, match=r"rest.csv: .* in driven by .* not a record at rest"):
        prepare(record, model, moving)


@pytest.mark.parametrize("noise", [1e-4, 0.0])
def test_a_stated_noise_of_nothing_is_measured(noise):
    """A computed record without noise has a little of it all the same."""
    record = driven(np.arange(8000) / 1000, phase=START)
    x = record.x + noise * np.random.default_rng(0).standard_normal(record.t.size)
    record = make_record("zero", {"t": record.t, "x": x, "phi": record.phi}, {"sensor_noise_sigma_m": 0})
    prepared = prepare(record, Model.from_text(CASE))
    assert prepared.sigma == pytest.approx(max(noise, 1e-6 * np.std(x)), rel=0.1)
    assert not prepared.sigma_stated
    assert "sensor_noise_sigma_m is 0: measured instead" in prepared.notes


@pytest.mark.parametrize("gap", [0.3, 2.0, 61.7])
def test_a_measured_crank_angle_is_followed_across_a_gap(gap):
    t = np.arange(800) / 100
    t[300:] += gap
    prepared = prepare(driven(t), Model.from_text(CASE))
    assert prepared.frequency == pytest.approx(RATE, rel=1e-9)
    angle = prepared.phase + prepared.frequency * (t - prepared.origin)
    assert np.cos(angle - START - RATE * t) == pytest.approx(1, abs=1e-9)


def pushed(t: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Columns and velocity of a mass of 2 kg under 3 cos(2 t) N."""
    x, v = -0.375 * np.cos(2 * t), 0.75 * np.sin(2 * t)
    return {"t": t, "x": x, "force": 3 * np.cos(2 * t)}, v


def test_a_measured_force_acts_at_its_time_after_a_gap():
    t = np.arange(2000) * 0.005
    kept = (t < 4) | (t >= 6.003)
    columns, v = pushed(t[kept])
    record = make_record("pushed", columns, {"sensor_noise_sigma_m": 1e-4})
    model = Model.from_text(PUSHED)
    edge = record.pieces[1][0]
    first = np.array([0, edge - 100, edge, record.t.size - 100])
    problem = BodyInMotion(model, [prepare(record, model)], padded(np.zeros(4, int), first, first + 100), [])
    found = problem.evaluate(np.zeros(0), np.column_stack([record.x[first], v[first]]), derivatives=False)
    assert not found.failed.any()
    # linear interpolation between samples is good to 1e-5 of the force
    assert np.abs(found.residual).max() < 0.2


def test_a_measured_force_at_two_rates_is_refused():
    t = np.concatenate([np.arange(500) * 0.005, 4 + np.arange(500) * 0.006])
    columns, _ = pushed(t)
    with pytest.raises(SeparatrixError, match=r"from 4 s on.*0\.006 s.*0\.005 s"):
        prepare(make_record("pushed", columns), Model.from_text(PUSHED))


def test_a_machine_under_measured_force_needs_one():
    columns, _ = pushed(np.arange(500) * 0.005)
    del columns["force"]
    with pytest.raises(SeparatrixError, match="no column 'force'"):
        prepare(make_record("pushed", columns), Model.from_text(PUSHED))


@pytest.mark.parametrize(
    ("channel", "factor", "words"),
    [
        ("phi", 0, "'phi' advances by 0 rad"),
        ("v", 0, "'v' is constant"),
        ("v", 1000, r"'v' is 100\d times the slope of 'x'.*m/s"),
        ("v", -1, "'v' is not the velocity of 'x'"),
    ],
)
def test_channels_that_cannot_be_what_they_are_called_are_refused(channel, factor, words):
    t = np.arange(800) / 100
    x = 0.8 + 0.2 * np.cos(RATE * t)
    true = {"phi": RATE * t, "v": -0.2 * RATE * np.sin(RATE * t) + 0.01 * np.cos(333 * t)}
    record = make_record("odd", {"t": t, "x": x, channel: factor * true[channel]}, {"phase": 0})
    with pytest.raises(SeparatrixError, match=words):
        prepare(record, Model.from_text(CASE))


@pytest.mark.parametrize(("stated", "reported"), [(RATE, False), (12.0, True)])
def test_a_stated_frequency_that_the_crank_contradicts_is_reported(stated, reported):
    record = driven(np.arange(800) / 100, drive_frequency_rad_s=stated)
    prepared = prepare(record, Model.from_text(CASE))
    assert prepared.frequency == pytest.approx(RATE, rel=1e-9)
    note = f"drive_frequency_rad_s is {stated:g}, phi turns at 9.9 rad/s: that is taken"
    assert (note in prepared.notes) == reported
    assert any("drive_frequency" in one for one in prepared.notes) == reported


@pytest.mark.parametrize(("size", "accepted"), [(1.0, True), (-1.0, False)])
def test_a_velocity_is_recognised_where_x_moves_less_than_its_noise_from_sample_to_sample(size, accepted):
    """As 50 000 samples at 4 kHz with noise of 1 % of the motion."""
    t = np.arange(50_000) / 4000
    random = np.random.default_rng(3)
    x = 0.8 + 0.2 * np.cos(RATE * t) + 2e-3 * random.standard_normal(t.size)
    v = -0.2 * RATE * np.sin(RATE * t) + 2e-3 * RATE * random.standard_normal(t.size)
    record = make_record("fast", {"t": t, "x": x, "v": size * v}, {"phase": 0})
    notes = []
    if accepted:
        check_velocity(record, notes)
        assert notes == []
    else:
        with pytest.raises(SeparatrixError, match="'v' is not the velocity of 'x'"):
            check_velocity(record, notes)


SLOW = """\
[body]
mass = 1
gravity = 9.81
[restoring]
law = "linear"
stiffness = 88.8
free_length = 0.4
[friction]
law = "coulomb"
kinetic_coefficient = 0.2
[contact]
law = "newton"
restitution = 0.5
upper = 1.1
[drive]
law = "fourier"
ratio = 0.2
mean = 0.31
cosine = [0.095]
sine = [0.0]
"""


def slow(amplitude: float, scale: float, noise: float = 8e-6) -> Record:
    """A body about 0.71 m that moves slowly with an amplitude, under a drive of some scale."""
    t = np.arange(40_000) / 2000
    x = 0.71 + amplitude * np.cos(0.2 * np.sqrt(88.8) * t)
    x += noise * np.random.default_rng(3).standard_normal(t.size)
    header = {"drive_ratio": 0.2, "drive_scale": scale, "phase": 0.0}
    return make_record("slow", {"t": t, "x": x}, header)


def at_rest(noise: float = 8e-6) -> Record:
    t = np.arange(4000) / 2000
    return make_record("rest", {"t": t, "x": 0.7 + noise * np.random.default_rng(4).standard_normal(t.size)})


@pytest.mark.parametrize(("amplitude", "scale"), [(0.007, 0.3), (0.007, 1.0), (2e-3, 0.1), (2e-5, 0.3)])
def test_a_small_motion_is_that_of_the_machine_under_its_drive(amplitude, scale):
    prepared = prepare(slow(amplitude, scale), Model.from_text(SLOW), at_rest())
    assert prepared.sigma == pytest.approx(8e-6, rel=0.05)


@pytest.mark.parametrize(
    ("amplitude", "scale", "factor"),
    [(0.09, 1.0, 1e-3), (0.09, 1.0, 1e3), (0.007, 0.3, 1e-3), (0.007, 0.3, 1e3)],
)
def test_wrong_units_are_refused_whatever_the_drive(amplitude, scale, factor):
    record = slow(amplitude, scale)
    record.x = factor * record.x
    with pytest.raises(SeparatrixError, match="wrong units"):
        prepare(record, Model.from_text(SLOW))


def test_a_motion_below_the_noise_of_a_sample_is_seen_by_its_slow_part():
    prepared = prepare(slow(8e-6, 0.3), Model.from_text(SLOW), at_rest())
    assert prepared.sigma_stated
    assert not prepared.rests


def test_a_rest_record_that_moves_slowly_is_refused_beside_a_small_motion():
    rest = slow(1e-4, 0.3)
    rest.file = "rest.csv"
    with pytest.raises(SeparatrixError, match="rest.csv: .* slowly: not a record at rest"):
        prepare(slow(8e-5, 0.3), Model.from_text(SLOW), rest)


def test_a_body_that_friction_holds_all_the_time_is_a_record_of_the_machine():
    """A weak drive leaves it at rest, which bounds friction from below; a strong one does not."""
    prepared = prepare(slow(0.0, 0.3), Model.from_text(SLOW), at_rest())
    assert prepared.rests
    assert "the body rests" in prepared.notes[-1]
    for factor in (1e-3, 1e3):
        record = slow(0.0, 0.3)
        record.x = factor * record.x
        with pytest.raises(SeparatrixError, match="wrong units"):
            prepare(record, Model.from_text(SLOW))
    with pytest.raises(SeparatrixError, match="nothing but noise"):
        prepare(slow(0.0, 1.0), Model.from_text(SLOW), at_rest())


def test_records_in_which_the_body_rests_all_the_time_are_refused():
    with pytest.raises(SeparatrixError, match="rests in all records"):
        discover(Model.from_text(SLOW), [slow(0.0, 0.3)], [slow(0.09, 1.0)])


def test_a_start_in_a_rest_has_no_speed():
    """A body that turns moves on; one that sticks shows the noise of the smoother alone."""
    t = np.arange(600) / 100
    still = (t > 2) & (t < 4)
    x = np.where(still, 0.5, 0.5 + 0.2 * np.where(t < 3, 2 - t, t - 4))
    x = x + 1e-5 * np.random.default_rng(1).standard_normal(t.size)
    seen = smooth(t, x, 1e-5, 600)
    inside = in_intervals(t, stick_intervals(seen))
    assert inside[(t > 2.3) & (t < 3.7)].mean() > 0.9
    assert not inside[(t < 1.8) | (t > 4.2)].any()
    assert not in_intervals(t, []).any()
