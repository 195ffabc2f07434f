# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""An impacting body driven by a motor of limited power, by heyoka: one by one, or in batches."""

import math
from collections.abc import Callable

import heyoka
import numpy as np

MASS, STIFFNESS, DAMPING, KINETIC, STATIC = 1.0, 88.82643960980423, 0.2, 0.3, 0.45
STOP, RESTITUTION, RADIUS = 0.12, 0.7, 0.03
TORQUE, SLOPE, INERTIA, BEARING = 0.1 * 8, 0.05, 0.05, 0.002
DURATION = 50.0


class Peer:
    """Taylor integration with terminal events, in batches of `batch` lanes, or one by one if that is 0.

    The parameter of a lane is the direction of slip. Sticking is left out: where friction would hold the
    body, it goes on slipping, and `stuck` is set.
    """

    def __init__(self, tolerance: float, batch: int) -> None:
        self.lanes = max(batch, 1)
        phi, w, x, v = heyoka.make_vars("phi", "w", "x", "v")
        spring = STIFFNESS * (RADIUS * heyoka.cos(phi) - x)
        load = -RADIUS * spring * heyoka.sin(phi)
        equations = [
            (phi, w),
            (w, (TORQUE - (SLOPE + BEARING) * w - load) / INERTIA),
            (x, v),
            (v, (spring - heyoka.par[0] * KINETIC - DAMPING * v) / MASS),
        ]
        way = heyoka.event_direction
        found = [(x - STOP, self.hit, way.positive), (v, self.turn, way.any)]
        self.stuck = np.zeros(self.lanes, dtype=bool)
        make_event = heyoka.t_event_batch if batch else heyoka.t_event
        events = [
            make_event(surface, callback=self.callback(rule, batch), direction=direction)
            for surface, rule, direction in found
        ]
        make = heyoka.taylor_adaptive_batch if batch else heyoka.taylor_adaptive
        shape = (4, batch) if batch else (4,)
        self.solver = make(equations, np.zeros(shape), tol=tolerance, t_events=events)
        # views of the solver's memory: quicker to index than its arrays
        self.state = memoryview(self.solver.state.reshape(4, self.lanes))
        self.pars = memoryview(self.solver.pars.reshape(1, self.lanes))

    @staticmethod
    def callback(rule: Callable[[int], bool], batch: int) -> Callable[..., bool]:
        """A rule for a lane as heyoka calls it."""
        if batch:
            return lambda _solver, _sign, lane: rule(lane)
        return lambda _solver, _sign: rule(0)

    def spring(self, lane: int) -> float:
        """Force of the spring."""
        return STIFFNESS * (RADIUS * math.cos(self.state[0, lane]) - self.state[2, lane])

    def hit(self, lane: int) -> bool:
        """Newton's impact law."""
        self.state[3, lane] *= -RESTITUTION
        self.pars[0, lane] = -1.0
        return True

    def turn(self, lane: int) -> bool:
        """At a turning point friction changes its sign, or holds the body."""
        force = self.spring(lane)
        self.state[3, lane] = 0.0
        self.pars[0, lane] = math.copysign(1.0, force)
        if abs(force) <= STATIC:
            self.stuck[lane] = True
        return True

    def run(self, starts: np.ndarray) -> np.ndarray:
        """Ends (x, v, w) of starts (w, x, v); not numbers where the body would have stuck."""
        ends = np.empty((len(starts), 3))
        for first in range(0, len(starts), self.lanes):
            chosen = starts[np.minimum(first + np.arange(self.lanes), len(starts) - 1)]
            for lane, (w, x, v) in enumerate(chosen.tolist()):
                for row, value in enumerate((0.0, w, x, v)):
                    self.state[row, lane] = value
                self.pars[0, lane] = math.copysign(1.0, v)
            self.stuck[:] = False
            if self.lanes > 1:
                self.solver.set_time(np.zeros(self.lanes))
            else:
                self.solver.time = 0.0
            self.solver.reset_cooldowns()
            self.solver.propagate_until(DURATION)
            for lane in range(min(self.lanes, len(starts) - first)):
                ends[first + lane] = self.state[2, lane], self.state[3, lane], self.state[1, lane]
                if self.stuck[lane]:
                    ends[first + lane] = math.nan
        return ends
