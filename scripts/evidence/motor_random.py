# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares random machines with a motor with SciPy's DOP853: events, energy; writes docs/motor_random.md."""

import argparse
import json
import math
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import h5py
import motor_reference
import numpy as np
from evidence_rows import SOURCE, table
from motor_reference import DAMPING, DRY, WORK, Motion
from motor_reference_machine import Machine

MOTORS = ("linear", "kloss", "dc", "pi", "table")
DRIVES = ("harmonic", "slider_crank", "crank_lever_rod", "unbalance")
KINDS = (
    "impact_upper",
    "impact_lower",
    "stick",
    "release",
    "turning_point",
    "chatter",
    "chatter",
    "barrier_release",
)
DURATION = 6.0
#: Largest difference of an event, or so many times what another tolerance changes in the reference.
BAR, SENSITIVE = 1e-9, 10.0
BALANCE = 1e-8
# An impact this slow [m/s] begins a sequence of ever smaller ones.
_SLOW = 1e-3

PAGE = """\
# Random machines with a motor against SciPy

Written by `scripts/evidence/motor_random.py`; do not edit. Each machine has a random motor, mechanism or
unbalance, friction and stops, bearing, and start; some motors have a ramp. The reference integrates equations
of its own with SciPy's DOP853 at a relative tolerance of 1e-13, and finds the events by Newton's method. A
difference is the largest of time, angle, speed, position and velocity of an event over 6 s (SI units).
Allowed is 1e-9, plus ten times what another tolerance changes in the reference. The table lists the
differences of events that the tolerance changes by less than 1e-10. The energy balance must close to 1e-8.

{rows}

## Failures

{wrong}
"""


@dataclass
class Comparison:
    """A machine by both: number of events, largest differences, and what is wrong, '' if nothing."""

    events: int = 0
    difference: float = 0.0
    closing: float = 0.0
    wrong: str = ""


def random_motor(law: str, rng: np.random.Generator, speed: float, torque: float, natural: float) -> dict:
    """A motor with a speed without load, and a torque at standstill or nearly."""
    motor = {"law": law}
    if law == "linear":
        motor |= {"stall_torque": torque, "no_load_speed": speed}
    elif law == "kloss":
        slip = float(rng.uniform(0.1, 0.6))
        motor |= {"breakdown_torque": torque, "breakdown_slip": slip, "synchronous_speed": speed}
    elif law == "dc":
        constant = float(rng.uniform(0.2, 1))
        resistance = constant**2 * speed / torque
        motor |= {"voltage": constant * speed, "torque_constant": constant, "resistance": resistance}
        if rng.random() < 0.6:
            motor["inductance"] = resistance / natural * float(rng.uniform(0.1, 3))
            motor["start_current"] = torque / constant * float(rng.uniform(0, 1))
    elif law == "pi":
        motor |= {"proportional": torque / speed * float(rng.uniform(0.5, 3)), "reference": speed}
        motor |= {"integral": torque * float(rng.uniform(0.05, 1))}
        if rng.random() < 0.5:
            motor["torque_limit"] = torque * float(rng.uniform(0.2, 1))
    else:
        at = np.sort(speed * (np.arange(6) + rng.uniform(0, 0.5, 6)) / 4)
        motor |= {"speed": at.tolist(), "torque": (torque * (1 - (at / speed) ** 3)).tolist()}
    if rng.random() < 0.3 and law != "table":
        motor |= {"ramp_time": float(rng.uniform(1, 4)), "ramp_from": float(rng.uniform(0.1, 0.9))}
        motor["ramp_from"] *= motor["voltage"] if law == "dc" else speed
    if rng.random() < 0.7:
        motor["crank_speed"] = speed * float(rng.uniform(-0.2, 1.3))
    return motor


def random_drive(law: str, rng: np.random.Generator, radius: float, mass: float, motor: dict) -> dict:
    """A mechanism or an unbalance; its inertias come to the motor."""
    if law == "unbalance":
        most = 0.7 * math.sqrt(mass * motor["inertia"])
        return {"law": law, "moment": min(mass * radius, most)}
    motor["foot_mass"] = mass * float(rng.uniform(0, 1))
    if law == "harmonic":
        return {"law": law, "amplitude": radius}
    if law == "slider_crank":
        return {"law": law, "crank": radius, "rod": radius * float(rng.uniform(1.3, 5))}
    motor["lever_inertia"] = motor["inertia"] * float(rng.uniform(0, 1))
    motor["rod_mass"] = mass * float(rng.uniform(0, 1))
    motor["rod_inertia"] = motor["inertia"] * float(rng.uniform(0, 0.01))
    return {
        "law": law,
        "crank": radius,
        "pivot_distance": radius * float(rng.uniform(1.5, 1.8)),
        "lever": 4.5 * radius,
        "rod": radius * float(rng.uniform(4, 6)),
        "pivot_angle": math.radians(float(rng.uniform(-122, -112))),
        "guide_height": -2 * radius,
        "side": 1,
        "shift": 4.48 * radius,
    }


def random_machine(motor_law: str, drive_law: str, number: int) -> tuple[Machine, float, float]:
    """A machine with a start x, v. Bits of the number set the stops that it has: upper (1), lower (2)."""
    rng = np.random.default_rng([number, MOTORS.index(motor_law), DRIVES.index(drive_law)])
    mass, natural, radius = (float(rng.uniform(*ends)) for ends in ((0.5, 3), (5, 15), (0.01, 0.05)))
    stiffness = mass * natural**2
    size = stiffness * radius**2
    torque = size * float(10 ** rng.uniform(-0.3, 0.8))
    speed = natural * float(rng.uniform(0.6, 2.2))
    motor = random_motor(motor_law, rng, speed, torque, natural)
    motor["inertia"] = size / natural**2 * float(10 ** rng.uniform(0.3, 2.5))
    motor["bearing_damping"] = torque / speed * float(rng.uniform(0, 0.05))
    motor["bearing_friction"] = torque * float(rng.uniform(0, 0.1)) * int(rng.integers(2))
    friction = stiffness * radius * float(rng.uniform(0.02, 0.4)) * int(rng.integers(3) > 0)
    machine = Machine(
        motor,
        random_drive(drive_law, rng, radius, mass, motor),
        mass=mass,
        stiffness=stiffness,
        free_length=float(rng.choice([0, 0.3])),
        kinetic=friction,
        static=friction * float(rng.uniform(1, 1.6)),
        damping=mass * natural * float(rng.uniform(0.02, 0.12)),
        restitution=float(rng.choice([0.9, 0.7, 0.5, 0.2, 0.0])),
    )
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    middle = machine.free_length + float(np.mean([machine.mechanism(angle)[0] for angle in turn]))
    range_ = radius * float(rng.uniform(1.5, 5))
    if number & 1:
        machine.upper = middle + range_
    if number & 2:
        machine.lower = middle - range_ * float(rng.uniform(0.5, 1.5))
    x = middle + range_ * float(rng.uniform(-0.4, 0.9))
    return machine, x, range_ * natural * float(rng.uniform(-0.5, 0.5)) * int(rng.integers(5) > 0)


def case_text(machine: Machine, x: float, v: float) -> str:
    """The case file of a machine."""
    friction = {"law": "viscous", "damping": machine.damping}
    if machine.kinetic > 0:
        friction["law"] = "coulomb_viscous"
        friction["kinetic_coefficient"] = machine.kinetic / machine.mass
        friction["static_coefficient"] = machine.static / machine.mass
    tables = {
        "body": {"mass": machine.mass, "gravity": 1.0},
        "restoring": {"law": "linear", "stiffness": machine.stiffness, "free_length": machine.free_length},
        "friction": friction,
        "drive": machine.drive,
        "motor": machine.motor,
        "start": {"x0": x, "v0": v},
        "run": {"duration": DURATION, "window": DURATION / 4, "average": "window"},
    }
    stops = {name: value for name in ("upper", "lower") if math.isfinite(value := getattr(machine, name))}
    if stops:
        tables["contact"] = {"law": "newton", "restitution": machine.restitution, **stops}
    lines = []
    for name, values in tables.items():
        lines.append(f"[{name}]")
        lines += [f"{key} = {json.dumps(value)}" for key, value in values.items()]
    return "\n".join(lines) + "\n"


def ours(program: Path, case: Path) -> tuple[list, np.ndarray, float]:
    """Events by the simulator up to a chatter sequence, then values at the end and the closing error."""
    output = case.with_suffix(".h5")
    subprocess.run([program, "trajectory", case, "-o", output, "--force", "-q"], check=True)
    with h5py.File(output) as file:
        names = ("event_time", "event_crank_angle", "event_crank_speed", "event_x", "event_v_before")
        columns = [file[name][()] for name in names]
        kinds = [KINDS[code - 1] for code in file["event_kind"][()]]
        last = (
            "crank_angle",
            "crank_speed",
            "x",
            "v",
            "drive_work",
            "damping_loss",
            "friction_loss",
            "contact_loss",
        )
        end = np.array([file[name][-1] for name in last])
        closing = float(abs(file.attrs["energy_closing_error"]))
    events = list(zip(kinds, *columns, strict=True))
    if "chatter" in kinds:
        events = events[: kinds.index("chatter") + 1]
    return events, end, closing


def theirs(machine: Machine, x: float, v: float, until: float, tolerance: float) -> Motion:
    """The motion by the reference."""
    motor = machine.motor
    own = motor.get("start_current", 0.0)
    motor_reference.TOLERANCE = tolerance
    motion = Motion(machine, np.array([0, motor.get("crank_speed", 0.0), x, v, own, 0, 0, 0], float))
    motion.run(until)
    return motion


def compare(program: Path, folder: Path, machine: Machine, x: float, v: float) -> Comparison:
    """Both, event by event; what comes after a sequence of ever smaller impacts is left out."""
    case = folder / "random.toml"
    case.write_text(case_text(machine, x, v))
    events, end, closing = ours(program, case)
    found = Comparison(closing=closing)
    if closing > BALANCE:
        found.wrong = f"energy balance {closing:.1e}"
    until = DURATION
    if events and events[-1][0] == "chatter":
        slow = [one[0].startswith("impact") and abs(one[5]) < _SLOW for one in events]
        events = events[: slow.index(True) if True in slow else -1]
        until = events[-1][1] + 1e-9 if events else 0.0
    motions = [theirs(machine, x, v, until, tolerance) for tolerance in (1e-13, 3e-14)]
    found.events = len(events)
    for number, (one, first, second) in enumerate(
        zip(events, *(motion.events for motion in motions), strict=False)
    ):
        if one[0] != first[0]:
            found.wrong = f"event {number}: {one[0]} at {one[1]:.9g} s, not {first[0]} at {first[1]:.9g} s"
            return found
        difference = np.abs(np.subtract(one[1:], first[1:])).max()
        known_to = BAR + SENSITIVE * np.abs(np.subtract(second[1:], first[1:])).max()
        found.difference = max(found.difference, difference if known_to < 2 * BAR else 0.0)
        if difference > known_to:
            found.wrong = found.wrong or f"event {number} off by {difference:.1e}"
    if len(events) != len(motions[0].events):
        found.wrong = found.wrong or f"{len(events)} events, not {len(motions[0].events)}"
    if until == DURATION and not found.wrong:
        ends = [np.array([*one.z[:4], *one.z[[WORK, DAMPING, DRY]], one.contact]) for one in motions]
        scale = np.maximum(1, np.abs(ends[0]))
        off = (np.abs(end - ends[0]) / scale).max()
        if off > BALANCE + SENSITIVE * (np.abs(ends[1] - ends[0]) / scale).max():
            found.wrong = f"end off by {off:.1e}"
    return found


def main() -> None:
    """Compare all, write the page, end with 1 if something is not as it must be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=SOURCE / "build")
    parser.add_argument("--machines", type=int, default=20, help="of each motor with each drive")
    options = parser.parse_args()
    folder = options.build / "motor_random"
    folder.mkdir(parents=True, exist_ok=True)
    program = options.build / "bin" / "separatrix"
    rows, wrong = [], []
    for motor in MOTORS:
        for drive in DRIVES:
            found = []
            for number in range(options.machines):
                found.append(compare(program, folder, *random_machine(motor, drive, number)))
                if found[-1].wrong:
                    wrong.append(f"{motor}, {drive}, {number}: {found[-1].wrong}")
            events = sum(one.events for one in found)
            apart, closing = max(one.difference for one in found), max(one.closing for one in found)
            rows.append((motor, drive, str(len(found)), str(events), f"{apart:.1e}", f"{closing:.1e}"))
            print(*rows[-1], *wrong[-1:], sep=" | ", flush=True)
    names = ["motor", "drive", "machines", "events", "largest difference", "error of the energy balance"]
    listed = "\n".join(f"* {item}" for item in wrong) if wrong else "None."
    (SOURCE / "docs" / "motor_random.md").write_text(PAGE.format(rows=table(names, rows), wrong=listed))
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
