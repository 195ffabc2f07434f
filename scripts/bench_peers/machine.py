# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The problem that every contestant gets: the published machine, its start points, what is returned."""

import ctypes
import hashlib
import math
import random
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).resolve().parents[2]
CASE = SOURCE / "examples" / "basin_coulomb.toml"
TOLERANCE = 1e-9
SEED = 20240611
HARMONICS = 3
X0 = (0.0, 1.1)
V0 = (-6.0, 6.0)


class Machine(ctypes.Structure):
    """machine_t of published_case.h."""

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


def read_case() -> dict:
    """The case file with plain numbers."""
    case = tomllib.loads(CASE.read_text())
    return {
        name: {
            key: si(value) if key not in ("law", "cosine", "sine", "average") else value
            for key, value in table.items()
        }
        for name, table in case.items()
        if isinstance(table, dict)
    }


def published_machine() -> Machine:
    """The machine of the case file, per unit of mass."""
    case = read_case()
    drive, spring, contact = case["drive"], case["restoring"], case["contact"]
    stiffness = spring["stiffness"] / case["body"]["mass"]
    machine = Machine(
        stiffness=stiffness,
        rest=spring["free_length"] + drive["mean"],
        friction=case["friction"]["kinetic_coefficient"] * case["body"]["gravity"],
        restitution=contact["restitution"],
        barrier=contact["upper"],
        frequency=drive["ratio"] * math.sqrt(stiffness),
        angle=drive["angle"],
        cosine=tuple(drive["cosine"]),
        sine=tuple(drive["sine"]),
        duration=case["run"]["duration"],
        window=case["run"]["window"],
    )
    reach = sum(abs(a) + abs(b) for a, b in zip(drive["cosine"], drive["sine"], strict=True))
    if stiffness * (machine.barrier - machine.rest - reach) <= machine.friction:
        raise ValueError("a body could rest at the barrier: the drivers of the peers do not know that state")
    return machine


def start_points(count: int) -> np.ndarray:
    """The first `count` starts (x0, v0); the same bits wherever Python runs."""
    numbers = random.Random(SEED)
    return np.array([(numbers.uniform(*X0), numbers.uniform(*V0)) for _ in range(count)])


def fingerprint(starts: np.ndarray) -> str:
    """SHA-256 of the bits, shortened."""
    return hashlib.sha256(starts.astype("<f8").tobytes()).hexdigest()[:16]
