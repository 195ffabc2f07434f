# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Public problems whose numbers other programs and books print."""

import os

import h5py
import numpy as np
import separatrix as sx
from evidence_rows import Row
from validation_public_program import CLOSED, Program, largest, series


def modelica(source: str, what: str, theirs: float, ours: float) -> Row:
    """A number of Modelica's reference results, which are computed with a tolerance of 1e-6."""
    return Row(source, what, theirs, ours, 2e-5 * max(1.0, abs(theirs)))


def reference_fmu(program: Program) -> list[Row]:
    """BouncingBall of Reference-FMUs, whose impacts come early by what its integrator loses at each."""
    found = program.events("ball", "impact_lower", "contact.ground")
    rest = program.events("ball", "chatter_lower", "contact.ground")[0, 0]
    fall = np.sqrt(2 / 9.81)
    closed = [fall * (1 + 2 * sum(0.7**j for j in range(1, k + 1))) for k in range(11)]
    source = "Modelica Association, Reference-FMUs, BouncingBall_ref.csv"
    what = "ball, e = 0.7: impact"
    numbers = [
        Row(
            source,
            f"{what} {k + 1} (s)",
            theirs,
            found[k, 0],
            5 * 10.0 ** -len(str(theirs).split(".")[1]) / 10,
            closed=closed[k],
        )
        for k, theirs in ((0, 0.451522), (1, 1.08365), (4, 2.05263), (10, 2.498))
    ]
    speed = np.sqrt(2 * 9.81) * 0.7**4
    numbers.append(
        Row(source, "the same: speed before impact 5 (m/s)", 1.06326, abs(found[4, 2]), 5e-6, closed=speed)
    )
    return [*numbers, Row(CLOSED, "the same: time of rest (s)", fall * (1 + 2 * 0.7 / 0.3), rest, 1e-9)]


def petsc(program: Program) -> list[Row]:
    """The bouncing ball of TS tutorial 40, to the three decimals of its test."""
    theirs = [4.082, 7.755, 11.061, 14.037, 16.715, 19.125, 21.294, 23.246, 25.003, 26.585]
    machine = {"body__ball__load": -9.8, "contact__ground__restitution": 0.9, "start__x0": 0, "start__v0": 20}
    found = program.events("ball", "impact_lower", "contact.ground", run__duration=27, **machine)
    source = "PETSc, TS tutorial ex40, its test's output"
    return [largest(source, "ball, e = 0.9: times of impacts (s)", theirs, found[:, 0], 5e-4)]


def siconos(program: Program) -> list[Row]:
    """The event-driven bouncing balls of Siconos, with rebound and without."""
    source = "Siconos, BouncingBallED.ref"
    theirs = [6.719654906527709, 6.905584333747781, 7.072920818245836, 7.223523654294080]
    found = program.events(
        "ball",
        "impact_lower",
        "contact.ground",
        run__duration=7.25,
        contact__ground__restitution=0.9,
    )
    numbers = series(source, "ball, e = 0.9, at 6.7 s and later: impact (s)", theirs, found[-4:, 0], 1e-11)
    source = "Siconos, BouncingBallEDwithRestingContact.ref"
    found = program.events("ball", "impact_lower", "contact.ground", contact__ground__restitution=0)
    return [
        *numbers,
        Row(source, "ball, e = 0: impact (s)", 0.4515236409857311, found[0, 0], 1e-12),
        Row(source, "the same: its speed (m/s)", 4.429446918070021, abs(found[0, 2]), 1e-12),
        Row(source, "the same: impacts in 3 s", 1, len(found), 0),
    ]


def scipy_cannon(program: Program) -> list[Row]:
    """The cannon of solve_ivp's documentation, which stays on the ground."""
    source = "SciPy, documentation of solve_ivp"
    hit = program.events("cannon", "impact_lower", "contact.ground")
    at_end = program.ends("cannon", "x", "v")
    return [
        Row(source, "upward shot: impact on the ground (s)", 40.0, hit[0, 0], 1e-12),
        Row(CLOSED, "the same, no rebound: speed 10 s later", 0.0, abs(at_end[1]), 0),
    ]


def simulink(program: Program) -> list[Row]:
    """The ball of the page on Zeno behaviour, whose solver errs or goes on with chatter after 20 s."""
    machine = {"start__x0": 10, "start__v0": 15, "contact__ground__restitution": 0.8, "run__duration": 25}
    rest = program.events("ball", "chatter_lower", "contact.ground", **machine)[0, 0]
    fall = np.sqrt(15**2 + 2 * 9.81 * 10)
    theirs = (15 + fall) / 9.81 + 2 * 0.8 * fall / 9.81 / (1 - 0.8)
    source = "Simulink, Simulation of a Bouncing Ball; closed form"
    return [Row(source, "ball, e = 0.8: time of rest (s)", theirs, rest, 1e-9)]


def modelica_force(program: Program) -> list[Row]:
    """The driven mass with Stribeck friction."""
    source = "Modelica Standard Library 4.0, Translational.Examples.Friction, stop1"
    happened = [at for _, at in program.times("stribeck_force")]
    position, rate = program.ends("stribeck_force", "x", "v")
    return [
        *(
            modelica(source, f"driven mass with Stribeck friction: {what} (s)", theirs, ours)
            for what, theirs, ours in zip(
                ("onset of sliding", "first reversal", "second reversal"),
                (0.410143135, 2.442688825, 4.441939901),
                happened,
                strict=True,
            )
        ),
        modelica(source, "the same: position after 5 s (m)", 1.768462821, position),
        modelica(source, "the same: velocity after 5 s (m/s)", 6.864858590, rate),
    ]


def modelica_stop(program: Program) -> list[Row]:
    """The mass on a spring that meets its stop, leaves it, and sticks."""
    source = "Modelica Standard Library 4.0, Translational.Examples.Friction, stop2"
    theirs = (
        0.060596954,
        0.201105640,
        0.341616548,
        0.482140110,
        0.622692612,
        0.763328814,
        0.904204209,
        1.045974061,
    )
    found = sorted({round(at, 12) for _, at in program.times("stribeck_stop")})
    return [
        largest(source, "mass on a spring with stops: impact, reversals and stick (s)", theirs, found, 2e-5),
        modelica(
            source, "the same: position in stick (m)", -0.247515848, program.ends("stribeck_stop", "x")[0]
        ),
    ]


def modelica_clutch(program: Program) -> list[Row]:
    """The drive train whose clutch closes, slips and closes again."""
    source = "Modelica Standard Library 4.0, Rotational.Examples.Friction"
    theirs = (0.006779709000, 0.059340056359, 0.109289495222)
    motor, shaft, load, rate = program.ends("clutch", "motor_x", "shaft_x", "load_x", "motor_v")
    return [
        largest(
            source,
            "clutch: closing, slip, closing (s)",
            theirs,
            [at for _, at in program.times("clutch")],
            2e-6,
        ),
        modelica(source, "the same after 0.5 s: angle of the motor (rad)", 48.115488553, motor),
        modelica(source, "the same: speed of the motor (rad/s)", 91.787156737, rate),
        modelica(source, "the same: slip of the clutch (rad)", -0.171390615, shaft - motor),
        modelica(source, "the same: twist of the shaft (rad)", -0.201617934, load - shaft),
    ]


def galperin(program: Program) -> list[Row]:
    """Impacts of two blocks and a wall: digits of pi."""
    numbers = []
    for ratio, theirs in ((1, 3), (100, 31), (10000, 314), (1000000, 3141)):
        happened = program.times("blocks_pi", body__heavy__mass=ratio)
        numbers.append(
            Row(
                "G. Galperin (2003)",
                f"two blocks and a wall, {ratio} times the mass: impacts",
                theirs,
                len(happened),
                0,
            )
        )
    return numbers


def rao(program: Program) -> list[Row]:
    """A mass let go on dry friction."""
    source = "S. S. Rao, Mechanical Vibrations, problem on Coulomb damping"
    happened = program.times("rao_coulomb")
    return [
        Row(source, "20 kg, 50 N of friction: half cycles until stick", 5, len(happened), 0),
        Row(CLOSED, "the same: onset of stick (s)", 5 * np.pi / np.sqrt(500), happened[-1][1], 1e-12),
        Row(CLOSED, "the same: rest position (m)", 0.0, program.ends("rao_coulomb", "x")[0], 1e-14),
    ]


def five_cycles(program: Program) -> list[Row]:
    """Shares of the five cycles of a Duffing oscillator; two of period 2 are each other's mirror image."""
    source = "M. Stender, N. Hoffmann, bSTAB (2022), by pyBasin's comparison, 10000 starts"
    with h5py.File(program.run("basin", "duffing_five")) as file:
        entries, label = file["catalogue"], file["attractor"][:]
        share = np.array([np.mean(label == k) for k in entries["attractor"][:]])
        period, amplitude = entries["period"][:], entries["amplitude"][:]
    numbers = [Row(source, "Duffing oscillator: coexisting cycles", 5, len(share), 0)]
    kinds = (
        ("the small cycle of period 1", 0.2027, (period == 1) & (amplitude < 0.5)),
        ("the large cycle of period 1", 0.4950, (period == 1) & (amplitude > 0.5)),
        ("both cycles of period 2", 0.0545, period == 2),
        ("the cycle of period 3", 0.2478, period == 3),
    )
    for what, theirs, which in kinds:
        bar = 2 * np.sqrt(theirs * (1 - theirs) * (1 / 10000 + 1 / label.size))
        numbers.append(Row(source, f"the same: share of {what}", theirs, float(np.sum(share[which])), bar))
    return numbers


def chaos(program: Program) -> list[Row]:
    """Exponents of a double well under a force; the sum is minus the damping."""
    os.environ.setdefault("SEPARATRIX_PROGRAM", str(program.path))
    found = sx.stability(sx.load(program.cases / "duffing_chaos.toml"), periods=2000)
    first, second = found.exponents[:2]
    source = "W. Gilpin, dysts (2021), Duffing, its two estimates 0.0995 and 0.1403"
    return [
        Row(
            source,
            "forced double well: largest exponent, mean of their estimates (1/s)",
            0.1199,
            first,
            0.0205,
        ),
        Row(
            "Runge-Kutta method with fixed steps",
            "the same, from 200 pairs of motions",
            pairs_part(),
            first,
            0.015,
        ),
        Row(CLOSED, "the same: sum of the exponents (1/s)", -0.1, first + second, 1e-8),
    ]


def pairs_part(count: int = 200, periods: int = 120, steps: int = 100, apart: float = 1e-8) -> float:
    """How pairs of motions of the double well part, after 50 periods, by fixed Runge-Kutta steps."""
    random = np.random.default_rng(1)
    state = random.uniform(-1, 1, (2, count))
    state = np.concatenate([state, state + [[apart], [0]]], axis=1)
    step, total = 2 * np.pi / 1.4 / steps, 0.0

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[1], 0.35 * np.cos(1.4 * t) - 0.1 * y[1] + y[0] - y[0] ** 3])

    for period in range(periods + 50):
        for k in range(steps):
            t = k * step
            a = slope(t, state)
            b = slope(t + step / 2, state + step / 2 * a)
            c = slope(t + step / 2, state + step / 2 * b)
            state = state + step / 6 * (a + 2 * b + 2 * c + slope(t + step, state + step * c))
        one, other = np.split(state, 2, axis=1)
        distance = np.linalg.norm(other - one, axis=0)
        if period >= 50:
            total += float(np.mean(np.log(distance / apart)))
        state = np.concatenate([one, one + (other - one) * apart / distance], axis=1)
    return total / (periods * 2 * np.pi / 1.4)


COMPUTED = (
    reference_fmu,
    petsc,
    siconos,
    scipy_cannon,
    simulink,
    modelica_force,
    modelica_stop,
    modelica_clutch,
    galperin,
    rao,
    five_cycles,
    chaos,
)
