# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles of a machine with a motor by Newton's method on segments of the library."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from separatrix.library import Model

TURN = 2 * np.pi
TOLERANCE, STEPS = 1e-14, 12
# derivatives of the map by differences of the sixth order: steps (m, m/s, rad/s), parts of them, weights
STEP = 5e-4
PARTS = np.array([-3, -2, -1, 1, 2, 3])
WEIGHTS = np.array([-1, 9, -45, 45, -9, 1]) / 60
# of a sample: x, crank angle, v, crank speed, current or integral
ANGLE = 1


@dataclass(frozen=True)
class Cycle:
    """A cycle of one turn: mean speed [rad/s], section point (x, v, w [, own]), multipliers, impact speed."""

    speed: float
    point: np.ndarray
    multipliers: np.ndarray
    impact_speed: float


def flown(model: Model, starts: np.ndarray, durations: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """States (x, angle, v, w, own) at the end of segments from starts, and the speeds of all impacts."""
    first = np.arange(len(starts) + 1)
    times = np.array(durations, float)
    none = ([], np.empty(0))
    found = model.segments(*none, starts, first, times, derivatives=False, tolerance=TOLERANCE)
    if found.reason.any():
        raise ValueError(f"segment given up: {found.reason.max()}")
    return found.motion, found.impact.speed_before


def on_section(model: Model, start: np.ndarray, angle: float, duration: float) -> tuple[float, np.ndarray]:
    """Time and state at which the crank reaches an angle, near a duration."""
    for _ in range(STEPS):
        (end,), _ = flown(model, start[None], [duration])
        missing = wrapped(angle - end[ANGLE])
        if abs(missing) < 1e-14 * max(1.0, angle):
            break
        duration += missing / end[3]
    end[ANGLE] = angle
    return duration, end


def wrapped(angle: float) -> float:
    """An angle from -pi to pi."""
    return (angle + np.pi) % TURN - np.pi


def full(point: np.ndarray) -> np.ndarray:
    """The start of a segment at a section point (x, v, w [, own])."""
    x, v, w, *own = point
    return np.array([x, 0.0, v, w, own[0] if own else 0.0])


def closed(model: Model, point: np.ndarray, duration: float) -> Cycle:
    """The cycle near a section point and a duration [s]."""
    point = np.array(point, float)
    for _ in range(STEPS):
        image, slopes, duration, hits = returned(model, point, duration)
        change = np.linalg.solve(slopes - np.eye(point.size), point - image)
        point = point + change
        if np.abs(change).max() < 1e-13:
            break
    return Cycle(TURN / duration, point, np.linalg.eigvals(slopes), float(hits[0]) if hits.size else np.nan)


def returned(
    model: Model, point: np.ndarray, duration: float
) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """Where a section point returns to, the derivative of this map, the time of a turn, impact speeds."""
    moving = [0, 2, 3, 4][: point.size]
    steps = np.array([(column, part) for column in range(point.size) for part in PARTS])
    starts = np.array([full(point)] * (1 + len(steps)))
    for start, (column, part) in zip(starts[1:], steps, strict=True):
        start[moving[int(column)]] += part * STEP
    times = np.full(len(starts), duration)
    for _ in range(STEPS):
        ends, _ = flown(model, starts, times)
        missing = wrapped(-ends[:, ANGLE])
        if np.abs(missing).max() < 1e-14:
            break
        times = times + missing / ends[:, 3]
    images = ends[:, moving]
    _, hits = flown(model, starts[:1], times[:1])
    slopes = np.tensordot(images[1:].reshape(point.size, len(PARTS), -1), WEIGHTS, (1, 0)).T / STEP
    return images[0], slopes, float(times[0]), hits


def doubling(
    model_at: Callable[[float], Model], point: np.ndarray, value: float, duration: float
) -> tuple[float, Cycle]:
    """The value of a parameter at which a multiplier of a cycle is -1, near one, by the secant method."""

    def excess(at: float) -> tuple[float, Cycle]:
        cycle = closed(model_at(at), point, duration)
        return float(np.min(cycle.multipliers.real)) + 1, cycle

    # from a distance, so that the number of others is not the answer
    (one, other), (before, _) = (value + 1e-3, value + 2e-4), excess(value + 1e-3)
    for _ in range(STEPS):
        now, cycle = excess(other)
        if not abs(now - before) > 0 or abs(other - one) < 1e-13:
            break
        one, other, before = other, other - now * (other - one) / (now - before), now
    return other, cycle
