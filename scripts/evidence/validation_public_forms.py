# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of textbooks and papers whose motions have a closed form, most of them by expressions."""

from math import asin, cos, log, pi, sin, sqrt

import h5py
import numpy as np
from evidence_rows import Row
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import ellipj
from validation_public_machines import TIGHT, compared
from validation_public_program import Program


def kepler(program: Program) -> list[Row]:
    """Half a period later the planet is at its aphelion."""
    source, what = "J. Kepler (1609), closed form", "planet on an ellipse, half a period later"
    return compared(program, "kepler", source, what, ("x_x", "y_x", "x_v", "y_v"), (-1.6, 0, 0, -0.5), 1e-9)


def foucault(program: Program) -> list[Row]:
    """Two circles of opposite sense, seen from the turning ground."""
    turn, time = 0.05, 30.0
    fast = sqrt(2.0**2 + turn**2)
    forth = (1 + turn / fast) / 2
    position = forth * np.exp(1j * (fast - turn) * time) + (1 - forth) * np.exp(-1j * (fast + turn) * time)
    source, end = "L. Foucault (1851), closed form", (position.real, position.imag)
    return compared(program, "foucault", source, "Foucault's pendulum", ("x_x", "y_x"), end, 1e-9)


def henon_heiles(program: Program) -> list[Row]:
    """By scipy; the energy is that of the start."""

    def slope(_: float, y: np.ndarray) -> list[float]:
        return [y[2], y[3], -y[0] - 2 * y[0] * y[1], -y[1] - y[0] ** 2 + y[1] ** 2]

    end = solve_ivp(slope, (0, 40), [0, 0.1, 0.45, 0], **TIGHT).y[:, -1]
    source = "M. Henon, C. Heiles (1964), by scipy's DOP853"
    names = ("x_x", "y_x", "x_v", "y_v")
    x, y, u, v = program.ends("henon_heiles", *names)
    energy = (u**2 + v**2 + x**2 + y**2) / 2 + x**2 * y - y**3 / 3
    wanted = 0.45**2 / 2 + 0.1**2 / 2 - 0.1**3 / 3
    return [
        *compared(program, "henon_heiles", source, "star in a galaxy after 40", names, end, 1e-8),
        Row("closed form", "the same: energy", wanted, energy, 1e-11),
    ]


def morse(program: Program) -> list[Row]:
    """exp(x) is an ellipse over the time."""
    end = log(2 + sqrt(2) * cos(20 - 3 * pi / 4))
    return compared(
        program, "morse", "P. M. Morse (1929), closed form", "diatomic molecule after 20", ("x",), [end], 1e-9
    )


def hardening(program: Program) -> list[Row]:
    """Jacobi's elliptic cosine."""
    rate, parameter = sqrt(1 + 3 * 2.0**2), 12 / 26
    sine, cosine, delta, _ = ellipj(rate * 10, parameter)
    end = (2 * cosine, -2 * rate * sine * delta)
    source = "G. Duffing (1918), by Jacobi's elliptic functions"
    return compared(program, "duffing_free", source, "hardening spring after 10 s", ("x", "v"), end, 1e-9)


def vibrated_ball(program: Program) -> list[Row]:
    """One impact per period: the ball flies g T/2 up, and the table has the speed that restores it."""
    turn = 2 * pi * 25
    flies = 9.81 / 50
    table = flies / 3
    # Released where the orbit is at the start, a little above.
    since = asin(table / (5e-4 * turn)) / turn
    height = 5e-4 * cos(turn * since) + flies * since - 9.81 / 2 * since**2
    speed = flies - 9.81 * since
    found = program.events(
        "vibrated_ball", "impact_lower", "contact.ground", start__x0=height + 1e-5, start__v0=speed
    )
    source = "P. J. Holmes (1982), closed form"
    return [
        Row(source, "ball on a vibrating table: interval of the last impacts (s)", 0.04,
            found[-1, 0] - found[-2, 0], 1e-9),
        Row(source, "the same: impact speed (m/s)", flies + table, -found[-1, 2], 1e-9),
        Row(source, "the same: sine of the phase of the table", -table / (5e-4 * turn),
            sin(turn * found[-1, 0]), 1e-7),
    ]  # fmt: skip


def tuned_damper(program: Program) -> list[Row]:
    """The steady motion of both masses."""
    turn, stiffness, damping = 1.05, 0.9070294784580499, 0.2418972213829403
    link = stiffness + 1j * turn * damping
    matrix = np.array([[20 + link - 20 * turn**2, -link], [-link, link - turn**2]])
    end = (np.linalg.solve(matrix, [20, 0]) * np.exp(1j * turn * 600)).real
    source = "J. P. Den Hartog, Mechanical Vibrations, 3.3, closed form"
    names = ("main_x", "absorber_x")
    return compared(program, "tuned_damper", source, "vibration absorber after 600 s", names, end, 1e-9)


def pull_in(program: Program) -> list[Row]:
    """Below the dynamic pull-in, attraction 1/8, the plate turns where its energy is that of the start."""
    source = "H. C. Nathanson et al. (1967), closed form"
    with h5py.File(program.run("trajectory", "pull_in")) as file:
        reaches = float(file.attrs["x_max"])
    return [Row(source, "plate under a step of the voltage: largest deflection", 0.4, reaches, 1e-9)]


def bungee(program: Program) -> list[Row]:
    """The depth where the weight has done what the cord stores, and the motion on the cord."""
    source, weight, stiffness = "bungee jump of textbooks, closed form", 75 * 9.81, 80.0
    own, rest = sqrt(80 / 75), weight / 80
    taut, speed = sqrt(40 / 9.81), sqrt(40 * 9.81)
    after = own * (5 - taut)
    end = -(20 + rest) + rest * cos(after) - speed / own * sin(after)
    with h5py.File(program.run("trajectory", "bungee")) as file:
        deepest = float(file.attrs["x_min"])
    deep = 20 + rest + sqrt(rest**2 + 2 * weight * 20 / stiffness)
    return [
        Row(source, "jump on a cord: lowest position (m)", -deep, deepest, 1e-9),
        *compared(program, "bungee", source, "jump on a cord: after 5 s", ("x",), [end], 1e-9),
    ]


def flutter(program: Program) -> list[Row]:
    """Two modes with one frequency: the motion grows."""
    matrix = np.zeros((4, 4))
    matrix[:2, 2:] = np.eye(2)
    matrix[2:, :2] = -np.array([[2, 0.2], [-1, 2]])
    end = (expm(30 * matrix) @ [1e-3, 0, 0, 0])[:2]
    source = "N. Hoffmann et al. (2002), by the matrix exponential"
    return compared(program, "flutter", source, "brake pad that flutters", ("x_x", "y_x"), end, 1e-11)


COMPUTED = (
    kepler, foucault, henon_heiles, morse, hardening, vibrated_ball, tuned_damper, pull_in, bungee, flutter,
)  # fmt: skip
