# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The independent simulator, machine.c, compiled and called through ctypes."""

import ctypes
import hashlib
import os
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent
FLAGS = ("-O2", "-std=c11", "-ffp-contract=off", "-fPIC", "-shared")
HARMONICS = 6
STATES = 6
X, V, DAHL, SECOND_X, SECOND_V, MAXWELL = range(STATES)
POWER, SATURATING, STEP = 1, 2, 3
"""Shapes of a restitution that falls with the speed of impact; 0 is the line of the catalogue."""
NOWHERE = 1e30
"""Where a barrier is that is not there."""

SCALARS = (
    "mass stiffness free_length mean cosine sine scale angle frequency phase coulomb viscous restitution"
    " upper quadratic stribeck stribeck_velocity static_excess dahl"
    " asymmetric_coulomb asymmetric_viscous friction_slope cubic offset"
    " restitution_slope contact_stiffness contact_damping lower"
    " ripple_sine ripple_cosine ripple_harmonic"
    " quadratic_exponent stribeck_exponent cubic_exponent contact_exponent"
    " restitution_shape restitution_constant friction_wave friction_wave_phase"
    " stiffness_wave stiffness_wave_frequency friction_drift second_mass second_stiffness second_damping"
    " delayed_stiffness delay restitution_wave restitution_wave_frequency maxwell_stiffness maxwell_time"
).split()


class Machine(ctypes.Structure):
    """`struct machine` of machine.h."""

    _fields_ = [
        *(
            (name, ctypes.c_double * HARMONICS if name in ("cosine", "sine") else ctypes.c_double)
            for name in SCALARS
        ),
        ("history", ctypes.POINTER(ctypes.c_double)),
        ("history_first", ctypes.c_double),
        ("history_step", ctypes.c_double),
        ("history_count", ctypes.c_long),
    ]

    def copy(self, **changes: float) -> "Machine":
        """The same machine with some parameters changed; the past is shared."""
        other = Machine()
        ctypes.pointer(other)[0] = self
        other.keep = getattr(self, "keep", None)
        for name, value in changes.items():
            if name not in SCALARS:
                raise KeyError(name)
            setattr(other, name, (ctypes.c_double * HARMONICS)(*value) if np.ndim(value) else value)
        return other

    @property
    def period(self) -> float:
        """Of the drive [s]."""
        return 2 * np.pi / self.frequency


class SimulationError(Exception):
    """Events piled up, or the motion is not finite."""


def compiled(name: str, sources: list[Path]) -> Path:
    """A library of the first of its sources; compiled once per version of these."""
    text = b"".join(source.read_bytes() for source in sources) + " ".join(FLAGS).encode()
    folder = Path(
        os.environ.get("SEPARATRIX_GENERATOR", Path(tempfile.gettempdir()) / f"generator-{os.getuid()}")
    )
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    path = folder / f"{name}-{hashlib.sha256(text).hexdigest()[:16]}.so"
    if not path.is_file():
        draft = folder / f"{path.name}.{os.getpid()}"
        subprocess.run(["cc", *FLAGS, "-o", draft, sources[0], "-lm"], check=True)
        draft.rename(path)
    return path


@cache
def library() -> ctypes.CDLL:
    """The compiled simulator."""
    found = ctypes.CDLL(str(compiled("machine", [FOLDER / "machine.c", FOLDER / "machine.h"])))
    array = np.ctypeslib.ndpointer
    found.machine_size.restype = ctypes.c_long
    if found.machine_size() != ctypes.sizeof(Machine):
        raise RuntimeError("machine.h and simulator.py differ")
    found.simulate.argtypes = [
        ctypes.POINTER(Machine),
        array(np.float64, shape=(STATES,), flags="C"),
        ctypes.c_double,
        ctypes.c_double,
        ctypes.c_long,
        ctypes.c_long,
        array(np.float64, ndim=2, flags="C"),
        array(np.int64, ndim=1, flags="C"),
    ]
    found.simulate_pieces.argtypes = [
        ctypes.POINTER(Machine),
        ctypes.c_long,
        array(np.float64, ndim=2, flags="C"),
        array(np.float64, ndim=1, flags="C"),
        array(np.int64, ndim=1, flags="C"),
        ctypes.c_double,
        ctypes.c_long,
        array(np.float64, ndim=2, flags="C"),
        array(np.int64, ndim=1, flags="C"),
    ]
    return found


def state(machine: Machine, x: float, v: float) -> np.ndarray:
    """A start: everything attached at rest relative to the body, the presliding spring saturated."""
    start = np.zeros(STATES)
    start[[X, V, SECOND_X, SECOND_V]] = x, v, x, v
    if machine.dahl > 0:
        start[DAHL] = machine.coulomb * np.sign(v)
    return start


def simulate(
    machine: Machine, start: np.ndarray, t0: float, interval: float, count: int, substeps: int
) -> tuple[np.ndarray, int]:
    """States (count, STATES) at t0 + i interval, and the number of impacts.

    Leaves the past in the machine where it has a delayed force.
    """
    if machine.delayed_stiffness != 0:
        machine.keep = (ctypes.c_double * (2 * (count * substeps + 2)))()
        machine.history = machine.keep
    states, impacts = np.empty((count, STATES)), np.zeros(1, dtype=np.int64)
    failed = library().simulate(machine, np.array(start), t0, interval, count, substeps, states, impacts)
    if failed or not np.isfinite(states).all():
        raise SimulationError
    return states, int(impacts[0])


def simulate_pieces(
    machine: Machine, starts: np.ndarray, t0: np.ndarray, first: np.ndarray, interval: float, substeps: int
) -> tuple[np.ndarray, np.ndarray]:
    """States of many short flights one below the other, and the number of impacts of each."""
    states, impacts = np.empty((first[-1], STATES)), np.zeros(len(starts), dtype=np.int64)
    arguments = (len(starts), starts, t0, first, interval, substeps, states, impacts)
    if library().simulate_pieces(machine, *arguments) or not np.isfinite(states).all():
        raise SimulationError
    return states, impacts
