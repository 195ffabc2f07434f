# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sensor with a low pass of first order shows instead of one with a delay, along a fitted motion."""

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import lfilter

from separatrix.discovery.fitting.hypotheses import Hypothesis, Motion
from separatrix.discovery.policy import SEARCH

LOW_PASS = "low pass of the sensor"
FORMULA = "a (x_s - x(t - tau)), tau x_s' = x - x_s"


def low_pass(delay: float) -> Hypothesis:
    """A low pass with the time constant of a fitted delay [s] instead of it: then the coefficient is 1.

    To first order both are one: what differs is the rounding of fast changes.
    """
    return Hypothesis(
        (LOW_PASS,), lambda m, _: (_columns(m, delay), None), FORMULA, ("time constant tau", "s"),
        values=np.array([delay]),
    )  # fmt: skip


def _columns(m: Motion, delay: float) -> np.ndarray:
    """One column (segments, width, 1): the low pass less the delay, over the noise."""
    table = np.zeros((m.x.shape[0], m.fit.evaluation.residual.shape[1], 1))
    segments, length = m.problem.segments, m.x.shape[1]
    for number, prepared in enumerate(m.problem.prepared):
        rows = np.flatnonzero(segments.record == number)
        change = _change(m, rows, delay) / prepared.deviation(segments.index[rows])
        table[rows, :length, 0] = np.where(m.good[rows], change, 0.0)
    return m.problem.whitened(table)


def _change(m: Motion, rows: np.ndarray, delay: float) -> np.ndarray:
    """Low pass less delay at the samples of a record [m]; the fitted motion is the delayed one."""
    usable = m.good[rows]
    found = np.zeros(usable.shape)
    t, first = np.unique(m.t[rows][usable], return_index=True)
    if t.size < 2:
        return found
    x, v = m.x[rows][usable][first], m.v[rows][usable][first]
    step = delay / SEARCH.low_pass_steps
    even = np.arange(t[0], t[-1] + delay, step)
    # after its end the record goes on as it does there
    path = CubicHermiteSpline(
        np.append(t, t[-1] + 2 * delay), np.append(x, x[-1] + 2 * delay * v[-1]), np.append(v, v[-1])
    )
    share = step / delay
    forgets = np.exp(-share)
    late, new = (1 - forgets) / share - forgets, 1 - (1 - forgets) / share
    position = path(even)
    # before its beginning too
    begin = position[0] - delay * v[0]
    filtered = lfilter([new, late], [1, -forgets], position, zi=[begin - new * position[0]])[0]
    at = m.t[rows]
    found[usable] = (np.interp(at + delay, even, filtered) - path(at))[usable]
    return found
