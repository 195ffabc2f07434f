# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of several bodies by the simulator of tests/referee/structures.py, event by event."""

import sys
from math import cos, sin

import h5py
import numpy as np
from evidence_program import Program
from evidence_rows import SOURCE, Row

sys.path.insert(0, str(SOURCE / "tests" / "referee"))
from structures import Friction, Rigid, Structure  # noqa: E402


def pulled(q, first: float, coupling: float, second: float = 0.0) -> np.ndarray:
    """Springs of two masses: ground to first, first to second, ground to second."""
    pull = coupling * (q[1] - q[0])
    return np.array([-first * q[0] + pull, -second * q[1] - pull])


def two_masses_by_steps() -> Structure:
    """The equations of two_masses.toml."""
    return Structure(
        [1, 1],
        lambda t, q, v: pulled(q, 1, 1) + 0.04 * pulled(v, 1, 1) + [cos(0.6 * t), 0],
        rigid=[Rigid([0, 1], 1, 1, lambda u: 0.8)],
    )


def damper_by_steps() -> Structure:
    """The equations of impact_damper.toml."""
    return Structure(
        [1, 0.1],
        lambda t, q, v: np.array([-q[0] - 0.1 * v[0] + sin(t), 0]),
        rigid=[Rigid([-1, 1], 10, 1, lambda u: 0.8), Rigid([-1, 1], -10, -1, lambda u: 0.8)],
    )


def pounding_by_steps() -> Structure:
    """The equations of pounding.toml."""
    return Structure(
        [1, 2],
        lambda t, q, v: np.array(
            [-q[0] - 0.1 * v[0] - cos(1.2 * t), -5.12 * q[1] - 0.32 * v[1] - 2 * cos(1.2 * t)]
        ),
        rigid=[Rigid([1, -1], 0.5, 1, lambda u: 0.65)],
    )


def blocks_by_steps(kinetic, static) -> Structure:
    """The equations of blocks.toml and blocks_hyperbolic.toml; `kinetic` are functions of the speed."""
    rows = ([1, 0], [0, 1])
    return Structure(
        [1, 1],
        lambda t, q, v: pulled(q, 1, 1.2, 1),
        [Friction(row, law, level, 0.2) for row, law, level in zip(rows, kinetic, static, strict=True)],
    )


SIMULATED = {
    "two_masses": (two_masses_by_steps, ([0, 0], [0, 0]), 40.0),
    "impact_damper": (damper_by_steps, ([1.126, 0], [0, 3]), 30.0),
    "pounding": (pounding_by_steps, ([0, 0], [0, 0]), 25.0),
    "blocks": (
        lambda: blocks_by_steps((lambda u: 0.6, lambda u: 0.78), (1.0, 1.3)),
        ([0.3, 0.1], [0, 0]),
        15.0,
    ),
    "blocks_hyperbolic": (
        lambda: blocks_by_steps((lambda u: 1 / (1 + 3 * u), lambda u: 1.3 / (1 + 3 * u)), (1.0, 1.3)),
        ([0.3, 0.1], [0, 0]),
        15.0,
    ),
}


def simulated(program: Program) -> list[Row]:
    """Times of all events from the start of a case, by scipy's steps and by the program."""
    found = []
    for case, (build, (q, v), until) in SIMULATED.items():
        machine = build()
        machine.run(q, v, until)
        with h5py.File(program.run("trajectory", case, run__duration=until, run__window=until / 2)) as file:
            ours = np.unique(file["event_time"][:])
        theirs = np.array([at for _, _, at in machine.events])
        miss = np.max(abs(ours - theirs)) if ours.shape == theirs.shape else np.inf
        what = f"{case}: largest difference in time of {len(theirs)} events in {until:g} s"
        found.append(Row("`tests/referee/structures.py`", what, 0.0, miss, 1e-9))
    return found
