# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Members of a family of effects that are functions: values at knots instead of one built-in shape.

The number of knots is chosen by the evidence. Afterwards the closed forms of the family are held against the
function as it was found.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import least_squares
from scipy.stats import chi2

from separatrix.discovery.fitting.catalogue import Candidate
from separatrix.discovery.fitting.data import Data
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.problem import Problem
from separatrix.discovery.fitting.refit import Fitted, values_of
from separatrix.discovery.measured.smoother import impact_table
from separatrix.errors import SeparatrixError

RESTITUTION = "restitution_curve"
KNOTS = (3, 5, 8, 12)
"""Numbers of knots that are tried, one after the other."""
# impacts that a knot takes
_IMPACTS = 3
# share of the range of speeds that two knots are apart at least
_APART = 0.02
# probability, or largest relative deviation, from which on a closed form fits
_LIKELY, _CLOSE = 0.01, 2e-3


@dataclass
class Function:
    """A function as it was found: values at `at` with their covariance, and the closed forms that fit it."""

    effect: str
    variable: str
    unit: str
    at: np.ndarray
    value: np.ndarray
    covariance: np.ndarray
    forms: dict[str, dict]

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the values."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0))


def impact_speeds(data: Data) -> np.ndarray:
    """Speeds before the impacts that are seen in records [m/s]."""
    return np.sort(np.concatenate([np.abs(impact_table(one)[:, 2]) for one in data.smoothed]))


def speeds_at(speeds: np.ndarray, count: int) -> np.ndarray | None:
    """Knots at quantiles of the speeds; None where impacts are too few or too much alike."""
    if speeds.size < _IMPACTS * count:
        return None
    knots = np.quantile(speeds, np.linspace(0, 1, count))
    least = _APART * (knots[-1] - knots[0])
    for i in range(1, count):
        knots[i] = max(knots[i], knots[i - 1] + least)
    return knots if knots[-1] > 1.05 * knots[0] else None


def restitution_curve(data: Data, known: Fitted, change: Callable, knots: np.ndarray) -> Fitted | None:
    """The machine with a table of the restitution, fitted from a `known` one that changes so over speed."""
    begun = change(knots)
    values = {f"speed[{i}]": float(one) for i, one in enumerate(knots, start=1)}
    values |= {f"change[{i}]": 0.0 for i in range(1, knots.size + 1)}
    model, names = known.model, known.names
    try:
        if names and names[-1] in ("restitution_slope", RESTITUTION):
            names = names[:-1]
            model = type(model).from_text(_without_last_effect(model.to_text({}), known.names[-1]))
        extended = model.with_effect(RESTITUTION, values)
    except SeparatrixError:
        return None
    free = [one for one in known.problem.free if one.path in extended.parameters or one.is_nuisance]
    added = [
        Free(f"effect.{RESTITUTION}.change[{i}]", float(begun[i - 1] - begun[0]), -1.0, 1.0, 0.05)
        for i in range(2, knots.size + 1)
    ]
    place = tuple(range(len(free), len(free) + len(added)))
    origin = np.zeros(len(added))
    linear = np.ones(len(added), bool)
    made = Candidate((*names, RESTITUTION), extended, free + added, place, [origin], [origin], linear)
    start = values_of(known, made.free)
    # a table on other knots has other values
    start[list(place)] = begun[1:] - begun[0]
    start[[one.path for one in free].index("contact.restitution")] += begun[0]
    problem = Problem(extended, data.prepared, data.stages[data.last], made.free)
    fit = minimise(problem, start, known.fit.starts, most=40, patient=True)
    return Fitted(made.names, extended, problem, fit, place)


def _without_last_effect(text: str, name: str) -> str:
    """A resolved case without the table of an effect."""
    head, _, tail = text.partition(f"[effect.{name}]\n")
    rest = tail.partition("\n[")
    return head + (f"[{rest[2]}" if rest[1] else "")


def change_of(fitted: Fitted) -> Callable:
    """How the restitution of a fitted machine changes with the speed."""
    found = {
        one.path: one.physical(value)
        for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True)
    }
    slope = found.get("effect.restitution_slope.slope")
    if slope is not None:
        return lambda speed: -slope * speed
    if fitted.names and fitted.names[-1] == RESTITUTION:
        knots, values = _table(fitted)
        spline = make_interp_spline(knots, values, k=min(3, knots.size - 1))
        return lambda speed: spline(np.clip(speed, knots[0], knots[-1]))
    return lambda speed: 0 * speed


def _table(fitted: Fitted) -> tuple[np.ndarray, np.ndarray]:
    paths = fitted.model.parameters
    count = sum(path.startswith(f"effect.{RESTITUTION}.speed[") for path in paths)
    knots = [paths[f"effect.{RESTITUTION}.speed[{i}]"].value for i in range(1, count + 1)]
    return np.array(knots), np.concatenate([[0.0], fitted.fit.values[list(fitted.added)]])


def function_of(fitted: Fitted) -> Function | None:
    """The function that a fitted machine holds as a table, with the closed forms that fit it."""
    if RESTITUTION not in fitted.names:
        return None
    knots, changes = _table(fitted)
    whole = [one.path for one in fitted.problem.free].index("contact.restitution")
    places = [whole, *fitted.added]
    # each value is the restitution at low speed and a change
    sums = np.eye(len(places))
    sums[:, 0] = 1
    covariance = sums @ fitted.covariance[np.ix_(places, places)] @ sums.T
    value = fitted.fit.values[whole] + changes
    return Function(
        RESTITUTION, "impact speed", "m/s", knots, value, covariance, closed_forms(knots, value, covariance)
    )


_FORMS: dict[str, tuple[Callable, list[float]]] = {
    "constant": (lambda v, a: a + 0 * v, [0.5]),
    "linear": (lambda v, a, b: a - b * v, [0.5, 0.0]),
    "power": (lambda v, a, b: a * v**-b, [0.5, 0.0]),
    "exponential": (lambda v, a, b: a * np.exp(-b * v), [0.5, 0.0]),
    "viscoelastic": (lambda v, a, b: 1 - a * v**0.2 + b * v**0.4, [0.3, 0.0]),
}
"""Restitution over speed v, and parameters to start from."""


def closed_forms(at: np.ndarray, value: np.ndarray, covariance: np.ndarray) -> dict[str, dict]:
    """Closed forms held against values: parameters, probability, largest relative deviation, fit or not."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-24))
    root = np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-9 * np.eye(at.size))
    found = {}
    for name, (form, start) in _FORMS.items():
        if len(start) >= at.size:
            continue

        def off(parameters: np.ndarray, form: Callable = form) -> np.ndarray:
            return np.linalg.solve(root, (value - form(at, *parameters)) / scale)

        fit = least_squares(off, start, x_scale="jac")
        p = float(chi2.sf(2 * fit.cost, at.size - len(start)))
        deviation = float(np.max(np.abs(form(at, *fit.x) / value - 1)))
        found[name] = {
            "parameters": [float(one) for one in fit.x],
            "p": p,
            "deviation": deviation,
            "fits": p > _LIKELY or deviation < _CLOSE,
        }
    return found
