# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""An independent simulator of machines of several bodies: scipy's DOP853 between events.

It shares nothing with the program: equations written as functions, events by scipy's root finding on the
dense output, sticking by the constraint solved as a linear system, modes found by trying all of them, no
closed form, no chatter completed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

OPEN, CLOSED = 0, 1
#: A slide has ended when its speed is this far beyond zero: one that begins is not ended by rounding.
LATE = 1e-12


@dataclass
class Friction:
    """Dry friction along a row: `force(u)` for u >= 0 is the level of sliding, `static` that at rest."""

    row: Sequence[float]
    force: Callable[[float], float]
    static: float
    belt: float = 0.0


@dataclass
class Soft:
    """A contact that pushes with `force(p, rate)` [N] over the penetration p > 0, on `side` +1 or -1."""

    row: Sequence[float]
    stop: float
    side: int
    force: Callable[[float, float], float]


@dataclass
class Rigid:
    """A stop on `side` +1 or -1 with a restitution that may depend on the speed."""

    row: Sequence[float]
    stop: float
    side: int
    restitution: Callable[[float], float]


@dataclass
class Structure:
    """M q'' = force(t, q, v) + joints."""

    mass: Sequence[float]
    force: Callable[[float, np.ndarray, np.ndarray], np.ndarray]
    frictions: Sequence[Friction] = ()
    soft: Sequence[Soft] = ()
    rigid: Sequence[Rigid] = ()
    tolerance: float = 1e-12
    #: Two events of one guard within a step are not seen [s].
    longest_step: float = 0.05
    events: list[tuple[str, int, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Rows as arrays."""
        self.n = len(self.mass)
        self.inverse = 1 / np.asarray(self.mass, float)
        self.rows = [np.asarray(joint.row, float) for joint in self.frictions]
        self.soft_rows = [np.asarray(joint.row, float) for joint in self.soft]
        self.rigid_rows = [np.asarray(joint.row, float) for joint in self.rigid]

    def free(
        self, t: float, q: np.ndarray, v: np.ndarray, slides: Sequence[int], pressed: Sequence[int]
    ) -> np.ndarray:
        """All forces but those that hold."""
        total = np.array(self.force(t, q, v), float)
        for joint, row, sign in zip(self.frictions, self.rows, slides, strict=True):
            if sign:
                total -= row * sign * joint.force(max(sign * (row @ v - joint.belt), 0.0))
        for joint, row, on in zip(self.soft, self.soft_rows, pressed, strict=True):
            if on:
                p = joint.side * (row @ q - joint.stop)
                total -= row * joint.side * joint.force(p, joint.side * (row @ v))
        return total

    def accelerate(self, t, q, v, slides, closed, pressed) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations and the forces of joints that do not slide and contacts that are closed."""
        total = self.free(t, q, v, slides, pressed)
        held = [row for row, sign in zip(self.rows, slides, strict=True) if not sign]
        held += [row for row, on in zip(self.rigid_rows, closed, strict=True) if on]
        if not held:
            return total * self.inverse, np.zeros(0)
        w = np.array(held).T
        hold = np.linalg.solve(w.T @ (w * self.inverse[:, None]), -w.T @ (total * self.inverse))
        return (total + w @ hold) * self.inverse, hold

    def choose(self, t, q, v, slides, closed, pressed, released=None) -> tuple[list[int], list[int]]:
        """The mode at rest: every combination is tried; what follows must agree with what is assumed."""
        speeds = [row @ v - joint.belt for joint, row in zip(self.frictions, self.rows, strict=True)]
        size = 1e-10 * (1 + np.max(np.abs(v)))
        slow = [abs(u) <= size for u in speeds]
        choices = [(0, 1, -1) if s else (int(np.sign(u)),) for s, u in zip(slow, speeds, strict=True)]
        if released is not None:
            choices[released] = (1, -1)
        choices += [(1, 0) if on else (0,) for on in closed]
        m = len(self.frictions)
        for mode in sorted(product(*choices), key=lambda mode: sum(map(abs, mode[:m]))):
            slides, shut = list(mode[:m]), list(mode[m:])
            a, hold = self.accelerate(t, q, v, slides, shut, pressed)
            held = iter(hold)
            fits = True
            for joint, row, sign, s in zip(self.frictions, self.rows, slides, slow, strict=True):
                if not sign:
                    fits &= abs(next(held)) <= joint.static * (1 + 1e-9) + 1e-12
                elif s:
                    fits &= sign * (row @ a) >= -1e-9
            for joint, row, on, was in zip(self.rigid, self.rigid_rows, shut, closed, strict=True):
                if on:
                    fits &= joint.side * next(held) <= 1e-12
                elif was:
                    fits &= joint.side * (row @ a) <= 1e-12
            if fits:
                return slides, shut
        raise RuntimeError(f"no mode at {t}")

    def run(self, q: Sequence[float], v: Sequence[float], until: float, start: float = 0.0) -> np.ndarray:
        """Positions and velocities at `until`; `events` are (what, joint, time)."""
        y = np.concatenate([q, v]).astype(float)
        t, n = start, self.n
        pressed = [
            int(j.side * (r @ y[:n] - j.stop) > 0) for j, r in zip(self.soft, self.soft_rows, strict=True)
        ]
        closed = [OPEN] * len(self.rigid)
        slides = [int(np.sign(r @ y[n:] - j.belt)) for j, r in zip(self.frictions, self.rows, strict=True)]
        slides, closed = self.choose(t, y[:n], y[n:], slides, closed, pressed)
        while t < until:
            t, y, what = self.fly(t, y, until, slides, closed, pressed)
            if what is None:
                break
            kind, i = what
            self.events.append((kind, i, t))
            if kind == "hit":
                row, joint = self.rigid_rows[i], self.rigid[i]
                u = row @ y[n:]
                # What is held takes part, what sticks does not.
                w = np.array([row] + [r for r, on in zip(self.rigid_rows, closed, strict=True) if on]).T
                jump = np.zeros(w.shape[1])
                jump[0] = -(1 + joint.restitution(abs(u))) * u
                y[n:] += self.inverse * (w @ np.linalg.solve(w.T @ (w * self.inverse[:, None]), jump))
                if abs(row @ y[n:]) < 1e-7:
                    closed[i] = CLOSED
            elif kind == "touch":
                pressed[i] = 1
            elif kind == "leave":
                pressed[i] = 0
            elif kind == "open":
                closed[i] = OPEN
            elif kind == "stop":
                row = self.rows[i]
                y[n:] -= (
                    self.inverse * row * (row @ y[n:] - self.frictions[i].belt) / (row @ (row * self.inverse))
                )
            released = i if kind == "slip" else None
            slides, closed = self.choose(t, y[:n], y[n:], slides, closed, pressed, released)
        return y

    def fly(self, t, y, until, slides, closed, pressed):
        """To the first event: time, state, (what, joint) or None."""
        n = self.n

        def slope(now, z):
            return np.concatenate([z[n:], self.accelerate(now, z[:n], z[n:], slides, closed, pressed)[0]])

        def watch(function):
            function.terminal, function.direction = True, -1
            return function

        guards, meaning = [], []
        number = 0
        for i, (joint, row, sign) in enumerate(zip(self.frictions, self.rows, slides, strict=True)):
            if sign:
                guards.append(watch(lambda s, z, r=row, j=joint, d=sign: d * (r @ z[n:] - j.belt) + LATE))
                meaning.append(("stop", i))
            else:
                guards.append(
                    watch(
                        lambda s, z, j=joint, k=number: (
                            j.static - abs(self.accelerate(s, z[:n], z[n:], slides, closed, pressed)[1][k])
                        )
                    )
                )
                meaning.append(("slip", i))
                number += 1
        for i, (joint, row, on) in enumerate(zip(self.soft, self.soft_rows, pressed, strict=True)):
            sign = -1 if on else 1
            guards.append(watch(lambda s, z, r=row, j=joint, d=sign: d * j.side * (j.stop - r @ z[:n])))
            meaning.append(("leave" if on else "touch", i))
        for i, (joint, row, on) in enumerate(zip(self.rigid, self.rigid_rows, closed, strict=True)):
            if on:
                guards.append(
                    watch(
                        lambda s, z, j=joint, k=number: (
                            -j.side * self.accelerate(s, z[:n], z[n:], slides, closed, pressed)[1][k]
                        )
                    )
                )
                meaning.append(("open", i))
                number += 1
            else:
                # What moves away is no impact: root finding would find again the one that it comes from.
                guards.append(
                    watch(
                        lambda s, z, r=row, j=joint: max(
                            j.side * (j.stop - r @ z[:n]), LATE if j.side * (r @ z[n:]) < 0 else -np.inf
                        )
                    )
                )
                meaning.append(("hit", i))
        way = solve_ivp(
            slope,
            (t, until),
            y,
            method="DOP853",
            rtol=self.tolerance,
            atol=self.tolerance * 1e-2,
            events=guards,
            max_step=self.longest_step,
        )
        if way.status != 1:
            return until, way.y[:, -1], None
        hit = [(way.t_events[k][0], k) for k in range(len(guards)) if len(way.t_events[k])]
        at, k = min(hit)
        return at, way.y_events[k][0].copy(), meaning[k]
