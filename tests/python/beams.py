# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A beam as finite elements and by its modes; orbits with one impact a period of any linear structure."""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

# Angular frequencies of a clamped-free beam of unit length, stiffness and mass; every mode, mass-normalised,
# moves the tip by 2.
RATIOS = (
    np.array(
        [
            brentq(lambda b: np.cos(b) * np.cosh(b) + 1, np.pi * (k - 0.7), np.pi * (k - 0.3))
            for k in range(1, 9)
        ]
    )
    ** 2
)


def cantilever(elements: int) -> tuple[np.ndarray, np.ndarray]:
    """Return M and K of a clamped-free Euler beam, all of its measures one: (w, w') of each node."""
    h, size = 1 / elements, 2 * (elements + 1)
    bend = [[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]
    inertia = [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]
    length = np.outer([1, h, 1, h], [1, h, 1, h])
    k, m = np.array(bend) * length / h**3, np.array(inertia) * length * h / 420
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    for element in range(elements):
        rows = slice(2 * element, 2 * element + 4)
        mass[rows, rows] += m
        stiffness[rows, rows] += k
    return mass[2:, 2:], stiffness[2:, 2:]


def single_impact_orbits(mass, damping, stiffness, force, omega, row, stop, restitution):  # noqa: ANN001, ANN201
    """Return (impact speed, phase, state after) of the orbits with one impact a period, admissible or not.

    Force cos(omega t), stop of row.q from above: g = -(1+e)(I - Phi)^-1 Phi d is the echo of the jump, and
    the impact speed solves (stop - a V)^2 + ((1 - b) V/omega)^2 = A_p^2, a quadratic.
    """
    n = len(mass)
    inverse = np.linalg.inv(mass)
    flow = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    phi = expm(flow * 2 * np.pi / omega)
    d = np.concatenate([np.zeros(n), inverse @ row / (row @ inverse @ row)])
    g = -(1 + restitution) * np.linalg.solve(np.eye(2 * n) - phi, phi @ d)
    a, b = row @ g[:n], row @ g[n:]
    steady = np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping, force)
    amplitude = row @ steady
    roots = np.roots([a**2 + ((1 - b) / omega) ** 2, -2 * stop * a, stop**2 - abs(amplitude) ** 2])
    orbits = []
    for speed in roots[np.isreal(roots) & (roots.real > 0)].real:
        angle = np.arctan2(-(1 - b) * speed / (omega * abs(amplitude)), (stop - a * speed) / abs(amplitude))
        phase = angle - np.angle(amplitude)
        turn = np.exp(1j * phase)
        before = np.concatenate([np.real(steady * turn), np.real(1j * omega * steady * turn)]) + speed * g
        orbits.append((speed, phase, before - (1 + restitution) * speed * d))
    return orbits
