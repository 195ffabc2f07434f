# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Artefacts of sensors and clocks are reported with their rows and not mistaken for motion."""

import numpy as np
import pytest
from separatrix.discovery.measured.condense import whole
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.measured.segments import cut
from separatrix.discovery.measured.signals import resolution_of
from separatrix.discovery.measured.smoother import smooth
from separatrix.errors import SeparatrixError

RATE, SIGMA = 1000, 1e-5


def bouncing(count: int = 4000, sigma: float = SIGMA) -> tuple[np.ndarray, np.ndarray]:
    """Times, and a motion of about 1 m/s with impacts on a barrier at 0."""
    t = np.arange(count) / RATE
    noise = sigma * np.random.default_rng(0).standard_normal(count)
    return t, np.abs(0.3 * np.sin(4 * t) + 0.05 * np.cos(9 * t)) + noise


def of(t: np.ndarray, x: np.ndarray, **header):
    """The record of these samples."""
    return make_record("record", {"t": t, "x": x}, {"units": "s, m", **header})


@pytest.mark.parametrize("size", [0.01, -0.002, 0.0005])
def test_a_stray_sample_in_fast_motion_is_left_out(size):
    """Though it is no further away than the body moves in some steps."""
    t, x = bouncing()
    x[[400, 900]] += size
    record = of(t, x)
    assert np.array_equal(record.t, np.delete(t, [400, 900]))
    for row in (401, 901):
        assert any(
            text.startswith(f"record, row {row}: x is") and "left out" in text for text in record.notes
        )


def test_impacts_pulses_and_rest_are_no_artefacts():
    t, x = bouncing()
    # a burst of a force at the limit of what is sampled
    shaken = x + 1e-4 * np.cos(2.2 * np.arange(t.size)) * (np.abs(t - 2) < 0.03)
    pause = np.pi / 8
    resting = 0.3 * np.sin(4 * np.where(t < pause, t, np.maximum(pause, t - 0.5)))
    for motion in (x, shaken, resting, bouncing(sigma=0.0)[1]):
        record = of(t, motion)
        assert np.array_equal(record.t, t)
        assert record.notes == []


def test_rest_before_a_gap_is_no_held_value():
    t = np.arange(4000) / RATE
    x = 0.3 * np.sin(4 * np.minimum(t, 3 * np.pi / 8))
    later = t >= 1.5
    x[later] = 0.1 * np.cos(3 * t[later])
    kept = (t < 1.3) | later
    record = of(t[kept], x[kept])
    assert np.array_equal(record.t, t[kept])
    assert len(record.notes) == 1
    assert "gap" in record.notes[0]


def test_held_values_are_left_out():
    t, x = bouncing()
    x[400:420] = x[400]
    record = of(t, x)
    assert np.array_equal(record.t, np.delete(t, slice(401, 420)))
    assert record.pieces == [(0, 401), (401, 3981)]
    assert any(
        text.startswith("record, row 401: x stays at") and "for 20 samples" in text for text in record.notes
    )


def test_a_sensor_slower_than_the_record_is_refused():
    t, x = bouncing()
    for times in (2, 10):
        with pytest.raises(SeparatrixError, match=f"row {times + 1}: x changes in one of {times} rows only"):
            of(t, np.repeat(x[::times], times))


@pytest.mark.parametrize("step", [1e-4, 1 / 8192])
def test_the_resolution_is_found_where_most_values_differ(step):
    t, x = bouncing(sigma=0.0)
    quantised = np.array([float(f"{value:.9g}") for value in step * np.round(x / step)])
    assert np.unique(quantised).size > 0.25 * t.size
    assert resolution_of(quantised) == pytest.approx(step, rel=1e-4)
    assert resolution_of(quantised[::5]) == pytest.approx(step, rel=1e-4)
    assert resolution_of(x) == 0
    # digits of the file
    assert resolution_of(np.round(bouncing()[1], 8)) == 0


def test_turning_points_on_a_grid_are_no_clipping():
    """The body stays within one step of the sensor while it turns round."""
    t = np.arange(4000) / RATE
    x = 1e-4 * np.round(0.3 * np.sin(4 * t) / 1e-4)
    assert (np.diff(x[np.flatnonzero(x == x.max())[:5]]) == 0).all()
    assert of(t, x).notes == []
    with pytest.raises(SeparatrixError, match="clipped"):
        of(t, np.minimum(x, 0.2))


def jittered(size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Even times, stamps that scatter about them by up to `size` of a step, and the motion at even times."""
    t, x = bouncing()
    return t, t + size / RATE * np.random.default_rng(1).uniform(-1, 1, t.size), x


@pytest.mark.parametrize("size", [0.05, 0.3])
def test_stamps_that_scatter_are_evened(size):
    even, stamps, x = jittered(size)
    record = of(stamps, x)
    assert record.pieces == [(0, even.size)]
    assert np.abs(record.t - even).max() < 0.05 * size / RATE
    assert len(record.notes) == 1
    assert "even times are taken" in record.notes[0]


def test_a_lost_sample_is_found_among_stamps_that_scatter():
    even, stamps, x = jittered(0.3)
    kept = np.delete(np.arange(even.size), [1000, 1001, 2500])
    record = of(stamps[kept], x[kept])
    assert record.pieces == [(0, 1000), (1000, 2498), (2498, kept.size)]
    assert np.abs(record.t - even[kept]).max() < 0.05 / RATE


def test_uneven_samples_that_the_motion_follows_keep_their_times():
    _, stamps, _ = jittered(0.3)
    x = np.interp(stamps, np.arange(80000) / 20000, 0.3 * np.sin(4 * np.arange(80000) / 20000))
    record = of(stamps, x + SIGMA * np.random.default_rng(2).standard_normal(stamps.size))
    assert np.array_equal(record.t, stamps)
    assert any("x follows" in text for text in record.notes)


@pytest.mark.parametrize("quiet", ["ring-down", "rest", "grid"])
def test_stamps_that_a_mostly_quiet_motion_follows_stay(quiet):
    _, stamps, _ = jittered(0.3)
    x = 0.3 * np.exp(-4 * stamps) * np.sin(20 * stamps)
    if quiet == "rest":
        x = np.where(stamps < 1.2, 0.3 * np.sin(20 * stamps), 0.3 * np.sin(24.0))
    elif quiet == "grid":
        x = 0.01 * np.round(0.3 * np.sin(0.9 * stamps) / 0.01)
    else:
        x = x + 1e-7 * np.random.default_rng(2).standard_normal(stamps.size)
    assert np.array_equal(of(stamps, x).t, stamps)


def test_a_record_of_gaps_alone_is_refused():
    t, x = bouncing(400)
    rows = np.flatnonzero(np.arange(t.size) % 10 < 8)
    with pytest.raises(SeparatrixError, match="row 9: gaps leave 0 samples in intervals of at least 12"):
        of(t[rows], x[rows])


def test_pieces_shorter_than_a_segment_are_cut_within_their_ends():
    """Also one that begins with an impact, where no segment may start."""
    t, x = bouncing()
    rows = np.setdiff1d(np.arange(t.size), [800, 814, 840, 900])
    record = of(t[rows], x[rows])
    smoothed = smooth(record.t, record.x, SIGMA)
    smoothed.state[:, 1] = np.where((smoothed.t > 0.79) & (smoothed.t < 0.91), 0.0, smoothed.state[:, 1])
    segments = cut([whole(record)], [smoothed], [400])
    assert (segments.last - segments.first >= 6).all()
    for first, last in zip(segments.first, segments.last, strict=True):
        assert any(a <= first and last <= b for a, b in record.pieces)
