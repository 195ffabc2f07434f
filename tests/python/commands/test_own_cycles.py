# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Limit cycles of one body by expressions without a drive: exponents and branches beside SciPy."""

import math
import re
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import run, succeed
from scipy.integrate import solve_ivp

PUMP = '[force.pump]\nforce = "mu*(1 - x^2)*v - x"\nmu = {mu}\n'
WALL = '[contact]\nlaw = "expression"\nlower = -1.2\nrestitution = "0.8/(1 + speed)"\n'
FRICTION = '[friction]\nlaw = "expression"\nforce = "0.1 + 0.05*exp(-speed)"\n'
STATE = '[force.z]\nforce = "-0.3*z"\n[state.z]\nrate = "(x - z)/2"\n'
TIGHT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


def write(folder: Path, forces: str, x: float = 1.4) -> None:
    (folder / "case.toml").write_text(f"[body]\nmass = 1\n{forces}[start]\nx0 = {x}\n[run]\nduration = 100\n")


def exponents(separatrix, folder: Path) -> tuple[list[float], float]:
    """Those that are printed, and the time of a return."""
    out = succeed(separatrix, "stability", "case.toml", "--periods", "4000", folder=folder).out
    found = [float(value) for value in re.findall(r"exponent \d: (\S+) 1/s", out)]
    return found, float(re.search(r"crossed every (\S+) s", out)[1])


def over_wall(rates: Callable, z: np.ndarray) -> tuple[float, np.ndarray]:
    """From a point with v = 0 to the next maximum, over the wall."""
    time = 0.0

    def turns(_: float, y: np.ndarray) -> float:
        return y[1]

    def wall(_: float, y: np.ndarray) -> float:
        return y[0] + 1.2

    turns.direction, turns.terminal = -1, True
    wall.direction, wall.terminal = -1, True
    z = np.array(z, dtype=float)
    while True:
        # Off the section at first.
        start = solve_ivp(rates, (0, 1e-3), z, **TIGHT).y[:, -1]
        flown = solve_ivp(rates, (0, 50), start, events=(turns, wall), **TIGHT)
        time += 1e-3 + flown.t[-1]
        z = flown.y[:, -1]
        if len(flown.t_events[0]):
            return time, z
        z[1] *= -0.8 / (1 + abs(z[1]))


def over_minimum(rates: Callable, z: np.ndarray) -> tuple[float, np.ndarray]:
    """From a maximum to the next without a wall, halted at the minimum, where friction changes its sign."""
    time = 0.0
    for direction in (1, -1):

        def turns(_: float, y: np.ndarray) -> float:
            return y[1]

        turns.direction, turns.terminal = direction, True
        z = np.array(z, dtype=float)
        # Friction acts against the motion that begins.
        z[1] = -direction * 1e-13
        start = solve_ivp(rates, (0, 1e-3), z, **TIGHT).y[:, -1]
        flown = solve_ivp(rates, (0, 50), start, events=turns, **TIGHT)
        time += 1e-3 + flown.t[-1]
        z = flown.y[:, -1]
    return time, z


def cycle(to_section: Callable, rates: Callable, size: int) -> tuple[float, np.ndarray]:
    """Period and multipliers by differences of SciPy's return map."""
    z = np.array([1.4] + [0.0] * (size - 1))
    for _ in range(30):
        time, z = to_section(rates, z)
    free = [0, *range(2, size)]
    slopes = np.zeros((len(free), len(free)))
    for column, k in enumerate(free):
        step = np.zeros(size)
        step[k] = 1e-4
        slopes[:, column] = (to_section(rates, z + step)[1] - to_section(rates, z - step)[1])[free] / 2e-4
    return time, np.sort(np.abs(np.linalg.eigvals(slopes)))[::-1]


def oscillator(_: float, z: np.ndarray) -> list[float]:
    return [z[1], (1 - z[0] ** 2) * z[1] - z[0]]


def with_friction(_: float, z: np.ndarray) -> list[float]:
    speed = abs(z[1])
    return [z[1], oscillator(0, z)[1] - math.copysign(0.1 + 0.05 * math.exp(-speed), z[1])]


def with_state(_: float, z: np.ndarray) -> list[float]:
    return [z[1], oscillator(0, z)[1] - 0.3 * z[2], (z[0] - z[2]) / 2]


@pytest.mark.parametrize(
    ("more", "rates", "size", "to_section"),
    [
        ("", oscillator, 2, over_minimum),
        (WALL, oscillator, 2, over_wall),
        (FRICTION, with_friction, 2, over_minimum),
        (STATE, with_state, 3, over_minimum),
    ],
)
def test_exponents_are_those_of_scipys_return_map(separatrix, tmp_path, more, rates, size, to_section):
    write(tmp_path, PUMP.format(mu=1) + more)
    found, period = exponents(separatrix, tmp_path)
    time, multipliers = cycle(to_section, rates, size)
    assert period == pytest.approx(time, rel=1e-8)
    assert found == pytest.approx(np.log(multipliers) / time, rel=1e-3)


def test_branch_of_limit_cycles_is_one_over_the_whole_range(separatrix, tmp_path):
    write(tmp_path, PUMP.format(mu=1))
    asked = ("--parameter", "force.pump.mu", "--from", "1", "--to", "1.1", "--searches", "1")
    succeed(separatrix, "branches", "case.toml", "-o", "b.h5", "-q", *asked, folder=tmp_path, timeout=300)
    with h5py.File(tmp_path / "b.h5") as file:
        assert set(file["branch"][:]) == {1}
        parameter, time = file["parameter"][:], file["cycle_time"][:]
        multiplier = file["multiplier_real"][:, 0]
    first, last = parameter.argmin(), parameter.argmax()
    assert (parameter[first], parameter[last]) == pytest.approx((1, 1.1))
    # Of mu = 1 as docs/machines/expressions.md prints it, from a search without variations.
    assert (time[first], multiplier[first]) == pytest.approx((6.6632869, 0.0008597), rel=1e-4)


def test_a_rotation_has_the_multiplier_of_its_losses(separatrix, tmp_path):
    """exp(-c T/J), as no other torque changes with the speed."""
    (tmp_path / "case.toml").write_text(
        '[body]\nmass = "1 kg m^2"\n[restoring]\nlaw = "pendulum"\nmoment = "1 N m"\n[force.motor]\n'
        'force = "m - c*v"\nm = "1.3 N m"\nc = "0.3 N m s/rad"\n[start]\nx0 = "0.1 rad"\n'
        "[run]\nduration = 100\n"
    )
    found, _ = exponents(separatrix, tmp_path)
    assert found == pytest.approx([-0.3], rel=1e-6)


def test_a_motion_that_dies_away_is_no_cycle(separatrix, tmp_path):
    write(tmp_path, '[force.spring]\nforce = "-x - 0.1*v"\n')
    ended = run(separatrix, "stability", "case.toml", "--periods", "400", folder=tmp_path)
    assert "not known: the motion comes to rest" in ended.out
    assert "periodic" not in ended.out


@pytest.mark.parametrize("drag", ["0.1*v*abs(v)", "0.1*v^3"])
def test_a_motion_that_dies_away_by_a_power_of_time_is_no_cycle(separatrix, tmp_path, drag):
    write(tmp_path, f'[force.spring]\nforce = "-x - {drag}"\n')
    ended = run(separatrix, "stability", "case.toml", "--periods", "1000", folder=tmp_path)
    assert "comes to rest" in ended.out
    assert "periodic" not in ended.out


@pytest.mark.parametrize("rate", ["1", "x^2"])
def test_a_state_that_drifts_is_on_no_cycle(separatrix, tmp_path, rate):
    write(tmp_path, PUMP.format(mu=1) + f'[state.d]\nrate = "{rate}"\n')
    ended = run(separatrix, "stability", "case.toml", "--periods", "1000", folder=tmp_path)
    assert "periodic" not in ended.out
    assert "not known" in ended.out
