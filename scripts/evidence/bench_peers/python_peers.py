# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The peers that are driven from Python: heyoka, one by one and in batches, and SciPy."""

import math
from collections.abc import Callable

import heyoka
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from machine import HARMONICS, HUNT_CROSSLEY, KELVIN_VOIGT_CUT, RIGID, Machine, Outcomes


class AtRest:
    """What a body does at a turning point."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.a, self.b = tuple(machine.cosine), tuple(machine.sine)
        hold = machine.friction + machine.excess
        self.up, self.down, self.slope = hold + machine.asymmetric, hold - machine.asymmetric, machine.slope

    def foot(self, time: float) -> float:
        """Motion of the foot of the spring about its mean."""
        phi = self.machine.frequency * time
        tau = phi + self.machine.angle + self.machine.ripple * math.sin(phi)
        (a1, a2, a3), (b1, b2, b3) = self.a, self.b
        c, s = math.cos(tau), math.sin(tau)
        c2, s2 = 2 * c * c - 1, 2 * s * c
        c3, s3 = c2 * c - s2 * s, s2 * c + c2 * s
        return a1 * c + b1 * s + a2 * c2 + b2 * s2 + a3 * c3 + b3 * s3

    def spring(self, time: float, x: float) -> float:
        """Acceleration by a linear spring alone."""
        return self.machine.stiffness * (self.machine.rest + self.foot(time) - x)

    def direction_of(self, foot: float, x: float, z: float) -> int:
        """Sign of the sliding that begins, 0 if friction holds the body; z: Dahl's friction."""
        machine = self.machine
        extension = machine.rest + foot - x
        a = machine.stiffness * extension
        a += machine.cubic * extension**3
        if machine.barrier_law and x > machine.barrier:
            a -= machine.barrier_stiffness * (x - machine.barrier)
        if machine.dahl:
            return 1 if a > z else -1
        factor = 1 + self.slope * x
        return 1 if a > factor * self.up else -1 if a < -factor * self.down else 0

    def direction(self, time: float, x: float) -> int:
        """The same at a time."""
        return self.direction_of(self.foot(time), x, 0.0)

    def release(self, time: float, x: float) -> float:
        """When a body that is held at x is let go, at most the duration."""
        step = 2 * math.pi / self.machine.frequency / 128
        held = time
        while self.direction(held + step, x) == 0:
            held += step
            if held >= self.machine.duration:
                return self.machine.duration
        free = held + step
        while True:
            middle = 0.5 * (held + free)
            if not held < middle < free:
                return free
            if self.direction(middle, x) == 0:
                held = middle
            else:
                free = middle


def restitution_of(machine: Machine) -> Callable[[float], float]:
    """Restitution over the speed of an impact."""
    k, (first, second) = machine.restitution, machine.coefficients
    laws = (
        lambda speed: k,
        lambda speed: max(0.0, k - first * speed),
        lambda speed: k * (speed / first) ** -second if speed > first else k,
        lambda speed: min(1.0, max(0.0, 1 - first * speed**0.2 + second * speed**0.4)),
    )
    return laws[int(machine.restitution_law)]


class Heyoka:
    """Taylor integration with terminal events, in batches of `batch` lanes, or one by one if that is 0.

    Parameters per lane: h, the direction of sliding, and 1 on a soft barrier. Sliding has h = 1. Where the
    body sticks, h = 0 and v counts up from minus the time to release; the event v = 0 ends it.
    Without `events` it is another problem, the flow alone, which bounds the speed that events leave.
    """

    def __init__(self, machine: Machine, tolerance: float, batch: int, events: bool = True) -> None:
        if machine.barrier_law == HUNT_CROSSLEY:
            raise ValueError("p^1.5 has no Taylor series at p = 0")
        self.machine, self.batch, self.lanes = machine, batch, max(batch, 1)
        self.at_rest = AtRest(machine)
        self.oscillators = not machine.ripple
        self.z_row = 2 if machine.dahl else None
        equations, surfaces = self.problem()
        directions = heyoka.event_direction
        directions = (directions.positive, directions.any, directions.negative)
        wanted = [
            self.event(surface, callback, direction)
            for surface, callback, direction in zip(surfaces, self.callbacks(), directions, strict=False)
        ]
        self.events = wanted if events else []
        shape = (batch,) if batch else ()
        make = heyoka.taylor_adaptive_batch if batch else heyoka.taylor_adaptive
        self.solver = make(
            equations,
            np.zeros((len(equations), *shape)),
            tol=tolerance,
            t_events=self.events,
        )
        # views of the solver's memory: quicker to index than its arrays, and callbacks are most of the time
        self.state = memoryview(self.solver.state.reshape(-1, self.lanes))
        self.pars = memoryview(self.solver.pars.reshape(-1, self.lanes))
        self.impacts, self.sticks = [0] * self.lanes, 0
        # without dry friction and drag the equations do not know the direction
        self.knows_direction = len(self.pars) > 1

    def event(self, surface: heyoka.expression, callback: Callable[..., bool], direction: object) -> object:
        """A terminal event; one by one the callback gets no lane."""
        if self.batch:
            return heyoka.t_event_batch(surface, callback=callback, direction=direction)
        alone = lambda solver, sign: callback(solver, sign, 0)  # noqa: E731
        return heyoka.t_event(surface, callback=alone, direction=direction)

    def problem(self) -> tuple[list, list]:
        """Equations and what vanishes at events; the harmonics are oscillators, which callbacks can read."""
        machine, h, d, pressed = self.machine, *(heyoka.par[i] for i in range(3))
        x, v, z = heyoka.make_vars("x", "v", "z")
        foot, oscillators = self.oscillating_foot() if self.oscillators else (self.rippled_foot(), [])
        extension, p = machine.rest + foot - x, x - machine.barrier
        a = machine.stiffness * extension
        if machine.cubic:
            a += machine.cubic * extension**3
        if machine.viscous:
            a -= machine.viscous * v
        if machine.asymmetric_viscous or machine.quadratic:
            a -= d * (machine.asymmetric_viscous + machine.quadratic * v) * v
        excess = machine.excess * heyoka.exp(-((v / machine.velocity) ** 2)) if machine.excess else 0.0
        dry = d * (machine.friction + excess) + machine.asymmetric
        if machine.slope:
            dry *= 1 + machine.slope * x
        wall = machine.barrier_stiffness * p + machine.barrier_damping * v
        if machine.barrier_law != RIGID:
            a -= pressed * wall
        equations = [(x, h * v), (v, h * (a - (z if machine.dahl else dry)) + (1 - h))]
        if machine.dahl:
            equations.append((z, h * machine.dahl * (1 - z * d / machine.friction) * v))
        surfaces = [p, v]
        if machine.barrier_law != RIGID:
            surfaces.append(wall if machine.barrier_law == KELVIN_VOIGT_CUT else p)
        return equations + oscillators, surfaces

    def oscillating_foot(self) -> tuple[heyoka.expression, list]:
        """Motion of the foot by oscillators, and their equations."""
        names = [f"{kind}{k}" for kind in "ds" for k in range(1, HARMONICS + 1)]
        drive, shift = np.reshape(heyoka.make_vars(*names), (2, HARMONICS))
        speeds = [(k + 1) * self.machine.frequency for k in range(HARMONICS)]
        equations = [(drive[k], speeds[k] * shift[k]) for k in range(HARMONICS)]
        return sum(drive), equations + [(shift[k], -speeds[k] * drive[k]) for k in range(HARMONICS)]

    def rippled_foot(self) -> heyoka.expression:
        """Motion of the foot over time."""
        machine, phi = self.machine, self.machine.frequency * heyoka.time
        tau = phi + machine.angle + machine.ripple * heyoka.sin(phi)
        return sum(
            machine.cosine[k] * heyoka.cos((k + 1) * tau) + machine.sine[k] * heyoka.sin((k + 1) * tau)
            for k in range(HARMONICS)
        )

    def callbacks(self) -> tuple[Callable[..., bool], ...]:
        """What happens at the barrier, at v = 0 and where a soft barrier lets go; closures, because heyoka
        makes copies of objects."""
        machine, direction_of, z_row = self.machine, self.at_rest.direction_of, self.z_row
        restitution, soft = restitution_of(machine), machine.barrier_law != RIGID
        first, barrier = 3 if machine.dahl else 2, machine.barrier

        def hit(_solver: object, _sign: int, lane: int) -> bool:
            if soft:
                if self.pars[2, lane] == 0.0:
                    self.pars[2, lane] = 1.0
                    self.impacts[lane] += 1
                return True
            self.state[1, lane] *= -restitution(self.state[1, lane])
            if self.knows_direction:
                self.pars[1, lane] = -1.0
            self.impacts[lane] += 1
            return True

        def turn(solver: object, _sign: int, lane: int) -> bool:
            state, pars = self.state, self.pars
            x, z = state[0, lane], state[z_row, lane] if z_row else 0.0
            if self.oscillators:
                foot = state[first, lane] + state[first + 1, lane] + state[first + 2, lane]
            else:
                foot = self.at_rest.foot(self.time_of(solver, lane))
            direction = direction_of(foot, x, z)
            if direction == 0 and pars[0, lane] == 0.0:
                # let go: rounding
                direction = 1 if foot + machine.rest > x else -1
            if direction == 0:
                self.stick(solver, lane)
            else:
                pars[0, lane], state[1, lane] = 1.0, 0.0
                if self.knows_direction:
                    pars[1, lane] = direction
            if soft:
                pars[2, lane] = 1.0 if x > barrier else 0.0
            return True

        def let_go(_solver: object, _sign: int, lane: int) -> bool:
            self.pars[2, lane] = 0.0
            return True

        return hit, turn, let_go

    @staticmethod
    def time_of(solver: object, lane: int) -> float:
        """Time of a lane."""
        return float(np.atleast_1d(solver.time)[lane])

    def stick(self, solver: object, lane: int) -> None:
        """Hold a lane until its release."""
        time, x = self.time_of(solver, lane), self.state[0, lane]
        self.sticks += 1
        self.pars[0, lane] = 0.0
        self.state[1, lane] = time - self.at_rest.release(time, x)

    def run(self, starts: np.ndarray) -> Outcomes:
        """Run every start; their number is a multiple of the batch."""
        machine, solver = self.machine, self.solver
        found = np.empty((len(starts), 4))
        drive = self.drive_at_zero() if self.oscillators else np.empty(0)
        state, pars = np.asarray(self.state), np.asarray(self.pars)
        self.sticks = 0
        for first in range(0, len(starts), self.lanes):
            chunk = slice(first, first + self.lanes)
            if self.batch:
                solver.set_time(np.zeros(self.batch))
            else:
                solver.time = 0.0
            if self.events:
                solver.reset_cooldowns()
            state[:] = 0.0
            state[:2] = starts[chunk].T
            state[len(state) - len(drive) :] = drive[:, None]
            pars[:] = 0.0
            pars[0], pars[1:2] = 1.0, np.sign(state[1])
            self.impacts[:] = [0] * self.lanes
            solver.propagate_until(machine.duration - machine.window)
            before = np.array(self.impacts)
            solver.propagate_until(machine.duration)
            # a lane that is still stuck has the rest of the waiting time in v
            v = np.where(pars[0] > 0, state[1], 0.0)
            found[chunk] = np.column_stack([state[0], v, self.impacts, self.impacts - before])
        x, v, impacts, window_impacts = found.T
        return Outcomes(x, v, impacts.astype(int), window_impacts > 0, self.sticks)

    def drive_at_zero(self) -> np.ndarray:
        """State of the oscillators at crank angle 0."""
        machine, numbers = self.machine, range(HARMONICS)
        turn = [((k + 1) * machine.angle, machine.cosine[k], machine.sine[k]) for k in numbers]
        drive = [a * math.cos(tau) + b * math.sin(tau) for tau, a, b in turn]
        return np.array(drive + [b * math.cos(tau) - a * math.sin(tau) for tau, a, b in turn])


class Scipy:
    """solve_ivp with DOP853 and terminal events, one call per phase."""

    def __init__(self, machine: Machine, tolerance: float) -> None:
        self.machine, self.tolerance, self.friction = machine, tolerance, AtRest(machine)

    def events(self, direction: int) -> list:
        """The turning point and, on the way up, the barrier."""

        def turning(_time: float, y: np.ndarray) -> float:
            return y[1]

        def barrier(_time: float, y: np.ndarray) -> float:
            return y[0] - self.machine.barrier

        turning.terminal = barrier.terminal = True
        turning.direction, barrier.direction = -direction, 1
        return [turning, barrier] if direction > 0 else [turning]

    def phase(self, direction: int, time: float, y: list[float]) -> tuple[float, list[float], bool, bool]:
        """Time and state where a phase ends, if that is the barrier, and if solve_ivp had missed it."""
        machine, spring = self.machine, self.friction.spring

        def derivatives(t: float, y: np.ndarray) -> tuple[float, float]:
            return y[1], spring(t, y[0]) - direction * machine.friction

        solution = solve_ivp(
            derivatives,
            (time, machine.duration),
            y,
            method="DOP853",
            rtol=self.tolerance,
            atol=self.tolerance,
            events=self.events(direction),
            dense_output=True,
        )
        if solution.status < 0:
            raise RuntimeError(solution.message)
        end, state = solution.t[-1], solution.y[:, -1]
        if solution.status == 0:
            return end, list(state), False, False
        if direction > 0 and len(solution.t_events[1]) > 0:
            return end, [machine.barrier, state[1]], True, False
        if state[0] > machine.barrier and y[0] < machine.barrier:
            at = brentq(lambda t: solution.sol(t)[0] - machine.barrier, time, end, xtol=1e-15)
            return at, [machine.barrier, solution.sol(at)[1]], True, True
        return end, [state[0], 0.0], False, False

    def run(self, starts: np.ndarray) -> Outcomes:
        """Run every start."""
        found = [self.trajectory(float(x0), float(v0)) for x0, v0 in starts]
        x, v, impacts, window_impacts, sticks, repaired = np.array(found).T
        return Outcomes(x, v, impacts.astype(int), window_impacts > 0, int(sticks.sum()), int(repaired.sum()))

    def trajectory(self, x: float, v: float) -> tuple[float, float, int, int, int, int]:
        """Final state, impacts, those in the window, stick phases, impacts that solve_ivp had missed."""
        machine, time = self.machine, 0.0
        impacts = window_impacts = sticks = repaired = 0
        while time < machine.duration:
            direction = int(math.copysign(1, v)) if v else self.friction.direction(time, x)
            if direction == 0:
                sticks += 1
                time = self.friction.release(time, x)
                continue
            time, (x, v), hit, missed = self.phase(direction, time, [x, v])
            if hit:
                impacts += 1
                window_impacts += time >= machine.duration - machine.window
                repaired += missed
                v = -machine.restitution * v
        return x, v, impacts, window_impacts, sticks, repaired
