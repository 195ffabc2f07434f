# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What small imperfections of a rig would change in the records of one body."""

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.motions import scaled_motion
from separatrix.discovery.fitting.response import standardised
from separatrix.discovery.policy import FIT


def columns_of_rig(problem: Likelihood, fit: Fit, usual: float | None = None) -> np.ndarray:
    """Columns of imperfections of one standard deviation: curved sensors, harmonics of the drive."""
    state = scaled_motion(problem, fit)
    inside = problem.segments.inside
    columns = [_sensor(problem, fit)]
    if state["phase"] is not None:
        usual = usual_acceleration(problem, fit) if usual is None else usual
        waves = [
            f(n * state["phase"]) for n in range(1, FIT.imperfect_harmonics + 1) for f in (np.sin, np.cos)
        ]
        accelerations = FIT.imperfection_size * usual * np.stack(waves, axis=2) * inside[:, :, None]
        columns.append(problem.force_columns(fit, accelerations, 1.0))
    return np.concatenate(columns, axis=2)


def usual_acceleration(problem: Likelihood, fit: Fit) -> float:
    """Median acceleration of a fitted motion [m/s^2], below that of impacts; 0 without a segment."""
    steps = np.diff(problem.sample_times(), axis=1)
    usable = problem.segments.inside[:, 1:] & fit.good[:, None] & (steps > 0)
    rates = np.diff(fit.evaluation.v, axis=1)[usable] / steps[usable]
    return float(np.median(np.abs(rates))) / 0.6745 if rates.size else 0.0


def _sensor(problem: Likelihood, fit: Fit) -> np.ndarray:
    """Contributions of square and cube of the compared signal, position or force, to its measurement.

    They are separate for each record: a smooth curve has other terms over another range.
    """
    signal = problem.observed(fit)
    count, length = signal.shape
    records = len(problem.prepared)
    table = np.zeros((count, fit.evaluation.residual.shape[1], records * len(FIT.imperfect_powers)))
    u, deviations = standardised(problem, signal)
    # also of segments that only another machine follows well
    inside = problem.segments.inside & ~fit.evaluation.failed[:, None]
    for number, prepared in enumerate(problem.prepared):
        rows = np.flatnonzero(problem.segments.record == number)
        sigma = prepared.deviation(problem.segments.index[rows])
        size = FIT.imperfection_size * deviations[number]
        for column, power in enumerate(FIT.imperfect_powers, start=number * len(FIT.imperfect_powers)):
            table[rows, :length, column] = inside[rows] * size * u[rows] ** power / sigma
    return problem.whitened(table)
