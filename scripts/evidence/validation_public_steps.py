# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Public problems whose sources give equations that tests/referee/structures.py integrates."""

import sys
from math import cos, exp, pi, sin

import h5py
import numpy as np
from evidence_rows import SOURCE, Row
from scipy.integrate import solve_ivp
from validation_public_program import Program, largest

sys.path.insert(0, str(SOURCE / "tests" / "referee"))
from structures import Friction, Structure  # noqa: E402

#: Angular frequency of the belt of PathSim [rad/s].
TURN = 2 * pi / 50


def by_steps(source: str, what: str, machine: Structure, program: Program, case: str, until: float) -> Row:
    """The largest difference in time of the events of a motion that `machine` has run."""
    theirs = sorted({round(at, 9): at for _, _, at in machine.events}.values())
    ours = sorted({round(at, 9): at for _, at in program.times(case, run__duration=until)}.values())
    return largest(
        f"{source}, by `tests/referee/structures.py`", f"{what}: times of events (s)", theirs, ours, 1e-8
    )


def belt(program: Program) -> list[Row]:
    """A block on a belt whose friction falls with the speed."""
    source = "R. I. Leine and others (1998)"
    machine = Structure([1], lambda t, q, v: -q, [Friction([1], lambda u: 1 / (1 + 3 * u), 1.0, 0.2)])
    machine.run([0.5], [0.2], 60)
    slips = [at for kind, _, at in machine.events if kind == "slip"]
    with h5py.File(program.run("trajectory", "leine_belt")) as file:
        cycle = float(file.attrs["cycle_time"])
    return [
        by_steps(source, "block on a belt", machine, program, "leine_belt", 60),
        Row(source, "the same: limit cycle (s)", slips[-1] - slips[-2], cycle, 1e-9),
    ]


def moving_belt(program: Program) -> list[Row]:
    """A box on a belt that goes to and fro, in the frame of the belt."""

    def force(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        position, rate = -2 / TURN * cos(TURN * t), 2 * sin(TURN * t)
        return -70 * (q + position) - 10 * (v + rate) - 20 * 2 * TURN * cos(TURN * t)

    machine = Structure([20], force, [Friction([1], lambda u: 294.3, 294.3)])
    machine.run([2 / TURN], [0], 100)
    return [
        by_steps(
            "PathSim, stick slip", "box on an oscillating belt", machine, program, "belt_back_and_forth", 100
        )
    ]


def modelica(program: Program) -> list[Row]:
    """The machines of Modelica with friction once more."""
    source = "Modelica Standard Library, Translational.Examples.Friction"
    driven = Structure(
        [1],
        lambda t, q, v: 25 * sin(pi * t / 2) - v,
        [Friction([1], lambda u: 5 + 10 * exp(-2 * u), 15.015)],
    )
    end = driven.run([0], [0], 5)

    def torque(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        shaft = 160 * (q[2] - q[1]) + v[2] - v[1]
        return np.array([200 * sin(100 * t), shaft, -shaft])

    clutch = Structure([1, 0.05, 1], torque, [Friction([-1, 1, 0], lambda u: 80.0, 80.0)], longest_step=1e-3)
    last = clutch.run([0, 0, 0], [100, 90, 90], 0.5)
    position, rate = program.ends("stribeck_force", "x", "v")
    angle, speed = program.ends("clutch", "motor_x", "motor_v")
    own = f"{source}, by `tests/referee/structures.py`"
    rotational = "Modelica Standard Library, Rotational.Examples.Friction"
    return [
        by_steps(source, "driven mass", driven, program, "stribeck_force", 5),
        Row(own, "the same: position after 5 s (m)", end[0], position, 1e-8),
        Row(own, "the same: velocity after 5 s (m/s)", end[1], rate, 1e-8),
        by_steps(rotational, "clutch", clutch, program, "clutch", 0.5),
        Row(
            f"{rotational}, by `tests/referee/structures.py`",
            "the same: angle of the motor after 0.5 s (rad)",
            last[0],
            angle,
            1e-7,
        ),
        Row(
            f"{rotational}, by `tests/referee/structures.py`",
            "the same: speed of the motor (rad/s)",
            last[3],
            speed,
            1e-7,
        ),
    ]


def row(program: Program) -> list[Row]:
    """A ball meets two others that touch, with Hertz contacts."""

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        push = np.maximum(y[:2] - y[1:3], 0) ** 1.5
        return np.array([*y[3:], -push[0], push[0] - push[1], push[1]])

    end = solve_ivp(slope, (0, 20), [-0.01, 0, 0, 1, 0, 0], "DOP853", rtol=1e-12, atol=1e-14, max_step=0.01)
    ours = program.ends("hertz_row", "first_v", "second_v", "third_v")
    source = "E. J. Hinch, S. Saint-Jean (1999), equations, by scipy's DOP853"
    what = "three balls with Hertz contacts: velocity afterwards (m/s) of ball"
    return [Row(source, f"{what} {k + 1}", end.y[3 + k, -1], ours[k], 1e-8) for k in range(3)]


COMPUTED = (belt, moving_belt, modelica, row)
