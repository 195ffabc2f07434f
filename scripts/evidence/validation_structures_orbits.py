# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions with one impact a period of a linear structure, in closed form."""

import numpy as np
from scipy.linalg import expm


def orbits(frequency, mass, damping, stiffness, force, row, gap, loss) -> list[tuple]:
    """Motions with one impact a period: speed, phase, position and velocity just after it, by the quadratic.

    The machine is M q'' + C q' + K q = force cos(frequency t) with a stop at row q = gap.
    """
    m, c, k = (np.atleast_2d(np.asarray(a, float)) for a in (mass, damping, stiffness))
    row, force, n = np.asarray(row, float), np.asarray(force, float), len(m)
    turn = np.linalg.inv(m)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-turn @ k, -turn @ c]])
    once = expm(system * 2 * np.pi / frequency)
    kick = np.concatenate([np.zeros(n), turn @ row / (row @ turn @ row)])
    back = -(1 + loss) * np.linalg.solve(np.eye(2 * n) - once, once @ kick)
    a, b = row @ back[:n], row @ back[n:]
    response = np.linalg.solve(k - frequency**2 * m + 1j * frequency * c, force)
    reach = row @ response
    # (gap - a V)^2 + ((1 - b) V/frequency)^2 = |reach|^2
    found = []
    for speed in np.roots([a**2 + ((1 - b) / frequency) ** 2, -2 * gap * a, gap**2 - abs(reach) ** 2]):
        phase = np.arctan2(-(1 - b) * speed / frequency, gap - a * speed) - np.angle(reach)
        steady = response * np.exp(1j * phase)
        state = back * speed - (1 + loss) * speed * kick
        state += np.concatenate([steady.real, (1j * frequency * steady).real])
        found.append((speed, phase % (2 * np.pi), state[:n], state[n:]))
    return found
