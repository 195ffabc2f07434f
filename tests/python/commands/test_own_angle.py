# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A pendulum under torques by expressions goes round on a circle, beside SciPy and the catalogue."""

import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import run, succeed
from scipy.integrate import solve_ivp

CASE = """
[body]
mass = "1 kg m^2"
[restoring]
law = "pendulum"
moment = "1 N m"
[friction]
law = "viscous"
damping = "{damping} N m s/rad"
{drive}
[force.torque]
force = "{torque}"
torque = "{size} N m"
[start]
x0 = "-2 rad"
v0 = "3 rad/s"
[run]
duration = {duration}
[[axis]]
name = "x0"
from = "-180 deg"
to = "144 deg"
count = 10
[[axis]]
name = "v0"
from = -2
to = 3
count = 6
"""
DRIVE = '[drive]\nlaw = "expression"\nperiod = "3*pi"'
BIASED = {"damping": 0.2, "drive": "", "torque": "torque", "size": 0.6, "duration": 60}
DRIVEN = {"damping": 0.5, "drive": DRIVE, "torque": "torque*cos(phase)", "size": 1.35, "duration": 60}


def write(folder: Path, **values: object) -> None:
    (folder / "case.toml").write_text(CASE.format(**values))


def rate(_: float, z: np.ndarray) -> list[float]:
    return [z[1], 0.6 - 0.2 * z[1] - math.sin(z[0])]


def test_rest_and_rotation_of_a_pendulum_under_a_constant_torque(separatrix, tmp_path):
    """Labels of all starts, the period of the rotation, and its multiplier exp(-c T/J)."""
    write(tmp_path, **BIASED)
    succeed(separatrix, "basin", "case.toml", "-o", "map.h5", "-q", folder=tmp_path)
    with h5py.File(tmp_path / "map.h5") as file:
        labels, x0, v0 = file["regime"][:], file["x0"][:], file["v0"][:]
        catalogue = file["catalogue"]
        turning = np.abs(catalogue["rotation_number"][:]) > 0
        assert list(turning) in ([True, False], [False, True])
        period = float(catalogue["cycle_time"][:][turning][0])
        multiplier = float(catalogue["multiplier"][:][turning][0])
        assert float(catalogue["x_max"][:][turning][0]) == pytest.approx(math.pi, abs=1e-12)
    end = solve_ivp(rate, [0, 120], [0, 3], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]

    def passes(_: float, z: np.ndarray) -> float:
        return math.sin(z[0] / 2)

    found = solve_ivp(rate, [0, 10], end, method="DOP853", rtol=1e-12, atol=1e-12, events=passes)
    assert period == pytest.approx(found.t_events[0][2] - found.t_events[0][1], rel=1e-8)
    assert multiplier == pytest.approx(math.exp(-0.2 * period), rel=1e-6)
    rests = labels == labels[np.unravel_index(np.argmin(np.hypot(*np.meshgrid(v0, x0))), labels.shape)]
    shape = labels.shape
    for i in range(0, len(x0), 3):
        for k in range(0, len(v0), 2):
            last = solve_ivp(rate, [0, 60], [x0[i], v0[k]], method="DOP853", rtol=1e-8, atol=1e-8).y[1, -1]
            assert bool(rests[(i, k) if shape == (len(x0), len(v0)) else (k, i)]) == (abs(last) < 0.05)


def test_a_driven_pendulum_is_that_of_the_catalogue(separatrix, tmp_path):
    """The same attractors and labels as under the torque by a record; quadruple precision agrees."""
    write(tmp_path, **DRIVEN)
    succeed(separatrix, "basin", "case.toml", "-o", "map.h5", "-q", folder=tmp_path)
    printed = succeed(separatrix, "verify", "map.h5", "--sample", "2", folder=tmp_path).out
    assert "2 points run again: 0 differ" in printed
    assert "0 label flips" in printed
    with h5py.File(tmp_path / "map.h5") as file:
        ours = file["attractor"][:]
        assert sorted(file["catalogue"]["rotation_number"][:]) == [-1, 1]
        assert list(file["catalogue"]["x_max"][:]) == pytest.approx([math.pi] * 2, abs=1e-12)
        senses = file["catalogue"]["rotation_number"][:]
    times = np.arange(1440) * 3 * math.pi / 1440
    rows = "".join(f"{t!r},{1.35 * math.cos(2 * t / 3)!r}\n" for t in times.tolist())
    (tmp_path / "torque.csv").write_text("t,force\n" + rows)
    case = (tmp_path / "case.toml").read_text().replace(DRIVE, "")
    before, after = case.split("[force.torque]")
    after = after[after.index("[start]") :]
    record = '[drive]\nlaw = "measured_force"\nforce = "torque.csv"\nperiodic = 1\n'
    (tmp_path / "twin.toml").write_text(before + record + after)
    succeed(separatrix, "basin", "twin.toml", "-o", "twin.h5", "-q", folder=tmp_path)
    with h5py.File(tmp_path / "twin.h5") as file:
        theirs = file["attractor"][:]
        other = file["catalogue"]["rotation_number"][:]
    assert np.mean(senses[ours - 1] == other[theirs - 1]) > 0.98


@pytest.mark.parametrize("values", [DRIVEN, BIASED, BIASED | {"size": -1.2}])
def test_lanes_and_the_event_loop_find_the_same_rotations(separatrix, tmp_path, values):
    write(tmp_path, **values)
    found = []
    for lanes in ("auto", "off"):
        settings = ["--set", f'integrator.lanes="{lanes}"', "--set", "attractors.sample=64"]
        succeed(separatrix, "basin", "case.toml", "-o", f"{lanes}.h5", "-q", *settings, folder=tmp_path)
        with h5py.File(tmp_path / f"{lanes}.h5") as file:
            turns = file["catalogue"]["rotation_number"][:]
            found.append((turns, file["attractor"][:], file["x_max"][:]))
    assert set(np.abs(found[0][0])) <= {0, 1}
    assert values["size"] > -1 or list(found[0][0]) == [-1]
    for one, other in zip(*found, strict=True):
        assert one == pytest.approx(other, rel=1e-6)


def test_a_rotation_keeps_its_label_over_the_torque(separatrix, tmp_path):
    write(tmp_path, **BIASED)
    more = '[[axis]]\nname = "force.torque.torque"\nfrom = 0.6\nto = 0.7\ncount = 3\n'
    with (tmp_path / "case.toml").open("a") as file:
        file.write(more)
    settings = ["--set", "axis.x0.count=3", "--set", "axis.v0.count=3", "--set", "attractors.sample=32"]
    succeed(separatrix, "basin", "case.toml", "-o", "map.h5", "-q", *settings, folder=tmp_path)
    with h5py.File(tmp_path / "map.h5") as file:
        catalogue = file["catalogue"]
        labels = catalogue["attractor"][:][np.abs(catalogue["rotation_number"][:]) > 0]
    assert len(labels) == 3
    assert len(set(labels)) == 1


def test_a_torque_that_knows_whole_turns_is_no_angle_on_a_circle(separatrix, tmp_path):
    """A weak torsion spring brings a pendulum that went round back to where it began."""
    write(tmp_path, **BIASED | {"torque": "torque - 0.05*x", "size": 0})
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "-q", folder=tmp_path)
    with h5py.File(tmp_path / "out.h5") as file:
        x, v = file["x"][:], file["v"][:]
        time = file["time"][:]

    def wound(_: float, z: np.ndarray) -> list[float]:
        return [z[1], -0.05 * z[0] - 0.2 * z[1] - math.sin(z[0])]

    theirs = solve_ivp(wound, [0, 60], [-2, 3], method="DOP853", rtol=1e-11, atol=1e-11, t_eval=[60]).y[:, -1]
    assert time[-1] == 60
    assert [x[-1], v[-1]] == pytest.approx(theirs, abs=1e-6)


@pytest.mark.parametrize(("key", "wrong", "allowed"), [
    ("body.mass", "1 kg", "kg m^2"), ("friction.damping", "1 N s/m", "N m s/rad"),
])  # fmt: skip
def test_units_of_a_pendulum_are_those_of_rotation(separatrix, tmp_path, key, wrong, allowed):
    write(tmp_path, **DRIVEN)
    ended = run(
        separatrix, "trajectory", "case.toml", "--set", f'{key}="{wrong}"', "-o", "out.h5", folder=tmp_path
    )
    assert ended.code == 65
    assert f"key '{key}': found \"{wrong}\"" in ended.err
    assert allowed in ended.err


def test_branches_of_rotations_are_followed(separatrix, tmp_path):
    """Both senses of rotation, each once, stable, with the product of multipliers exp(-c T/J)."""
    write(tmp_path, **DRIVEN | {"size": 1.35})
    limits = ["--from", "1.34", "--to", "1.36", "--searches", "1"]
    command = ["branches", "case.toml", "--parameter", "force.torque.torque", *limits, "-o", "out.h5", "-q"]
    succeed(separatrix, *command, folder=tmp_path)
    with h5py.File(tmp_path / "out.h5") as file:
        stable = file["stable"][:] > 0
        rounds = file["x_max"][:] - file["x_min"][:] > 2 * math.pi * (1 - 1e-9)
        branch, period = file["branch"][:], file["period"][:]
        values = file["multiplier_real"][:] + 1j * file["multiplier_imag"][:]
    turning = rounds & (period == 1) & stable
    assert len(np.unique(branch[turning])) == 2
    products = np.prod(values[turning], axis=1)
    assert products.real == pytest.approx(math.exp(-0.5 * 3 * math.pi), rel=1e-8)
