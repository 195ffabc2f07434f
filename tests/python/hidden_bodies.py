# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of machines of several bodies with hidden effects, from the simulator of tests/referee."""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "referee"))
import structures
from scipy.integrate import solve_ivp
from structures import Structure

# the case of the owner is some per cent off in every number
SPRINGS = """
body.first.mass = 1
body.second.mass = 0.8
watch.body = "second"
drive.force = {law = "force", body = "first", amplitude = 4.1, frequency = 7}
run.duration = 20
[spring.frame]
between = ["first"]
stiffness = 41
damping = 0.28
[spring.coupling]
between = ["first", "second"]
stiffness = 58
damping = 0.22
"""
"""Two bodies in a row on springs, the first driven."""


@dataclass
class Sprung:
    """M q'' = force(t, q, v) and friction with a spring before it slides, along a row: no closed form."""

    mass: Sequence[float]
    force: Callable[[float, np.ndarray, np.ndarray], np.ndarray]
    row: Sequence[float]
    stiffness: float
    level: float
    # +1 or -1: it slides so at the start; 0: its spring has no extension
    slides: int = 0

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.mass)

    def along(self, q: Sequence[float], v: Sequence[float], times: np.ndarray) -> np.ndarray:
        """Positions, then velocities (times, 2 n) of a motion from its start at the first of the times."""
        n, row = self.n, np.asarray(self.row, float)
        longest = self.level / self.stiffness

        def slope(t, y, mode):
            total = self.force(t, y[:n], y[n:-1]) - row * self.stiffness * y[-1]
            return np.concatenate([y[n:-1], total / np.asarray(self.mass), [0 if mode else row @ y[n:-1]]])

        def ends(t, y, mode):
            # a slide that has just begun is not ended by rounding
            return mode * (row @ y[n:-1]) + 1e-12 if mode else longest - abs(y[-1])

        ends.terminal, ends.direction = True, -1
        mode, t = self.slides, float(times[0])
        y = np.concatenate([q, v, [mode * longest]]).astype(float)
        found = np.zeros((times.size, 2 * n))
        while True:
            span, options = (t, float(times[-1])), {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12}
            way = solve_ivp(
                slope, span, y, dense_output=True, events=ends, args=(mode,), max_step=0.05, **options
            )
            here = (times >= t) & (times <= way.t[-1])
            if here.any():
                found[here] = way.sol(times[here]).T[:, :-1]
            if way.status != 1:
                return found
            t, y = float(way.t[-1]), way.y[:, -1].copy()
            mode = 0 if mode else int(np.sign(y[-1]))
            # just short of what it takes to slide
            y[-1] = np.sign(y[-1]) * longest * (1 if mode else 1 - 1e-12)


def flown(machine: Structure, q: Sequence[float], v: Sequence[float], times: np.ndarray) -> np.ndarray:
    """Positions, then velocities (times, 2 n) of a motion from its start at the first of the times."""
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
    machine: Structure | Sprung,
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
    follow = machine.along if isinstance(machine, Sprung) else partial(flown, machine)
    motion = follow(q, np.zeros(machine.n), times)[1:]
    header = {"drive_frequency_rad_s": float(frequency), "phase": 0.0}
    return write(path, times[1:], shown(motion), noise, header, seed, stated)
