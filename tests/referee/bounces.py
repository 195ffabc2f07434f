# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A referee for linear structures between rigid stops: matrix exponentials, impact by impact.

It shares nothing with the program: scipy's `expm` of the matrix with the harmonic force in it, over equal
intervals, and Brent's method where a gap closes. A body that bounces on and on does so until a bounce is
shorter than the digits of its time, then it stays.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq


@dataclass
class Stop:
    """A gap `row z` that impacts do not let below 0: its rate changes its sign and keeps `loss` of its size.

    An impact moves z along `kick`, for which the rate grows by one.
    """

    row: np.ndarray
    kick: np.ndarray
    loss: float


@dataclass
class Bounces:
    """z' = A z between impacts, integrated in intervals of `step` [s], shorter than any gap's turn."""

    matrix: np.ndarray
    stops: list[Stop]
    step: float
    #: Time, stop and rate before of every impact.
    impacts: list[tuple[float, int, float]] = field(default_factory=list)
    #: When a body came to stay at a stop [s].
    stays: float = np.inf

    def gap(self, stop: Stop, z: np.ndarray, time: float) -> float:
        """A gap `time` later."""
        return float(stop.row @ expm(self.matrix * time) @ z)

    def fall(self, stop: Stop, z: np.ndarray, length: float) -> float:
        """When a gap closes, within `length` [s]."""
        return brentq(lambda s: self.gap(stop, z, s), 0, length, xtol=1e-17, rtol=9e-16)

    def first_interval(self, z: np.ndarray, touched: Stop | None) -> float:
        """A time for which every gap has opened that has just closed; 0 if the body stays."""
        if touched is None:
            return self.step
        rate = float(touched.row @ self.matrix @ z)
        curvature = float(touched.row @ self.matrix @ self.matrix @ z)
        # A bounce lasts 2 rate/|curvature|.
        return self.step if curvature >= 0 else min(self.step, rate / -curvature)

    def run(self, z: np.ndarray, until: float, touched: int | None = None, most: int = 100000) -> np.ndarray:
        """State at `until`; `touched` is a stop that z begins at and leaves; it ends after `most` impacts."""
        t, over = 0.0, expm(self.matrix * self.step)
        length = self.first_interval(z, None if touched is None else self.stops[touched])
        while t < until and len(self.impacts) < most:
            length = min(length, until - t)
            after = (over if length == self.step else expm(self.matrix * length)) @ z
            closed = [k for k, stop in enumerate(self.stops) if stop.row @ after < 0]
            if not closed:
                z, t, length = after, t + length, self.step
                continue
            time, k = min((self.fall(self.stops[k], z, length), k) for k in closed)
            z, t = expm(self.matrix * time) @ z, t + time
            stop = self.stops[k]
            rate = float(stop.row @ self.matrix @ z)
            self.impacts.append((t, k, rate))
            z = z - (1 + stop.loss) * rate * stop.kick
            length = self.first_interval(z, stop)
            if length < 1e-15:
                self.stays = t
                z = z - float(stop.row @ self.matrix @ z) * stop.kick
                return expm(self.held(stop) * (until - t)) @ z
        return z

    def held(self, stop: Stop) -> np.ndarray:
        """The matrix with a gap that stays closed."""
        rate = stop.row @ self.matrix
        return self.matrix - np.outer(stop.kick, rate @ self.matrix) / (rate @ stop.kick)
