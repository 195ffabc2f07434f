# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Linearised response of the sensors of a machine of several bodies to a small force at any location.

As in `response`: a force f along a row of the coordinates moves the start by the integral of T^-1 M^-1 f, T
being the derivative of the motion by the start, and a sensor by its derivatives by the start.
"""

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.policy import FIT


def columns_of(
    problem: Likelihood,
    fit: Fit,
    forces: np.ndarray,
    rows: np.ndarray | None = None,
    kick: bool = False,
) -> np.ndarray:
    """Columns (segments, width, rows*q) of forces (segments, length, q) [N] along rows over the coordinates.

    Without rows along each coordinate by itself. Kicks are impulses [N s] at the samples.
    """
    structure = problem.structure
    rows = np.eye(structure.n) if rows is None else np.atleast_2d(rows)
    pushed = rows / structure.mass
    back, alive = back_to_start(problem, fit)
    # (segments, length, start, rows, q)
    carried = np.einsum("klsn,rn,klq->klsrq", back, pushed, forces, optimize=True)
    carried = carried.reshape(*carried.shape[:3], -1)
    if kick:
        started = np.cumsum(carried, axis=1)
    else:
        steps = np.diff(problem.sample_times(), axis=1)[:, :, None, None]
        areas = 0.5 * steps * (carried[:, 1:] + carried[:, :-1])
        started = np.concatenate([np.zeros_like(carried[:, :1]), np.cumsum(areas, axis=1)], axis=1)
    started[~alive] = 0
    count, length = problem.segments.inside.shape
    found = np.zeros((count, fit.evaluation.residual.shape[1], started.shape[3]))
    for channel, name in enumerate(problem.columns):
        part = slice(channel * length, (channel + 1) * length)
        found[:, part] = np.einsum("kls,klsq->klq", fit.evaluation.by_start[:, part], started, optimize=True)
        kind, _, of = name.partition(".")
        if kind == "a" and not kick:
            direct = np.einsum("r,klq->klrq", pushed[:, structure.names.index(of)], forces)
            found[:, part] += direct.reshape(count, length, -1) / sigmas_of(problem, name)[:, None, None]
    return found * (fit.evaluation.used > 0)[:, :, None]


def sigmas_of(problem: Likelihood, name: str) -> np.ndarray:
    """Noise of a sensor by segment, infinite where a record lacks it."""
    known = [one.sensor(name) for one in problem.prepared]
    return np.array([np.inf if one is None else one.sigma for one in known])[problem.segments.record]


def back_to_start(problem: Likelihood, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Change of the start (segments, length, 2 n, n) equivalent to speeds at a sample, and its validity."""
    transition, n = fit.evaluation.transition, problem.structure.n
    inside = problem.segments.inside & fit.good[:, None]
    finite = np.isfinite(transition).all(axis=(2, 3)) & inside
    # in units in which positions and speeds are of equal size
    moved = fit.evaluation.motion[inside]
    lengths, speeds = moved[:, :n].std(), moved[:, n:].std()
    size = np.concatenate([np.full(n, lengths or 1.0), np.full(n, speeds or 1.0)])
    scaled = np.where(finite[:, :, None, None], transition, np.eye(2 * n)) * size / size[:, None]
    alive = np.logical_and.accumulate(finite & (np.abs(np.linalg.det(scaled)) > FIT.lost_memory), axis=1)
    scaled[~alive] = np.eye(2 * n)
    inverse = np.linalg.inv(scaled) * size[:, None] / size
    back = inverse[:, :, :, n:]
    back[~alive] = 0
    return back, alive
