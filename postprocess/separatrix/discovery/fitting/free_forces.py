# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Families of free forces on one body: smooth in speed, position, phase and time, and kicks at impacts."""

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.motions import (
    after_impacts,
    impacts_at,
    knots_of,
    products,
    scaled_motion,
    splines,
)


def families_of_body(problem: Likelihood, fit: Fit, mass: float) -> dict[str, np.ndarray]:
    """Columns of each family by its name."""
    state = scaled_motion(problem, fit)
    good = problem.segments.inside & fit.good[:, None]
    x, v, phase, time = state["x"], state["v"], state["phase"], state["time"]
    sign = np.sign(v)
    one = np.ones_like(x)
    forces = {
        "speed": splines(v, knots_of(v[good], 7), good),
        "position": splines(x, knots_of(x[good], 7), good),
        "speed and position": products(
            splines(v, knots_of(v[good], 4), good), splines(x, knots_of(x[good], 4), good)
        ),
        "time": np.stack(
            [time * f for f in (one, x, v, sign)] + [time**2 * f for f in (one, x, sign)], axis=2
        ),
    }
    if phase is not None:
        waves = [f(n * phase) for n in (1, 2, 3) for f in (np.sin, np.cos)]
        forces["phase"] = np.stack(
            waves + [f(n * phase) for n in (4, 5, 6) for f in (np.sin, np.cos)], axis=2
        )
        forces["phase and state"] = np.stack([w * f for w in waves[:4] for f in (x, v, sign)], axis=2)
    since = after_impacts(problem, fit)
    known = good & np.isfinite(since)
    if known.sum() > 100:
        forces["time since impact"] = splines(since, knots_of(since[known], 12), known)
    made = {name: problem.force_columns(fit, values, mass) for name, values in forces.items()}
    kicks = impact_kicks(problem, fit, state)
    if kicks is not None:
        made["impacts"] = problem.kick_columns(fit, kicks)
    return made


def impact_kicks(problem: Likelihood, fit: Fit, state: dict) -> np.ndarray | None:
    """Changes of the speed after an impact: a cubic of the speed before, and with time and its square."""
    before, at = impacts_at(problem, fit)
    if np.count_nonzero(at) < 4:
        return None
    speed = before / state["speed"]
    scale = 0.1 * state["speed"]
    return scale * np.stack(
        [at * speed**n for n in range(4)] + [at * state["time"], at * state["time"] ** 2], axis=2
    )
