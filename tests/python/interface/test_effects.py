# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every command works on machines with effects, and what is recorded shows what a sensor would."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import CASE, STARTS, run, succeed

RECORD = '\n[run]\nduration = 3\n[record]\nrate = "2 kHz"\n'
DAHL = "\n[effect.dahl]\nstiffness = 500\n[effect.cubic_spring]\nstiffness = 10\n"


def columns(path):
    """Columns of a record by name."""
    header, *rows = (line for line in path.read_text().splitlines() if not line.startswith("#"))
    return dict(zip(header.split(","), np.array([row.split(",") for row in rows], float).T, strict=True))


def record(separatrix, folder, text, *settings):
    """The record that the case makes with these settings."""
    (folder / "case.toml").write_text(text)
    words = [word for setting in settings for word in ("--set", setting)]
    succeed(separatrix, "trajectory", "case.toml", "--force", "--record", "record.csv", *words, folder=folder)
    return columns(folder / "record.csv")


def test_sensors_change_the_record_alone(separatrix, tmp_path):
    """Record = (1 + gain) x(t - delay) + bias, to rounding, and the same motion."""
    plain = record(separatrix, tmp_path, CASE + RECORD)
    motion = h5py.File(tmp_path / "case.trajectory.h5")["x"][:]
    sensed = record(
        separatrix,
        tmp_path,
        CASE + RECORD,
        "effect.sensor_gain.gain=0.02",
        'effect.sensor_bias.bias="3 mm"',
        'effect.sensor_delay.delay="5 ms"',
    )
    np.testing.assert_array_equal(motion, h5py.File(tmp_path / "case.trajectory.h5")["x"][:])
    np.testing.assert_allclose(sensed["x"][10:], 1.02 * plain["x"][:-10] + 0.003, rtol=0, atol=1e-12)
    assert sensed["x"][0] == pytest.approx(1.02 * 0.4 + 0.003)


def test_measured_force_drives_what_it_was_measured_on(separatrix, tmp_path):
    """A record of x and force, read back as the force of a case, gives the same x."""
    times = np.arange(2001) / 1000
    force = 30 * np.sin(4 * times) + 8 * np.sin(17 * times)
    (tmp_path / "force.csv").write_text(
        "t,force\n" + "".join(f"{t},{f}\n" for t, f in zip(times, force, strict=True))
    )
    text = (
        '[body]\nmass = 2\n[friction]\nlaw = "coulomb_viscous"\nkinetic_coefficient = 0.3\ndamping = 4\n'
        '[drive]\nlaw = "measured_force"\nforce = "force.csv"\n[effect.asymmetric_friction]\nviscous = 1\n'
        '[run]\nduration = 2\n[record]\nrate = "1 kHz"\n'
    )
    first = record(separatrix, tmp_path, text)
    np.testing.assert_allclose(first["force"][:-1], force[:-1], rtol=0, atol=1e-12)
    assert np.ptp(first["x"]) > 0.1
    (tmp_path / "force.csv").write_text((tmp_path / "record.csv").read_text().replace("# ", "# copy of "))
    again = record(separatrix, tmp_path, text)
    np.testing.assert_allclose(again["x"][:-1], first["x"][:-1], rtol=0, atol=1e-8)


def test_samples_of_a_force_repeat_as_one_period(separatrix, tmp_path):
    """Reported: the first sample follows the last, or the period ends with the last sample and jumps."""
    samples = [round(float(x), 12) for x in np.cos(2 * np.pi * np.arange(20) / 20)]
    text = (
        "[body]\nmass = 1\n[restoring]\nlaw = 'linear'\nstiffness = 4\n"
        "[friction]\nlaw = 'viscous'\ndamping = 0.5\n"
        f"[drive]\nlaw = 'measured_force'\ninterval = 0.1\nforce = {samples}\n[run]\nduration = {{}}\n"
    )
    for name, duration, settings, warned in (
        ("whole", 1.9, ["--set", "drive.periodic=0"], False),
        ("longer", 40, ["--set", "drive.periodic=0"], True),
        ("periodic", 40, [], False),
    ):
        (tmp_path / "case.toml").write_text(text.format(duration))
        output = succeed(
            separatrix, "trajectory", "case.toml", *settings, "-o", f"{name}.h5", folder=tmp_path
        ).out
        assert ("set drive.periodic = 1" in output) == warned
        assert ("assumed: drive.periodic = 1 (the first sample follows the last: period 2.0" in output) == (
            not settings
        )
    with h5py.File(tmp_path / "longer.h5") as file:
        assert file.attrs["drive_period"] == pytest.approx(1.9)
    with h5py.File(tmp_path / "periodic.h5") as file:
        assert file.attrs["drive_period"] == pytest.approx(2.0)
        # a chain of straight lines instead of a cosine has (sin(pi/20)/(pi/20))^2 of its amplitude
        expected = (np.sin(np.pi / 20) / (np.pi / 20)) ** 2 / np.hypot(4 - np.pi**2, 0.5 * np.pi)
        assert file.attrs["amplitude"] == pytest.approx(expected, rel=2e-3)


def test_maps_over_an_effect(separatrix, tmp_path):
    """Basin over the size of an effect, points, sweep and verification against quadruple precision."""
    case = CASE.replace(
        'name = "v0"\nfrom = -6\nto = "6 m/s"\ncount = 31',
        'name = "effect.cubic_spring.stiffness"\nvalues = [0, 10]',
    )
    case = case.replace("count = 19", "count = 5") + DAHL + "[run]\nduration = 4\n"
    case = case.replace(
        "[sweep]\nfrom = 0.8\nto = 1.4\nstep = 0.1",
        "[sweep]\nparameter = 'effect.dahl.stiffness'\nfrom = 500\nto = 600\ncount = 2",
    )
    case = case.replace("sample = 32", "sample = 8").replace("starts = [3, 2]", "starts = [0, 0]")
    (tmp_path / "case.toml").write_text(case)
    (tmp_path / "starts.csv").write_text(STARTS)
    succeed(separatrix, "basin", "case.toml", folder=tmp_path)
    with h5py.File(tmp_path / "case.basin.h5") as file:
        np.testing.assert_array_equal(file["effect_cubic_spring_stiffness"], [0, 10])
        assert np.all(file["reason"][:] < 3)
    answer = run(separatrix, "verify", "case.basin.h5", "--sample", "2", folder=tmp_path)
    assert answer.code == 0
    assert "0 label flips" in answer.out
    succeed(separatrix, "points", "case.toml", "--list", "starts.csv", "-o", "points.h5", folder=tmp_path)
    succeed(separatrix, "sweep", "case.toml", "-o", "sweep.h5", folder=tmp_path)


def names_in(cell):
    """The words in backquotes of a cell of a table."""
    return cell.split("`")[1::2]


def test_laws_list_the_effects(separatrix, tmp_path):
    """Names, units and defaults that the discovery workflow takes from the table; the guide has them all."""
    rows = json.loads(run(separatrix, "laws", "--json", folder=tmp_path).out)
    effects = {
        row["law"]: {p["name"]: p for p in row["parameters"]} for row in rows if row["family"] == "effect"
    }
    guide = (Path(__file__).parents[3] / "docs" / "case-file.md").read_text()
    table = guide.split("#### Effects: [effect.NAME]")[1].split("\n#### ")[0].split("|---|---|---|")[1]
    described = [
        name for line in table.splitlines() if line.startswith("|") for name in names_in(line.split("|")[1])
    ]
    assert sorted(described) == sorted(effects)
    assert effects["quadratic_drag"]["coefficient"]["unit"] == "N s^2/m^2"
    assert effects["stribeck"]["exponent"]["default"] == 2
    assert effects["dahl"]["stiffness"]["default"] is None
