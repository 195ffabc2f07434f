# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Periodic orbits, stable or not, on the stroboscopic map that the library flies.

Newton's method needs the map and its derivative: both come from flights of libseparatrix, the derivative from
central differences of fourth order, so that multipliers have ten digits. A fold or a doubling is where the
determinant of the linearised map less a multiplier of +1 or -1 is zero.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from separatrix.library import Model, Segments

# steps of the differences, in the units of x and v, and their weights; a second pair removes the cubic error
OFFSETS, WEIGHTS = np.array([-2.0, -1.0, 1.0, 2.0]), np.array([1.0, -8.0, 8.0, -1.0]) / 12


@dataclass(frozen=True)
class Orbit:
    """A fixed point of the map, its linearisation and its impacts over one drive period.

    `impact_phase` is the crank angle of each impact in radians.
    """

    point: np.ndarray
    matrix: np.ndarray
    impact_speed: np.ndarray
    impact_phase: np.ndarray

    @property
    def multipliers(self) -> np.ndarray:
        """Eigenvalues of the linearisation, the largest modulus first."""
        values = np.linalg.eigvals(self.matrix)
        return values[np.argsort(-np.abs(values), kind="stable")]


class Map:
    """The stroboscopic map of a case, with some of its parameters set."""

    def __init__(
        self, model: Model, values: Mapping[str, float] | None = None, step: float = 2e-4, angle: float = 0.0
    ):
        """`values` of parameters, `step` of the differences, `angle` of the crank at the section."""
        self.model, self.step, self.angle = model, step, angle
        self.values = dict(values or {})
        self.duration = 2 * np.pi / model.drive_frequency(self.values)

    def fly(self, starts: np.ndarray, times: np.ndarray | None = None) -> Segments:
        """Fly starts, rows of x and v; sampled after the period unless times of one start are given."""
        starts = np.atleast_2d(starts)
        count = len(starts)
        first = np.arange(count + 1) if times is None else np.array([0, len(times)])
        when = np.full(count, self.duration) if times is None else times
        paths = list(self.values)
        states = np.column_stack([starts, np.full(count, self.angle)])
        chosen = np.array([self.values[path] for path in paths])
        return self.model.segments(paths, chosen, states, first, when, derivatives=False)

    def image(self, starts: np.ndarray) -> np.ndarray:
        """Rows of x and v after the period."""
        flown = self.fly(starts)
        return np.column_stack([flown.x, flown.v])

    def matrix(self, point: np.ndarray, step: float) -> np.ndarray:
        """The derivative of the map."""
        starts = np.concatenate([point + step * np.outer(OFFSETS, axis) for axis in np.eye(2)])
        ends = self.image(starts).reshape(2, 4, 2)
        return np.einsum("k,ikj->ji", WEIGHTS, ends) / step

    def orbit(self, guess: np.ndarray, step: float | None = None) -> Orbit:
        """The orbit near a guess, by Newton's method; raises ValueError where it does not converge."""
        point, step = np.array(guess, float), step or self.step
        last = np.inf
        for _ in range(50):
            move = np.linalg.solve(self.matrix(point, step) - np.eye(2), self.image(point)[0] - point)
            point = point - move
            if not np.all(np.isfinite(point)):
                break
            # until rounding stops the steps from shrinking
            size = np.max(np.abs(move)) / max(1.0, np.max(np.abs(point)))
            if size == 0 or (size < 1e-11 and size >= last / 4):
                return self.seen(point, step)
            last = size
        raise ValueError(f"no orbit near {guess}")

    def seen(self, point: np.ndarray, step: float) -> Orbit:
        """The orbit through a fixed point."""
        flown = self.fly(point)
        phase = np.mod(self.angle + flown.impact.time * 2 * np.pi / self.duration, 2 * np.pi)
        return Orbit(point, self.matrix(point, step), np.abs(flown.impact.speed_before), phase)

    def orbits(
        self, x: tuple[float, float], v: tuple[float, float], impacts: int, side: int = 24
    ) -> list[Orbit]:
        """All orbits with so many impacts that Newton's method finds from a grid of starts."""
        grid = np.stack(np.meshgrid(np.linspace(*x, side), np.linspace(*v, side), indexing="ij"), -1).reshape(
            -1, 2
        )
        residual = np.max(np.abs(self.image(grid) - grid), axis=1)
        found: list[Orbit] = []
        for guess in grid[np.argsort(residual)[: 2 * side]]:
            try:
                orbit = self.orbit(guess)
            except (ValueError, np.linalg.LinAlgError):
                continue
            if len(orbit.impact_speed) != impacts:
                continue
            if all(np.max(np.abs(orbit.point - other.point)) > 1e-6 for other in found):
                found.append(orbit)
        return sorted(found, key=lambda item: -np.sum(item.impact_speed))

    def highest(self, point: np.ndarray) -> tuple[float, float]:
        """Time and height of the highest point of the motion from a start over one period."""
        times = np.linspace(0, self.duration, 257)
        flown = self.fly(point, times)
        near = int(np.argmax(flown.x))
        low, high = times[max(near - 1, 0)], times[min(near + 1, 256)]

        def velocity(time: float) -> float:
            return float(self.fly(point, np.array([0.0, time])).v[1])

        time = brentq(velocity, low, high, xtol=1e-15, rtol=1e-15)
        return time, float(self.fly(point, np.array([0.0, time])).x[1])


def follow(
    at: Callable[[float], Map],
    first: float,
    last: float,
    guess: np.ndarray,
    steps: int = 40,
    least: float = 1e-5,
) -> list[tuple[float, Orbit]]:
    """Follow an orbit from one value of a parameter towards another by secants.

    Where it is lost the step is halved, down to `least` of the whole way: the branch then ends near a fold.
    """
    branch = [(first, at(first).orbit(guess))]
    step = whole = (last - first) / steps
    while branch[-1][0] != last and abs(step) > least * abs(last - first):
        here, orbit = branch[-1]
        value = last if abs(last - here) < 1.5 * abs(step) else here + step
        guess = orbit.point
        if len(branch) > 1:
            before, previous = branch[-2]
            guess = guess + (guess - previous.point) * (value - here) / (here - before)
        try:
            found = at(value).orbit(guess)
        except (ValueError, np.linalg.LinAlgError):
            found = None
        near = found and np.max(np.abs(found.point - guess)) < 0.1 * max(1.0, np.max(np.abs(guess)))
        if near and len(found.impact_speed) == len(orbit.impact_speed):
            branch.append((value, found))
            step = whole if abs(step) > abs(whole) / 2 else 1.3 * step
        else:
            step /= 2
    return branch


def doubling(at: Callable[[float], Map], low: float, high: float, guess: np.ndarray) -> tuple[float, Orbit]:
    """The value between two at which a multiplier of an orbit is -1, and the orbit there."""
    near = {"point": guess}

    def excess(value: float) -> float:
        orbit = at(value).orbit(near["point"])
        near["point"] = orbit.point
        return float(np.linalg.det(orbit.matrix + np.eye(2)))

    value = brentq(excess, low, high, xtol=1e-14, rtol=1e-14)
    return value, at(value).orbit(near["point"])


def fold(at: Callable[[float], Map], value: float, guess: np.ndarray, step: float) -> tuple[float, Orbit]:
    """The value at which two orbits meet, a multiplier being +1.

    Newton's method on three equations: fixed point, and zero determinant of the linearised map less one.
    `step` is that of the differences, small beside the distance of the orbits from a graze.
    """
    unknown = np.array([*guess, value])

    def equations(y: np.ndarray) -> np.ndarray:
        here = at(float(y[2]))
        determinant = np.linalg.det(here.matrix(y[:2], step) - np.eye(2))
        return np.array([*(here.image(y[:2])[0] - y[:2]), determinant])

    for _ in range(60):
        slopes = np.empty((3, 3))
        for k in range(3):
            move = np.zeros(3)
            move[k] = step / 4
            slopes[:, k] = (equations(unknown + move) - equations(unknown - move)) / (step / 2)
        change = np.linalg.solve(slopes, equations(unknown))
        unknown = unknown - change
        if np.max(np.abs(change)) < 1e-13:
            break
    here = at(float(unknown[2]))
    return float(unknown[2]), here.seen(unknown[:2], step)
