# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Response of the samples to a small force along the fitted motion, from the transition matrices.

With T(t) the derivative of x and v by the start, impacts included, a force f(s) moves the state at t by the
integral of T(t) T(s)^-1 (0, f(s)/m) ds. No simulation is needed, so that any number of forces can be tried.
"""

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.policy import FIT


def columns_of_motion(problem: Likelihood, fit: Fit, forces: np.ndarray, mass: float) -> np.ndarray:
    """Columns (segments, width, q) of forces (segments, length, q) [N] given at the samples."""
    back, alive = _back(problem, fit)
    carried = back[:, :, :, None] * forces[:, :, None, :] / mass
    steps = np.diff(problem.sample_times(), axis=1)[:, :, None, None]
    areas = 0.5 * steps * (carried[:, 1:] + carried[:, :-1])
    moved = np.concatenate([np.zeros_like(carried[:, :1]), np.cumsum(areas, axis=1)], axis=1)
    return _as_columns(problem, fit, moved, alive)


def kicks_of_motion(problem: Likelihood, fit: Fit, kicks: np.ndarray) -> np.ndarray:
    """Columns of sudden changes of velocity (segments, length, q) [m/s] at the samples."""
    back, alive = _back(problem, fit)
    return _as_columns(problem, fit, np.cumsum(back[:, :, :, None] * kicks[:, :, None, :], axis=1), alive)


def columns_of_force(problem: Likelihood, fit: Fit, forces: np.ndarray) -> np.ndarray:
    """Forces over the noise of a measured force."""
    columns = np.zeros((*fit.evaluation.residual.shape, forces.shape[2]))
    length = forces.shape[1]
    for number, prepared in enumerate(problem.prepared):
        rows = np.flatnonzero(problem.segments.record == number)
        sigma = prepared.deviation(problem.segments.index[rows])[:, :, None]
        columns[rows, :length] = -forces[rows] / sigma
    return problem.whitened(columns * (fit.evaluation.used > 0)[:, :, None])


def _back(problem: Likelihood, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Change of the start that is equivalent to a kick in v at each sample, and its validity."""
    transition = fit.evaluation.transition
    determinant = (
        transition[:, :, 0, 0] * transition[:, :, 1, 1] - transition[:, :, 0, 1] * transition[:, :, 1, 0]
    )
    # a body that sticks loses its memory: later forces have no earlier equivalent
    alive = np.logical_and.accumulate(
        (np.abs(determinant) > FIT.lost_memory) & problem.segments.inside, axis=1
    )
    safe = np.where(alive, determinant, 1.0)
    # second column of the inverse
    back = np.stack([-transition[:, :, 0, 1] / safe, transition[:, :, 0, 0] / safe], axis=2)
    back[~alive] = 0
    return back, alive


def _as_columns(problem: Likelihood, fit: Fit, started: np.ndarray, alive: np.ndarray) -> np.ndarray:
    """What changes of the start do to x and v in units of the noise, as the residuals are laid out."""
    moved = np.einsum("klij,kljq->kliq", fit.evaluation.transition, started)
    moved[~alive] = 0
    count, length = problem.segments.inside.shape
    width = fit.evaluation.residual.shape[1]
    columns = np.zeros((count, width, moved.shape[3]))
    for number, prepared in enumerate(problem.prepared):
        rows = np.flatnonzero(problem.segments.record == number)
        spread = prepared.samples.spread(prepared.memory)[problem.segments.index[rows]][:, :, None]
        columns[rows, :length] = moved[rows, :, 0] / (prepared.sigma * spread)
        if problem.channels > 1 and prepared.record.v is not None:
            columns[rows, length : 2 * length] = moved[rows, :, 1] / (prepared.velocity_sigma * spread)
    return problem.whitened(columns)


def standardised(problem: Likelihood, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A signal (segments, samples) less the mean of its record, over its standard deviation, and the latter.

    Both are of the record as measured, which is sampled evenly: condensed samples are denser near impacts.
    """
    found, deviations = np.zeros(signal.shape), np.zeros(len(problem.prepared))
    for number, prepared in enumerate(problem.prepared):
        rows = np.flatnonzero(problem.segments.record == number)
        measured = prepared.column
        deviations[number] = float(np.std(measured))
        if deviations[number] > 0:
            found[rows] = (signal[rows] - np.mean(measured)) / deviations[number]
    return found, deviations
