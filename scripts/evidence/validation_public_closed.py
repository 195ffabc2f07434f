# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Public problems whose sources give equations that are solved in closed form here."""

from math import acosh, atan, atanh, cos, gamma, log, pi, sin, sqrt

import h5py
import numpy as np
from evidence_rows import Row
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipk
from validation_public_program import Program, largest


def sciml(program: Program) -> list[Row]:
    """The ball that falls through the floor of issue 696: it lies still before the end."""
    source = "SciML, DifferentialEquations.jl issue 696, closed form"
    machine = {"body__ball__load": -9.8, "contact__ground__restitution": 0.5, "contact__ground__lower": -1}
    found = program.events(
        "ball",
        "chatter_lower",
        "contact.ground",
        start__x0=0,
        start__v0=1,
        run__duration=2,
        **machine,
    )
    speed = sqrt(1 + 2 * 9.8)
    theirs = (1 + speed) / 9.8 + 2 * 0.5 * speed / (9.8 * 0.5)
    return [
        Row(
            source,
            "ball, e = 0.5, thrown upwards above the floor: time of rest (s)",
            theirs,
            found[0, 0],
            1e-9,
        )
    ]


def ball_drag(program: Program) -> list[Row]:
    """A ball with quadratic drag: up by an arc tangent, down by an area cosine."""
    source = "PathSim, bouncing ball with friction, closed form"
    found = program.events("ball_drag", "impact_lower", "contact.ground")
    terminal, rate = sqrt(9.81 / 0.2), sqrt(9.81 * 0.2)
    position, speed, at, theirs = 1.0, 5.0, 0.0, []
    for _ in found:
        height = position + log(1 + (speed / terminal) ** 2) / 0.4
        at += atan(speed / terminal) / rate + acosh(np.exp(0.2 * height)) / rate
        position, speed = 0.0, 0.95 * terminal * sqrt(1 - np.exp(-0.4 * height))
        theirs.append(at)
    return [largest(source, "ball with the drag of air: times of impacts (s)", theirs, found[:, 0], 1e-9)]


def pendulum(program: Program) -> list[Row]:
    """A pendulum that meets a wall at its lower position."""
    source = "PathSim, bouncing pendulum, by elliptic integrals"
    found = program.events("pendulum_wall", "impact_lower", "contact.wall")
    own = sqrt(9.81)
    modulus = sin(0.99 * pi / 2)
    theirs = [ellipk(modulus**2) / own]
    while len(theirs) < len(found):
        modulus *= 0.9
        theirs.append(theirs[-1] + 2 * ellipk(modulus**2) / own)
    speed = 2 * own * sin(0.99 * pi / 2)
    return [
        largest(source, "pendulum and wall: times of impacts (s)", theirs, found[:, 0], 1e-9),
        Row(source, "the same: speed of the first (rad/s)", speed, abs(found[0, 2]), 1e-9),
    ]


def hertz(program: Program) -> list[Row]:
    """Two spheres of glass meet: Hertz."""
    source = "Y. C. Chung, J. Y. Ooi (2011), test 1, by Hertz"
    mass, stiffness, speed = 5.864306286700947e-3, 2357022603.9551587, 20.0
    deep = (1.25 * mass * speed**2 / stiffness) ** 0.4
    with h5py.File(program.run("trajectory", "hertz_spheres")) as file:
        ours = -float(file.attrs["x_min"])
        at = file["event_time"][:]
    lasts = 0.8 * sqrt(pi) * gamma(0.4) / gamma(0.9) * deep / speed
    return [
        Row(source, "two spheres of glass at 20 m/s: largest overlap (m)", deep, ours, 1e-13),
        Row(source, "the same: contact duration (s)", lasts, at[1] - at[0], 1e-13),
        Row(source, "the same: largest force (N)", stiffness * deep**1.5, stiffness * ours**1.5, 1e-5),
        Row(
            source, "the same: speed after contact (m/s)", speed, program.ends("hertz_spheres", "v")[0], 1e-9
        ),
    ]


def rocking(program: Program) -> list[Row]:
    """Free rocking of a slender block: half cycles, and when it stands still."""
    source = "G. W. Housner (1963), closed form"
    found = program.events("rocking_block", "impact_lower", "contact.ground")
    at, speed, theirs = acosh(1 / (1 - 0.8)), sqrt(0.8 * 1.2), []
    total = at + sum(2 * atanh(0.9**n * speed) for n in range(1, 400))
    while len(theirs) < len(found):
        theirs.append(at)
        speed *= 0.9
        at += 2 * atanh(speed)
    still = program.events("rocking_block", "chatter_lower", "contact.ground")[0, 0]
    return [
        largest(source, "rocking block: times of impacts", theirs, found[:, 0], 1e-9),
        Row(source, "the same: end of the rocking", total, still, 1e-9),
    ]


def springs(program: Program) -> list[Row]:
    """A mass between two springs, and one on a spring with two stiffnesses."""
    found = program.events("clearance", "touch_upper", "contact.springs")[:, 0]
    period = 2 * pi / 5 + 2 * 0.2 / 1.5
    twice = program.events("bilinear", "touch_upper", "contact.more")[:, 0]
    return [
        Row(
            "J. P. Den Hartog, Mechanical Vibrations, 8.2, closed form",
            "mass with clearance between springs: period (s)",
            period,
            float(np.mean(np.diff(found))),
            1e-12,
        ),
        Row(
            "S. W. Shaw, P. J. Holmes (1983), closed form",
            "bilinear oscillator, 1 and 9 N/m: free period (s)",
            pi * (1 + 1 / 3),
            float(np.mean(np.diff(twice))),
            1e-12,
        ),
    ]


def plastic(program: Program) -> list[Row]:
    """A ball without rebound on a vibrating plate: flights begin where the plate falls away."""
    numbers = []
    for strength in (1.5, 2.0, 3.0):
        found = {
            kind: program.events("plastic_ball", kind, "contact.plate", drive__force__sine=f"[{strength}]")[
                :, 0
            ]
            for kind in ("barrier_release", "impact_lower")
        }
        begin = np.arcsin(1 / strength)

        def height(time: float, begin: float = begin, strength: float = strength) -> float:
            rise = time * cos(begin) - sin(begin + time) + sin(begin)
            return strength * rise - time**2 / 2

        lasts = brentq(height, 0.5, 2 * pi, xtol=1e-15)
        leave = found["barrier_release"][-2]
        ours = found["impact_lower"][found["impact_lower"] > leave][0] - leave
        source = "T. Gilet, N. Vandewalle, S. Dorbolo (2009), closed form"
        what = f"ball without rebound on a vibrating plate, Gamma = {strength:g}: flight"
        numbers.append(Row(source, f"{what} duration", lasts, ours, 1e-9))
        numbers.append(Row(source, f"{what} phase at take-off", begin, leave % (2 * pi), 1e-9))
    return numbers


def well(program: Program) -> list[Row]:
    """A motion over the hill of a double well, by quadrature of its energy."""
    found = program.events("double_well", "impact_lower", "contact.line")[:, 0]
    start, wall = 1.6, -0.5

    def level(x: float) -> float:
        return x**4 / 4 - x**2 / 2

    def rate(s: float) -> float:
        x = start - (start - wall) * s**2
        return 2 * (start - wall) * s / sqrt(2 * (level(start) - level(x))) if s else 0.0

    half = quad(rate, 1e-12, 1, epsabs=1e-13, epsrel=1e-13)[0]
    theirs = [half * (2 * k + 1) for k in range(len(found))]
    source = "P. Holmes (1979), by quadrature"
    return [largest(source, "double well with a wall beyond its hill: times of impacts", theirs, found, 1e-8)]


def drill(program: Program) -> list[Row]:
    """Stick and slip of a drill string turned at a constant speed."""
    source = "J. D. Jansen, L. van den Steen (1995), closed form"
    with h5py.File(program.run("trajectory", "drill_string")) as file:
        ours = float(file.attrs["cycle_time"])
    own, twist = sqrt(473 / 374), 1000 / 473
    theirs = 2 * (pi - atan(own * twist / 6)) / own + 2 * twist / 6
    return [Row(source, "drill string: stick-slip period (s)", theirs, ours, 1e-9)]


def mathieu(program: Program) -> list[Row]:
    """The first cosine of Mathieu, which is periodic."""
    position, rate = program.ends("mathieu", "x", "v")
    source = "M. Abramowitz, I. A. Stegun, table 20.1, a_1(1) = 1.85910 807"
    return [
        Row(source, "Mathieu's equation: position after one period, initially 1", 1.0, position, 1e-9),
        Row(source, "the same: velocity", 0.0, rate, 1e-9),
    ]


def stacked(program: Program) -> list[Row]:
    """A small ball on a large one, dropped."""
    source = "W. G. Harter (1971), closed form"
    found = program.events("stacked_balls", "impact_lower", "contact.balls")
    fall = sqrt(2 * 9.81)
    late = 1e-6 / (2 * fall)
    up, down = fall - 9.81 * late, -fall - 9.81 * late
    after = (2000 * up + (1 - 1000) * down) / 1001
    ours = program.ends("stacked_balls", "v", run__duration=0.5)[0]
    first = sqrt(2 / 9.81)
    return [
        Row(source, "small ball on a large one: collision (s)", first + late, found[0, 0], 1e-12),
        Row(
            source,
            "the same: velocity of the small one (m/s)",
            after - 9.81 * (0.5 - first - late),
            ours,
            1e-9,
        ),
    ]


def cradle(program: Program) -> list[Row]:
    """Three pendulums that touch: the outer ones move in turn."""
    quarter = ellipk(sin(0.25) ** 2) / sqrt(9.81)
    kinds = {
        side: np.unique(program.events("three_pendulums", "impact_lower", f"contact.{side}")[:, 0])
        for side in ("left", "right")
    }
    theirs = [quarter * (2 * k + 1) for k in range(len(kinds["left"]))]
    at = 2 * quarter
    third = program.ends("three_pendulums", "first_x", "third_x", run__duration=at)
    source = "Newton's cradle, by elliptic integrals"
    return [
        largest(source, "three pendulums, 1e-9 rad apart: times of impacts (s)", theirs, kinds["left"], 1e-7),
        Row(source, "the same: amplitude of the third (rad)", 0.5, third[1], 1e-8),
        Row(source, "the same: angle of the first at that time (rad)", 0.0, third[0], 1e-8),
    ]


COMPUTED = (
    sciml,
    ball_drag,
    pendulum,
    hertz,
    rocking,
    springs,
    plastic,
    well,
    drill,
    mathieu,
    stacked,
    cradle,
)
