# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Held-out segments whose motion stays within the knots of a fitted table; beyond these it is not known."""

from collections.abc import Callable

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.motions import extensions
from separatrix.discovery.policy import SEARCH

_VARIABLES: dict[tuple[str, str], Callable[[Likelihood, Fit], np.ndarray | None]] = {
    ("friction_curve", "speed"): lambda problem, fit: np.abs(fit.evaluation.v),
    ("friction_position_curve", "position"): lambda problem, fit: fit.evaluation.x,
    ("force_curve", "position"): lambda problem, fit: fit.evaluation.x,
    ("spring_curve", "extension"): extensions,
}
"""Variables of the tables of one body by effect and key of their knots."""


def scored_segments(prediction: Prediction) -> np.ndarray:
    """Which segments can be scored; all of them where too few stay within the tables, or there is none."""
    within = within_tables(prediction)
    return within if within.sum() >= SEARCH.few_segments else np.ones(within.size, bool)


def within_tables(prediction: Prediction) -> np.ndarray:
    """Which segments stay within the knots of the tables of the machine."""
    problem, fit = prediction.problem, prediction.fit
    within = np.ones(fit.chi2.size, bool)
    for (effect, key), variable in _VARIABLES.items():
        knots = _knots(problem.model.parameters, f"effect.{effect}.{key}[")
        seen = variable(problem, fit) if knots.size > 1 else None
        if seen is None:
            continue
        slack = SEARCH.beyond_knots * np.ptp(knots)
        beyond = (seen < knots.min() - slack) | (seen > knots.max() + slack)
        within &= ~np.any(beyond & problem.segments.inside, axis=1)
    return within


def _knots(parameters: dict, path: str) -> np.ndarray:
    return np.array([one.value for name, one in parameters.items() if name.startswith(path)])
