# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Petals on dry ground.

Dry friction under the petals, a twentieth of the amplitude of the spring force. Both motions survive it,
and neither sticks; but the cores of the petals fill with ever thinner rings of both colours. There
friction brings a start almost to rest in front of the wall. A little more or less of it decides in which
period of the drive the first impact occurs.
"""

import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 800
dry = {"law": "coulomb_viscous", "kinetic_coefficient": 0.05, "damping": 0.04}
case = sx.load("petals.toml").with_({"body.gravity": 1.0, "friction": dry})
result = sx.basin(case, x0=points, v0=points)
print(result.separatrix.attractors[["share", "regime", "period", "event_word"]].to_string())
result.separatrix.save(
    "dry", formats=["png"], title="Petals on dry ground", shade=True, size=(130, 95), caption="short", dpi=200
)
