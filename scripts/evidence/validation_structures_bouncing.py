# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies without a spring in docs/validation.md: a ball on a table by `branches`, a gear between walls."""

import h5py
import numpy as np
from evidence_program import Program
from evidence_rows import Row


def bouncing(program: Program) -> list[Row]:
    """Where a ball on a vibrating table begins to bounce once in k periods, and where that motion doubles."""
    source, found = "P. J. Holmes (1982), closed form", []
    for loss, k in ((0.5, 1), (0.8, 1), (0.8, 2)):
        least = np.pi * k * (1 - loss) / (1 + loss)
        double = float(np.hypot(least, 2 * (1 + loss**2) / (1 + loss) ** 2))
        ends = (0.97 * least, 1.02 * double)
        points = program.branches("table", "drive.force.amplitude", ends, contact__table__restitution=loss)
        cycles = (points["period"] == k) & (points["impacts"] == 1)
        for label, what, expected in (("SN", "saddle-node", least), ("PD", "period doubling", double)):
            near = points["parameter"][cycles & (points["label"] == label)]
            ours = min(near, key=lambda at, expected=expected: abs(at - expected), default=np.nan)
            bounces = "one bounce per period" if k == 1 else f"one bounce in {k} periods"
            text = f"ball on a table, e = {loss}, {bounces}: {what} at Gamma"
            found.append(Row(source, text, expected, ours, 1e-9))
    return found


def rattle(program: Program) -> list[Row]:
    """Coexisting motions of a gear between two walls."""
    source = "S. L. T. de Souza, I. L. Caldas (2001), values of BasinsCollection"
    with h5py.File(program.run("basin", "gear_rattle")) as file:
        count = np.unique(file["attractor"][:]).size
    return [Row(source, "gear rattle between two walls: coexisting attractors", 2, count, 0)]
