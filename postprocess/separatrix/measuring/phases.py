# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures over all phases of the drive: local integrity, phase-robust safe basin, critical impulse."""

import math

import numpy as np

from separatrix.measuring import areas, balls
from separatrix.measuring.integrity import RAY, ball_at, basis
from separatrix.measuring.maps import Slice
from separatrix.measuring.report import Measure

#: Steps along an impulse.
_STEPS = 256


def angles(count: int) -> np.ndarray:
    """Crank angles, evenly over a turn."""
    return 2 * np.pi * np.arange(count) / count


def local_integrity_over_phases(found: Slice, own: int) -> Measure:
    """Least radius of the ball round the motion over the crank angles."""
    definition = (
        "LIM of the orbit: the largest distance within which every start belongs to the basin, "
        "round the motion at "
        "each crank angle; the least of them"
    )
    name = "local_integrity_over_phases"
    if found.machine is None:
        return Measure(name, definition, found.unit, own, limits=(*found.limits, "needs new starts"))
    turns = angles(found.phases)
    balls_found = []
    for angle in turns:
        points = found.machine.section(own, float(angle))
        if points is None:
            return Measure(
                name, definition, found.unit, own, limits=(*found.limits, "needs a cycle over x0 and v0")
            )
        balls_found.append(ball_at(found, own, points, float(angle), definition))
    lowers = np.array([one.lower for one in balls_found])
    values = np.array([one.value for one in balls_found])
    limits = {limit: None for one in balls_found for limit in one.limits}
    curve = {
        "crank_angle": turns,
        "radius": values,
        "lower": lowers,
        "upper": [one.upper for one in balls_found],
    }
    if np.isnan(lowers).any():
        return Measure(name, definition, found.unit, own, limits=(*found.limits, *limits), details=curve)
    least = int(np.argmin(lowers))
    limits = list(balls_found[least].limits)
    limits.append(f"{found.phases} crank angles: between them the radius may be less")
    return Measure(
        name,
        definition,
        found.unit,
        own,
        balls_found[least].value,
        balls_found[least].lower,
        balls_found[least].upper,
        RAY,
        {"phases": found.phases, "worst_crank_angle": float(turns[least])},
        tuple(limits),
        {**curve, **balls_found[least].details},
    )


def critical_impulse(found: Slice, own: int) -> Measure:
    """Least change of velocity that takes the machine out of the basin, over the crank angles."""
    definition = (
        "critical impulse: the least sudden change of velocity at a point of the motion that leaves "
        "the basin; the "
        "least over the crank angles and both directions"
    )
    if found.machine is None or found.names != ("x0", "v0"):
        return Measure(
            "critical_impulse",
            definition,
            "m/s",
            own,
            limits=(*found.limits, "needs new starts over x0 and v0"),
        )
    turns = angles(found.phases)
    reach = float(found.region.size[1])
    speed = found.scale[1]
    curve = {sign: [] for sign in (1, -1)}
    for angle in turns:
        points = found.machine.section(own, float(angle))
        if points is None:
            return Measure(
                "critical_impulse", definition, "m/s", own, limits=(*found.limits, "needs a cycle")
            )

        def labels(starts: np.ndarray, angle: float = float(angle)) -> np.ndarray:
            return found.machine.labels(starts, angle)

        for sign, rows in curve.items():
            exits = [
                balls.first_exit(labels, point, np.array([0.0, sign]), own, reach, _STEPS) for point in points
            ]
            rows.append(min(exits, key=lambda one: one[0]))
    lows = {sign: np.array([row[0] for row in rows]) * speed for sign, rows in curve.items()}
    highs = {sign: np.array([row[1] for row in rows]) * speed for sign, rows in curve.items()}
    sign = min(lows, key=lambda one: lows[one].min())
    least = int(np.argmin(lows[sign]))
    lower, upper, label = lows[sign][least], highs[sign][least], curve[sign][least][2]
    limits = [
        *found.limits,
        f"a foreign piece shorter than {reach * speed / _STEPS:.3g} m/s may be missed",
        f"{found.phases} crank angles: between them less may suffice",
    ]
    value = upper
    if math.isinf(upper):
        limits.append("no impulse up to the height of the window leaves the basin")
        value = math.nan
    elif label == 0:
        limits.append("it leads to a start without a known label")
    mass = found.machine.case.resolved["body"].get("mass")
    parameters = {
        "phases": found.phases,
        "crank_angle": float(turns[least]),
        "direction": "up" if sign > 0 else "down",
    }
    # a table: one of several bodies is called mass
    if mass is not None and not isinstance(mass, dict) and math.isfinite(upper):
        parameters["impulse"] = f"{upper * float(mass):.9g} N s"
    return Measure(
        "critical_impulse",
        definition,
        "m/s",
        own,
        value,
        lower,
        upper,
        "own starts up to the lower end, in steps; another label at the upper end",
        parameters,
        tuple(limits),
        {"crank_angle": turns, "up": highs[1], "down": highs[-1], "label": [row[2] for row in curve[sign]]},
    )


def safe_basin(found: Slice, own: int) -> list[Measure]:
    """Share of the window, and largest ball, of the starts that are safe at every crank angle."""
    definition = (
        "phase-robust safe basin: the share of the window whose starts end in the basin at every crank angle"
    )
    names = ("safe_basin", "safe_basin_integrity_factor")
    second = (
        "IF of the phase-robust safe basin: the radius of the largest ball that is safe at every crank angle"
    )
    if found.machine is None:
        return [
            Measure(name, text, "1", own, limits=(*found.limits, "needs new starts"))
            for name, text in zip(names, (definition, second), strict=True)
        ]
    grid, shares, worst, last = _intersection(found, own)
    labels = robust(found, own)
    share = areas.global_share(labels, grid, found.axes, own, found.starts // 4, found.seed)
    limits = [*found.limits]
    if last > max(share.upper - share.lower, 0):
        limits.append(f"the last doubling of the crank angles still took {last:.3g} of the window: take more")
    details = {
        "crank_angle": angles(found.phases),
        "share_at_each": shares,
        "lost_by_the_last_doubling": last,
    }
    parameters = {"phases": found.phases, "crank_angle_that_takes_most": worst, "new_starts": share.starts}
    first = Measure(
        names[0],
        definition,
        "1",
        own,
        share.value,
        share.lower,
        share.upper,
        basis(share),
        parameters,
        tuple(limits),
        details,
    )
    if not found.even or not (grid == own).any():
        return [
            first,
            Measure(
                names[1], second, found.unit, own, limits=(*limits, "no start is safe, or axes are uneven")
            ),
        ]
    ball, bound = balls.inscribed_ball(labels, grid, found.axes, own, found.region, 1, 1024, found.seed)
    if not ball.settled:
        return [
            first,
            Measure(names[1], second, found.unit, own, limits=(*limits, "foreign starts went on turning up")),
        ]
    if math.isinf(ball.outer):
        limits.append("the ball ends at the edge of the window")
    return [
        first,
        Measure(
            names[1],
            second,
            found.unit,
            own,
            ball.inner,
            ball.inner,
            max(bound, ball.inner),
            "a ball that was tried; its radius in the map and half a diagonal of its cells",
            {"phases": found.phases},
            tuple(limits),
            {"centre": ball.centre * found.scale},
        ),
    ]


def robust(found: Slice, own: int) -> object:
    """Labels of starts over all crank angles: own if it is own at each, else the first other label."""

    def labels(points: np.ndarray) -> np.ndarray:
        answer = np.full(len(points), own)
        left = np.arange(len(points))
        for angle in angles(found.phases):
            if not len(left):
                break
            there = found.machine.labels(points[left], float(angle))
            answer[left] = there
            left = left[there == own]
        return answer

    return labels


def _intersection(found: Slice, own: int) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Labels of the grid over all angles, the share at each, the least one's angle, what odd ones took."""
    points = found.points
    every = np.full(len(points), own)
    coarse = np.full(len(points), fill_value=True)
    shares = []
    for i, angle in enumerate(angles(found.phases)):
        there = found.machine.labels(points, float(angle))
        shares.append(float(np.mean(there == own)))
        every = np.where(every == own, there, every)
        if i % 2 == 0:
            coarse &= there == own
    last = float(np.mean(coarse) - np.mean(every == own))
    worst = float(angles(found.phases)[int(np.argmin(shares))])
    return every.reshape(found.grid.shape), np.array(shares), worst, last
