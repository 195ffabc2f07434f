# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The peers that are driven from Python: heyoka, one by one and in batches, and SciPy."""

import math
from collections.abc import Callable

import heyoka
import numpy as np
from published_case import HARMONICS, Machine, Outcomes
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


class Friction:
    """What a body does at a turning point."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.a, self.b = tuple(machine.cosine), tuple(machine.sine)

    def spring(self, time: float, x: float) -> float:
        """Acceleration by the spring alone."""
        tau = self.machine.frequency * time + self.machine.angle
        (a1, a2, a3), (b1, b2, b3) = self.a, self.b
        c, s = math.cos(tau), math.sin(tau)
        c2, s2 = 2 * c * c - 1, 2 * s * c
        c3, s3 = c2 * c - s2 * s, s2 * c + c2 * s
        drive = a1 * c + b1 * s + a2 * c2 + b2 * s2 + a3 * c3 + b3 * s3
        return self.machine.stiffness * (self.machine.rest + drive - x)

    def direction(self, time: float, x: float) -> int:
        """Sign of the sliding that begins, 0 if friction holds the body."""
        spring = self.spring(time, x)
        return 0 if abs(spring) <= self.machine.friction else 1 if spring > 0 else -1

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


class Heyoka:
    """Taylor integration with terminal events, in batches of `batch` lanes, or one by one if that is 0.

    Parameters per lane: h, q in x' = h v, v' = h (spring) + q. Sliding has h = 1 and q = the friction. Where
    the body sticks, h = 0, q = 1 and v counts up from minus the time to release; the event v = 0 ends it.
    Without `events` it is another problem, the flow alone, which bounds the speed that events leave.
    """

    def __init__(self, machine: Machine, tolerance: float, batch: int, events: bool = True) -> None:
        self.machine, self.batch, self.lanes = machine, batch, max(batch, 1)
        self.friction = Friction(machine)
        equations, wall, v = self.problem()
        hit, turn = self.callbacks()
        upward = heyoka.event_direction.positive
        if batch:
            wanted = [
                heyoka.t_event_batch(wall, callback=hit, direction=upward),
                heyoka.t_event_batch(v, callback=turn),
            ]
            start, parameters = np.zeros((len(equations), batch)), np.zeros((2, batch))
            make = heyoka.taylor_adaptive_batch
        else:
            wanted = [
                heyoka.t_event(wall, callback=lambda solver, sign: hit(solver, sign, 0), direction=upward),
                heyoka.t_event(v, callback=lambda solver, sign: turn(solver, sign, 0)),
            ]
            start, parameters = [0.0] * len(equations), [0.0, 0.0]
            make = heyoka.taylor_adaptive
        self.events = wanted if events else []
        self.solver = make(equations, start, pars=parameters, tol=tolerance, t_events=self.events)
        # views of the solver's memory: quicker to index than its arrays, and callbacks are most of the time
        self.state = memoryview(self.solver.state.reshape(-1, self.lanes))
        self.pars = memoryview(self.solver.pars.reshape(-1, self.lanes))
        self.impacts, self.sticks = [0] * self.lanes, 0

    def problem(self) -> tuple[list, heyoka.expression, heyoka.expression]:
        """Equations and what vanishes at events; the harmonics are oscillators, which callbacks can read."""
        machine = self.machine
        x, v = heyoka.make_vars("x", "v")
        names = [f"{kind}{k}" for kind in "ds" for k in range(1, HARMONICS + 1)]
        drive, shift = np.reshape(heyoka.make_vars(*names), (2, HARMONICS))
        speeds = [(k + 1) * machine.frequency for k in range(HARMONICS)]
        spring = machine.stiffness * (machine.rest + sum(drive) - x)
        equations = [(x, heyoka.par[0] * v), (v, heyoka.par[0] * spring + heyoka.par[1])]
        equations += [(drive[k], speeds[k] * shift[k]) for k in range(HARMONICS)]
        equations += [(shift[k], -speeds[k] * drive[k]) for k in range(HARMONICS)]
        return equations, x - machine.barrier, v

    def callbacks(self) -> tuple[Callable[..., bool], Callable[..., bool]]:
        """What happens at the barrier and at v = 0; closures, because heyoka makes copies of objects."""
        machine, bound = self.machine, self.machine.friction
        stiffness, rest, restitution = machine.stiffness, machine.rest, machine.restitution

        def hit(_solver: object, _sign: int, lane: int) -> bool:
            self.state[1, lane] *= -restitution
            self.pars[1, lane] = bound
            self.impacts[lane] += 1
            return True

        def turn(solver: object, _sign: int, lane: int) -> bool:
            state, pars = self.state, self.pars
            spring = stiffness * (rest + state[2, lane] + state[3, lane] + state[4, lane] - state[0, lane])
            if abs(spring) > bound or pars[0, lane] == 0.0:
                pars[0, lane], pars[1, lane] = 1.0, -bound if spring > 0 else bound
                state[1, lane] = 0.0
            else:
                self.stick(solver, lane)
            return True

        return hit, turn

    def stick(self, solver: heyoka.taylor_adaptive_dbl | heyoka.taylor_adaptive_batch_dbl, lane: int) -> None:
        """Hold a lane until its release."""
        time, x = float(np.atleast_1d(solver.time)[lane]), self.state[0, lane]
        self.sticks += 1
        self.pars[0, lane], self.pars[1, lane] = 0.0, 1.0
        self.state[1, lane] = time - self.friction.release(time, x)

    def run(self, starts: np.ndarray) -> Outcomes:
        """Run every start; their number is a multiple of the batch."""
        machine, solver = self.machine, self.solver
        found = np.empty((len(starts), 4))
        drive = self.drive_at_zero()
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
            state[:2], state[2:] = starts[chunk].T, drive[:, None]
            pars[0], pars[1] = 1.0, -np.sign(state[1]) * machine.friction
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
        self.machine, self.tolerance, self.friction = machine, tolerance, Friction(machine)

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
