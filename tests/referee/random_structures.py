# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of several bodies that nobody chose: drawn by a seed, as a case and as the referee has it.

    python tests/referee/random_structures.py FIRST LAST [PROGRAM]

prints for each seed whether the program and the referee meet the same events.
"""

import bisect
import csv
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from structures import Friction, Rigid, Soft, Structure

DURATION = 10.0
BODIES = ("first", "second", "third", "fourth")
#: Events of one instant, as those of a joint that stops and another that is let go by it [s].
INSTANT = 1e-11
#: Events nearer to each other may be of a chatter, which the program completes and the referee counts [s].
CHATTER = 5e-3
#: scipy locates an event no better than its tolerance, and a motion with impacts enlarges what it misses [s].
AGREED = 2e-6


class Draw:
    """A machine by its seed: its case as text, and the `Structure` with the same equations."""

    def __init__(self, seed: int) -> None:
        """Draw bodies, springs, a force, friction of every law, rigid and soft stops."""
        self.random = np.random.default_rng(seed)
        self.n = int(self.random.integers(1, 5))
        self.parts: list[str] = []
        self.mass = [self.number(0.3, 3) for _ in range(self.n)]
        self.load = [self.number(-1, 1) if self.chance(0.3) else 0.0 for _ in range(self.n)]
        self.x0 = [self.number(-0.15, 0.15) for _ in range(self.n)]
        self.v0 = [self.number(-1, 1) for _ in range(self.n)]
        self.springs: list[tuple[np.ndarray, float, float, float]] = []
        self.frictions: list[Friction] = []
        self.rigid: list[Rigid] = []
        self.soft: list[Soft] = []
        for i in range(self.n):
            self.add(f"spring.s{i}", self.spring(i))
        self.driven, self.angle = int(self.random.integers(self.n)), self.number(0, 6)
        self.amplitude, self.frequency = self.number(0.3, 2), self.number(0.5, 3)
        self.add(
            "drive.force",
            {
                "law": "force",
                "body": BODIES[self.driven],
                "amplitude": self.amplitude,
                "frequency": self.frequency,
                "angle": self.angle,
            },
        )
        rubbed = set()
        for i in range(int(self.random.integers(4))):
            ends = self.ends()
            if frozenset(ends) not in rubbed:
                rubbed.add(frozenset(ends))
                self.add(f"friction.f{i}", self.friction(*ends))
        for i in range(int(self.random.integers(1, 4))):
            self.add(f"contact.c{i}", self.contact(*self.ends()))

    def number(self, low: float, high: float) -> float:
        """Three decimals, so that case and referee have the same."""
        return round(float(self.random.uniform(low, high)), 3)

    def chance(self, share: float) -> bool:
        """Whether something with this probability is so."""
        return bool(self.random.random() < share)

    def ends(self) -> tuple[int | None, int]:
        """Two bodies, or the ground and one."""
        second = int(self.random.integers(self.n))
        first = int(self.random.integers(self.n + 1)) - 1
        return (None if first in (-1, second) else first), second

    def row(self, first: int | None, second: int) -> np.ndarray:
        """What the joint coordinate is of the coordinates."""
        row = np.zeros(self.n)
        row[second] = 1
        if first is not None:
            row[first] = -1
        return row

    def add(self, name: str, keys: dict[str, object]) -> None:
        """Write a table of the case."""
        lines = (
            f"{key} = {str(value).lower() if isinstance(value, bool) else value!r}"
            for key, value in keys.items()
        )
        self.parts.append(f"[{name}]\n" + "\n".join(lines).replace("'", '"') + "\n")

    def between(self, first: int | None, second: int) -> dict[str, object]:
        """The key of the ends."""
        return {"between": [BODIES[i] for i in (first, second) if i is not None]}

    def spring(self, i: int) -> dict[str, object]:
        """From the body before or the ground, one in five with a cubic part."""
        first = i - 1 if i else None
        stiffness, damping = self.number(0.5, 5), self.number(0, 0.2) if self.chance(0.5) else 0.0
        cubic = self.number(0.2, 2) if self.chance(0.2) else 0.0
        self.springs.append((self.row(first, i), stiffness, damping, cubic))
        keys = {**self.between(first, i), "stiffness": stiffness, "damping": damping}
        return {**keys, "law": "polynomial", "cubic": cubic} if cubic else keys

    def friction(self, first: int | None, second: int) -> dict[str, object]:
        """Of any law; of the ground perhaps a belt."""
        level = self.number(0.05, 0.8)
        static = round(level * self.number(1, 1.8), 3) if self.chance(0.5) else level
        belt = self.number(-0.5, 0.5) if first is None and self.chance(0.5) else 0.0
        width, slope = self.number(0.05, 0.5), self.number(0.05, 0.8)
        law, more, force = [
            ("coulomb", {}, lambda u: level),
            ("coulomb_viscous", {"damping": slope}, lambda u: level + slope * u),
            ("coulomb_quadratic", {"drag": slope}, lambda u: level + slope * u * u),
            (
                "coulomb_stribeck",
                {"stribeck_velocity": width},
                lambda u: level + (static - level) * math.exp(-u / width),
            ),
            (
                "coulomb_hyperbolic",
                {"fading_velocity": width},
                lambda u: level + (static - level) / (1 + u / width),
            ),
        ][self.random.integers(5)]
        self.frictions.append(Friction(self.row(first, second), force, static, belt))
        keys = {"law": law, **self.between(first, second), "force": level, "static_force": static, **more}
        return {**keys, "velocity": belt} if belt else keys

    def contact(self, first: int | None, second: int) -> dict[str, object]:
        """Rigid, with spring and damper, or of Hunt and Crossley; one stop or two."""
        stops = [(self.number(0.31, 0.8), 1)]
        if self.chance(0.4):
            stops.append((-self.number(0.31, 0.8), -1))
        keys = {**self.between(first, second), "upper": stops[0][0]}
        if len(stops) > 1:
            keys["lower"] = stops[1][0]
        row, kind = self.row(first, second), self.random.random()
        if kind < 0.6:
            e = self.number(0.4, 0.95)
            self.rigid += [Rigid(row, stop, side, lambda u: e) for stop, side in stops]
            return {**keys, "law": "newton", "restitution": e}
        stiffness, damping = self.number(50, 1000), self.number(0, 3)
        if kind < 0.8:
            self.soft += [
                Soft(row, stop, side, lambda p, u: stiffness * p + damping * u) for stop, side in stops
            ]
            return {**keys, "law": "kelvin_voigt", "stiffness": stiffness, "damping": damping, "tension": 1}
        self.soft += [
            Soft(row, stop, side, lambda p, u: stiffness * np.sign(p) * abs(p) ** 1.5 * (1 + 0.2 * u))
            for stop, side in stops
        ]
        return {**keys, "law": "hunt_crossley", "stiffness": stiffness, "damping": 0.2, "exponent": 1.5}

    def case(self) -> str:
        """The text of a case file."""
        head = f'[run]\nduration = {DURATION}\nwindow = {DURATION}\nstop = "duration"\n'
        head += f"[start]\nx0 = {self.x0[0]}\nv0 = {self.v0[0]}\n"
        for i, mass in enumerate(self.mass):
            head += f"[body.{BODIES[i]}]\nmass = {mass}\nload = {self.load[i]}\n"
            head += f"x0 = {self.x0[i]}\nv0 = {self.v0[i]}\n" if i else ""
        return head + "".join(self.parts)

    def force(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """All but the joints."""
        total = np.array(self.load)
        total[self.driven] += self.amplitude * math.cos(self.frequency * t + self.angle)
        for row, stiffness, damping, cubic in self.springs:
            extension = row @ q
            total -= row * (stiffness * extension + damping * (row @ v) + cubic * extension**3)
        return total

    def referee(self, longest_step: float) -> list[float]:
        """The times of the events [s]."""
        machine = Structure(
            self.mass, self.force, self.frictions, self.soft, self.rigid, longest_step=longest_step
        )
        machine.run(self.x0, self.v0, DURATION)
        return instants(at for _, _, at in machine.events)


def instants(times: object) -> list[float]:
    """Times in order, those of one instant once."""
    found: list[float] = []
    for at in sorted(map(float, times)):
        if not found or at - found[-1] > INSTANT:
            found.append(at)
    return found


def alone(times: list[float]) -> list[float]:
    """Events that are no part of a chatter."""
    steps = np.diff(times, prepend=-np.inf, append=np.inf)
    return [
        at for at, before, after in zip(times, steps, steps[1:], strict=False) if min(before, after) > CHATTER
    ]


def missing(ours: list[float], theirs: list[float]) -> list[float]:
    """Events of one list that are no part of a chatter and that the other has not."""
    lost = []
    for one, other in ((ours, theirs), (theirs, ours)):
        for at in alone(one):
            k = bisect.bisect(other, at)
            if not any(abs(at - near) <= AGREED for near in other[max(k - 1, 0) : k + 1]):
                lost.append(at)
    return lost


def compared(seed: int, program: str, folder: Path) -> tuple[int, list[float], int]:
    """How many events are held against the referee, what one of the two lacks, most of one time."""
    draw = Draw(seed)
    (folder / "case.toml").write_text(draw.case())
    command = [program, "trajectory", "case.toml", "--csv", "events.csv", "-o", "motion.h5", "--force", "-q"]
    subprocess.run(command, cwd=folder, check=True)
    with (folder / "events.csv").open() as file:
        times = [row["time"] for row in csv.DictReader(file)]
    ours = instants(times)
    lost = missing(ours, draw.referee(0.05))
    if lost:
        # Two events of one guard within a step are not seen by scipy.
        lost = missing(ours, draw.referee(0.003))
    return len(alone(ours)), lost, max((times.count(at) for at in times), default=0)


if __name__ == "__main__":
    program = sys.argv[3] if len(sys.argv) > 3 else "build/bin/separatrix"
    for seed in range(int(sys.argv[1]), int(sys.argv[2])):
        with tempfile.TemporaryDirectory() as folder:
            try:
                events, lost, _ = compared(seed, str(Path(program).resolve()), Path(folder))
                print(seed, events, "events", f"differ at {lost[:3]}" if lost else "agree", flush=True)
            except (np.linalg.LinAlgError, RuntimeError) as error:
                # Joints that share a force: it knows no way to share it.
                print(seed, "the referee has no answer:", error, flush=True)
