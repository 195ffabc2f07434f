# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Driven bodies as cases by expressions, as cases by built-in laws, and by heyoka."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import heyoka
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

DURATION = 50.0
FREQUENCY = 1.2

HEAD = """title = "benchmark"
[body]
mass = "1 kg"
"""
RUN = f"""[run]
duration = "{DURATION:g} s"
window = "10 s"
stop = "duration"
"""
FREE = """[friction]
law = "none"
[contact]
law = "none"
"""
CLOCK = f"""[drive]
law = "expression"
period = "2*pi/w"
w = "{FREQUENCY:g} rad/s"
"""


@dataclass(frozen=True)
class Machine:
    """A machine: its case, the case by built-in laws if there is one, the rates of heyoka's variables."""

    name: str
    case: str
    built_in: str
    rates: Callable[..., list]
    states: int = 0
    by_sign: bool = False
    """The sign of v is a parameter that changes where v is zero."""


def cubic(x: object, v: object, cosine: object) -> list:
    """Cubic spring on a moving foot."""
    s = 0.3 * cosine - x
    return [v, s + s**3 - 0.1 * v]


def tanh(x: object, v: object, cosine: object) -> list:
    """Smoothed dry friction."""
    return [v, cosine - x - 0.3 * heyoka.tanh(v / 0.1)]


def drag(x: object, v: object, cosine: object) -> list:
    """Quadratic drag; the parameter is the sign of the velocity."""
    return [v, 0.3 * cosine - x - 0.2 * heyoka.par[0] * v**2]


def lugre(x: object, v: object, cosine: object, z: object) -> list:
    """Friction with bristles."""
    rate = v - 100 / (0.5 + 0.3 * heyoka.exp(-((v / 0.2) ** 2))) * (heyoka.par[0] * v) * z
    return [v, 1.5 * cosine - 2 * x - 100 * z - 0.4 * v, rate]


BUILT_IN = f"""[restoring]
law = "linear"
stiffness = "1 N/m"
[contact]
law = "none"
[drive]
law = "harmonic"
amplitude = "0.3 m"
ratio = {FREQUENCY:g}
"""

MACHINES = [
    Machine(
        "cubic spring",
        HEAD
        + '[restoring]\nlaw = "expression"\nforce = "k*(a*cos(phase) - x) + k3*(a*cos(phase) - x)^3"\n'
        + 'a = "0.3 m"\nk = "1 N/m"\nk3 = "1 N/m^3"\n[force.damper]\nforce = "-c*v"\nc = "0.1 N s/m"\n'
        + FREE
        + CLOCK
        + RUN,
        HEAD
        + BUILT_IN
        + '[friction]\nlaw = "viscous"\ndamping = "0.1 N s/m"\n[effect.cubic_spring]\nstiffness = "1 N/m^3"\n'
        + RUN,
        cubic,
    ),
    Machine(
        "quadratic drag",
        HEAD
        + '[restoring]\nlaw = "expression"\nforce = "k*(a*cos(phase) - x)"\na = "0.3 m"\nk = "1 N/m"\n'
        + '[force.drag]\nforce = "-c*v*abs(v)"\nc = "0.2 N s^2/m^2"\n'
        + FREE
        + CLOCK
        + RUN,
        HEAD
        + BUILT_IN
        + '[friction]\nlaw = "none"\n[effect.quadratic_drag]\ncoefficient = "0.2 N s^2/m^2"\n'
        + RUN,
        drag,
        by_sign=True,
    ),
    Machine(
        "tanh friction",
        HEAD
        + '[restoring]\nlaw = "expression"\nforce = "-k*x"\nk = "1 N/m"\n'
        + '[force.other]\nforce = "f*cos(phase) - a*tanh(v/v0)"\nf = "1 N"\na = "0.3 N"\nv0 = "0.1 m/s"\n'
        + FREE
        + CLOCK
        + RUN,
        "",
        tanh,
    ),
    Machine(
        "LuGre",
        HEAD
        + '[restoring]\nlaw = "expression"\nforce = "-k*x"\nk = "2 N/m"\n'
        + '[force.other]\nforce = "f*cos(phase) - s0*z - s2*v"\nf = "1.5 N"\n'
        + 's0 = "100 N/m"\ns2 = "0.4 N s/m"\n'
        + '[state.z]\nrate = "v - s0/(fc + (fs - fc)*exp(-(v/vs)^2))*abs(v)*z"\nstart = "0 m"\n'
        + 's0 = "100 N/m"\nfc = "0.5 N"\nfs = "0.8 N"\nvs = "0.2 m/s"\n'
        + FREE
        + CLOCK
        + RUN,
        "",
        lugre,
        states=1,
        by_sign=True,
    ),
]


class Peer:
    """heyoka's Taylor integration in batches of `batch` lanes, or one by one if that is 0."""

    def __init__(self, machine: Machine, tolerance: float, batch: int) -> None:
        self.machine, self.lanes = machine, max(batch, 1)
        names = heyoka.make_vars("x", "v", "z")[: 2 + machine.states]
        rates = machine.rates(names[0], names[1], heyoka.cos(FREQUENCY * heyoka.time), *names[2:])
        count = len(names)
        events = []
        if machine.by_sign:
            make_event = heyoka.t_event_batch if batch else heyoka.t_event
            # heyoka copies a bound method with its object, but no closure
            turn = self.turn
            if batch:
                events = [make_event(names[1], callback=lambda _solver, sign, lane: turn(sign, lane))]
            else:
                events = [make_event(names[1], callback=lambda _solver, sign: turn(sign))]
        make = heyoka.taylor_adaptive_batch if batch else heyoka.taylor_adaptive
        shape = (count, batch) if batch else (count,)
        equations = list(zip(names, rates, strict=True))
        words = {"t_events": events} if events else {}
        self.solver = make(equations, np.zeros(shape), tol=tolerance, **words)
        self.state = self.solver.state.reshape(count, self.lanes)
        self.pars = self.solver.pars.reshape(-1, self.lanes)

    def turn(self, sign: int, lane: int = 0) -> bool:
        """The velocity of a lane changes its sign."""
        self.pars[0, lane] = sign
        return True

    def run(self, starts: np.ndarray) -> np.ndarray:
        """Ends (x, v) of starts (x, v)."""
        ends = np.empty((len(starts), 2))
        for first in range(0, len(starts), self.lanes):
            chosen = starts[np.minimum(first + np.arange(self.lanes), len(starts) - 1)]
            self.state[:2] = chosen.T
            self.state[2:] = 0
            if self.machine.by_sign:
                self.pars[0] = np.copysign(1.0, chosen[:, 1])
                self.solver.reset_cooldowns()
            if self.lanes > 1:
                self.solver.set_time(np.zeros(self.lanes))
            else:
                self.solver.time = 0.0
            self.solver.propagate_until(DURATION)
            here = slice(first, min(first + self.lanes, len(starts)))
            ends[here] = self.state[:2].T[: here.stop - here.start]
        return ends
