# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The independent referee (referee.c) in Python: machines from case files, outcomes of many starts.

It reads the same case files as the program, by `tomllib` and in SI numbers alone, and shares no code with it.
"""

import ctypes
import math
import os
import subprocess
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
HARMONICS, LONGEST = 8, 512


class Machine(ctypes.Structure):
    """`machine` of referee.c: everything per unit mass."""

    _fields_ = [
        *((name, ctypes.c_double) for name in ("spring", "rest", "cubic", "pendulum", "damping", "kinetic")),
        *((name, ctypes.c_double) for name in ("static_friction", "restitution", "upper", "lower")),
        ("wall_stiffness", ctypes.c_double),
        ("frequency", ctypes.c_double),
        ("cosine", ctypes.c_double * HARMONICS),
        ("sine", ctypes.c_double * HARMONICS),
        ("samples", ctypes.c_int),
        ("interval", ctypes.c_double),
        ("force", ctypes.POINTER(ctypes.c_double)),
        ("longest_step", ctypes.c_double),
    ]

    @property
    def period(self) -> float:
        """Drive period [s]."""
        return 2 * math.pi / self.frequency


class _Outcome(ctypes.Structure):
    _fields_ = [
        ("period", ctypes.c_int),
        ("turns", ctypes.c_int),
        ("settled", ctypes.c_long),
        *((name, ctypes.c_int) for name in ("impacts", "simulated", "chatters", "stops")),
        ("exponent", ctypes.c_double * 2),
        *((name, ctypes.c_double) for name in ("trace", "determinant", "slowest", "margin")),
        ("cycle", ctypes.c_double * 2 * LONGEST),
        ("failed", ctypes.c_bool),
    ]


@dataclass(frozen=True)
class Effort:
    """How long a motion is followed, in drive periods: `exponents` is how long they are averaged."""

    longest: int = 512
    least: int = 64
    most: int = 4000
    exponents: int = 2000
    tolerance: float = 1e-10


@dataclass(frozen=True)
class Outcome:
    """Where a start ends up; `period` is 0 without a cycle. Counts are per cycle or `Effort.exponents`."""

    period: int
    turns: int
    settled: int
    impacts: int
    simulated: int
    chatters: int
    stops: int
    exponents: tuple[float, float]
    multipliers: tuple[complex, complex]
    slowest: float
    margin: float
    cycle: np.ndarray
    failed: bool

    @property
    def kind(self) -> str:
        """The motion in a word: its period, `chaos`, or `slow` where neither a cycle nor chaos was seen."""
        if self.failed:
            return "failed"
        if self.period:
            return f"period {self.period}"
        return "chaos" if self.exponents[0] > 1e-3 else "slow"


def build(folder: Path, long: bool = False) -> ctypes.CDLL:
    """Compile referee.c into `folder` (in long double if asked) and load it."""
    path = folder / f"referee{'_long' if long else ''}.so"
    source = HERE / "referee.c"
    newest = max(item.stat().st_mtime for item in (source, *HERE.glob("*.h")))
    if not path.is_file() or path.stat().st_mtime < newest:
        flags = ["-O2", "-shared", "-fPIC", *(["-DREAL_IS_LONG"] if long else [])]
        compiler = os.environ.get("CC", "cc")
        subprocess.run([compiler, *flags, "-o", path, source, "-lm"], check=True)
    library = ctypes.CDLL(str(path))
    assert library.referee_size() == ctypes.sizeof(_Outcome)
    return library


def machine_of(case: dict, step: float = 0.8) -> Machine:
    """The machine of a case: one body on a spring or a pendulum, a drive of the foot or a measured force."""
    body, restoring, drive = case["body"], case["restoring"], case["drive"]
    friction, contact = case.get("friction", {"law": "none"}), case.get("contact", {"law": "none"})
    mass = body["mass"]
    spring = restoring.get("stiffness", 0.0) / mass
    machine = Machine(longest_step=step, spring=spring, pendulum=restoring.get("moment", 0.0) / mass)
    machine.rest = restoring.get("free_length", 0.0) + drive.get("mean", 0.0)
    machine.cubic = case.get("effect", {}).get("cubic_spring", {}).get("stiffness", 0.0) / mass
    machine.damping = friction.get("damping", 0.0) / mass
    gravity = body.get("gravity", 9.81)
    machine.kinetic = friction.get("kinetic_coefficient", 0.0) * gravity
    machine.static_friction = (
        friction.get("static_coefficient", friction.get("kinetic_coefficient", 0.0)) * gravity
    )
    machine.upper, machine.lower = contact.get("upper", math.inf), contact.get("lower", -math.inf)
    if contact["law"] == "newton":
        machine.restitution = contact["restitution"]
    elif contact["law"] == "kelvin_voigt" and contact["damping"] == 0:
        machine.wall_stiffness = contact["stiffness"] / mass
    elif contact["law"] != "none":
        raise ValueError(f"the referee has no contact law {contact['law']}")
    if drive["law"] == "measured_force":
        # the last sample ends the period, or a step back to the first one
        forces = [*drive["force"], *(drive["force"][:1] if drive.get("periodic", 0) else [])]
        machine.samples, machine.interval = len(forces), drive["interval"]
        machine.frequency = 2 * math.pi / ((machine.samples - 1) * machine.interval)
        machine.kept = (ctypes.c_double * machine.samples)(*(force / mass for force in forces))
        machine.force = machine.kept
        return machine
    machine.frequency = drive["ratio"] * math.sqrt(spring)
    if drive["law"] == "harmonic":
        cosine, sine = [drive["amplitude"]], [0.0]
    elif drive["law"] == "fourier":
        cosine, sine = drive["cosine"], drive["sine"]
    else:
        raise ValueError(f"the referee has no drive law {drive['law']}")
    for n, (a, b) in enumerate(zip(cosine, sine, strict=True), 1):
        turned = (a - 1j * b) * complex(
            math.cos(n * drive.get("angle", 0.0)), math.sin(n * drive.get("angle", 0.0))
        )
        machine.cosine[n - 1], machine.sine[n - 1] = spring * turned.real, -spring * turned.imag
    return machine


def with_value(case: dict, path: str, value: float) -> dict:
    """A case with another value of one parameter, `family.parameter`."""
    family, name = path.split(".")
    return {**case, family: {**case[family], name: value}}


def outcomes(
    library: ctypes.CDLL, machine: Machine, starts: np.ndarray, effort: Effort | None = None
) -> list[Outcome]:
    """Where the starts, rows of x and v at crank angle 0, end up."""
    effort = effort or Effort()
    starts = np.ascontiguousarray(starts, float)
    found = (_Outcome * len(starts))()
    library.referee_outcomes(
        ctypes.byref(machine),
        len(starts),
        starts.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
        effort.longest,
        ctypes.c_long(effort.least),
        ctypes.c_long(effort.most),
        ctypes.c_long(effort.exponents),
        ctypes.c_double(effort.tolerance),
        found,
    )
    return [_outcome(item) for item in found]


def _outcome(item: _Outcome) -> Outcome:
    rows = item.period or LONGEST
    root = np.sqrt(complex(item.trace**2 / 4 - item.determinant))
    return Outcome(
        item.period,
        item.turns,
        item.settled,
        item.impacts,
        item.simulated,
        item.chatters,
        item.stops,
        (item.exponent[0], item.exponent[1]),
        (item.trace / 2 + root, item.trace / 2 - root),
        item.slowest,
        item.margin,
        np.ctypeslib.as_array(item.cycle)[:rows].copy(),
        item.failed,
    )


def sections(library: ctypes.CDLL, machine: Machine, x: float, v: float, periods: int) -> np.ndarray:
    """Rows x, v, impacts, chatters at the end of each drive period of one motion."""
    rows = np.empty((periods, 4))
    library.referee_sections(
        ctypes.byref(machine),
        ctypes.c_double(x),
        ctypes.c_double(v),
        ctypes.c_long(periods),
        rows.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
    )
    return rows


def read_case(path: Path) -> dict:
    """A case file."""
    return tomllib.loads(path.read_text())
