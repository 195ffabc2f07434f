# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws cases of ten machines that are not the published one, with records as long as those of a rig.

The motion is that of tests/referee/structures.py: SciPy's DOP853 between events.
"""

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from simulator import FOLDER

sys.path[:0] = [str(FOLDER.parent / "referee"), str(FOLDER.parent / "python")]
from hidden_bodies import SPRINGS, flown  # noqa: E402
from structures import Friction, Rigid, Soft, Structure  # noqa: E402

RECORDS = ("first.csv", "second.csv", "held_out.csv")
BASE, TRUTH = "base.toml", "truth.json"
NOISE = 2e-3
"""Of every sensor, over the standard deviation of its signal."""
ACCURACY = 1e-9


@dataclass
class Rig:
    """A machine with what it hides; `shown` are columns of a motion (samples, 2 n)."""

    case: str
    machine: Callable[[float], Structure]
    drives: tuple[float, float, float]
    """Drive frequency [rad/s] of each record, or the number of its force or release."""
    hidden: tuple[str, ...]
    """Names of which any is right."""
    shown: tuple[str, ...]
    rate: float = 2000.0
    seconds: float = 15.0
    settle: float = 5.0
    driven: bool = True
    force: Callable[[float, np.ndarray], np.ndarray] | None = None
    """Measured force [N] of a record over time."""
    release: Mapping[float, list[float]] = field(default_factory=dict)
    """Position and velocity of each body at the start of a record."""


def chain(draw: np.random.Generator) -> Rig:
    """Two masses; dry friction and a wall at the second, where drag is missing."""
    drag = draw.uniform(0.4, 0.8)
    case = (
        SPRINGS
        + """
[friction.rail]
between = ["second"]
force = 0.16
[contact.wall]
between = ["second"]
law = "newton"
restitution = 0.73
upper = 0.123
"""
    )

    def machine(w: float) -> Structure:
        def force(t, q, v):
            coupling = 60 * (q[1] - q[0]) + 0.2 * (v[1] - v[0])
            return np.array(
                [coupling - 40 * q[0] - 0.3 * v[0] + 4 * np.cos(w * t), -coupling - drag * v[1] * abs(v[1])]
            )

        return Structure(
            [1, 0.8],
            force,
            [_dry([0, 1], 0.15)],
            rigid=[Rigid([0, 1], 0.12, 1, lambda u: 0.7)],
            tolerance=ACCURACY,
        )

    return Rig(case, machine, (6.0, 7.5, 9.0), ("quadratic_drag@second",), ("x.first", "x.second"))


def belt(draw: np.random.Generator) -> Rig:
    """A block in stick-slip on a belt: its spring hardens, and the Stribeck velocity of the case is wrong."""
    cubic = draw.uniform(300, 700)
    case = """
body.block.mass = 1
run.duration = 20
[spring.frame]
between = ["block"]
stiffness = 41
damping = 0.11
[friction.belt]
between = ["block"]
law = "coulomb_stribeck"
velocity = VELOCITY
force = 3.1
static_force = 5.8
stribeck_velocity = 0.2
stribeck_exponent = 2
"""

    def machine(belt: float) -> Structure:
        def force(t, q, v):
            return np.array([-40 * q[0] - cubic * q[0] ** 3 - 0.1 * v[0]])

        level = Friction([1], lambda u: 3 + 3 * np.exp(-((u / 0.4) ** 2)), 6, belt)
        return Structure([1], force, [level], tolerance=ACCURACY)

    return Rig(
        case.replace("VELOCITY", "0.2"), machine, (0.2, 0.2, 0.2), ("cubic_spring@block",), ("x.block",),
        driven=False, settle=0.0, release={},
    )  # fmt: skip


def capsule(draw: np.random.Generator) -> Rig:
    """A shell on dry ground with a driven mass and a soft stop inside; the shell is dragged."""
    drag = draw.uniform(0.5, 1.0)
    case = """
body.shell.mass = 2.5
body.inner.mass = 1.03
drive.force = {law = "force", body = "inner", amplitude = 4.1, frequency = 6}
run.duration = 20
[spring.inner]
between = ["shell", "inner"]
stiffness = 31
damping = 0.21
[contact.stop]
between = ["shell", "inner"]
law = "kelvin_voigt"
stiffness = 880
damping = 2.1
upper = 0.051
[friction.ground]
between = ["shell"]
force = 1.05
"""

    def machine(w: float) -> Structure:
        def force(t, q, v):
            inner = 30 * (q[1] - q[0]) + 0.2 * (v[1] - v[0])
            return np.array([inner - drag * v[0] * abs(v[0]), 4 * np.cos(w * t) - inner])

        stop = Soft([-1, 1], 0.05, 1, lambda p, rate: max(0.0, 900 * p + 2 * rate))
        return Structure([2.5, 1], force, [_dry([1, 0], 1.0)], [stop], tolerance=ACCURACY)

    return Rig(case, machine, (5.0, 6.0, 7.0), ("quadratic_drag@shell",), ("x.shell", "x.inner"))


def hammer(draw: np.random.Generator) -> Rig:
    """A mass on a spring struck by a measured force; its pad has another exponent than that of the case."""
    pad = draw.uniform(900, 1200)
    case = """
body = {mass = 1.03}
restoring = {law = "linear", stiffness = 41}
friction = {law = "viscous", damping = 0.52}
contact = {law = "kelvin_voigt", stiffness = 450, damping = 1.1, upper = 0.0205}
drive = {law = "measured_force", interval = "1 ms", force = [0.0, 0.0]}
run.duration = 1
"""
    strikes = {number: np.sort(draw.uniform(0, 15, 14)) for number in range(3)}
    sizes = {number: draw.uniform(20, 45, 14) for number in range(3)}

    def pulses(number: float, t: np.ndarray) -> np.ndarray:
        at, size = strikes[int(number)], sizes[int(number)]
        u = np.clip((np.asarray(t)[..., None] - at) / 0.02, 0, 1)
        return np.sum(size * np.sin(np.pi * u) ** 2, axis=-1)

    def machine(number: float) -> Structure:
        def force(t, q, v):
            return np.array([-40 * q[0] - 0.5 * v[0] + pulses(number, t)])

        soft = Soft([1], 0.02, 1, lambda p, rate: max(0.0, pad * max(p, 0.0) ** 1.3 + 1.0 * rate))
        return Structure([1], force, soft=[soft], tolerance=ACCURACY, longest_step=0.005)

    return Rig(
        case,
        machine,
        (0, 1, 2),
        ("contact_hardening",),
        ("x",),
        driven=False,
        settle=0.0,
        force=pulses,
    )


def slide(draw: np.random.Generator) -> Rig:
    """A driven slide with a rigid stop: drag and a hardening spring are missing."""
    drag, cubic = draw.uniform(0.4, 0.8), draw.uniform(300, 700)
    case = """
body.slide.mass = 1
drive.force = {law = "force", body = "slide", amplitude = 5.2, frequency = 7}
run.duration = 20
[spring.frame]
between = ["slide"]
stiffness = 41
damping = 0.5
[contact.stop]
between = ["slide"]
law = "newton"
restitution = 0.77
upper = 0.151
"""

    def machine(w: float) -> Structure:
        def force(t, q, v):
            return np.array(
                [5 * np.cos(w * t) - 40 * q[0] - cubic * q[0] ** 3 - 0.5 * v[0] - drag * v[0] * abs(v[0])]
            )

        return Structure([1], force, rigid=[Rigid([1], 0.15, 1, lambda u: 0.75)], tolerance=ACCURACY)

    return Rig(case, machine, (5.0, 6.5, 8.0), ("cubic_spring@slide", "quadratic_drag@slide"), ("x.slide",))


def play(draw: np.random.Generator) -> Rig:
    """Two masses whose coupling has a free play."""
    half = draw.uniform(0.002, 0.005)

    def machine(w: float) -> Structure:
        def force(t, q, v):
            damper = 0.2 * (v[1] - v[0])
            return np.array([damper - 40 * q[0] - 0.3 * v[0] + 4 * np.cos(w * t), -damper])

        soft = [Soft([-1, 1], side * half, side, lambda p, rate: 60 * p) for side in (1, -1)]
        return Structure([1, 0.8], force, soft=soft, tolerance=ACCURACY)

    return Rig(SPRINGS, machine, (6.0, 7.5, 9.0), ("backlash@spring.coupling",), ("x.first", "x.second"))


def duffing(draw: np.random.Generator) -> Rig:
    """A mass with a soft wall under a measured force; its spring hardens."""
    cubic, phases = draw.uniform(300, 700), draw.uniform(0, 2 * np.pi, (3, 3))
    case = """
body = {mass = 1.03}
restoring = {law = "linear", stiffness = 41}
friction = {law = "viscous", damping = 0.52}
contact = {law = "kelvin_voigt", stiffness = 880, damping = 2.1, upper = 0.121}
drive = {law = "measured_force", interval = "1 ms", force = [0.0, 0.0]}
run.duration = 1
"""

    def several(number: float, t: np.ndarray) -> np.ndarray:
        return _tones(2.2, (4.0 + number, 6.5 + 0.5 * number, 9.0), phases[int(number)], t)

    def machine(number: float) -> Structure:
        def force(t, q, v):
            return np.array([several(number, t) - 40 * q[0] - cubic * q[0] ** 3 - 0.5 * v[0]])

        wall = Soft([1], 0.12, 1, lambda p, rate: max(0.0, 900 * p + 2 * rate))
        return Structure([1], force, soft=[wall], tolerance=ACCURACY)

    return Rig(case, machine, (0, 1, 2), ("cubic_spring",), ("x",), driven=False, settle=0.0, force=several)


def decay(draw: np.random.Generator) -> Rig:
    """Free oscillations with dry friction that the case lacks."""
    dry = draw.uniform(0.05, 0.1)
    case = """
body = {mass = 1.0}
restoring = {law = "linear", stiffness = 41}
friction = {law = "viscous", damping = 0.12}
contact = {law = "none"}
drive = {law = "none"}
run.duration = 20
"""

    def machine(number: float) -> Structure:
        return Structure(
            [1], lambda t, q, v: np.array([-40 * q[0] - 0.1 * v[0]]), [_dry([1], dry)], tolerance=ACCURACY
        )

    releases = {0: [0.3, 0.0], 1: [0.2, 0.5], 2: [0.25, -0.3]}
    return Rig(case, machine, (0, 1, 2), ("coulomb",), ("x",), driven=False, settle=0.0, release=releases)


def pendulum(draw: np.random.Generator) -> Rig:
    """A pendulum that is let go; drag is missing."""
    drag = draw.uniform(0.02, 0.06)
    case = """
body = {mass = 1.0}
restoring = {law = "pendulum", moment = 52.0}
friction = {law = "viscous", damping = 0.06}
contact = {law = "none"}
drive = {law = "none"}
run.duration = 20
"""

    def machine(number: float) -> Structure:
        return Structure(
            [1],
            lambda t, q, v: np.array([-50 * np.sin(q[0]) - 0.05 * v[0] - drag * v[0] * abs(v[0])]),
            tolerance=ACCURACY,
        )

    releases = {0: [1.4, 0.0], 1: [0.9, 1.0], 2: [1.1, -1.0]}
    return Rig(
        case, machine, (0, 1, 2), ("quadratic_drag",), ("x",), driven=False, settle=0.0, release=releases
    )


def force(draw: np.random.Generator) -> Rig:
    """A mass with dry friction moved by a measured force; the friction falls with the speed."""
    excess = draw.uniform(0.8, 1.5)
    phases = draw.uniform(0, 2 * np.pi, (3, 2))
    case = """
body = {mass = 2.06, gravity = 9.81}
restoring = {law = "none"}
friction = {law = "coulomb_viscous", kinetic_coefficient = 0.105, damping = 4.2}
contact = {law = "none"}
drive = {law = "measured_force", interval = "1 ms", force = [0.0, 0.0]}
run.duration = 1
"""

    def several(number: float, t: np.ndarray) -> np.ndarray:
        return _tones(5.0, (2.0 + 0.5 * number, 7.0 - number), phases[int(number)], t)

    def machine(number: float) -> Structure:
        def push(t, q, v):
            return np.array([several(number, t) - 4 * v[0]])

        level = Friction([1], lambda u: 2 + excess * np.exp(-((u / 0.15) ** 2)), 2 + excess)
        return Structure([2], push, [level], tolerance=ACCURACY)

    return Rig(case, machine, (0, 1, 2), ("stribeck",), ("x",), driven=False, settle=0.0, force=several)


RIGS = {
    one.__name__: one for one in (chain, belt, capsule, hammer, slide, play, duffing, decay, pendulum, force)
}


def _tones(size: float, frequencies: tuple[float, ...], phases: np.ndarray, t: np.ndarray) -> np.ndarray:
    """A force of several frequencies [rad/s]."""
    return sum(size * np.cos(w * t + phase) for w, phase in zip(frequencies, phases, strict=True))


def _dry(row: list[float], level: float) -> Friction:
    return Friction(row, lambda u: level, level)


def write_rig(folder: Path, seed: int, number: int, name: str) -> Rig:
    """The base case, three records and the sealed truth of a machine."""
    folder.mkdir(parents=True, exist_ok=True)
    rig = RIGS[name](np.random.default_rng([seed, 15, number]))
    random = np.random.default_rng([seed, 16, number])
    (folder / BASE).write_text(rig.case)
    for record, drive in zip(RECORDS, rig.drives, strict=True):
        _write_record(folder / record, rig, drive, random)
    (folder / TRUTH).write_text(json.dumps({"machine": name, "effects": rig.hidden}))
    return rig


def _write_record(path: Path, rig: Rig, drive: float, random: np.random.Generator) -> None:
    machine = rig.machine(drive)
    n, sampled = machine.n, np.arange(round(rig.seconds * rig.rate)) / rig.rate
    times = np.concatenate([[0.0], rig.settle + sampled]) if rig.settle else sampled
    start = np.asarray(rig.release.get(drive) or [0.0] * 2 * n)
    if not rig.release and not rig.driven and rig.force is None:
        start = random.uniform(-0.1, 0.1, 2 * n)
    motion = flown(machine, start[:n], start[n:], times)[-sampled.size :]
    columns = {"t": sampled}
    for at, name in enumerate(rig.shown):
        x = motion[:, at]
        columns[name] = x + NOISE * np.std(x) * random.standard_normal(x.size)
    lines = [f"# sampling_rate_hz: {rig.rate!r}"]
    units = ["t s", *(f"{name} m" for name in rig.shown)]
    if rig.driven:
        lines += [f"# drive_frequency_rad_s: {drive!r}", f"# phase: {(drive * rig.settle) % (2 * np.pi)!r}"]
    if rig.force is not None:
        columns["force"] = rig.force(drive, sampled)
        units.append("force N")
    lines += [f"# units: {', '.join(units)}", ",".join(columns)]
    np.savetxt(
        path, np.column_stack(list(columns.values())), "%.10g", ",", header="\n".join(lines), comments=""
    )
