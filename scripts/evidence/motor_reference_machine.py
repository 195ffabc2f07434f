# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Equations of one body with a motor, independent of the simulator: mechanisms, torques, ramps."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline, KroghInterpolator

SUPPLIES = {
    "linear": "no_load_speed",
    "kloss": "synchronous_speed",
    "dc": "voltage",
    "pi": "reference",
}


@dataclass
class Machine:
    """Parameters by the names of the case file, and the mechanism by its name."""

    motor: dict
    drive: dict
    mass: float = 1.0
    stiffness: float = 1.0
    free_length: float = 0.0
    kinetic: float = 0.0
    static: float = 0.0
    damping: float = 0.0
    restitution: float = 1.0
    upper: float = math.inf
    lower: float = -math.inf

    @property
    def moment(self) -> float:
        """Static moment of an unbalance [kg m], 0 with a mechanism."""
        return self.drive["moment"] if self.drive["law"] == "unbalance" else 0.0

    def mechanism(self, phi: float) -> tuple[float, float, float, float]:
        """Position of the foot and inertia, each with its derivative by the angle."""
        law = self.drive["law"]
        inertia, foot = self.motor["inertia"], self.motor.get("foot_mass", 0.0)
        if law == "unbalance":
            return 0.0, 0.0, inertia, 0.0
        if law == "crank_lever_rod":
            return self.lever(phi)
        sine, cosine = math.sin(phi), math.cos(phi)
        if law == "harmonic":
            r = self.drive["amplitude"]
            x, x1, x2 = r * cosine, -r * sine, -r * cosine
        else:
            r, rod = self.drive["crank"], self.drive["rod"]
            q = math.sqrt(rod**2 - (r * sine) ** 2)
            q1 = -(r**2) * sine * cosine / q
            q2 = (-(r**2) * (cosine**2 - sine**2) - q1**2) / q
            x, x1, x2 = r * cosine + q - rod, -r * sine + q1, -r * cosine + q2
        return x, x1, inertia + foot * x1**2, 2 * foot * x1 * x2

    def lever(self, phi: float) -> tuple[float, float, float, float]:
        """Slotted lever about the origin and rod to the guide, by angles of lever and rod."""
        d, m = self.drive, self.motor
        e = np.array([math.cos(phi), math.sin(phi)])
        n = np.array([-e[1], e[0]])
        pin = d["pivot_distance"] * np.array([math.cos(d["pivot_angle"]), math.sin(d["pivot_angle"])])
        pin = pin + d["crank"] * e
        square = pin @ pin
        turn = d["crank"] * (pin @ e) / square
        turn2 = d["crank"] * (pin @ n) * (1 - 2 * turn) / square
        u = pin / math.sqrt(square)
        across = np.array([-u[1], u[0]])
        end, end1 = d["lever"] * u, d["lever"] * turn * across
        end2 = d["lever"] * (turn2 * across - turn**2 * u)
        height, side = end[1] - d["guide_height"], d["side"]
        q = math.sqrt(d["rod"] ** 2 - height**2)
        q1 = -height * end1[1] / q
        q2 = -(height * end2[1] + end1[1] ** 2 + q1**2) / q
        x, x1, x2 = d["shift"] + end[0] + side * q, end1[0] + side * q1, end2[0] + side * q2
        rod = -end1[1] / (side * q)
        rod2 = -(end2[1] + side * q1 * rod) / (side * q)
        centre = np.array([(end1[0] + x1) / 2, end1[1] / 2])
        centre2 = np.array([(end2[0] + x2) / 2, end2[1] / 2])
        inertia = m["inertia"] + m["lever_inertia"] * turn**2 + m["rod_mass"] * (centre @ centre)
        inertia += m["rod_inertia"] * rod**2 + m["foot_mass"] * x1**2
        slope = m["lever_inertia"] * turn * turn2 + m["rod_mass"] * (centre @ centre2)
        slope += m["rod_inertia"] * rod * rod2 + m["foot_mass"] * x1 * x2
        return x, x1, inertia, 2 * slope

    def supply(self, t: float) -> float:
        """What a ramp changes: voltage, or speed without torque."""
        m = self.motor
        name = SUPPLIES[m["law"]]
        if t >= m.get("ramp_time", 0.0):
            return m[name]
        begin = m.get("ramp_from", 0.0)
        return begin + (m[name] - begin) * t / m["ramp_time"]

    def torque(self, t: float, w: float, y: float) -> tuple[float, float]:
        """Torque of the motor without a limit, and rate of its own state."""
        m = self.motor
        if m["law"] == "table":
            return float(self.table(w)), 0.0
        supply = self.supply(t)
        if m["law"] == "linear":
            return m["stall_torque"] * (1 - w / supply), 0.0
        if m["law"] == "kloss":
            slip, top = 1 - w / supply, m["breakdown_slip"]
            return 2 * m["breakdown_torque"] * slip * top / (slip**2 + top**2), 0.0
        if m["law"] == "dc":
            excess = supply - m["torque_constant"] * w
            if m.get("inductance", 0.0) == 0:
                return m["torque_constant"] * excess / m["resistance"], 0.0
            return m["torque_constant"] * y, (excess - m["resistance"] * y) / m["inductance"]
        return m["proportional"] * (supply - w) + m["integral"] * y, supply - w

    @cached_property
    def table(self) -> CubicHermiteSpline:
        """A table of the torque: slopes at its knots from five knots, straight on beyond them."""
        at, values = np.array(self.motor["speed"], float), np.array(self.motor["torque"], float)
        slopes = []
        for i, x in enumerate(at):
            first = max(0, min(i - 2, len(at) - 5))
            near = slice(first, first + 5)
            slopes.append(float(KroghInterpolator(at[near], values[near]).derivative(x)))
        far = 1e3 * (1 + abs(at).max())
        low, high = at[0] - far, at[-1] + far
        return CubicHermiteSpline(
            [low, *at, high],
            [values[0] - slopes[0] * far, *values, values[-1] + slopes[-1] * far],
            [slopes[0], *slopes, slopes[-1]],
        )
