# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments of structures: the motion of another simulator, and its derivatives by starts and numbers."""

import numpy as np
import pytest
from hidden_bodies import Sprung, flown
from separatrix.library import CaseError, Model
from separatrix.segments import flown_in_threads
from structures import Friction, Rigid, Structure

CASE = """
body.first.mass = 1
body.second.mass = 0.8
drive.force = {law = "force", body = "first", amplitude = 4, frequency = 7}
run.duration = 20
[spring.frame]
between = ["first"]
law = "polynomial"
stiffness = 40
cubic = 30
damping = 0.3
[spring.coupling]
between = ["first", "second"]
stiffness = 60
damping = 0.2
[friction.rail]
between = ["first"]
force = 0.15
[contact.stop]
between = ["second"]
law = "newton"
restitution = 0.7
upper = 0.12
"""
PATHS = ["spring.frame.cubic", "friction.rail.force", "contact.stop.upper", "contact.stop.restitution",
         "body.second.mass", "drive.force.frequency"]  # fmt: skip
VALUES = np.array([30, 0.15, 0.12, 0.7, 0.8, 7.0])


def machine() -> Structure:
    def force(t, q, v):
        frame = -40 * q[0] - 30 * q[0] ** 3 - 0.3 * v[0]
        coupling = 60 * (q[1] - q[0]) + 0.2 * (v[1] - v[0])
        return np.array([frame + coupling + 4 * np.cos(7 * t), -coupling])

    rail = Friction([1, 0], lambda u: 0.15, 0.15)
    return Structure([1, 0.8], force, [rail], rigid=[Rigid([0, 1], 0.12, 1, lambda u: 0.7)])


def segments(count: int, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(3)
    start = random.normal(0, [0.1, 0.05, 0.7, 0.7, 2.0], (count, 5))
    start[:, 1] = np.minimum(start[:, 1], 0.1)
    return start, np.arange(count + 1) * samples, np.tile(np.linspace(0, 0.9, samples), count)


@pytest.mark.usefixtures("library")
def test_segments_are_the_motion_of_another_simulator() -> None:
    model = Model.from_text(CASE)
    assert model.coordinates == ("first", "second")
    assert [name.rpartition(".")[2] for name in model.contacts] == ["stop"]
    start, first, times = segments(6, 40)
    found = model.segments(PATHS, VALUES, start, first, times, derivatives=False)
    assert found.jacobian is None
    for i, one in enumerate(start):
        begins = one[4] / 7
        wanted = flown(machine(), one[:2], one[2:4], begins + times[:40])
        assert found.motion[first[i] : first[i + 1]] == pytest.approx(wanted, abs=1e-7)
    assert found.impacts.sum() >= 3
    assert set(found.impact.contact) == {0}
    assert found.impact.speed_after == pytest.approx(0.7 * found.impact.speed_before)


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize("derivatives", [True, False])
def test_threads_share_segments_and_change_no_bit(derivatives: bool) -> None:
    """With numbers of samples that differ, and fewer segments than threads could take."""
    model = Model.from_text(CASE)
    for count in (23, 5, 0):
        start, *_ = segments(count, 1)
        sizes = 1 + np.arange(count) * 7 % 40
        first = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        times = np.concatenate([[0.0], *(np.linspace(0, 0.9, size) for size in sizes)])[1:]
        given = (PATHS, VALUES, start, first, times, None, derivatives)
        alone = model.segments(*given)
        assert count < 23 or (np.unique(alone.impact.segment).size > 3 and alone.impact.segment.max() > 12)
        with flown_in_threads(3):
            shared = model.segments(*given)
        for name in ("motion", "jacobian", "impacts", "steady", "reason"):
            np.testing.assert_array_equal(getattr(shared, name), getattr(alone, name))
        for name in ("segment", "time", "contact", "speed_before", "speed_after", "side"):
            np.testing.assert_array_equal(getattr(shared.impact, name), getattr(alone.impact, name))


@pytest.mark.usefixtures("library")
def test_elastic_friction_begins_in_slide() -> None:
    law = 'law = "elastic_coulomb"\nstiffness = 80\nforce = 0.5'
    model = Model.from_text(CASE[: CASE.index("[contact")].replace("force = 0.15", law))
    start, first, times = segments(6, 40)
    found = model.segments([], np.zeros(0), start, first, times, derivatives=False)
    whole = machine()
    for i, one in enumerate(start):
        other = Sprung(whole.mass, whole.force, [1, 0], 80.0, 0.5, int(np.sign(one[2])))
        wanted = other.along(one[:2], one[2:4], one[4] / 7 + times[:40])
        assert found.motion[first[i] : first[i + 1]] == pytest.approx(wanted, abs=1e-7)


@pytest.mark.usefixtures("library")
def test_derivatives_are_those_of_another_step() -> None:
    model = Model.from_text(CASE)
    start, first, times = segments(12, 40)
    found = model.segments(PATHS, VALUES, start, first, times)
    good = np.repeat(found.steady & (found.reason == 0), 40)
    assert good.sum() > 0.7 * good.size

    def apart(values: tuple, starts: tuple, step: float) -> np.ndarray:
        ends = [
            model.segments(PATHS, v, s, first, times, derivatives=False).motion
            for v, s in zip(values, starts, strict=True)
        ]
        return (ends[0] - ends[1]) / (2 * step)

    columns = []
    for k, value in enumerate(VALUES):
        step = 1e-4 * value
        moved = [VALUES + sign * step * (np.arange(VALUES.size) == k) for sign in (1, -1)]
        columns.append(apart(tuple(moved), (start, start), step))
    for k in range(5):
        moved = [start + sign * 1e-5 * (np.arange(5) == k) for sign in (1, -1)]
        columns.append(apart((VALUES, VALUES), tuple(moved), 1e-5))
    for k, wanted in enumerate(columns):
        error = np.abs(found.jacobian[good, :, k] - wanted[good])
        # samples next to an impact lie on either side of it
        assert np.quantile(error, 0.97) < 1e-3 * max(1e-2, np.abs(wanted[good]).max()), k


@pytest.mark.usefixtures("library")
def test_what_starts_cannot_express_is_refused(source_dir) -> None:
    one_body = Model.read(source_dir / "examples" / "trajectory_viscous_0.8.toml")
    assert one_body.coordinates == ()
    with pytest.raises(CaseError, match=r"start: found shape \(1, 5\), allowed \(1, 3\)"):
        one_body.segments([], np.zeros(0), np.zeros((1, 5)), np.array([0, 0]), np.zeros(0))
    impulse = '[drive.impulse]\nlaw = "impulse"\nbody = "first"\nimpulse = 1\ntime = 2\n'
    struck = Model.from_text(CASE + impulse)
    with pytest.raises(CaseError, match="impulses, or samples of a controller"):
        struck.segments([], np.zeros(0), np.zeros((1, 5)), np.array([0, 0]), np.zeros(0))


@pytest.mark.usefixtures("library")
def test_a_sample_without_a_derivative_is_not_steady() -> None:
    """At the instant of an impact a velocity has one before and one after it."""
    model, start, first = Model.from_text(CASE), np.array([[0.0, 0.0, 0.0, 2.0, 0.0]]), np.array([0, 2])

    def fly(time: float):
        return model.segments([], np.zeros(0), start, first, np.array([time, 0.1]))

    hit = fly(0.0).impact.time
    assert hit.size == 1
    assert fly(hit[0] - 1e-3).steady[0]
    assert fly(hit[0] + 1e-3).steady[0]
    assert not fly(hit[0]).steady[0]
