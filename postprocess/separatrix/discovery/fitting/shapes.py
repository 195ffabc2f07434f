# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed forms of the families of effects, compared with a function that was found as a table."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline, KroghInterpolator
from scipy.optimize import least_squares
from scipy.stats import chi2

from separatrix.discovery.policy import FIT


@dataclass(frozen=True)
class Form:
    """A closed form of some parameters, and what to start them from, given the arguments."""

    value: Callable
    start: Callable


def _line(x: np.ndarray) -> list[list[float]]:
    return [[0.5, 0.0]]


_CONSTANT = Form(lambda x, a: a + 0 * x, lambda x: [[0.5]])
_LINEAR = Form(lambda x, a, b: a + b * x, _line)
_SQUARE = Form(lambda x, a, b, c: a + b * x + c * x**2, lambda x: [[0.5, 0.0, 0.0]])

FORMS: dict[str, dict[str, Form]] = {
    "restitution_curve": {
        "constant": _CONSTANT,
        "linear": _LINEAR,
        "power": Form(lambda v, a, b: a * v**-b, _line),
        "exponential": Form(lambda v, a, b: a * np.exp(-b * v), _line),
        "viscoelastic": Form(lambda v, a, b: 1 - a * v**0.2 + b * v**0.4, lambda x: [[0.3, 0.0]]),
    },
    "friction_curve": {
        "constant": _CONSTANT,
        "linear": _LINEAR,
        "quadratic": _SQUARE,
        "power": Form(
            lambda v, a, b, c: a + b * np.abs(v) ** np.clip(c, 0.1, 8), lambda x: [[0.5, 0.1, 1.5]]
        ),
        "stribeck": Form(
            # an excess that fades within the speeds seen: else it is a parabola
            lambda v, a, b, c: a + abs(b) * np.exp(-((v / np.clip(abs(c), 1e-3 * v[-1], v[-1])) ** 2)),
            lambda x: [[0.5, 0.2, share * x[-1]] for share in (0.1, 0.3, 0.6)],
        ),
    },
    "friction_position_curve": {
        "constant": _CONSTANT,
        "linear": _LINEAR,
        "quadratic": _SQUARE,
        "sine": Form(
            lambda x, a, b, c, d: a + b * np.sin(d * x) + c * np.cos(d * x),
            lambda x: [[0.1, 0.01, 0.01, turns * np.pi / np.ptp(x)] for turns in (0.5, 1, 2, 3, 4, 6)],
        ),
    },
    "spring_curve": {
        "linear": _LINEAR,
        "quadratic": _SQUARE,
        "cubic": Form(lambda s, a, b, c: a + b * s + c * s**3, lambda x: [[0.0, 0.0, 0.0]]),
        "free play": Form(
            lambda s, a, b, c, d: a + b * s + c * np.clip(s, -abs(d), abs(d)),
            lambda x: [[0.0, 0.0, 1.0, share * np.max(np.abs(x))] for share in (0.1, 0.3, 0.6)],
        ),
    },
    "force_curve": {
        "constant": _CONSTANT,
        "linear": _LINEAR,
        "quadratic": _SQUARE,
        "cubic": Form(lambda x, a, b, c, d: a + b * x + c * x**2 + d * x**3, lambda x: [[0.0] * 4]),
        "sine": Form(
            lambda x, a, b, c, d: a + b * np.sin(d * x) + c * np.cos(d * x),
            lambda x: [[0.1, 0.01, 0.01, turns * np.pi / np.ptp(x)] for turns in (0.5, 1, 2, 3, 4, 6)],
        ),
    },
    "contact_curve": {
        "linear": Form(lambda p, a: a * p, lambda x: [[1.0]]),
        "hertz": Form(lambda p, a: a * p**1.5, lambda x: [[1.0]]),
        "power": Form(
            lambda p, a, b: a * p ** np.clip(b, 0.5, 10),
            lambda x: [[10.0**size, 1.5] for size in range(2, 9, 2)],
        ),
    },
    # a series is its own closed form
    "drive_harmonics": {},
}
"""By effect: the function over its variable."""
FORM_OF = {
    "viscous": "linear",
    "coulomb": "constant",
    "quadratic_drag": "quadratic",
    "stribeck": "stribeck",
    "position_dependent_friction": "linear",
    "restitution_slope": "linear",
    "cubic_spring": "cubic",
    "compliant_contact": "hertz",
    "contact_hardening": "power",
}
"""Closed form of its family that an effect is."""
UNNAMED_FORMS = {"restitution_slope": ("power", "exponential", "viscoelastic")}
"""Closed forms of as many parameters that no effect is, so that none competes with the effect."""


def through(at: np.ndarray, value: np.ndarray) -> CubicHermiteSpline:
    """The curve of the law through a table: slopes are those of the polynomial through up to five knots."""
    slopes = []
    for i in range(at.size):
        first = max(0, min(i - 2, at.size - 5))
        part = slice(first, min(at.size, first + 5))
        slopes.append(float(KroghInterpolator(at[part], value[part]).derivative(at[i])))
    return CubicHermiteSpline(at, value, slopes)


def closed_forms(
    effect: str, at: np.ndarray, value: np.ndarray, rows: np.ndarray, zero: np.ndarray
) -> dict[str, dict]:
    """Closed forms compared with a function: parameters, misfit, its freedom and probability, deviation, fit.

    The misfit of a form to the records is |rows form(at) - zero|^2; `value` is the estimated function.
    """
    found = {}
    for name, form in FORMS[effect].items():
        starts = form.start(at)
        freedom = zero.size - len(starts[0])
        if freedom < 1:
            continue

        def off(parameters: np.ndarray, form: Form = form) -> np.ndarray:
            return np.nan_to_num(rows @ form.value(at, *parameters) - zero, nan=1e9)

        fits = [least_squares(off, start, x_scale="jac", max_nfev=400) for start in starts]
        fit = min(fits, key=lambda one: one.cost)
        p = float(chi2.sf(2 * fit.cost, freedom))
        deviation = float(np.max(np.abs(form.value(at, *fit.x) - value)) / np.max(np.abs(value)))
        fine = np.linspace(at[0], at[-1], 60)
        found[name] = {
            "parameters": [float(one) for one in fit.x],
            "misfit": float(2 * fit.cost),
            "freedom": freedom,
            "p": p,
            "deviation": deviation,
            "fits": p > FIT.form_p or deviation < FIT.form_close,
            "at": fine,
            "curve": form.value(fine, *fit.x),
        }
    return found
