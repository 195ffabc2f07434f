# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Regimes of the published machine, and the motion of one experiment on it."""

import math
from dataclasses import dataclass, field

import numpy as np
from simulator import NOWHERE, Machine, V, X, simulate, simulate_pieces, state

GRAVITY = 9.81
STIFFNESS = 9 * math.pi**2
ANGLE = math.radians(191.1)
COSINE = (0.09495, 0.01, -0.02003)
SINE = (0.0, 0.02849, -0.02686)
FINE = 1600
"""Least steps per drive period of a record."""


@dataclass(frozen=True)
class Regime:
    """A machine as its owner believes it to be, and the drive ratios of its experiments."""

    friction: tuple[str, ...]
    """What the base case has: coulomb, viscous or both."""
    coefficient: float
    damping: float
    restitution: float
    upper: float
    ratios: tuple[float, float]
    spacing: float
    """Least distance of two ratios."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Parameters of the machine that whoever looks for an effect has to refit."""
        return ("stiffness", *self.friction, "restitution", "upper", "scale")

    def machine(self) -> Machine:
        """The machine of the base case; its drive has yet no frequency."""
        return Machine(
            mass=1,
            stiffness=STIFFNESS,
            free_length=0.4,
            mean=0.31055,
            scale=1,
            angle=ANGLE,
            coulomb=self.coefficient * GRAVITY,
            viscous=self.damping,
            restitution=self.restitution,
            upper=self.upper,
            lower=-NOWHERE,
        ).copy(cosine=COSINE, sine=SINE)


REGIMES = {
    "published": Regime(("coulomb",), 0.2, 0.0, 0.5, 1.1, (0.7, 1.32), 0.12),
    "damped": Regime(("coulomb", "viscous"), 0.1, 1.0, 0.6, 0.95, (0.7, 1.32), 0.12),
    "viscous": Regime(("viscous",), 0.0, 1.5, 0.5, 1.05, (0.7, 1.32), 0.12),
    "wild": Regime(("coulomb",), 0.05, 0.0, 0.8, 0.71, (0.77, 0.9), 0.025),
    "rough": Regime(("coulomb",), 0.05, 0.0, 0.65, 0.71, (0.8, 0.97), 0.03),
}


@dataclass
class Experiment:
    """Conditions of one record."""

    ratio: float
    """Drive frequency over the natural frequency of the *base case*."""
    phase: float
    """Crank angle at the first sample [rad]."""
    x0: float
    v0: float
    settling: int
    """Drive periods from the start to the first sample."""
    samples_per_period: int
    periods: int
    sensor: dict[str, float] = field(default_factory=dict)
    """sensor_bias [m], sensor_gain [1], sensor_delay [s] of the position; sensor_lag: time constant [s] of a
    low pass of first order; sensor_curved and sensor_cubic: what square and cube of the signal over its
    standard deviation add to it."""
    scale: float = 1.0
    """Amplitude of the drive over that of the machine."""

    @property
    def frequency(self) -> float:
        """Of the drive [rad/s]."""
        return self.ratio * math.sqrt(STIFFNESS)

    @property
    def interval(self) -> float:
        """Time between samples [s]."""
        return 2 * math.pi / self.frequency / self.samples_per_period

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.periods * self.samples_per_period + 1

    def driven(self, machine: Machine) -> Machine:
        """The machine with the drive of this experiment."""
        return machine.copy(frequency=self.frequency, phase=self.phase, scale=self.scale * machine.scale)

    def substeps(self, steps_per_period: int) -> int:
        """Steps between two samples."""
        return -(-steps_per_period // self.samples_per_period)

    def states(self, driven: Machine, steps_per_period: int = FINE) -> tuple[np.ndarray, int]:
        """States at the samples, time 0 at the first, and the number of impacts in the record."""
        before = self.settling * self.samples_per_period
        substeps = self.substeps(steps_per_period)
        begin = (-before * self.interval, self.interval, before + self.count, substeps)
        start = state(driven, self.x0, self.v0)
        states, impacts = simulate(driven, start, *begin)
        if before:
            _, earlier = simulate(driven.copy(), start, *begin[:2], before + 1, substeps)
            impacts -= earlier
        return states[before:], impacts

    def observe(self, driven: Machine, states: np.ndarray, steps_per_period: int = FINE) -> np.ndarray:
        """Position and velocity (count, 2) as a sensor without noise shows them."""
        seen = states[:, [X, V]].copy()
        delay = self.sensor.get("sensor_delay", 0.0)
        if delay > 0:
            seen[:, X] = self._delayed(driven, states, delay, self.substeps(steps_per_period))
        if self.sensor.get("sensor_lag", 0.0) > 0:
            seen[:, X] = self._filtered(driven, states, self.substeps(steps_per_period))
        curved, cubic = self.sensor.get("sensor_curved", 0.0), self.sensor.get("sensor_cubic", 0.0)
        if curved or cubic:
            middle, deviation = seen[:, X].mean(), seen[:, X].std()
            u = (seen[:, X] - middle) / deviation
            seen[:, X] += deviation * (curved * u**2 + cubic * u**3)
        seen[:, X] *= 1 + self.sensor.get("sensor_gain", 0.0)
        seen[:, X] += self.sensor.get("sensor_bias", 0.0)
        return seen

    def _delayed(self, driven: Machine, states: np.ndarray, delay: float, substeps: int) -> np.ndarray:
        """Positions `delay` before the samples; before the first one, with the acceleration there."""
        whole = math.ceil(delay / self.interval)
        rest = whole * self.interval - delay
        starts = np.ascontiguousarray(states[: len(states) - whole])
        t0 = np.arange(len(starts)) * self.interval
        first = np.arange(0, 2 * len(starts) + 1, 2)
        ends, _ = simulate_pieces(driven, starts, t0, first, max(rest, 1e-12), substeps)
        earlier = self._before(states, np.arange(whole) * self.interval - delay)
        return np.concatenate([earlier, ends[1::2, X]])

    def _before(self, states: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Positions at times before the first sample, at time 0, with the acceleration after it."""
        acceleration = (states[1, V] - states[0, V]) / self.interval
        return states[0, X] + t * (states[0, V] + 0.5 * t * acceleration)

    def _filtered(self, driven: Machine, states: np.ndarray, substeps: int) -> np.ndarray:
        """Positions behind a low pass, exact for a position that is linear between the steps."""
        step = self.interval / substeps
        x = simulate(driven, states[0], 0.0, step, (len(states) - 1) * substeps + 1, 1)[0][:, X]
        share = step / self.sensor["sensor_lag"]
        forgets = np.exp(-share)
        late, new = (1 - forgets) / share - forgets, 1 - (1 - forgets) / share
        lag = self.sensor["sensor_lag"]
        seen = np.empty_like(x)
        # of the motion before the first sample
        seen[0] = (
            self._before(states, np.array([-lag]))[0]
            + 0.5 * lag**2 * (states[1, V] - states[0, V]) / self.interval
        )
        for i in range(1, len(x)):
            seen[i] = forgets * seen[i - 1] + late * x[i - 1] + new * x[i]
        return seen[::substeps]
