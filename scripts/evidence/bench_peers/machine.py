# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The problem that every contestant gets: a machine, its start points, what is returned."""

import ctypes
import hashlib
import math
import random
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).resolve().parents[3]
CASE = SOURCE / "examples" / "basin_coulomb.toml"
TOLERANCE = 1e-9
SEED = 20240611
HARMONICS = 3
X0 = (0.0, 1.1)
V0 = (-6.0, 6.0)
RESTITUTION_LAWS = ("newton", "newton_linear", "newton_power", "newton_viscoelastic")
RIGID, KELVIN_VOIGT, KELVIN_VOIGT_CUT, HUNT_CROSSLEY = range(4)


class Machine(ctypes.Structure):
    """machine_t of machine.h."""

    _fields_ = [
        ("stiffness", ctypes.c_double),
        ("rest", ctypes.c_double),
        ("friction", ctypes.c_double),
        ("restitution", ctypes.c_double),
        ("barrier", ctypes.c_double),
        ("frequency", ctypes.c_double),
        ("angle", ctypes.c_double),
        ("cosine", ctypes.c_double * HARMONICS),
        ("sine", ctypes.c_double * HARMONICS),
        ("duration", ctypes.c_double),
        ("window", ctypes.c_double),
        ("further", ctypes.c_double),
        ("ripple", ctypes.c_double),
        ("cubic", ctypes.c_double),
        ("quadratic", ctypes.c_double),
        ("viscous", ctypes.c_double),
        ("asymmetric", ctypes.c_double),
        ("asymmetric_viscous", ctypes.c_double),
        ("slope", ctypes.c_double),
        ("excess", ctypes.c_double),
        ("velocity", ctypes.c_double),
        ("dahl", ctypes.c_double),
        ("restitution_law", ctypes.c_double),
        ("coefficients", ctypes.c_double * 2),
        ("barrier_law", ctypes.c_double),
        ("barrier_stiffness", ctypes.c_double),
        ("barrier_damping", ctypes.c_double),
    ]


@dataclass
class Outcomes:
    """Final states and counts of the first len(x) starts."""

    x: np.ndarray
    v: np.ndarray
    impacts: np.ndarray
    label: np.ndarray
    """True for impact, False for non-impact, over the window at the end."""
    sticks: int | None = None
    """Stick phases in all trajectories, where the contestant counts them."""
    repaired: int | None = None
    """Impacts that the library's event location stepped over and its driver found afterwards."""


def si(value: float | str) -> float:
    """A quantity of the case file; the published case has SI units and degrees only."""
    if not isinstance(value, str):
        return float(value)
    number, unit = value.split(maxsplit=1)
    if unit not in ("kg", "m", "s", "m/s", "m/s^2", "N/m", "deg"):
        raise ValueError(f"unit of '{value}'")
    return math.radians(float(number)) if unit == "deg" else float(number)


def read_case(path: Path = CASE) -> dict:
    """The case file with plain numbers."""
    case = tomllib.loads(path.read_text())
    return {
        name: {
            key: value if isinstance(value, (list, dict)) or key in ("law", "average", "stop") else si(value)
            for key, value in table.items()
        }
        for name, table in case.items()
        if isinstance(table, dict)
    }


def published_machine() -> Machine:
    """The machine of the published case."""
    return machine_of(read_case())


def machine_of(case: dict) -> Machine:
    """The machine of a case, per unit of mass; see machine.h."""
    drive, spring, contact, friction = (case[name] for name in ("drive", "restoring", "contact", "friction"))
    effects, run, mass = case.get("effect", {}), case["run"], case["body"]["mass"]

    def effect(name: str, parameter: str) -> float:
        return effects.get(name, {}).get(parameter, 0.0)

    stiffness = spring["stiffness"] / mass
    normal = case["body"]["gravity"]
    machine = Machine(
        stiffness=stiffness,
        rest=spring.get("free_length", 0.0) + drive["mean"],
        friction=friction.get("kinetic_coefficient", 0.0) * normal,
        barrier=contact["upper"],
        frequency=drive["ratio"] * math.sqrt(stiffness),
        angle=drive["angle"],
        cosine=tuple(drive["cosine"]),
        sine=tuple(drive["sine"]),
        duration=run["duration"],
        window=run["window"],
        ripple=effect("drive_ripple", "sine"),
        cubic=effect("cubic_spring", "stiffness") / mass,
        quadratic=effect("quadratic_drag", "coefficient") / mass,
        viscous=friction.get("damping", 0.0) / mass,
        asymmetric=effect("asymmetric_friction", "coulomb") / mass,
        asymmetric_viscous=effect("asymmetric_friction", "viscous") / mass,
        slope=effect("position_dependent_friction", "slope"),
        excess=effect("stribeck", "excess") / mass,
        velocity=effect("stribeck", "velocity"),
        dahl=effect("dahl", "stiffness") / mass,
    )
    set_barrier(machine, contact, effects, mass)
    fields = [getattr(machine, name) for name, _ in Machine._fields_[12:]]
    machine.further = float(any(np.any(np.asarray(value)) for value in fields))
    check(machine)
    return machine


def set_barrier(machine: Machine, contact: dict, effects: dict, mass: float) -> None:
    """The law of the barrier."""
    law, slope = contact["law"], effects.get("restitution_slope")
    machine.restitution = contact.get("restitution", 1.0)
    if law in RESTITUTION_LAWS:
        machine.restitution_law = RESTITUTION_LAWS.index(law)
    if law == "newton_power":
        machine.coefficients = (contact["yield_speed"], contact.get("falloff", 0.25))
    elif law == "newton_viscoelastic":
        machine.coefficients = (contact["first"], contact["second"])
    elif law == "newton_linear":
        machine.coefficients = (contact["slope"], 0)
    elif law == "kelvin_voigt":
        machine.barrier_law = KELVIN_VOIGT if contact["tension"] > 0 else KELVIN_VOIGT_CUT
    if slope:
        machine.restitution_law, machine.coefficients = 1, (slope["slope"], 0)
    if "compliant_contact" in effects:
        contact, machine.barrier_law = effects["compliant_contact"], HUNT_CROSSLEY
    if machine.barrier_law != RIGID:
        share = 1 if machine.barrier_law == HUNT_CROSSLEY else mass
        machine.barrier_stiffness = contact["stiffness"] / mass
        machine.barrier_damping = contact["damping"] / share


def check(machine: Machine) -> None:
    """The drivers of the peers do not know a body that rests at a rigid barrier."""
    reach = sum(abs(a) + abs(b) for a, b in zip(machine.cosine, machine.sine, strict=True))
    extension = machine.barrier - machine.rest - reach
    push = machine.stiffness * extension
    hold = (machine.friction + machine.excess + abs(machine.asymmetric)) * (
        1 + machine.slope * machine.barrier
    )
    if machine.barrier_law == RIGID and push <= hold:
        raise ValueError("a body could rest at the barrier: the drivers of the peers do not know that state")


def start_points(count: int) -> np.ndarray:
    """The first `count` starts (x0, v0); the same bits wherever Python runs."""
    numbers = random.Random(SEED)
    return np.array([(numbers.uniform(*X0), numbers.uniform(*V0)) for _ in range(count)])


def fingerprint(starts: np.ndarray) -> str:
    """SHA-256 of the bits, shortened."""
    return hashlib.sha256(starts.astype("<f8").tobytes()).hexdigest()[:16]
