# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures between rigid stops, impact by impact: a cantilever by several modes, a capture, a chatter."""

import sys
from math import cos, cosh, pi
from pathlib import Path

import h5py
import numpy as np
from evidence_program import Program
from evidence_rows import SOURCE, Row
from scipy.optimize import brentq
from validation_structures_orbits import orbits

sys.path.insert(0, str(SOURCE / "tests" / "referee"))
from bounces import Bounces, Stop  # noqa: E402

CLOSED = "closed form"
BOUNCES = "`tests/referee/bounces.py`"


def clamped_free(count: int) -> np.ndarray:
    """Frequencies of a clamped and free beam over the first."""
    roots = [
        brentq(lambda b: cos(b) + 1 / cosh(b), (k + 0.5) * pi - 0.4, (k + 0.5) * pi + 0.4, xtol=1e-15)
        for k in range(count)
    ]
    return np.array(roots) ** 2 / roots[0] ** 2


def first_order(mass, damping, stiffness, load) -> np.ndarray:
    """z' = A z of M q'' + C q' + K q = load, z being positions, velocities and 1."""
    n = len(mass)
    a = np.zeros((2 * n + 1, 2 * n + 1))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n] = np.linalg.solve(mass, np.column_stack([-stiffness, -damping, load]))
    return a


def last(output: Path, *names: str) -> list[float]:
    """The last samples of columns."""
    with h5py.File(output) as file:
        return [float(file[name][-1]) for name in names]


#: The cantilever: frequency of the force on its tip [rad/s] and its size, restitution, damping ratio, stop.
DRIVE, FORCE, LOSS, RATIO, GAP = 0.9, 0.05, 0.8, 0.02, 0.5
TURN = 2 * pi / DRIVE


def beam_case(case: Path, lists: dict[str, np.ndarray], x: float, v: float, angle: float) -> None:
    """Writes the case of a cantilever by its modes, without its stop, over one period."""
    lines = [
        "[structure.beam]",
        f"damping_ratio = {RATIO}",
        *(f"{key} = {[float(value) for value in values]}" for key, values in lists.items()),
        '[drive.tip]\nlaw = "force"\nbody = "beam.tip"',
        f"amplitude = {FORCE}\nfrequency = {DRIVE}",
        f"[start]\nx0 = {float(x)}\nv0 = {float(v)}\ncrank_angle = {float(angle)}",
        f"[run]\nduration = {TURN!r}\nwindow = {TURN!r}",
    ]
    case.write_text("\n".join(lines) + "\n")


def beam_bounces(frequency: np.ndarray, tip: np.ndarray) -> Bounces:
    """The same with its stop; z is positions, velocities, 1, cosine and sine of the drive."""
    n = len(frequency)
    a = np.zeros((2 * n + 3, 2 * n + 3))
    damping, stiffness = np.diag(2 * RATIO * frequency), np.diag(frequency**2)
    a[: 2 * n + 1, : 2 * n + 1] = first_order(np.eye(n), damping, stiffness, np.zeros(n))
    a[n : 2 * n, 2 * n + 1] = FORCE * tip
    a[2 * n + 1, 2 * n + 2], a[2 * n + 2, 2 * n + 1] = -DRIVE, DRIVE
    row, kick = np.zeros(2 * n + 3), np.zeros(2 * n + 3)
    row[:n], row[2 * n], kick[n : 2 * n] = -tip, GAP, -tip / (tip @ tip)
    return Bounces(a, [Stop(row, kick, LOSS)], TURN / 40 / frequency[-1])


def cantilever(program: Program) -> list[Row]:
    """A cantilever by N modes: from N = 2 the quadratic gives a motion that goes through the stop."""
    found = []
    for n, speed in (
        (2, 0.3458546130),
        (3, 0.4537810705),
        (4, 0.5216891864),
        (5, 0.5700532545),
        (6, 0.6057024782),
        (8, 0.6541392525),
    ):
        frequency, tip = clamped_free(n), np.full(n, 2.0)
        damping, stiffness = np.diag(2 * RATIO * frequency), np.diag(frequency**2)
        _, phase, position, velocity = max(
            orbits(DRIVE, np.eye(n), damping, stiffness, FORCE * tip, tip, GAP, LOSS)
        )
        case = program.folder / f"cantilever_{n}.toml"
        lists = {"frequency": frequency, "point.tip": tip, "x0": position, "v0": velocity}
        beam_case(case, lists, tip @ position, tip @ velocity, phase)
        what = f"cantilever by {n} modes, one impact per period"
        ends = last(program.run("trajectory", case), "x", "v")
        found.append(Row(CLOSED, f"{what}, computed without the stop: speed", speed, ends[1], 5e-10))
        found.append(Row(CLOSED, "the same: final position, at the stop", GAP, ends[0], 1e-12))
        stop = '[contact.stop]\nbetween = ["beam.tip"]\nlaw = "newton"\n'
        case.write_text(f"{case.read_text()}{stop}restitution = {LOSS}\nupper = {GAP}\n")
        machine = beam_bounces(frequency, tip)
        start = np.concatenate([position, velocity, [1, np.cos(phase), np.sin(phase)]])
        machine.run(start, TURN, touched=0, most=5)
        theirs = np.array([time for time, *_ in machine.impacts])
        hits = program.events(case, "impact_upper", "contact.stop")
        ours = hits[hits[:, 0] > 0, 0][: len(theirs)]
        miss = float(np.max(abs(ours - theirs))) if len(ours) == len(theirs) else np.inf
        name = f"the same with the stop: impact after {theirs[0] / TURN:.3f} periods, {len(theirs)} impacts"
        found.append(Row(BOUNCES, name, 0, miss, 1e-10))
    return found


def sink(mass: float, loss: float, wave: float) -> tuple[Bounces, np.ndarray]:
    """A mass on a spring with a light particle in a cavity, on its slow manifold after the upper wall."""
    slope = 2 * (1 - loss) / (1 + loss) / pi
    a = first_order(np.diag([1, mass]), np.zeros((2, 2)), np.diag([1.0, 0]), np.zeros(2))
    stops = []
    for side in (1.0, -1.0):
        push = 1 / (1 + 1 / mass)
        stops.append(
            Stop(np.array([side, -side, 0, 0, 1]), np.array([0, 0, side, -side / mass, 0]) * push, loss)
        )
    start = np.array([wave - 1, wave, -slope * wave, -2 * wave / pi, 1])
    return Bounces(a, stops, 0.3), start


def capture(program: Program) -> list[Row]:
    """How long a light particle in a cavity stays with the motion of its structure, impact by impact."""
    found, scaled = [], []
    for mass, other, bar in ((1e-3, 1330.71, 5e-3), (1e-4, 12921.2, 5e-2)):
        machine, start = sink(mass, 0.6, 1.5)
        until = 1.37 / mass if mass > 5e-4 else 1.31 / mass
        settings = {
            "body__particle__mass": mass,
            "body__structure__x0": start[0],
            "body__structure__v0": start[2],
            "start__x0": start[1],
            "start__v0": start[3],
            "run__duration": until,
            "run__window": 100,
        }
        sides = [
            program.events("sink", f"impact_{side}", "contact.cavity", **settings)[:, 0]
            for side in ("upper", "lower")
        ]
        ours = np.sort(np.concatenate(sides))
        ours = ours[ours > 0]
        end = float(lost(ours))
        what = f"vibro-impact nonlinear energy sink, mass ratio {mass:g}"
        found.append(Row("other code", f"{what}: end of the resonance capture (s)", other, end, bar))
        machine.run(start, until, touched=0)
        theirs = lost(np.array([time for time, *_ in machine.impacts]))
        found.append(Row(BOUNCES, "the same (s)", theirs, end, 1e-6))
        scaled.append(end * mass)
    # What is left goes as the mass to the power 2/3: the passage of a fold.
    limit = scaled[1] - (scaled[0] - scaled[1]) / (10 ** (2 / 3) - 1)
    what = "the same times the mass ratio, extrapolated to ratio 0"
    return [*found, Row("asymptotics", what, 1.28243, limit, 2e-3)]


def lost(times: np.ndarray) -> float:
    """The first impact after a wait of more than 0.65 periods; captured, impacts are half a period apart."""
    return times[1:][np.diff(times) > 1.3 * pi][0]


def chatter(program: Program) -> list[Row]:
    """One of three bodies bounces until it stays: every impact, and one plastic impact instead of them."""
    mass = np.diag([1.0, 2, 1])
    stiffness = np.array([[50.0, -50, 0], [-50, 70, -20], [0, -20, 20]])
    damping = 0.3 * np.array([[1.0, -1, 0], [-1, 1, 0], [0, 0, 0]])
    a = first_order(mass, damping, stiffness, np.array([-10, -20, 3]))
    row, kick = np.eye(7)[0], np.eye(7)[3]
    found, differences = [], []
    names = [f"{body}_{what}" for what in "xv" for body in ("second", "third")]
    for speed in (0.1, 0.01, 0.001):
        machine = Bounces(a, [Stop(row, kick, 0.6)], 1e-3)
        settings = {"start__v0": speed, "run__duration": 0.3 * speed, "run__window": 0.3 * speed}
        theirs = machine.run(np.array([0, -0.34, -0.19, speed, 0.3, -0.1, 1]), 0.3 * speed, touched=0)
        every = np.array(last(program.run("trajectory", "chatter", **settings), *names))
        stays = last(program.run("trajectory", "chatter", **settings), "x", "v")
        what = f"chatter of one of three bodies from {speed:g} m/s, {len(machine.impacts)} impacts"
        found.append(
            Row(
                BOUNCES,
                f"{what}: state of the others after it",
                0,
                float(np.max(abs(every - theirs[[1, 2, 4, 5]]))),
                1e-9,
            )
        )
        found.append(
            Row(
                CLOSED,
                "the same: position and velocity of the resting body",
                0,
                float(np.max(np.abs(stays))),
                0,
            )
        )
        settings["contact__floor__restitution"] = 0
        once = np.array(last(program.run("trajectory", "chatter", **settings), *names))
        differences.append(float(np.max(abs(once - every)[2:])))
    for k, speed in enumerate((0.01, 0.001)):
        order = float(np.log10(differences[k] / differences[k + 1]))
        what = f"one plastic impact instead of all: order of the error in the speed, at {speed:g} m/s"
        found.append(Row("theorem (docs/theory.md)", what, 3, order, 0.1))
    return found


COMPUTED = (cantilever, capture, chatter)
