# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of machines of several bodies with hidden effects, from the simulator of tests/referee."""

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "referee"))
import structures
from structures import Structure


def flown(machine: Structure, q: Sequence[float], v: Sequence[float], times: np.ndarray) -> np.ndarray:
    """Places, then velocities (times, 2 n) of a motion from its start at the first of the times."""
    ways = []
    solve = structures.solve_ivp

    def kept(*arguments, **more):
        way = solve(*arguments, dense_output=True, **more)
        end = min([way.t[-1], *(at[0] for at in way.t_events if len(at))])
        ways.append((way.t[0], end, way.sol))
        return way

    structures.solve_ivp = kept
    try:
        machine.run(q, v, float(times[-1]), float(times[0]))
    finally:
        structures.solve_ivp = solve
    found = np.zeros((times.size, 2 * machine.n))
    for first, last, sol in ways:
        here = (times >= first) & (times <= last)
        if here.any():
            found[here] = sol(times[here]).T
    return found


def write(
    path: Path,
    times: np.ndarray,
    columns: Mapping[str, np.ndarray],
    noise: float,
    header: Mapping[str, float],
    seed: int,
    stated: bool = True,
) -> Path:
    """A record in which every column has noise of a share of its standard deviation."""
    random = np.random.default_rng(seed)
    lines = [f"# {key}: {value!r}" for key, value in header.items()]
    noisy = [times - times[0]]
    for name, column in columns.items():
        sigma = float(noise * np.std(column))
        noisy.append(column + sigma * random.standard_normal(column.size))
        if stated:
            lines.append(f"# noise.{name}: {sigma!r}")
    lines += ["# units: t s, x m", ",".join(["t", *columns])]
    np.savetxt(path, np.column_stack(noisy), delimiter=",", header="\n".join(lines), comments="")
    return path


def record(
    path: Path,
    machine: Structure,
    frequency: float,
    shown: Callable[[np.ndarray], Mapping[str, np.ndarray]],
    *,
    periods: int = 14,
    samples: int = 60,
    settle: int = 10,
    noise: float = 1e-3,
    seed: int = 1,
    start: Sequence[float] | None = None,
    stated: bool = True,
) -> Path:
    """The record of a driven machine after some periods, its drive being cos(frequency t + its phase)."""
    period = 2 * np.pi / frequency
    count = periods * samples
    times = period * np.concatenate([[0.0], settle + np.arange(count) / samples])
    q = np.zeros(machine.n) if start is None else np.asarray(start, float)
    motion = flown(machine, q, np.zeros(machine.n), times)[1:]
    header = {"drive_frequency_rad_s": float(frequency), "phase": 0.0}
    return write(path, times[1:], shown(motion), noise, header, seed, stated)
