# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What columns of machines of several bodies are of, and how well their drive is known."""

import numpy as np
import pytest
from hidden_bodies import SPRINGS
from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.machine import record_nuisances
from separatrix.discovery.fitting.sensed import gather_sensed
from separatrix.discovery.measured.records import Record, make_record
from separatrix.discovery.measured.segments import padded
from separatrix.discovery.measured.sensors import prepare_sensors
from separatrix.discovery.workflow import _cut
from separatrix.errors import SeparatrixError
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")

RATE, START = 7.3, 0.7
T = np.arange(1000) / 100
X, V = np.sin(RATE * T), RATE * np.cos(RATE * T)
OTHER, FORCE = 0.3 * np.sin(RATE * T + 1), 50 * np.cos(RATE * T)


def record(**columns: np.ndarray) -> Record:
    """Columns whose names have `_` for the dot, with a little noise."""
    random = np.random.default_rng(0)
    noisy = {
        name.replace("_", "."): column + 1e-3 * np.std(column) * random.standard_normal(T.size)
        for name, column in columns.items()
    }
    header = {"units": "t s, x m", "drive_frequency_rad_s": RATE, "phase": 0}
    return make_record("record", {"t": T} | noisy, header)


@pytest.mark.parametrize(
    ("columns", "found"),
    [
        ({"x": X}, ["x.second"]),
        ({"x": X, "v": V}, ["x.second", "v.second"]),
        ({"F_coupling": FORCE, "x": X}, ["x.second", "F.coupling"]),
        ({"x_first": OTHER, "x": X}, ["x.second", "x.first"]),
        ({"x_first": OTHER, "v": V}, ["x.first", "v.second"]),
        ({"x_first": OTHER, "v_second": V}, ["x.first", "v.second"]),
    ],
)
def test_x_and_v_are_of_the_watched_body_also_beside_named_columns(columns, found):
    whole, model = record(**columns), Model.from_text(SPRINGS)
    for one in (whole, _cut(whole, 0, 900, "")):
        prepared = prepare_sensors(one, model)
        assert [sensor.name for sensor in prepared.sensors] == found
        for name, kind in (("x.second", "x"), ("v.second", "v")):
            if kind in columns:
                assert np.array_equal(prepared.sensor(name).values, getattr(one, kind))
        assert prepared.observed == ("second" if "x" in columns else "first")
        assert np.array_equal(prepared.sensor(f"x.{prepared.observed}").values, one.x)
    # so that there is a position to follow
    assert gather_sensed([prepared], 1.0, None, model).last == 2


@pytest.mark.parametrize("kind", ["x", "v"])
def test_a_body_with_two_columns_of_a_kind_is_refused(kind):
    columns = {"x": X, kind: X, f"{kind}_second": X}
    with pytest.raises(SeparatrixError, match=f"columns {kind} and {kind}.second, allowed one of them"):
        prepare_sensors(record(**columns), Model.from_text(SPRINGS))


def test_x_beside_a_named_position_is_tested_for_clipping():
    with pytest.raises(SeparatrixError, match="x stays at its largest value 0.8 m .* clipped"):
        make_record("record", {"t": T, "x.first": OTHER, "x": np.minimum(X, 0.8)}, {"units": "t s, x m"})


def turned(t: np.ndarray, rate: float, noise: float = 0.0, **header: float) -> Record:
    """A record with the measured angle of its crank."""
    random = np.random.default_rng(3)
    phi = np.mod(START + rate * t + noise * random.standard_normal(t.size), 2 * np.pi)
    columns = {"t": t, "x.second": np.sin(RATE * t), "phi": phi}
    return make_record("turned", columns, {"units": "t s, x m", **header})


@pytest.mark.parametrize("stated", [0.0, 1e-3, 4e-3])
def test_a_noisy_crank_angle_is_known_within_its_error(stated):
    header = {"phi_noise_sigma_rad": stated} if stated else {}
    one = prepare_sensors(turned(T, RATE, 1e-3, **header), Model.from_text(SPRINGS))
    assert one.phase_known
    # where errors of angle and rate are independent
    assert one.origin == pytest.approx(T.mean())
    sigma = max(stated, 1e-3)
    assert one.phase_error == pytest.approx(sigma / np.sqrt(T.size), rel=0.1)
    clock = sigma * np.sqrt(12 / T.size) / one.record.duration / RATE
    assert one.clock_error == pytest.approx(clock, rel=0.1)
    assert abs(one.frequency / RATE - 1) < 4 * one.clock_error
    angle = one.phase + one.frequency * (T - one.origin)
    assert np.abs(np.angle(np.exp(1j * (angle - START - RATE * T)))).max() < 10 * one.phase_error
    errors = {free.path: free.error for free in record_nuisances([one])}
    assert errors == {"nuisance:phase": one.phase_error, "nuisance:clock": one.clock_error}


def test_the_error_of_a_crank_angle_counts_in_the_fit():
    model = Model.from_text(SPRINGS)
    one = prepare_sensors(turned(T, RATE, 1e-3), model)
    first = np.arange(0, T.size, 100)
    free = record_nuisances([one])
    problem = CoordinateProblem(model, [one], padded(0 * first, first, first + 100), free)
    off = np.array([3 * free[0].error, 0.0])
    starts = np.zeros((first.size, 4))
    starts[:, 1] = one.record.x[first]
    found = problem.evaluate(off, starts)
    # three errors cost 9 of chi^2, shared among the segments
    assert np.sum(found.used * found.residual**2, axis=0)[100:] == pytest.approx([9, 0])


@pytest.mark.parametrize(
    ("t", "rate", "words"),
    [
        (
            T,
            0.0,
            r"'phi' advances by \S+ rad in all: too short a record, or not the angle of a turning crank",
        ),
        (T[:100], RATE, r"1\.15 drive periods, at least 2 are needed"),
        (10 * T, RATE, "8.6 samples per drive period, at least 12 are needed"),
    ],
)
def test_an_angle_that_determines_no_drive_is_refused(t, rate, words):
    with pytest.raises(SeparatrixError, match=f"turned: .*{words}"):
        prepare_sensors(turned(t, rate), Model.from_text(SPRINGS))
