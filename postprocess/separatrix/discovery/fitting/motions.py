# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Variables of a missing force along a fitted motion: position, speed, phase, time, impacts."""

import numpy as np
from scipy.interpolate import BSpline, CubicSpline

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.policy import FIT
from separatrix.library import effects

# crank angles at which the position of the foot of the spring is computed
_ANGLES = np.linspace(0, 2 * np.pi, 65)


def scaled_motion(problem: Likelihood, fit: Fit) -> dict[str, np.ndarray | None]:
    """Position, velocity, crank angle and time (-1 to 1) at the samples, scaled to about 1.

    Without any simulated segment nothing is scaled.
    """
    inside = problem.segments.inside
    x, v = fit.evaluation.x.copy(), fit.evaluation.v.copy()
    good = inside & fit.good[:, None]
    middle, size, speed = 0.0, 1.0, 1.0
    if good.any():
        middle, size = np.mean(x[good]), np.std(x[good])
        speed = np.sqrt(np.mean(v[good] ** 2))
    time, phase = clock_of(problem, fit)
    return {"x": (x - middle) / size, "v": v / speed, "phase": phase, "time": time, "speed": speed}


def clock_of(problem: Likelihood, fit: Fit) -> tuple[np.ndarray, np.ndarray | None]:
    """Time of the samples, -1 to 1 over a record, and crank angle; None without a drive."""
    shape = problem.segments.inside.shape
    time, phase = np.zeros(shape), None
    for number, prepared in enumerate(problem.prepared):
        rows = np.flatnonzero(problem.segments.record == number)
        t = prepared.samples.t
        stamps = t[problem.segments.index[rows]]
        time[rows] = 2 * (stamps - t[0]) / (t[-1] - t[0]) - 1
        if prepared.frequency is not None:
            phase = np.zeros(shape) if phase is None else phase
            phase[rows] = problem.crank_angle(number, fit.values, stamps)
    return time, phase


def products(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Each column of one times each of the other, at the samples."""
    return (one[..., :, None] * other[..., None, :]).reshape(*one.shape[:2], -1)


def extensions(problem: Likelihood, fit: Fit) -> np.ndarray | None:
    """Extension of the spring at the samples [m]; None without a linear spring or where it is unknown."""
    if "restoring.stiffness" not in problem.model.parameters:
        return None
    found = np.zeros(problem.segments.inside.shape)
    for number, prepared in enumerate(problem.prepared):
        rows = np.flatnonzero(problem.segments.record == number)
        if not rows.size:
            continue
        stamps = prepared.samples.t[problem.segments.index[rows]]
        slack = _slack_positions(problem, fit, number)
        if not np.isfinite(slack).all():
            return None
        where = CubicSpline(_ANGLES, slack, bc_type="periodic")
        angle = np.mod(problem.crank_angle(number, fit.values, stamps), 2 * np.pi)
        found[rows] = where(angle) - fit.evaluation.x[rows]
    return found


def _slack_positions(problem: Likelihood, fit: Fit, number: int) -> np.ndarray:
    """Positions at which the spring is slack [m], at the crank angles `_ANGLES` of a record.

    They follow from the force on a body in the middle of the motion when only the spring acts; NaN where the
    machine cannot be simulated there.
    """
    model, x = problem.model, float(np.median(fit.evaluation.x[problem.segments.inside]))
    values = problem.machine_values(number, fit.values)
    for path in model.parameters:
        first, *middle, last = path.split(".")
        acts = first == "effect" and last.split("[")[0] in effects()[middle[0]].amplitudes
        if (first == "friction" and last.endswith(("coefficient", "damping"))) or acts:
            values[path] = 0.0
        # free play is no force of its own, but shifts these positions by half of it
        if path == "effect.backlash.gap":
            values[path] = 0.0
    time = FIT.slack_time / max(1.0, model.drive_frequency({}))
    start = np.column_stack([np.full(_ANGLES.size, x), np.zeros(_ANGLES.size), _ANGLES])
    flown = model.segments(
        list(values), np.array(list(values.values())), start, 2 * np.arange(_ANGLES.size + 1),
        np.tile([0.0, time], _ANGLES.size), derivatives=False, tolerance=1e-12,
    )  # fmt: skip
    mass, stiffness = (
        values.get(path, model.parameters[path].value) for path in ("body.mass", "restoring.stiffness")
    )
    pulled = mass * flown.v[1::2] / (time * stiffness)
    pulled[-1] = pulled[0]
    return x + pulled


def impacts_at(problem: Likelihood, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Speed before the impact, and its direction after it, at the first sample after each impact."""
    inside = problem.segments.inside
    before, at = np.zeros(inside.shape), np.zeros(inside.shape)
    for number, impacts in enumerate(fit.evaluation.impacts):
        rows = np.flatnonzero(problem.segments.record == number)
        if impacts is None or not rows.size:
            continue
        stamps = problem.prepared[number].samples.t[problem.segments.index[rows]]
        times = stamps - stamps[:, :1]
        for segment, time, speed, _, side in impacts:
            i = int(segment)
            j = int(np.searchsorted(times[i][inside[rows[i]]], time))
            if j < inside[rows[i]].sum():
                before[rows[i], j] = abs(speed)
                at[rows[i], j] = -side
    return before, at


def after_impacts(problem: Likelihood, fit: Fit) -> np.ndarray:
    """Time since the last impact of the segment at each sample [s], not a number before the first."""
    _, at = impacts_at(problem, fit)
    times = problem.sample_times()
    last = np.maximum.accumulate(np.where(at != 0, times, -np.inf), axis=1)
    return np.where(np.isfinite(last), times - last, np.nan)


def knots_of(values: np.ndarray, count: int) -> np.ndarray:
    """Knots of `count` cubic B-splines over the middle 98 % of the values, at their quantiles."""
    inner = np.quantile(values, np.linspace(0.01, 0.99, count - 2))
    inner += np.arange(inner.size) * 1e-9
    return np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])


def splines(values: np.ndarray, knots: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Cubic B-splines at the `known` values, constant beyond the knots; 0 elsewhere."""
    clipped = np.clip(np.where(known, values, knots[0]), knots[0], knots[-1])
    table = BSpline.design_matrix(clipped.ravel(), knots, 3).toarray().reshape(*values.shape, -1)
    return table * known[:, :, None]
