# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures of one basin: global and local integrity, integrity factor, stability, convergence."""

import math

import numpy as np

from separatrix.measuring import areas, balls
from separatrix.measuring.convergence import convergence_times
from separatrix.measuring.maps import Slice
from separatrix.measuring.report import Measure
from separatrix.measuring.sampling import generator

CELLS = (
    "95 %: the ends of cells of the basin, of others and with corners of more than one label are added "
    "(Clopper and Pearson, or what the map of every second point misses)"
)
POINTS = (
    "from none to all of the cells with corners of more than one label; of other cells what the map of every "
    "second point misses"
)
RAY = "own starts up to the lower end, a start of another label at the upper end"


def basis(share: areas.Share) -> str:
    """Return what the interval of a share of the window is from."""
    return CELLS if share.starts else POINTS


def global_integrity(found: Slice, own: int) -> Measure:
    """Share of the window that the basin has, and its area."""
    labels = found.machine.labels if found.machine else None
    share = areas.global_share(labels, found.grid, found.axes, own, found.starts, found.seed)
    volume = found.region.volume
    unit = found.unit if found.region.dimension == 1 else f"{found.unit}^{found.region.dimension}"
    limits = list(found.limits)
    if labels is None:
        limits.append(f"resolution of the map ({' x '.join(map(str, found.grid.shape))} points)")
    limits.append("nothing beyond the window is seen")
    return Measure(
        "global_integrity",
        "GIM: the share of the window that lies in the basin (area over area of the window)",
        "1",
        own,
        share.value,
        share.lower,
        share.upper,
        basis(share),
        {"new_starts": share.starts, "area_of_the_window": f"{volume:.9g} {unit}"},
        tuple(limits),
        {"area": share.value * volume, "share_not_known": share.not_known},
    )


def local_integrity(found: Slice, own: int) -> Measure:
    """Radius of the largest ball round the motion, over its points on the section of the map."""
    definition = (
        "LIM: the largest distance within which every start belongs to the basin, round each "
        "section point of "
        "the motion; the least of them"
    )
    points = found.machine.section(own) if found.machine else None
    if points is None:
        return Measure(
            "local_integrity", definition, found.unit, own, limits=(*found.limits, _no_points(found))
        )
    return ball_at(found, own, points, None, definition)


def ball_at(found: Slice, own: int, points: np.ndarray, angle: float | None, definition: str) -> Measure:
    """The least of the largest balls round section points at a crank angle."""
    machine = found.machine

    def labels(starts: np.ndarray) -> np.ndarray:
        return machine.labels(starts, angle)

    best: balls.Ball | None = None
    reach_limited = False
    for point in points:
        if labels(point[None])[0] != own:
            return Measure(
                "local_integrity",
                definition,
                found.unit,
                own,
                limits=(
                    *found.limits,
                    "a point of the motion itself does not get its label: it is not captured there",
                ),
            )
        # beyond the window the motion may lie; the ball is looked for within the diagonal of it
        edge = float(found.region.edge(point[None])[0])
        reach = edge if edge > 0 else 0.0
        # a barrier is no edge: starts go on to it, and there are none behind
        reach = max(reach, float(np.linalg.norm(found.region.size)))
        known = (
            None
            if angle is not None
            else balls.nearest_of_map(found.points, found.grid.ravel(), point, own, found.region)
        )
        if known is not None:
            reach = min(reach, float(np.linalg.norm(known - point)) * (1 + 1e-12))
        ball = balls.largest_ball(labels, point, own, reach, known, seed=found.seed)
        if best is None or ball.inner < best.inner:
            best, reach_limited = ball, math.isinf(ball.outer)
    return _ball(found, own, best, definition, reach_limited, angle)


def _ball(
    found: Slice, own: int, ball: balls.Ball, definition: str, reach_limited: bool, angle: float | None
) -> Measure:
    limits = list(found.limits)
    value, lower, upper = ball.inner, ball.inner, ball.outer
    if not ball.settled:
        value, lower = math.nan, math.nan
        limits.append("foreign starts went on turning up: the radius is not known")
    if reach_limited:
        value = math.nan
        limits.append(
            "no start of another basin within the diagonal of the window: only a lower bound is known"
        )
    elif ball.label == 0:
        limits.append("the nearest start that is not its own has no known label: the radius is a lower bound")
        value, upper = math.nan, math.inf
    share = 1 - 0.05 ** (1 / ball.samples)
    details = {"centre": ball.centre * found.scale, "samples": ball.samples}
    if ball.touching is not None:
        details |= {"nearest_foreign_start": ball.touching * found.scale, "its_label": ball.label}
        if not found.region.inside(ball.touching[None])[0]:
            limits.append("the nearest foreign start lies beyond the window of the map")
    limits.append(
        f"{ball.samples} starts in the ball and on its rim, none foreign: a foreign piece that was "
        f"missed is most likely "
        f"smaller than {100 * share:.2g} % of the ball"
    )
    parameters = {} if angle is None else {"crank_angle": angle}
    return Measure(
        "local_integrity",
        definition,
        found.unit,
        own,
        value,
        lower,
        upper,
        RAY,
        parameters,
        tuple(limits),
        details,
    )


def _no_points(found: Slice) -> str:
    if found.machine is None:
        return "needs new starts"
    return "needs a motion with section points over x0 and v0: a cycle, or one rest position"


def integrity_factor(found: Slice, own: int) -> Measure:
    """Radius of the largest ball anywhere in the basin."""
    definition = "IF: the radius of the largest ball of starts within the window that all belong to the basin"
    interval = "a ball that was tried; its radius in the map and half a diagonal of its cells"
    if not found.even:
        limit = "needs evenly spaced axes with two values or more"
        return Measure("integrity_factor", definition, found.unit, own, limits=(*found.limits, limit))
    if not (found.grid == own).any():
        return Measure(
            "integrity_factor",
            definition,
            found.unit,
            own,
            0.0,
            0.0,
            math.nan,
            limits=(*found.limits, "no start of the map"),
        )
    labels = found.machine.labels if found.machine else None
    if labels is None:
        return _factor_of_map(found, own, definition)
    ball, bound = balls.inscribed_ball(labels, found.grid, found.axes, own, found.region, seed=found.seed)
    limits = list(found.limits)
    if not ball.settled:
        return Measure(
            "integrity_factor",
            definition,
            found.unit,
            own,
            limits=(*limits, "foreign starts went on turning up"),
        )
    if math.isinf(ball.outer):
        limits.append("the ball ends at the edge of the window")
    elif ball.label == 0:
        limits.append("the ball ends at a start that the machine does not have, or whose label is not known")
    limits.append("the upper end is that of the resolution of the map")
    details = {"centre": ball.centre * found.scale, "samples": ball.samples}
    return Measure(
        "integrity_factor",
        definition,
        found.unit,
        own,
        ball.inner,
        ball.inner,
        max(bound, ball.inner),
        interval,
        {},
        tuple(limits),
        details,
    )


def _factor_of_map(found: Slice, own: int, definition: str) -> Measure:
    """Of the points of the map alone: no ball can be larger than their distances allow."""
    spacing = np.array([axis[1] - axis[0] for axis in found.axes])
    away = balls.map_distances(found.grid == own, spacing, found.region, found.axes)
    half = float(np.linalg.norm(spacing)) / 2
    best = float(away.max())
    return Measure(
        "integrity_factor",
        definition,
        found.unit,
        own,
        best,
        max(best - 2 * half, 0.0),
        best + half,
        "one diagonal of a cell less, half of one more",
        {},
        (*found.limits, "resolution of the map"),
    )


def basin_stability(found: Slice, own: int, deviation: np.ndarray | None = None) -> Measure:
    """Share of the starts of a density that end in the basin."""
    definition = "basin stability: the probability that a start drawn from the density ends in the basin"
    if found.machine is None:
        return Measure("basin_stability", definition, "1", own, limits=(*found.limits, "needs new starts"))
    if deviation is None:
        draw, density = areas.uniform(found.region), "uniform over the window"
    else:
        points = found.machine.section(own)
        if points is None:
            return Measure("basin_stability", definition, "1", own, limits=(*found.limits, _no_points(found)))
        sizes = np.asarray(deviation, float) / found.scale
        draw = _about(points, sizes)
        density = "normal about the section points, deviations " + ", ".join(
            f"{name} {value:.6g}" for name, value in zip(found.names, deviation, strict=True)
        )
    share, refused = areas.basin_stability(found.machine.labels, own, draw, found.starts, found.seed)
    limits = list(found.limits)
    if refused > 0:
        limits.append(f"{100 * refused:.3g} % of the draws are no starts of the machine and were drawn anew")
    if share.not_known > 0:
        limits.append(f"{100 * share.not_known:.3g} % of the draws have no known label")
    return Measure(
        "basin_stability",
        definition,
        "1",
        own,
        share.value,
        share.lower,
        share.upper,
        "95 %, Clopper and Pearson",
        {"density": density, "starts": share.starts},
        tuple(limits),
    )


def _about(points: np.ndarray, sizes: np.ndarray) -> object:
    def draw(count: int, random: np.random.Generator) -> np.ndarray:
        return points[random.integers(0, len(points), count)] + sizes * random.standard_normal(
            (count, sizes.size)
        )

    return draw


def convergence_time(found: Slice, own: int) -> Measure:
    """Mean time from a start of the basin to capture."""
    definition = (
        "time from a start to capture by the attractor, mean over the starts of its basin in the "
        "window; median "
        "and quantiles in the details"
    )
    limits = list(found.limits)
    if found.settle is not None:
        times, source = found.settle[found.grid == own], "starts of the map"
    elif found.machine is not None:
        drawn = found.machine.found(found.region.draw(found.starts, generator(found.seed, 8)))
        times, source = drawn["settle_time"][drawn["attractor"] == own], "new starts, uniform over the window"
    else:
        return Measure(
            "convergence_time", definition, "s", own, limits=(*limits, "a refined map has no times")
        )
    times = times[np.isfinite(times)]
    if not len(times):
        return Measure("convergence_time", definition, "s", own, limits=(*limits, "no start"))
    found_times = convergence_times(times)
    entry = found.entries.get(own, {})
    radius, multiplier = entry.get("capture_radius", math.nan), abs(entry.get("multiplier", math.nan))
    limits.append(
        "capture is entering the neighbourhood of the capture radius: a smaller one takes "
        "longer by "
        "ln(ratio)/-ln(multiplier) returns"
    )
    return Measure(
        "convergence_time",
        definition,
        "s",
        own,
        *found_times.mean,
        "95 %, as if the starts had been drawn at random (Student)",
        {"starts": found_times.count, "of": source, "capture_radius": radius, "multiplier": multiplier},
        tuple(limits),
        {
            "quantiles": [
                dict(zip(("share", "time", "lower", "upper"), row, strict=True))
                for row in found_times.quantiles
            ],
            "longest": found_times.longest,
        },
    )
