# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Families of forces at the locations of a machine of several bodies, and the small imperfections of its rig.

The counterparts of `ceiling` and `rig` for one body: what a flexible machine could explain of a residual, and
what is not a missing effect.
"""

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.joint_response import columns_of, sigmas_of
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.motions import clock_of, knots_of, splines
from separatrix.discovery.measured.bodies import contact_paths
from separatrix.discovery.policy import FIT


def families_of(problem: Likelihood, fit: Fit) -> dict[str, np.ndarray]:
    """Columns of families of forces by name: over speed, extension and time at locations, phase, kicks."""
    structure, n = problem.structure, problem.structure.n
    good = problem.segments.inside & fit.good[:, None]
    motion = fit.evaluation.motion
    found = {}
    time, phase = clock_of(problem, fit)
    for location in structure.locations:
        s, u = motion[:, :, :n] @ location.row, motion[:, :, n:] @ location.row
        if not np.std(s[good]) > 0:
            continue
        over = {
            "speed": splines(u, knots_of(u[good], FIT.free_knots), good),
            "extension": splines(s, knots_of(s[good], FIT.free_knots), good),
            "time": np.stack([time, time * u / np.std(u[good]), time * np.sign(u)], axis=2)
            * good[:, :, None],
        }
        for name, forces in over.items():
            found[f"{name} at {location.name}"] = columns_of(problem, fit, forces, location.row)
    if phase is not None:
        waves = [f(k * phase) for k in range(1, FIT.free_harmonics + 1) for f in (np.sin, np.cos)]
        forces = np.stack(waves, axis=2) * good[:, :, None]
        for body, row in zip(structure.names, np.eye(n), strict=True):
            found[f"phase at {body}"] = columns_of(problem, fit, forces, row)
    for name, kicks in kicks_of(problem, fit).items():
        found[f"impacts of {name}"] = kicks
    return found


def kicks_of(problem: Likelihood, fit: Fit) -> dict[str, np.ndarray]:
    """Kicks at the impacts of each contact by its path: a cubic of the speed before."""
    structure = problem.structure
    times = problem.sample_times()
    tables: dict[int, np.ndarray] = {}
    for number, hits in enumerate(fit.evaluation.impacts):
        rows = np.flatnonzero(problem.segments.record == number)
        for segment, time, before, _, side, contact in hits if hits is not None else ():
            row = rows[int(segment)]
            j = int(np.searchsorted(times[row][problem.segments.inside[row]], time))
            if j < problem.segments.inside[row].sum() and before > 0:
                table = tables.setdefault(int(contact), np.zeros((*times.shape, FIT.kick_powers)))
                table[row, j] = -side * before ** np.arange(FIT.kick_powers)
    found = {}
    for contact, table in tables.items():
        hit = np.any(table != 0, axis=2)
        if np.count_nonzero(hit) < FIT.impacts_of_kicks:
            continue
        path = contact_paths(problem.model)[contact]
        found[path] = columns_of(problem, fit, table, structure.joint(path).row, kick=True)
    return found


def imperfection_columns_of(problem: Likelihood, fit: Fit) -> np.ndarray:
    """Columns of small imperfections of a rig: slightly nonlinear sensors, further harmonics of a drive."""
    count, length = problem.segments.inside.shape
    good = problem.segments.inside & fit.good[:, None]
    columns = []
    for channel, name in enumerate(problem.columns):
        signal = np.zeros((count, length))
        for number, prepared in enumerate(problem.prepared):
            sensor, rows = prepared.sensor(name), np.flatnonzero(problem.segments.record == number)
            if sensor is not None:
                signal[rows] = sensor.values[problem.segments.index[rows]]
        part = slice(channel * length, (channel + 1) * length)
        seen = good & (fit.evaluation.used[:, part] > 0)
        deviation = float(np.std(signal[seen])) if seen.any() else 0.0
        if deviation == 0:
            continue
        u = (signal - np.mean(signal[seen])) / deviation
        for power in (2, 3):
            table = np.zeros((count, fit.evaluation.residual.shape[1], 1))
            sigma = sigmas_of(problem, name)[:, None]
            table[:, part, 0] = seen * FIT.imperfection_size * deviation * u**power / sigma
            columns.append(table)
    _, phase = clock_of(problem, fit)
    n = problem.structure.n
    for body in problem.structure.driven if phase is not None else ():
        if body not in problem.structure.names:
            continue
        index = problem.structure.names.index(body)
        steps = np.diff(problem.sample_times(), axis=1)
        usable = good[:, 1:] & (steps > 0)
        speeds = fit.evaluation.motion[:, :, n + index]
        rates = np.diff(speeds, axis=1)[usable] / steps[usable]
        usual = problem.structure.mass[index] * float(np.median(np.abs(rates))) / 0.6745
        waves = [
            f(k * phase) for k in range(1, FIT.imperfect_harmonics_of_bodies + 1) for f in (np.sin, np.cos)
        ]
        forces = FIT.imperfection_size * usual * np.stack(waves, axis=2) * good[:, :, None]
        columns.append(columns_of(problem, fit, forces, np.eye(n)[index]))
    return problem.whitened(np.concatenate(columns, axis=2))
