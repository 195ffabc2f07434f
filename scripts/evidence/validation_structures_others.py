# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of several bodies beside other programs and closed forms: one short run, or a few, for each."""

import sys
from math import asin, pi, sqrt
from pathlib import Path

import h5py
import numpy as np
from evidence_program import Program
from evidence_rows import SOURCE, Row
from scipy import io
from validation_structures_orbits import orbits

sys.path.insert(0, str(SOURCE / "tests" / "referee"))
from linear_modes import Modes, pressed, rubbed  # noqa: E402
from structures import Rigid, Structure  # noqa: E402

CLOSED = "closed form"
EXPONENTIALS = "`tests/referee/linear_modes.py`"
STEPS = "`tests/referee/structures.py`"


def last(output: Path, *names: str) -> list[float]:
    """The last samples of columns."""
    with h5py.File(output) as file:
        return [float(file[name][-1]) for name in names]


def grazes(program: Program) -> list[Row]:
    """Grazes of the motion without impacts: its largest position with the stop out of reach."""
    found = []
    coupled = np.array([[2, -1], [-1, 1]])
    for frequency in (0.999206009038, 1.424159514839, 1.721091812715):
        steady = np.linalg.solve(coupled - frequency**2 * np.eye(2) + 0.04j * frequency * coupled, [1, 0])
        rate = 1j * frequency * steady
        settings = {
            "drive__force__frequency": frequency,
            "contact__stop__upper": 2,
            "body__first__x0": steady[0].real,
            "body__first__v0": rate[0].real,
            "start__x0": steady[1].real,
            "start__v0": rate[1].real,
            "run__duration": 14,
            "run__window": 7,
        }
        with h5py.File(program.run("trajectory", "two_masses", **settings)) as file:
            largest = float(file.attrs["x_max"])
        what = f"two masses, {frequency} rad/s, graze: largest position of the second, stop at 1"
        found.append(Row(CLOSED, what, 1.0, largest, 1e-9))
    return found


def single_impacts(program: Program) -> list[Row]:
    """Orbits with one impact a period: any damping, three masses, the impact damper at another frequency."""
    found = []
    general = {"spring__frame__damping": 0.5, "spring__coupling__damping": 0}
    hit = program.events("two_masses", "impact_upper", "contact.stop", run__duration=1500, **general)[-1]
    what = "two masses with a stop, damping diag(0.5, 0), 0.6 rad/s: impact speed"
    found.append(Row(CLOSED, what, 1.418642594893, hit[2], 1e-9))
    chain = np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
    _, phase, position, velocity = max(
        orbits(0.5, np.eye(3), 0.05 * chain, chain, [1, 0, 0], [0, 0, 1], 1, 0.7)
    )
    start = {"start__crank_angle": phase, "start__x0": position[2], "start__v0": velocity[2]}
    for k, body in enumerate(("first", "second")):
        start |= {f"body__{body}__x0": position[k], f"body__{body}__v0": velocity[k]}
    hit = program.events("three_masses", "impact_upper", "contact.stop", run__duration=130, **start)[-1]
    what = "three masses with a stop, 0.5 rad/s: impact speed after ten periods"
    found.append(Row(CLOSED, what, 1.965215727977, hit[2], 1e-9))
    # Structure and particle just after the upper wall.
    speed, ratio, loss, clearance, frequency = -4.467709642531, 0.1, 0.8, 10, 1.1
    after = speed * (1 - loss + 2 * ratio) / (1 + loss) - 2 * ratio * speed
    position = -(speed * pi / frequency + clearance) / 2
    start = {
        "contact__cavity__upper": clearance / 2,
        "contact__cavity__lower": -clearance / 2,
        "drive__shaker__frequency": frequency,
        "start__crank_angle": 4.653356496199,
        "body__structure__x0": position,
        "body__structure__v0": after,
        "start__x0": position + clearance / 2,
        "start__v0": speed,
    }
    hit = program.events("impact_damper", "impact_upper", "contact.cavity", **start)[-1]
    source = "S. F. Masri, T. K. Caughey (1966), " + CLOSED
    what = "impact damper, clearance 10 m, 1.1 rad/s: relative speed after the impact"
    found.append(Row(source, what, abs(after - speed), abs(hit[3]), 1e-8))
    return found


def beads(program: Program) -> list[Row]:
    """A column that bounces as one body, two balls on a spring, and three in a row by both rules."""
    output = program.run("trajectory", "beads")
    position, lowest, highest = last(output, "b1_x", "b1_v", "b10_v")
    source = "Siconos, BeadColumnED_NewtonLaw"
    found = [
        Row(
            source,
            "column of ten beads at 0.493 s: position of the lowest (m)",
            1.602081295401314e-2,
            position,
            1e-13,
        ),
        Row(source, "the same: velocity of the lowest", -0.8745122353873974, lowest, 1e-12),
        Row(source, "the same: velocity of the highest", -0.8745122353873974, highest, 1e-12),
    ]
    hits = program.events("two_balls", "impact_lower", "contact.floor")
    source = "nosnoc, two_balls_cls, in 40 digits"
    wanted = ((0.4038550218769218, 3.961817764612603), (0.4233169688147067, 3.88599783811507))
    for k, (time, speed) in enumerate(wanted):
        found.append(Row(source, f"two balls on a spring: impact {k + 1} (s)", time, hits[k, 0], 1e-12))
        found.append(Row(source, f"the same: speed of impact {k + 1}", speed, abs(hits[k, 2]), 1e-9))
    ends = last(program.run("trajectory", "two_balls"), "lower_x", "upper_x", "lower_v", "upper_v")
    theirs = (0.2468418867288353, 1.228210312008501, -2.379839521466434, -3.114092393623756)
    for name, value, ours in zip(("lower", "upper", "lower v", "upper v"), theirs, ends, strict=True):
        found.append(Row(source, f"the same at 1 s: {name}", value, ours, 1e-9))
    for rule, loss, after in (
        (0, 1, (-1 / 3, 2 / 3, 2 / 3)),
        (1, 1, (0, 0, 1)),
        (0, 0.5, (0, 0.5, 0.5)),
        (1, 0.5, (0.203125, 0.234375, 0.5625)),
    ):
        settings = {"body__in_sequence": rule} | {
            f"contact__{side}__restitution": loss for side in ("left", "right")
        }
        ends = last(program.run("trajectory", "cradle", **settings), "first_v", "second_v", "third_v")
        what = (
            f"three balls in a row, e = {loss}, {'in sequence' if rule else 'together'}: largest difference"
        )
        found.append(Row(CLOSED, what, 0, float(np.max(abs(np.array(ends) - after))), 1e-12))
    return found


def stack(program: Program) -> list[Row]:
    """A break-away that takes another along, one that does not, and what redundant friction holds."""
    found = []
    for between, together in ((0.4, True), (0.6, False)):
        settings = {"friction__between__force": between}
        times = [
            program.events("stack", "release", f"friction.{joint}", **settings)[:, 0]
            for joint in ("ground", "between")
        ]
        what = f"two stacked bodies, {between} N between: release of the lower (s)"
        found.append(Row(CLOSED, what, asin(2 / 2.5) / 0.01, times[0][0], 1e-9))
        if together:
            found.append(
                Row(CLOSED, "the same: simultaneous release of the upper (s)", times[0][0], times[1][0], 0)
            )
        else:
            # Together 0.5 m/s^2; the upper stays until it would need more than 0.6.
            slow = times[1][0] if len(times[1]) else np.inf
            found.append(
                Row(CLOSED, "the same: later release of the upper (s)", asin(2.2 / 2.5) / 0.01, slow, 1e-9)
            )
    return found


def capsules(program: Program) -> list[Row]:
    """Progress of capsules per period of the drive, forward and backward."""
    source = "capsule after Y. Liu, E. Pavlovskaia, M. Wiercigroch (2013), other code"
    found = []
    for mass, frequency, periods, theirs in (
        (3, 0.95, 1, 1.632659585),
        (2, 0.95, 1, -0.292790117),
        (5, 1.1, 4, 0.374044496),
    ):
        settings = {"body__shell__mass": mass, "drive__inner__frequency": frequency}
        case = SOURCE / "examples" / "structure_capsule.toml"
        with h5py.File(program.run("trajectory", case, run__duration=3000, **settings)) as file:
            time, x = file["time"][:], file["shell_x"][:]
        turn = 2 * pi / frequency
        end = int(time[-1] // turn)
        ends = [x[np.argmin(abs(time - k * turn))] for k in (end - periods, end)]
        what = f"shell of {mass} kg, {frequency} rad/s: progress per period, of {periods}"
        found.append(Row(source, what, theirs, float(ends[1] - ends[0]) / periods, 1e-8))
    return found


def beam(program: Program) -> list[Row]:
    """A cantilever of 16 coordinates with dry friction at a node."""
    mass, damping, stiffness = (
        io.mmread(Program.cases / f"beam_{name}.mtx").toarray() for name in ("mass", "damping", "stiffness")
    )
    modes = Modes.of(mass, damping, stiffness)
    found = []
    source = "NLvib, example 08 with exact friction, other code"
    for frequency, tip, release, stick in (
        (248.97320477, 7.510904e-8, 0.12443, 0.34862),
        (200.0, 9.411109e-8, 0.00563, 0.21996),
    ):
        turn = 2 * pi / frequency
        settings = {"drive__force__frequency": frequency, "run__duration": 100 * turn, "run__window": turn}
        times = [
            program.events("beam_friction", kind, "friction.clamp", **settings)[-1, 0]
            for kind in ("release", "stick")
        ]
        shares = [(time / turn) % 0.5 for time in times]
        output = program.run("trajectory", "beam_friction", trajectory__samples_per_period=2000, **settings)
        with h5py.File(output) as file:
            largest = float(np.max(abs(file["x"][-2000:])))
        what = f"beam with dry friction, {frequency:g} rad/s"
        found.append(Row(source, f"{what}: largest deflection (m)", tip, largest, 5e-13))
        found.append(Row(source, f"{what}: onset of sliding (periods)", release, shares[0], 1e-5))
        found.append(Row(source, f"{what}: onset of stick (periods)", stick, shares[1], 1e-5))
        if frequency != 200:
            machine = rubbed(modes, 0.2 * modes.shapes[14], frequency, modes.shapes[4], 1.5, turn / 100)
            machine.run("stuck", modes.start(), 10 * turn)
            theirs = np.array([time for _, time in machine.events])
            with h5py.File(output) as file:
                ours = np.unique(file["event_time"][:])[: len(theirs)]
            what = f"the same: largest difference in time of {len(theirs)} events, in periods"
            found.append(Row(EXPONENTIALS, what, 0, float(np.max(abs(ours - theirs)) / turn), 1e-8))
    return found


#: A steel bar [Pa, kg/m^3, m^2, m], its speed towards the wall [m/s] and the modes kept.
YOUNG, DENSITY, AREA, LENGTH, SPEED, KEPT = 210e9, 7800.0, 3.14e-4, 1.0, 0.1, 16


def bar(program: Program) -> list[Row]:
    """A bar falls on a wall, by its free modes and the flexibility of all others."""
    wave, mass = sqrt(YOUNG / DENSITY), DENSITY * AREA * LENGTH
    number = np.arange(KEPT)
    frequency = number * pi * wave / LENGTH
    foot = np.where(number == 0, sqrt(1 / mass), sqrt(2 / mass))
    flexibility = LENGTH / (3 * YOUNG * AREA) - np.sum(foot[1:] ** 2 / frequency[1:] ** 2)
    at_start, velocity = np.zeros(KEPT), np.zeros(KEPT)
    at_start[0], velocity[0] = 5e-5 / foot[0], -SPEED / foot[0]
    case = program.folder / "bar.toml"
    case.write_text(
        "[structure.bar]\n"
        + "".join(
            f"{key} = {[float(v) for v in values]}\n"
            for key, values in (
                ("frequency", frequency),
                ("x0", at_start),
                ("v0", velocity),
                ("point.foot", foot),
            )
        )
        + '[contact.wall]\nbetween = ["bar.foot"]\nlaw = "massless"\nlower = 0\n'
        + f"stiffness = {float(1 / flexibility)!r}\n[start]\nx0 = 5e-5\nv0 = {-SPEED}\n"
        + "[run]\nduration = 1.2e-3\nwindow = 6e-4\n"
    )
    touch = program.events(case, "touch_lower", "contact.wall")[0, 0]
    leave = program.events(case, "separation", "contact.wall")[0, 0]
    machine = pressed(Modes(frequency, np.eye(KEPT), np.zeros((KEPT, KEPT))), foot, 1 / flexibility, 2e-7)
    z = np.zeros(2 * KEPT + 3)
    z[0], z[KEPT] = at_start[0], velocity[0]
    machine.run("open", z, 1e-3)
    lasted = machine.events[1][1] - machine.events[0][1]
    with h5py.File(program.run("trajectory", case)) as file:
        after = file["bar_1_v"][-1] * foot[0]
        energy = file["energy"][:]
    force = mass * (after + SPEED) / (leave - touch)
    source = "Siconos, ImpactingBar; waves"
    what = f"bar on a wall, {KEPT} modes and residual flexibility"
    return [
        Row(source, f"{what}: contact duration (s)", 2 * LENGTH / wave, leave - touch, 4e-6),
        Row(EXPONENTIALS, "the same: contact duration (s)", lasted, leave - touch, 1e-12),
        Row(source, "the same: mean force (N)", DENSITY * wave * AREA * SPEED, force, 13),
        Row(
            CLOSED, "the same: ratio of the energies after and before", 1, float(energy[-1] / energy[0]), 1e-9
        ),
        Row(source, "the same: velocity after contact (m/s)", SPEED, after, 5e-4),
    ]


def cage(program: Program) -> list[Row]:
    """A Duffing oscillator with a mass in a cage: two impacts a period, by steps and in turn."""
    found = []

    def force(frequency, cubic):
        def of(t, q, v):
            gap, rate = q[0] - q[1], v[0] - v[1]
            pull = 0.952**2 * gap + 0.254 * rate + cubic * gap**3
            own = q[0] + 0.04 * v[0] + cubic * q[0] ** 3
            return np.array([np.cos(frequency * t) - own - 0.05 * pull, 0.05 * pull])

        return of

    for frequency, cubic in ((1.5, 0.1), (0.7, 0.1), (1.5, 0.0)):
        settings = {
            "drive__force__frequency": frequency,
            "spring__ground__cubic": cubic,
            "spring__coupling__cubic": 0.05 * cubic,
        }
        until = 40.0
        stops = [Rigid([-1, 1], side, side, lambda u: 0.9) for side in (1, -1)]
        machine = Structure([1, 0.05], force(frequency, cubic), rigid=stops)
        machine.run([0, 0], [0, 0], until)
        with h5py.File(program.run("trajectory", "cage", run__duration=until, **settings)) as file:
            ours = np.unique(file["event_time"][:])
        theirs = np.array([time for _, _, time in machine.events])
        miss = float(np.max(abs(ours - theirs))) if ours.shape == theirs.shape else np.inf
        what = f"mass in a cage (PWSDDE-cont), {frequency} rad/s, eta {cubic}"
        what += f": difference in time of {len(theirs)} events"
        found.append(Row(STEPS, what, 0, miss, 1e-8))
        if frequency != 1.5:
            continue
        turn = 2 * pi / frequency
        hits = [
            program.events("cage", f"impact_{side}", "contact.cage", **settings)
            for side in ("upper", "lower")
        ]
        half = (hits[0][-1, 0] - hits[1][-1, 0]) % turn
        found.append(
            Row(
                CLOSED,
                "the same: interval of impacts of the symmetric orbit (periods)",
                0.5,
                half / turn,
                1e-8,
            )
        )
    return found


def pair(program: Program) -> list[Row]:
    """The pair with backlash as two bodies, in its own law and with names."""
    found = []
    for start, speed in ((0.05, 0.8), (-0.02, 0.3)):
        settings = {"start__x0": start, "start__v0": speed, "run__duration": 20}
        own = SOURCE / "examples" / "pair_backlash.toml"
        times = []
        for case in (own, "backlash"):
            with h5py.File(program.run("trajectory", case, **settings)) as file:
                times.append(np.unique(file["event_time"][:]))
        same = len(times[0]) == len(times[1])
        miss = float(np.max(abs(times[0] - times[1]))) if same else np.inf
        what = f"pair with backlash from ({start}, {speed}), as a law and as bodies: difference in time of "
        found.append(Row("pair of Separatrix", f"{what}{len(times[0])} events", 0, miss, 1e-9))
    return found


def microactuator(program: Program) -> list[Row]:
    """The voltage at which the plate of a frame that sticks just reaches its stop."""
    points = program.branches("microactuator", "spring.condenser.attraction", (0.165, 0.175))
    graze = points["parameter"][points["label"] == "GR"].min(initial=np.inf)
    source = "H. Dankowicz, F. Schilder, Recipes for Continuation (2013), 9.3 (COCO)"
    what = "stick-slip microactuator, graze of the orbit whose frame sticks: V"
    return [Row(source, what, 0.587516250415, sqrt(2 * graze), 1e-9)]


COMPUTED = (grazes, single_impacts, beads, stack, capsules, beam, bar, cage, pair, microactuator)
