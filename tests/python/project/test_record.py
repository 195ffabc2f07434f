# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated records look measured, and give back what they were made with."""

import h5py
import numpy as np
import pytest
from program import run, succeed

PLATFORM = """\
[body]
law = "friction_pair"
mass = 1
driven_mass = 0.7
friction = 0.3
[contact]
law = "newton"
restitution = 0.6
upper = 1
[drive]
law = "velocity"
velocity = 0.5
[start]
v0 = 0.5
[run]
duration = 8
[record]
rate = "2 kHz"
noise = "8 um"
"""


@pytest.fixture
def case(tmp_path):
    (tmp_path / "case.toml").write_text(PLATFORM)
    return tmp_path


def read(path):
    """Comments as a dictionary, and the columns."""
    lines = path.read_text().splitlines()
    comments = dict(line[2:].split(": ", 1) for line in lines if line.startswith("#"))
    header, *rows = (line for line in lines if not line.startswith("#"))
    return comments, dict(
        zip(header.split(","), np.array([row.split(",") for row in rows], float).T, strict=True)
    )


def record(separatrix, folder, *settings):
    words = [word for setting in settings for word in ("--set", setting)]
    succeed(separatrix, "trajectory", "case.toml", "--force", "--record", "record.csv", *words, folder=folder)
    return read(folder / "record.csv")


def test_restitution_and_friction_come_back(separatrix, case):
    """Flights between impacts are parabolas; their lengths and heights give e and b/m2."""
    _, columns = record(separatrix, case)
    t, x = columns["t"], columns["x"]
    stop = np.mean(x[t > 7])
    away = stop - x > 1e-4
    starts, ends = (np.flatnonzero(np.diff(away.astype(int)) == sign) for sign in (1, -1))
    flights = [
        (a, b)
        for a, b in zip(
            starts[starts > starts[0] - 1], ends[1:] if ends[0] < starts[0] else ends, strict=False
        )
        if b - a > 100
    ]
    times, heights = [], []
    for a, b in flights[:5]:
        inside = slice(a + 3, b - 2)
        middle = t[inside].mean()
        c = np.polyfit(t[inside] - middle, stop - x[inside], 2)
        times.append(np.sqrt(c[1] ** 2 - 4 * c[0] * c[2]) / abs(c[0]))
        heights.append(c[2] - c[1] ** 2 / (4 * c[0]))
    times, heights = np.array(times), np.array(heights)
    assert len(times) == 5
    assert times[1:] / times[:-1] == pytest.approx(0.6, abs=2e-3)
    assert np.sqrt(heights[1:] / heights[:-1]) == pytest.approx(0.6, abs=1e-3)
    assert 8 * heights / times**2 == pytest.approx(0.3 / 0.7, rel=5e-3)


def test_noise_resolution_and_delay(separatrix, case):
    _, clean = record(separatrix, case, 'record={rate="2 kHz"}')
    comments, noisy = record(separatrix, case)
    assert comments["sensor_noise_sigma_m"] == "8.0e-6"
    assert float(comments["sampling_rate_hz"]) == 2000
    noise = noisy["x"] - clean["x"]
    assert np.std(noise) == pytest.approx(8e-6, rel=0.03)
    assert abs(np.mean(noise)) < 3 * 8e-6 / np.sqrt(noise.size)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.04
    assert abs(np.corrcoef(noise, noisy["driver_x"] - clean["driver_x"])[0, 1]) < 0.04
    _, again = record(separatrix, case)
    assert np.array_equal(again["x"], noisy["x"])
    _, other = record(separatrix, case, 'record={rate="2 kHz", noise="8 um", seed=2}')
    assert not np.array_equal(other["x"], noisy["x"])
    _, coarse = record(separatrix, case, 'record={rate="2 kHz", resolution="0.1 mm"}')
    assert np.abs(coarse["x"] - clean["x"]).max() <= 0.5000001e-4
    assert np.abs(coarse["x"] / 1e-4 - np.round(coarse["x"] / 1e-4)).max() < 1e-6
    _, late = record(separatrix, case, 'record={rate="2 kHz", delay="1.5 ms"}')
    assert late["x"][3:] == pytest.approx(clean["x"][:-3], abs=1e-12)


def test_record_agrees_with_the_history(separatrix, case):
    _, columns = record(separatrix, case, 'record={rate="200 Hz"}')
    with h5py.File(case / "case.trajectory.h5") as file:
        time, x = file["time"][:], file["x"][:]
    assert time == pytest.approx(columns["t"], abs=1e-12)
    assert x == pytest.approx(columns["x"], abs=1e-12)


def test_options(separatrix, case):
    assert run(separatrix, "basin", "case.toml", "--record", "r.csv", folder=case).code == 64
    assert run(separatrix, "trajectory", "case.toml", "--record", "case.toml", folder=case).code == 64
    outcome = run(separatrix, "trajectory", "case.toml", "--set", "record.rate=0", folder=case)
    assert outcome.code == 65
    assert "record.rate" in outcome.err


def test_two_bodies_are_asked_for_what_they_have(separatrix, case):
    """Laws of one body are refused for two and the other way round, with the key."""
    for setting, key in (
        ('friction={law="coulomb", kinetic_coefficient=0.2}', "friction.law"),
        ('drive={law="harmonic", ratio=1, amplitude=1}', "drive.law"),
        ("start.x0=1.5", "start.x0"),
        ('body={law="point_mass", mass=1}', "drive.law"),
    ):
        outcome = run(separatrix, "trajectory", "case.toml", "--set", setting, folder=case)
        assert outcome.code == 65, setting
        assert key in outcome.err
    outcome = run(separatrix, "sweep", "case.toml", folder=case)
    assert outcome.code == 65
    assert "[sweep]" in outcome.err


def test_book_of_energy(separatrix, case):
    succeed(separatrix, "trajectory", "case.toml", folder=case)
    with h5py.File(case / "case.trajectory.h5") as file:
        book = dict(file.attrs)
        names = ("energy", "friction_loss", "damping_loss", "contact_loss", "drive_work")
        losses = {name: file[name][:] for name in names}
        assert file["mode"][-1] == 4
        assert file["x"][-1] == 1
        names = file["event_kind"].attrs["flag_meanings"].split()
        assert names[file["event_kind"][-1] - 1] == "chatter_upper"
        assert file["event_time"][-1] == pytest.approx(2 + 2 * 0.7 * 0.5 * 0.6 / (0.3 * 0.4), abs=1e-10)
    assert book["energy_start"] == 0.5 * 0.7 * 0.25
    assert abs(book["energy_closing_error"]) < 1e-12
    assert losses["contact_loss"][-1] > 0
    turned = losses["energy"][0] + losses["drive_work"]
    assert turned == pytest.approx(
        losses["energy"] + losses["friction_loss"] + losses["damping_loss"] + losses["contact_loss"],
        abs=1e-12,
    )
    assert np.all(np.diff(losses["friction_loss"]) >= 0)


@pytest.mark.parametrize("rate", [1e9, 3e8, 3e6])
def test_a_record_that_does_not_fit_is_refused_before_the_run(separatrix, case, rate):
    words = ("trajectory", "case.toml", "--record", "record.csv", "--set", f"record.rate={rate}")
    refused = run(separatrix, *words, folder=case)
    assert refused.code == 65
    assert "'record.rate'" in refused.err
    assert "at most 2500000.0 Hz over 8" in refused.err
    assert [path.name for path in case.iterdir()] == ["case.toml"]


def test_every_file_is_named_when_it_is_written(separatrix, case):
    output = succeed(
        separatrix, "trajectory", "case.toml", "--record", "record.csv", "--csv", "events.csv", folder=case
    ).out
    written = [line.split("wrote ")[1] for line in output.splitlines() if "wrote " in line]
    assert sorted(path.split("/")[-1] for path in written) == [
        "case.trajectory.h5",
        "events.csv",
        "record.csv",
    ]
