# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What to measure next: the experiments of the rig, ranked by how well they separate a machine from rivals.

One machine is simulated at another drive, and its rivals from the same states, drive period by drive period.
The differences that starts and parameters can imitate, the latter within their errors, are projected out. The
rest over the noise is d', the size in standard errors. Of several rivals the one that is hardest to
distinguish counts.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.forces import force_needed
from separatrix.discovery.fitting.normal_equations import inverse_scaled
from separatrix.discovery.policy import FIT, SEARCH
from separatrix.errors import SeparatrixError


@dataclass(frozen=True)
class Experiment:
    """A record as long as the first one: its drive ratio, scale of the drive or of the start, least d'."""

    drive_ratio: float | None
    scale: float
    d_prime: float
    # index of the rival that is hardest to distinguish
    rival: int
    # of a joint that is driven along the motion of the first record: how many times as fast
    rate: float | None = None

    def text(self, one: str, others: list[str]) -> str:
        """In words."""
        other = others[self.rival]
        if self.rate is not None:
            return (
                f"a record along the motion of the first one with {self.scale:g} times the amplitude, "
                f"{self.rate:g} times as fast: {one} and {other} would differ by {self.d_prime:.3g} standard "
                "errors"
            )
        what = "a record of a free motion from" if self.drive_ratio is None else "a record at"
        where = f"{self.scale:g} times the start of the first one"
        if self.drive_ratio is not None:
            where = f"drive ratio {self.drive_ratio:.2f} with {self.scale:g} times the drive"
        return f"{what} {where}: {one} and {other} would differ by {self.d_prime:.3g} standard errors"


def experiments(one: Fitted, others: list[Fitted]) -> list[Experiment]:
    """Feasible experiments, the most informative first; none where the force on the body must be known."""
    first = one.problem.prepared[0]
    if one.problem.experiment == "motion of the joint":
        return _along_other_motions(one, others)
    if not one.problem.experiment or first.record.force is not None:
        return []
    ratios = (
        [None] if first.frequency is None else [float(ratio) for ratio in np.linspace(*SEARCH.drive_ratios)]
    )
    found = []
    for ratio in ratios:
        for scale in SEARCH.drive_scales:
            try:
                apart = d_primes(one, others, ratio, scale)
            except SeparatrixError:
                # no such machine
                continue
            if np.isfinite(apart).all():
                found.append(Experiment(ratio, scale, min(apart), int(np.argmin(apart))))
    return sorted(found, key=lambda experiment: -experiment.d_prime)


def d_primes(one: Fitted, others: list[Fitted], ratio: float | None, scale: float) -> list[float]:
    """Distance of a machine from others in a record at a drive ratio of the case, in standard errors."""
    first = one.problem.prepared[0]
    frequency = None if ratio is None else one.model.drive_frequency({"drive.ratio": ratio})
    length = (
        2
        * np.pi
        / (frequency or first.natural or 2 * np.pi / (first.record.duration / SEARCH.compared_periods))
    )
    values = _values(one, frequency, scale)
    start = _states(one, values, frequency, length, scale)
    times = np.tile(
        np.arange(SEARCH.compared_steps) * length / SEARCH.compared_steps, SEARCH.compared_periods
    )
    edges = np.arange(SEARCH.compared_periods + 1) * SEARCH.compared_steps
    paths, directions, prior = _directions(one, values, scale if ratio is not None else 1.0)
    flown = one.model.segments(
        paths, np.array([values[path] for path in paths]), start, edges, times, directions=directions
    )
    shape = (SEARCH.compared_periods, SEARCH.compared_steps)
    slopes = (flown.jacobian[:, 0] / first.sigma).reshape(*shape, -1)
    found = []
    for other in others:
        its = _values(other, frequency, scale)
        beside = other.model.segments(
            list(its), np.array(list(its.values())), start, edges, times, derivatives=False
        )
        apart = ((beside.x - flown.x) / first.sigma).reshape(shape)
        usable = np.isfinite(apart).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2)) & flown.steady
        if not usable.any():
            found.append(np.nan)
            continue
        # samples of a whole record for each of these
        seen = np.ptp(first.record.t) / first.record.interval / (usable.sum() * SEARCH.compared_steps)
        found.append(_left(apart[usable], slopes[usable], directions.shape[0], seen, prior))
    return found


def _values(fitted: Fitted, frequency: float | None, scale: float) -> dict[str, float]:
    """The machine as fitted with the drive of an experiment."""
    values = fitted.problem.machine_values(0, fitted.fit.values)
    if frequency is None:
        return values
    for path in fitted.problem.amplitudes:
        values[path] = scale * values.get(path, fitted.model.parameters[path].value)
    # the ratio is one to the natural frequency of each machine
    values["drive.ratio"] *= frequency / fitted.model.drive_frequency(values)
    return values


def _states(
    one: Fitted, values: dict[str, float], frequency: float | None, length: float, scale: float
) -> np.ndarray:
    """States (periods, 3) at the beginnings of the periods that are compared, once the motion has settled."""
    begun = one.fit.starts[0] * (1.0 if frequency else scale)
    before = SEARCH.settling_periods if frequency else 0
    times = np.arange(before + SEARCH.compared_periods) * length
    start = np.array([[*begun, 0.0]])
    flown = one.model.segments(
        list(values), np.array(list(values.values())), start, [0, times.size], times, derivatives=False
    )
    return np.column_stack([flown.x, flown.v, np.zeros(times.size)])[before:]


def _directions(
    one: Fitted, values: dict[str, float], scale: float
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Paths of the machine, directions of what is free in it, and what the records know of these."""
    paths = list(values)
    rows, indices = [], []
    for index, free in enumerate(one.problem.free):
        row = np.zeros(len(paths))
        if free.path == "nuisance:drive_scale":
            for path, size in one.problem.amplitudes.items():
                row[paths.index(path)] = scale * size
        elif not free.is_nuisance:
            for path, slope in free.slopes(one.fit.values[index]).items():
                row[paths.index(path)] = slope
        if row.any():
            rows.append(row)
            indices.append(index)
    return paths, np.array(rows), _prior(one, indices)


def _left(apart: np.ndarray, slopes: np.ndarray, count: int, seen: float, prior: np.ndarray) -> float:
    """Length of the difference beside what starts and parameters imitate."""
    matrix, gradient, square = prior.copy(), np.zeros(count), 0.0
    for difference, table in zip(apart, slopes, strict=True):
        by_parameter, by_start = table[:, :count], table[:, count : count + 2]
        basis = np.linalg.qr(by_start / np.maximum(np.linalg.norm(by_start, axis=0), 1e-300))[0]
        difference = difference - basis @ (basis.T @ difference)
        by_parameter = by_parameter - basis @ (basis.T @ by_parameter)
        matrix += seen * by_parameter.T @ by_parameter
        gradient += seen * by_parameter.T @ difference
        square += seen * float(difference @ difference)
    return _length(square, matrix, gradient)


def _prior(one: Fitted, indices: list[int]) -> np.ndarray:
    """What the records know of some free parameters: the inverse of their covariance."""
    covariance = one.covariance[np.ix_(indices, indices)]
    return inverse_scaled(covariance, np.diag(covariance) > 0, 1e-15)


def _along_other_motions(one: Fitted, others: list[Fitted]) -> list[Experiment]:
    """Records of a driven joint along the motion of the first one, larger or smaller, faster or slower."""
    found = []
    for scale in SEARCH.joint_amplitudes:
        for rate in SEARCH.joint_rates:
            apart = [_apart_in_force(one, other, scale, rate) for other in others]
            found.append(Experiment(None, scale, min(apart), int(np.argmin(apart)), rate))
    return sorted(found, key=lambda experiment: -experiment.d_prime)


def _apart_in_force(one: Fitted, other: Fitted, scale: float, rate: float) -> float:
    """Difference of the forces of two machines along a motion, in standard errors."""
    first = one.problem.prepared[0]
    motion, measured, pieces = first.driven.scaled(scale, rate), first.record.force, first.record.pieces
    deviation = np.hypot(first.sigma, motion.inertia_error)
    indices = [i for i, free in enumerate(one.problem.free) if free.record is None]

    def force(fitted: Fitted, values: np.ndarray) -> np.ndarray:
        machine = fitted.problem.machine_values(0, values)
        return force_needed(fitted.model, machine, motion, measured, pieces) / deviation

    try:
        base = force(one, one.fit.values)
        apart = force(other, other.fit.values) - base
        slopes = [(force(one, moved) - base) / step for moved, step in _moved(one, indices)]
    except SeparatrixError:
        # no such machine there
        return 0.0
    columns = np.column_stack(slopes)
    matrix, gradient = _prior(one, indices) + columns.T @ columns, columns.T @ apart
    return _length(apart @ apart, matrix, gradient)


def _length(square: float, matrix: np.ndarray, gradient: np.ndarray) -> float:
    """Length of a difference whose square is given, less what parameters imitate."""
    imitated = gradient @ inverse_scaled(matrix, np.diag(matrix) > 0, 1e-11) @ gradient
    return float(np.sqrt(max(0.0, square - imitated)))


def _moved(one: Fitted, indices: list[int]) -> Iterator[tuple[np.ndarray, float]]:
    """Values of the machine with one parameter after the other moved by a step."""
    for index in indices:
        free, values = one.problem.free[index], one.fit.values.copy()
        step = FIT.force_step * free.size
        step = step if values[index] + step <= free.upper else -step
        values[index] += step
        yield values, step
