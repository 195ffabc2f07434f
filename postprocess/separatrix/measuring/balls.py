# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The largest ball round a motion (LIM) and of a basin (IF), and the least impulse out of a basin."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.optimize import linprog

from separatrix.measuring.sampling import NO_START, NOT_KNOWN, Labels, Region, generator, in_ball, label_all

#: Starts drawn in a ball to see that none is foreign.
SAMPLES = 4096
_HALVINGS = 44
_ROUNDS = 60


@dataclass(frozen=True)
class Ball:
    """A ball: every start drawn within `inner` is the basin's own, one at the distance `outer` is not.

    `outer` is inf where no foreign start was met within the `reach` that was looked at. `label` is that of
    the foreign start `touching`. `settled` is false where foreign starts went on turning up.
    """

    centre: np.ndarray
    inner: float
    outer: float
    touching: np.ndarray | None
    label: int
    settled: bool
    samples: int


def largest_ball(
    labels: Labels,
    centre: np.ndarray,
    own: int,
    reach: float,
    known: np.ndarray | None = None,
    samples: int = SAMPLES,
    seed: int = 1,
) -> Ball:
    """Return the largest ball round `centre` without a foreign start, as far as `reach`.

    `known` is a foreign start from which to begin, for example the nearest of a map. Rays to foreign starts
    are bisected, the direction is polished, and `samples` starts are drawn in the ball until none is foreign.
    What the ball has no start at (behind a barrier) is not foreign.
    """
    outer, inner, touching = np.inf, reach, None
    middle = label_all(labels, centre[None])
    if foreign(middle, own)[0]:
        return Ball(centre, 0.0, 0.0, centre, int(middle[0]), settled=True, samples=samples)
    if known is not None and np.linalg.norm(known - centre) <= reach:
        inner, outer, touching = _nearer(labels, centre, own, known)
    settled = False
    for i in range(_ROUNDS):
        drawn = centre + inner * _probes(samples, centre.size, generator(seed, 1, i))
        found = drawn[foreign(label_all(labels, drawn), own)]
        if not len(found):
            settled = True
            break
        nearest = found[np.argmin(np.linalg.norm(found - centre, axis=1))]
        inner, outer, touching = _nearer(labels, centre, own, nearest)
    label = 0 if touching is None else int(label_all(labels, touching[None])[0])
    return Ball(centre, inner, outer, touching, label, settled, samples)


def _probes(count: int, dimension: int, random: np.random.Generator) -> np.ndarray:
    """Points of the ball of radius 1, half of them on its surface: there a foreign piece shows first."""
    if dimension == 2:
        angles = 2 * np.pi * (np.arange(count // 2) + random.uniform()) / (count // 2)
        surface = np.column_stack([np.cos(angles), np.sin(angles)])
    else:
        surface = random.standard_normal((count // 2, dimension))
        surface /= np.linalg.norm(surface, axis=1, keepdims=True)
    return np.concatenate([surface, in_ball(count - count // 2, dimension, random)])


def foreign(found: np.ndarray, own: int) -> np.ndarray:
    """Whether labels are of another basin, or not known."""
    return (found != own) & (found != NO_START)


def _nearer(
    labels: Labels, centre: np.ndarray, own: int, point: np.ndarray
) -> tuple[float, float, np.ndarray]:
    """Bisect the ray to a foreign point, then turn the ray to where the boundary is nearest."""
    away = point - centre
    best = float(np.linalg.norm(away))
    direction = away / best
    inner, outer = _crossing(labels, centre, own, direction[None], best)
    inner, outer = inner[0], outer[0]
    if not np.isfinite(outer):
        # the foreign point itself is within rounding of the basin
        return best, best, point
    if centre.size == 1:
        return inner, outer, centre + outer * direction
    width, random = 1.0, generator(7, centre.size)
    while width > 1e-8:
        fan = _fan(direction, width, random)
        lows, highs = _crossing(labels, centre, own, fan, outer)
        least = int(np.argmin(highs))
        if highs[least] < outer * (1 - 1e-15):
            inner, outer, direction = lows[least], highs[least], fan[least]
            # a smooth boundary has its nearest point within the spacing of the fan
            width *= 0.5
        else:
            width *= 0.25
    return float(inner), float(outer), centre + outer * direction


def _fan(direction: np.ndarray, width: float, random: np.random.Generator) -> np.ndarray:
    """Directions about one, at most `width` away."""
    if direction.size == 2:
        angles = np.arctan2(direction[1], direction[0]) + width * np.linspace(-1, 1, 33)
        return np.column_stack([np.cos(angles), np.sin(angles)])
    turned = direction + width * in_ball(64, direction.size, random)
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


def _crossing(
    labels: Labels, centre: np.ndarray, own: int, directions: np.ndarray, outer: float
) -> tuple[np.ndarray, np.ndarray]:
    """Brackets of a crossing on rays whose end at `outer` is foreign; inf on the others."""
    lows, highs = np.zeros(len(directions)), np.full(len(directions), outer)
    away = foreign(label_all(labels, centre + outer * directions), own)
    for _ in range(_HALVINGS):
        if not away.any():
            break
        middle = (lows[away] + highs[away]) / 2
        out = foreign(label_all(labels, centre + middle[:, None] * directions[away]), own)
        lows[away] = np.where(out, lows[away], middle)
        highs[away] = np.where(out, middle, highs[away])
    return np.where(away, lows, np.inf), np.where(away, highs, np.inf)


def nearest_of_map(
    points: np.ndarray, found: np.ndarray, centre: np.ndarray, own: int, region: Region
) -> np.ndarray | None:
    """Return the foreign start of a map that is nearest to `centre`, None without one."""
    others = points[foreign(found, own)]
    if not len(others):
        return None
    apart = others - centre
    turning = np.isfinite(region.turns)
    apart[:, turning] -= region.turns[turning] * np.round(apart[:, turning] / region.turns[turning])
    return centre + apart[np.argmin(np.einsum("ij,ij->i", apart, apart))]


def inscribed_ball(
    labels: Labels,
    grid: np.ndarray,
    axes: list[np.ndarray],
    own: int,
    region: Region,
    candidates: int = 3,
    samples: int = SAMPLES,
    seed: int = 1,
) -> tuple[Ball, float]:
    """Return the largest ball of a region all of whose points are own starts, and the bound of the map on it.

    `grid` has the labels over evenly spaced `axes`. The centres that the exact distance transform offers are
    moved (linear programs over the foreign starts met so far) until the ball that they hold cannot grow. A
    start that the machine does not have ends a ball, and so does the edge of the region.
    """
    spacing = np.array([axis[1] - axis[0] for axis in axes])
    half = float(np.linalg.norm(spacing)) / 2
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    away = map_distances(grid == own, spacing, region, axes)
    others = points[grid != own]
    best: Ball | None = None
    for centre, bound in _peaks(points, away, candidates):
        if best is not None and bound + half <= best.inner:
            continue
        ball = _grown(labels, centre, own, bound, half, others, region, samples, seed)
        if best is None or ball.inner > best.inner:
            best = ball
    if best is None:
        nowhere = np.full(len(axes), np.nan)
        return Ball(nowhere, 0.0, 0.0, None, 0, settled=False, samples=samples), half
    return best, float(away.max()) + half


def map_distances(
    mask: np.ndarray, spacing: np.ndarray, region: Region, axes: list[np.ndarray]
) -> np.ndarray:
    """Distance of every point of a mask to the nearest point outside it, or to the edge of the region."""
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    edge = np.maximum(region.edge(points), 0).reshape(mask.shape)
    return edge if mask.all() else np.minimum(edge, _distances(mask, spacing, region))


def _distances(mask: np.ndarray, spacing: np.ndarray, region: Region) -> np.ndarray:
    pad = [
        (n // 2, n // 2) if np.isfinite(turn) else (0, 0)
        for n, turn in zip(mask.shape, region.turns, strict=True)
    ]
    wide = np.pad(mask, pad, mode="wrap")
    away = distance_transform_edt(wide, sampling=spacing)
    return away[tuple(slice(a, a + n) for (a, _), n in zip(pad, mask.shape, strict=True))]


def _peaks(points: np.ndarray, away: np.ndarray, count: int) -> list[tuple[np.ndarray, float]]:
    """The best centres that are apart from one another by more than half their radius."""
    left, found = away.copy(), []
    for _ in range(count):
        at = np.unravel_index(int(np.argmax(left)), left.shape)
        if not left[at] > 0:
            break
        found.append((points[at].copy(), float(away[at])))
        left[np.linalg.norm(points - points[at], axis=-1) < away[at] / 2] = 0
    return found


def _grown(
    labels: Labels,
    centre: np.ndarray,
    own: int,
    bound: float,
    half: float,
    others: np.ndarray,
    region: Region,
    samples: int,
    seed: int,
) -> Ball:
    """Move a centre until its ball cannot grow: cutting planes over the foreign starts met."""

    def strict(points: np.ndarray) -> np.ndarray:
        # what is no start ends this ball: it counts as foreign
        found = label_all(labels, points)
        return np.where(found == NO_START, NOT_KNOWN, found)

    shifts = others - centre
    turning = np.isfinite(region.turns)
    shifts[:, turning] -= region.turns[turning] * np.round(shifts[:, turning] / region.turns[turning])
    near = centre + shifts[np.linalg.norm(shifts, axis=1) < bound + 6 * half]
    best: Ball | None = None
    trust = 2 * half
    for i in range(40):
        moved = _moved(centre, near, region, trust)
        bound = _clearance(moved, near, region)
        ball = largest_ball(strict, moved, own, bound, None, samples, seed + i)
        if best is None or ball.inner > best.inner:
            best, centre = ball, moved
        else:
            trust /= 2
        if ball.touching is not None:
            near = np.vstack([near, ball.touching])
        if bound - best.inner < 1e-6 * bound or trust < 1e-9 * bound:
            break
    return best


def _clearance(centre: np.ndarray, near: np.ndarray, region: Region) -> float:
    away = float(region.edge(centre[None])[0])
    return min(away, float(np.linalg.norm(near - centre, axis=1).min())) if len(near) else away


def _moved(centre: np.ndarray, near: np.ndarray, region: Region, trust: float) -> np.ndarray:
    """The centre within a step of `trust` that is farthest from all points: linear programs.

    A distance is convex, so that its tangent never promises too much.
    """
    d = centre.size
    for _ in range(4):
        rows, bounds = [], []
        if len(near):
            apart = centre - near
            lengths = np.maximum(np.linalg.norm(apart, axis=1), 1e-300)
            rows.append(np.column_stack([-apart / lengths[:, None], np.ones(len(near))]))
            bounds.append(lengths)
        for k in np.flatnonzero(~np.isfinite(region.turns)):
            for sign, room in ((1.0, region.upper[k] - centre[k]), (-1.0, centre[k] - region.lower[k])):
                row = np.zeros((1, d + 1))
                row[0, k], row[0, d] = sign, 1.0
                rows.append(row)
                bounds.append(np.array([room]))
        cost = np.zeros(d + 1)
        cost[d] = -1
        if not rows:
            return centre
        limits = [(-trust, trust)] * d + [(0, None)]
        solved = linprog(cost, np.vstack(rows), np.concatenate(bounds), bounds=limits)
        if solved.status != 0:
            return centre
        step = solved.x[:d]
        centre = centre + step
        if np.linalg.norm(step) < 1e-12 * max(trust, 1e-300):
            break
    return centre


def first_exit(
    labels: Labels, start: np.ndarray, direction: np.ndarray, own: int, reach: float, steps: int = 256
) -> tuple[float, float, int]:
    """Return a bracket of the least length along a ray that leaves the basin, and the label there.

    Looked at are `steps` equal steps up to `reach`; (reach, inf, 0) where all of them are own. A foreign
    piece that is shorter than a step may be missed.
    """
    lengths = reach * np.arange(1, steps + 1) / steps
    found = label_all(labels, start + lengths[:, None] * direction)
    out = np.flatnonzero(foreign(found, own))
    if not len(out):
        return reach, np.inf, 0
    high = float(lengths[out[0]])
    low, label = high - reach / steps, int(found[out[0]])
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        there = label_all(labels, (start + middle * direction)[None])
        if foreign(there, own)[0]:
            high, label = middle, int(there[0])
        else:
            low = middle
    return low, high, label
