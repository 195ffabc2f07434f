# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One body with a motor by SciPy's DOP853, independent of the simulator: events, energy balance.

State: crank angle and speed, position and velocity, current or integral; work of the motor, viscous and dry
losses. An event is found on the dense output and refined by Newton's method on integrations of its step.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from motor_reference_machine import Machine
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq

Guard = Callable[[float, np.ndarray], float]
TOLERANCE, SMALL = 1e-13, 1e-15
PHI, W, X, V, Y, WORK, DAMPING, DRY = range(8)
#: Largest step, in radians of what is fastest; samples of a step in which events are looked for.
LONGEST, SAMPLES = 0.15, 8


@dataclass
class Motion:
    """A state that moves from event to event.

    `slip` is 1 or -1, 0 where the body is held, `turning` likewise. `limited` and `held` state at which limit
    torque and integral of a control are.
    """

    machine: Machine
    z: np.ndarray
    time: float = 0.0
    slip: int = 0
    turning: int = 1
    wall: int = 0
    limited: int = 0
    held: int = 0
    contact: float = 0.0
    events: list = field(default_factory=list)

    def __post_init__(self) -> None:
        """At which limits the motor is, and which way body and crank begin to move."""
        self.choose_limits()
        if self.z[W] == 0:
            self.turning = 0
            self.choose_crank()
        else:
            self.turning = 1 if self.z[W] > 0 else -1
        self.slip = int(np.sign(self.z[V]))
        if self.slip == 0:
            self.choose_body()

    def torque(self, t: float, w: float, y: float) -> tuple[float, float]:
        """Torque and rate of the own state of the motor."""
        torque, own = self.machine.torque(t, w, y)
        if self.limited:
            torque = self.limited * self.machine.motor["torque_limit"]
        return torque, 0.0 if self.held else own

    def rates(self, t: float, z: np.ndarray) -> np.ndarray:
        """Right-hand side in the present mode."""
        m, motor = self.machine, self.machine.motor
        phi, w, x, v = z[:4]
        foot, slope, inertia, inertia_slope = m.mechanism(phi)
        torque, own = self.torque(t, w, z[Y])
        bearing = motor.get("bearing_damping", 0.0) * w
        bearing_dry = motor.get("bearing_friction", 0.0) * self.turning
        spring = m.stiffness * (m.free_length + foot - x)
        dry = m.kinetic * self.slip
        drive = torque - bearing - bearing_dry
        force = spring - dry - m.damping * v
        if m.moment > 0:
            cross, throw = m.moment * math.sin(phi), m.moment * w**2 * math.cos(phi)
            if self.slip and self.turning:
                matrix = np.array([[m.mass, -cross], [-cross, inertia]])
                a, alpha = np.linalg.solve(matrix, [force + throw, drive])
            else:
                a, alpha = force / m.mass, drive / inertia
        else:
            a = force / m.mass
            alpha = (drive - spring * slope - inertia_slope * w**2 / 2) / inertia
        a, alpha = (a if self.slip else 0.0), (alpha if self.turning else 0.0)
        turning = w if self.turning else 0.0
        losses = m.damping * v**2 + bearing * w, dry * v + bearing_dry * w
        return np.array([turning, alpha, v if self.slip else 0.0, a, own, torque * w, *losses])

    def energy(self) -> float:
        """Kinetic energy and that of the spring."""
        m = self.machine
        phi, w, x, v = self.z[:4]
        foot, _, inertia, _ = m.mechanism(phi)
        energy = (inertia * w**2 + m.mass * v**2 + m.stiffness * (m.free_length + foot - x) ** 2) / 2
        return energy - m.moment * math.sin(phi) * w * v

    def hold(self, t: float, z: np.ndarray) -> float:
        """Force on the body that friction has to hold."""
        m = self.machine
        foot, _, inertia, _ = m.mechanism(z[PHI])
        force = m.stiffness * (m.free_length + foot - z[X])
        if m.moment > 0 and self.turning:
            motor = m.motor
            torque = self.torque(t, z[W], z[Y])[0] - motor.get("bearing_damping", 0.0) * z[W]
            alpha = (torque - motor.get("bearing_friction", 0.0) * self.turning) / inertia
            force += m.moment * (z[W] ** 2 * math.cos(z[PHI]) + alpha * math.sin(z[PHI]))
        return force

    def crank_hold(self, t: float, z: np.ndarray) -> float:
        """Torque on the crank that its bearing has to hold."""
        m = self.machine
        foot, slope, _, _ = m.mechanism(z[PHI])
        spring = m.stiffness * (m.free_length + foot - z[X])
        torque = self.torque(t, 0.0, z[Y])[0]
        if m.moment == 0:
            return torque - spring * slope
        if not self.slip:
            return torque
        force = spring - m.kinetic * self.slip - m.damping * z[V]
        return torque + m.moment * math.sin(z[PHI]) * force / m.mass

    def choose_body(self) -> None:
        """Mode of a body at rest."""
        m, force = self.machine, self.hold(self.time, self.z)
        self.wall = 1 if self.z[X] >= m.upper else -1 if self.z[X] <= m.lower else 0
        self.slip = int(np.sign(force)) if abs(force) > m.static else 0
        if self.slip == self.wall:
            self.slip = 0
        if self.slip:
            self.wall = 0

    def choose_crank(self) -> None:
        """Whether the bearing holds the crank."""
        torque = self.crank_hold(self.time, self.z)
        held = abs(torque) <= self.machine.motor.get("bearing_friction", 0.0)
        self.turning = 0 if held else int(np.sign(torque))

    def choose_limits(self) -> None:
        """Limits of a speed control."""
        m = self.machine.motor
        limit = m.get("torque_limit", 0.0)
        if limit == 0:
            return
        command = self.machine.torque(self.time, self.z[W], self.z[Y])[0]
        self.limited = int(np.sign(command)) if abs(command) > limit else 0

    def control(self) -> Iterator[tuple[str, Guard]]:
        """Guards of a limited speed control."""
        m = self.machine.motor
        limit = m.get("torque_limit", 0.0)
        if limit == 0:
            return

        def command(t: float, z: np.ndarray) -> float:
            return self.machine.torque(t, z[W], z[Y])[0]

        if self.limited:
            yield "follow", lambda t, z: limit - self.limited * command(t, z)
        else:
            yield "limit_up", lambda t, z: command(t, z) - limit
            yield "limit_down", lambda t, z: -command(t, z) - limit
        if self.held:
            yield "resume", lambda t, z: self.held * (z[W] - self.machine.supply(t))
        else:
            yield "hold_up", lambda _t, z: m["integral"] * z[Y] - limit
            yield "hold_down", lambda _t, z: -m["integral"] * z[Y] - limit

    def guards(self) -> Iterator[tuple[str, Guard]]:
        """Functions that cross zero from below at an event."""
        m, s, d = self.machine, self.slip, self.turning
        yield from self.control()
        if s:
            yield "turn", lambda _t, z: -s * z[V]
            if s > 0 and math.isfinite(m.upper):
                yield "impact_upper", lambda _t, z: z[X] - m.upper
            if s < 0 and math.isfinite(m.lower):
                yield "impact_lower", lambda _t, z: m.lower - z[X]
        else:
            if self.wall <= 0:
                yield "up", lambda t, z: self.hold(t, z) - m.static
            if self.wall >= 0:
                yield "down", lambda t, z: -self.hold(t, z) - m.static
        if d:
            yield "standstill", lambda _t, z: -d * z[W]
        else:
            level = m.motor.get("bearing_friction", 0.0)
            yield "crank_up", lambda t, z: self.crank_hold(t, z) - level
            yield "crank_down", lambda t, z: -self.crank_hold(t, z) - level

    def run(self, until: float) -> None:
        """Moves to a time [s]."""
        ramp = self.machine.motor.get("ramp_time", 0.0)
        while self.time < until:
            end = min(until, ramp) if self.time < ramp else until
            name = self.to_event(end)
            if name:
                self.happen(name)

    def to_event(self, until: float) -> str:
        """Moves to the next event, or to the time, then ''."""
        guards = list(self.guards())
        fastest = max(abs(self.z[W]), math.sqrt(self.machine.stiffness / self.machine.mass), 1.0)
        longest = min((until - self.time) / 4, LONGEST / fastest)
        solver = DOP853(self.rates, self.time, self.z, until, rtol=TOLERANCE, atol=SMALL, max_step=longest)
        before = np.array([f(self.time, self.z) for _, f in guards])
        while solver.status == "running":
            start, z0 = solver.t, solver.y.copy()
            solver.step()
            dense = solver.dense_output()
            times = np.linspace(start, solver.t, SAMPLES + 1)
            for t0, t1 in pairwise(times):
                z1 = dense(t1)
                after = np.array([f(t1, z1) for _, f in guards])
                crossed = np.flatnonzero((before < 0) & (after >= 0))
                before = after
                if crossed.size:
                    roots = [root(dense, guards[i][1], t0, t1) for i in crossed]
                    first = int(np.argmin(roots))
                    self.refine(start, z0, roots[first], guards[crossed[first]][1])
                    return guards[crossed[first]][0]
        self.time, self.z = solver.t, solver.y
        return ""

    def refine(self, start: float, z0: np.ndarray, time: float, guard: Guard) -> None:
        """Takes the event near a time, from the beginning of its step."""
        for _ in range(3):
            z = z0
            if time > start:
                z = solve_ivp(self.rates, (start, time), z0, "DOP853", rtol=TOLERANCE, atol=SMALL).y[:, -1]
            step = 1e-6
            rate = self.rates(time, z)
            ahead, behind = (guard(time + one, z + one * rate) for one in (step, -step))
            slope = (ahead - behind) / (2 * step)
            if not abs(slope) > 0 or abs(guard(time, z) / slope) > 1e-6:
                break
            time -= guard(time, z) / slope
        self.time, self.z = time, z.copy()

    def happen(self, name: str) -> None:
        """Takes the state past an event."""
        z, m = self.z, self.machine
        if name.startswith("impact"):
            z[X] = m.upper if name.endswith("upper") else m.lower
            self.impact(name)
        elif name == "turn":
            z[V] = 0.0
            self.choose_body()
            self.note("turning_point" if self.slip else "stick", 0.0)
        elif name in ("up", "down"):
            kind = "barrier_release" if self.wall else "release"
            self.slip, self.wall = (1 if name == "up" else -1), 0
            self.note(kind, 0.0)
        elif name == "standstill":
            z[W] = 0.0
            self.choose_crank()
        elif name.startswith("crank"):
            self.turning = 1 if name == "crank_up" else -1
        else:
            self.change_control(name)
        if m.moment > 0:
            if not self.turning:
                self.choose_crank()
            if not self.slip and abs(self.hold(self.time, z)) > m.static:
                was = self.wall
                self.choose_body()
                if self.slip:
                    self.note("barrier_release" if was else "release", 0.0)

    def change_control(self, name: str) -> None:
        """What ends or begins at a limit of the control."""
        if name.startswith("limit"):
            self.limited = 1 if name == "limit_up" else -1
        elif name.startswith("hold"):
            self.held = 1 if name == "hold_up" else -1
        elif name in ("follow", "resume"):
            # With a held integral both happen at the reference speed, where the command is at the limit.
            self.limited, self.held = 0, 0

    def impact(self, name: str) -> None:
        """Newton's law; an unbalance throws the crank."""
        z, m = self.z, self.machine
        before, energy = z[V], self.energy()
        self.note(name, before)
        z[V] = -m.restitution * before
        if m.moment > 0:
            z[W] += m.moment * math.sin(z[PHI]) * (z[V] - before) / m.motor["inertia"]
            self.turning = 1 if z[W] > 0 else -1
        self.slip = int(np.sign(z[V]))
        if self.slip == 0:
            self.choose_body()
            self.note("turning_point" if self.slip else "stick", 0.0)
        self.contact += energy - self.energy()

    def note(self, kind: str, v: float) -> None:
        """Adds an event: kind, time, angle, speed, position, velocity before."""
        self.events.append((kind, self.time, self.z[PHI], self.z[W], self.z[X], v))


def root(dense: Callable, guard: Guard, low: float, high: float) -> float:
    """Zero of a guard on a dense output between two times."""
    if guard(low, dense(low)) >= 0:
        return low
    return brentq(lambda t: guard(t, dense(t)), low, high, xtol=1e-15)
