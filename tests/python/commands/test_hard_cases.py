# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions that are given up, cost too much or are hardly meant: the file is right, the program reports it."""

import csv

import h5py
import pytest
from program import run, succeed

PAIR = """\
[body]
law = "friction_pair"
mass = 1
driven_mass = 1
friction = 0.5
[contact]
law = "newton"
restitution = 0.5
lower = 0
[drive]
law = "velocity"
velocity = 0.2
[run]
duration = 2
"""

LEANING = """\
drive = { law = "velocity", velocity = 0.5 }
contact = { law = "hunt_crossley_exact", stiffness = 1e14, restitution = 0.6, upper = 0.1 }
body = { law = "friction_pair", mass = 1, driven_mass = 0.7, friction = 3 }
start = { v0 = 0.5 }
run = { duration = 2, average = "window" }
integrator = { step_budget = 200000 }
"""

SHAKEN = """\
drive = { law = "sine", amplitude = 4, frequency = 1 }
contact = { law = "hunt_crossley_exact", stiffness = 1e12, restitution = 0.6, upper = 0.1, lower = -0.1 }
body = { law = "backlash_pair", mass = 1, driven_mass = 0.7, friction = 0.3 }
run = { duration = 5, average = "window" }
integrator = { step_budget = 20000 }
"""

SOFT = """\
[body]
mass = 1
[restoring]
law = "linear"
stiffness = 100
[contact]
law = "kelvin_voigt"
stiffness = 1e4
damping = 1e9
upper = 0.02
[drive]
law = "harmonic"
ratio = 0.7
amplitude = 0.05
[start]
v0 = 0.5
[run]
duration = 10
[integrator]
step_budget = 20000
"""


def test_a_body_at_rest_on_a_stop_is_pulled_off_it(separatrix, tmp_path):
    (tmp_path / "case.toml").write_text(PAIR)
    succeed(separatrix, "trajectory", "case.toml", "--csv", "events.csv", folder=tmp_path)
    with (tmp_path / "events.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows] == ["stick"]
    assert float(rows[0]["driver_x"]) == pytest.approx(0.08, abs=1e-14)
    assert float(rows[0]["driver_v"]) == 0.2
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        assert file.attrs["reason"] == "time_over"
        assert abs(file.attrs["energy_closing_error"]) < 1e-15


def test_a_body_leans_on_a_very_stiff_stop(separatrix, tmp_path):
    """Steps follow the contact's frequency, not the digits that positions have of its depth (F/K)^(2/3)."""
    (tmp_path / "case.toml").write_text(LEANING)
    succeed(separatrix, "trajectory", "case.toml", folder=tmp_path)
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        assert file.attrs["reason"] == "time_over"
        assert file["x"][-1] - 0.1 == pytest.approx((3 / 1e14) ** (2 / 3), abs=1e-15)


def test_a_very_stiff_stop_that_moves(separatrix, tmp_path):
    """Its motion, many million times as wide as the contact is deep, leaves that its digits."""
    (tmp_path / "case.toml").write_text(SHAKEN)
    succeed(separatrix, "trajectory", "case.toml", folder=tmp_path)
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        assert file.attrs["reason"] == "time_over"
        assert file.attrs["energy_lost_to_contacts"] > 0


def test_a_motion_given_up_at_once(separatrix, tmp_path):
    (tmp_path / "case.toml").write_text(PAIR + "[integrator]\nevent_budget = 1\n")
    outcome = run(separatrix, "trajectory", "case.toml", "--set", "body.impulse=1", folder=tmp_path)
    assert outcome.code == 78
    assert "given up before the end: event_budget (flights count" in outcome.out
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        assert file["time"].size == 0
        assert file.attrs["reason"] == "event_budget"
        assert "energy_start" in file.attrs
        assert not {"energy_end", "energy_closing_error"} & set(file.attrs)


def test_a_stiff_barrier_ends_by_the_step_budget(separatrix, tmp_path):
    (tmp_path / "case.toml").write_text(SOFT)
    outcome = run(separatrix, "trajectory", "case.toml", folder=tmp_path)
    output = outcome.out
    assert outcome.code == 78
    assert "so stiff that integrator.step_budget = 20000 suffices" in output
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        assert file.attrs["reason"] == "step_budget"
    (tmp_path / "list.csv").write_text("x0,v0\n0,0.5\n0.01,0\n")
    words = ["points", "case.toml", "--list", "list.csv", "-o", "points.h5", "--partial"]
    assert "given up: 2 of 2 points" in succeed(separatrix, *words, folder=tmp_path).out
    with h5py.File(tmp_path / "points.h5") as file:
        assert file["reason"][()].tolist() == [7, 7]


def test_an_impulse_after_the_end_is_reported(separatrix, tmp_path):
    (tmp_path / "case.toml").write_text(PAIR)
    impulse = ["--set", "body.impulse=1", "--set", "body.impulse_time=2.5"]
    output = succeed(separatrix, "trajectory", "case.toml", *impulse, folder=tmp_path).out
    assert "body.impulse_time = 2.5 s is after the end" in output


@pytest.mark.parametrize(
    ("setting", "key"),
    [
        ("body.impulse=0.1", "body.impulse"),
        (
            'drive={law="pid_velocity",velocity=0.2,proportional=50,sample_time=0.05}',
            "drive.sample_time",
        ),
    ],
)
def test_a_motion_without_section_is_reported(separatrix, tmp_path, setting, key):
    (tmp_path / "case.toml").write_text(PAIR)
    axes = 'axis=[{name="x0",from=0,to=1,count=2},{name="v0",from=0,to=1,count=2}]'
    output = succeed(
        separatrix, "basin", "case.toml", "--set", axes, "--set", setting, "-o", "b.h5", folder=tmp_path
    ).out
    assert f"no attractors are looked for: with {key} the state" in output
    with h5py.File(tmp_path / "b.h5") as file:
        assert set(file["attractor"][()].ravel().tolist()) <= {-1, 0}


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("trajectory.samples_per_period=2000000000", "allowed at most 20000000 samples in all"),
        (
            'contact={law="kelvin_voigt",stiffness=1e4,damping=1,upper=1,tension=0.5}',
            "key 'contact.tension': found 0.5, allowed 0 or 1",
        ),
    ],
)
def test_refused_before_the_start(separatrix, tmp_path, option, message):
    (tmp_path / "case.toml").write_text(PAIR)
    outcome = run(separatrix, "trajectory", "case.toml", "--set", option, folder=tmp_path)
    assert outcome.code == 65
    assert message in outcome.err
