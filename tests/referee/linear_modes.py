# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A referee for structures that are too stiff for steps: matrix exponentials between events.

One joint: friction that slides or sticks, or a spring that only pushes. It shares nothing with the
program: scipy's `expm` of the matrix with the harmonic force in it, over small equal intervals, and
Brent's method where a guard falls.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import eigh, expm
from scipy.optimize import brentq


@dataclass
class Piece:
    """One linear mode z' = A z; it ends where `guard(z)` falls below zero."""

    matrix: np.ndarray
    guard: Callable[[np.ndarray], float]
    follows: Callable[[np.ndarray], str]

    def fall(self, z: np.ndarray, length: float) -> float:
        """When the guard falls, within `length` [s]."""
        return brentq(lambda s: self.guard(expm(self.matrix * s) @ z), 0, length, xtol=1e-17)


@dataclass
class Pieces:
    """Pieces by name, integrated in intervals of `step` [s]."""

    pieces: dict[str, Piece]
    step: float
    events: list[tuple[str, float]] = field(default_factory=list)
    states: list[np.ndarray] = field(default_factory=list)

    def run(
        self, name: str, z: np.ndarray, until: float, watch: Callable[[np.ndarray], None] = lambda z: None
    ):
        """State at `until`; `events` are (piece that begins, time), `watch` gets each interval's end."""
        over = {key: expm(piece.matrix * self.step) for key, piece in self.pieces.items()}
        t = 0.0
        while t < until:
            piece = self.pieces[name]
            length = min(self.step, until - t)
            after = (over[name] if length == self.step else expm(piece.matrix * length)) @ z
            if piece.guard(after) < 0 <= piece.guard(z):
                high = piece.fall(z, length)
                z = expm(piece.matrix * high) @ z
                t += high
                name = piece.follows(z)
                self.events.append((name, t))
                self.states.append(z)
                continue
            z, t = after, t + length
            watch(z)
        return z


@dataclass
class Modes:
    """M q'' + C q' + K q by its undamped modes.

    z is amplitudes times frequency (rigid ones times 1), their rates, cosine, sine, 1.

    So scaled, exponentials of the matrix keep their digits.
    """

    frequency: np.ndarray
    shapes: np.ndarray
    damping: np.ndarray

    @classmethod
    def of(cls, mass, damping, stiffness) -> "Modes":
        """From matrices."""
        squares, shapes = eigh(stiffness, mass)
        return cls(np.sqrt(np.maximum(squares, 0)), shapes, shapes.T @ damping @ shapes)

    def __post_init__(self) -> None:
        """Scales of the amplitudes."""
        self.n = len(self.frequency)
        self.scale = np.where(self.frequency > 0, self.frequency, 1)

    def matrix(self, drive: float, force=0.0, push=0.0, spring=0.0) -> np.ndarray:
        """z' = A z under force cos(drive t) + push, over the modes; `spring` adds stiffness."""
        n = self.n
        a = np.zeros((2 * n + 3, 2 * n + 3))
        a[:n, n : 2 * n] = np.diag(self.scale)
        a[n : 2 * n, :n] = -(np.diag(self.frequency**2) + spring) / self.scale
        a[n : 2 * n, n : 2 * n] = -self.damping
        a[n : 2 * n, 2 * n] = force
        a[n : 2 * n, 2 * n + 2] = push
        a[2 * n, 2 * n + 1] = -drive
        a[2 * n + 1, 2 * n] = drive
        return a

    def start(self) -> np.ndarray:
        """At rest, the drive at its angle 0."""
        z = np.zeros(2 * self.n + 3)
        z[2 * self.n] = z[2 * self.n + 2] = 1
        return z

    def displacement(self, z: np.ndarray, row) -> float:
        """Displacement of a point with `row` in the coordinates of the modes."""
        return float(row @ (z[: self.n] / self.scale))


def rubbed(modes: Modes, force, drive: float, row, level: float, step: float) -> Pieces:
    """A structure with Coulomb's friction along `row` of its modes: pieces "up", "down" and "stuck"."""
    n = modes.n
    free = modes.matrix(drive, force)
    # Stuck: the acceleration along the row is zero.
    stuck = free.copy()
    stuck[n : 2 * n] -= np.outer(row / (row @ row), row @ free[n : 2 * n])

    def held(z: np.ndarray) -> float:
        """Force that holds."""
        return float(-(row @ free[n : 2 * n] @ z) / (row @ row))

    def slides(z: np.ndarray) -> str:
        return "down" if held(z) > 0 else "up"

    def rest(z: np.ndarray) -> str:
        z[n : 2 * n] -= row / (row @ row) * (row @ z[n : 2 * n])
        return "stuck" if abs(held(z)) < level else slides(z)

    def speed(z: np.ndarray) -> float:
        return float(row @ z[n : 2 * n])

    return Pieces(
        {
            "up": Piece(modes.matrix(drive, force, -level * row), speed, rest),
            "down": Piece(modes.matrix(drive, force, level * row), lambda z: -speed(z), rest),
            "stuck": Piece(stuck, lambda z: level - abs(held(z)), slides),
        },
        step,
    )


def pressed(modes: Modes, row, stiffness: float, step: float) -> Pieces:
    """A structure with a spring along `row` that only pushes it up from 0: pieces "open" and "pressed"."""
    return Pieces(
        {
            "open": Piece(modes.matrix(0.0), lambda z: modes.displacement(z, row), lambda z: "pressed"),
            "pressed": Piece(
                modes.matrix(0.0, spring=stiffness * np.outer(row, row)),
                lambda z: -modes.displacement(z, row),
                lambda z: "open",
            ),
        },
        step,
    )
