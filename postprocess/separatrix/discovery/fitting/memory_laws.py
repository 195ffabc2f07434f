# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of friction with memory along a known motion, for one unit of the largest force.

Each law has one unknown length or a few; its largest force is linear. Between turning points the laws follow
in closed form from the state at the last one, except LuGre's, whose steady friction depends on the speed.
Before the record the body is assumed to have slipped for long.
"""

import numpy as np

from separatrix.discovery.measured.driven import Driven

Pieces = list[tuple[int, int]]


def _along(motion: Driven, pieces: Pieces, lengths: np.ndarray, after) -> np.ndarray:
    """States (samples, lengths); `after` gives them from those at the turning point and the way [m] since."""
    found = np.zeros((motion.x.size, lengths.size))
    for first, last in pieces:
        state, before = None, None
        for a, b, sign, begun in motion.strokes(first, last):
            if state is None:
                state = np.full(lengths.size, float(sign)) * (1 if after is _dahl else lengths)
            else:
                state = after(state, begun - before[0], before[1], lengths)
            found[a:b] = after(state, (motion.x[a:b] - begun)[:, None], sign, lengths)
            before = begun, sign
    return found


def _dahl(state: np.ndarray, way: np.ndarray, sign: int, lengths: np.ndarray) -> np.ndarray:
    return sign + (state - sign) * np.exp(-np.maximum(sign * way, 0.0) / lengths)


def _stop(state: np.ndarray, way: np.ndarray, sign: int, lengths: np.ndarray) -> np.ndarray:
    return np.clip(state + way, -lengths, lengths)


def dahl(motion: Driven, pieces: Pieces, lengths: np.ndarray) -> np.ndarray:
    """Dahl's friction, which approaches its largest force exponentially over a length [m]."""
    return _along(motion, pieces, lengths, _dahl)


def slip(motion: Driven, pieces: Pieces, lengths: np.ndarray) -> np.ndarray:
    """A spring that slips at its largest force, reached at an extension [m]."""
    return _along(motion, pieces, lengths, _stop) / lengths


def dead_band(motion: Driven, pieces: Pieces, lengths: np.ndarray, share: float) -> np.ndarray:
    """The same with a dead band in series, which is a `share` of the extension where it slips."""
    extension = slip(motion, pieces, lengths)
    return np.sign(extension) * np.maximum(np.abs(extension) - share, 0.0) / (1 - share)


def lugre(motion: Driven, pieces: Pieces, lengths: np.ndarray, excess: float, speed: float) -> np.ndarray:
    """LuGre's friction without microscopic damping: a static excess that falls over a `speed` [m/s]."""
    steady = 1 + excess * np.exp(-((motion.v / speed) ** 2))
    found = np.zeros((motion.x.size, lengths.size))
    for first, last in pieces:
        state = np.full(lengths.size, np.sign(motion.v[first]) * steady[first])
        found[first] = state
        steps = np.diff(motion.x[first:last])
        for k, step in enumerate(steps, start=first + 1):
            level = np.sign(step) * steady[k]
            state = level + (state - level) * np.exp(-abs(step) / (lengths * steady[k]))
            found[k] = state
    return found
