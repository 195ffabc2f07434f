# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Dependences of a missing force of a machine of several bodies, and the location at which it acts."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.hypotheses import Hypothesis, Motion
from separatrix.discovery.fitting.joint_forces import kicks_of
from separatrix.discovery.fitting.joint_response import columns_of
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.motions import clock_of, knots_of, products, splines
from separatrix.discovery.policy import FIT, SEARCH


@dataclass(frozen=True)
class SensedMotion(Motion):
    """Of several bodies; `measured`: positions, velocities (segments, length, 2 n), fitted without a sensor.

    A missing force depends on the true motion, from which the fitted one differs where the gap is large.
    """

    measured: np.ndarray | None = None


def motion_at(problem: Likelihood, fit: Fit, data: object) -> SensedMotion:
    """The motion of a fit of several bodies; `t` is the time over a record, -1 to 1."""
    good = problem.segments.inside & fit.good[:, None]
    time, phase = clock_of(problem, fit)
    measured = fit.evaluation.motion.copy()
    for number in range(len(problem.prepared)):
        rows = np.flatnonzero(problem.segments.record == number)
        seen = data.measured(number)[problem.segments.index[rows]]
        measured[rows] = np.where(np.isnan(seen), measured[rows], seen)
    return SensedMotion(problem, fit, 1.0, 1.0, 1.0, time, phase, None, good, measured)


def hypotheses_at(training: Motion) -> Iterator[Hypothesis]:
    """All hypotheses at all locations; knots are those of the training records."""
    structure = training.problem.structure
    for location in structure.locations:
        s, u = _extension(training, location.row), _speed(training, location.row)
        if not np.std(s[training.good]) > 0:
            continue
        of_speed, of_extension = (knots_of(one[training.good], SEARCH.joint_knots) for one in (u, s))
        coarse = [knots_of(one[training.good], SEARCH.joint_knots_of_two) for one in (u, s)]
        row, name = location.row, location.name

        def over_speed(m: Motion, _: float, row=row, knots=of_speed) -> tuple:
            return _pushed(m, splines(_speed(m, row), knots, m.good), row), None

        def over_extension(m: Motion, _: float, row=row, knots=of_extension) -> tuple:
            return _pushed(m, splines(_extension(m, row), knots, m.good), row), None

        def over_both(m: Motion, _: float, row=row, knots=coarse) -> tuple:
            one, other = (
                splines(f(m, row), k, m.good) for f, k in zip((_speed, _extension), knots, strict=True)
            )
            forces = products(one, other)
            return _pushed(m, forces, row), None

        def drifting(m: Motion, _: float, row=row) -> tuple:
            drift = np.stack([m.t, m.t * _speed(m, row), m.t * np.sign(_speed(m, row))], axis=2)
            return None, _pushed(m, drift * m.good[:, :, None], row)

        yield Hypothesis((f"speed at {name}",), over_speed)
        yield Hypothesis((f"extension at {name}",), over_extension)
        yield Hypothesis((f"speed at {name}", f"extension at {name}"), over_both)
        yield Hypothesis((f"slow time at {name}",), drifting)
    if training.phase is not None:
        for body, row in zip(structure.names, np.eye(structure.n), strict=True):

            def over_phase(m: Motion, _: float, row=row) -> tuple:
                waves = [
                    f(k * m.phase) for k in range(1, SEARCH.joint_harmonics + 1) for f in (np.sin, np.cos)
                ]
                return _pushed(m, np.stack(waves, axis=2) * m.good[:, :, None], row), None

            yield Hypothesis((f"drive phase at {body}",), over_phase)
    for path in kicks_of(training.problem, training.fit):

        def at_impacts(m: Motion, _: float, path=path) -> tuple:
            # a held-out record may have too few of these impacts
            nothing = np.zeros((*m.fit.evaluation.residual.shape, FIT.kick_powers))
            return kicks_of(m.problem, m.fit).get(path, nothing), None

        yield Hypothesis((f"impact speed at {path}",), at_impacts)


def _pushed(motion: Motion, forces: np.ndarray, row: np.ndarray) -> np.ndarray:
    return columns_of(motion.problem, motion.fit, forces, row)


def _extension(motion: SensedMotion, row: np.ndarray) -> np.ndarray:
    return motion.measured[:, :, : row.size] @ row


def _speed(motion: SensedMotion, row: np.ndarray) -> np.ndarray:
    return motion.measured[:, :, row.size :] @ row
