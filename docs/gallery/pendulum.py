# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Left or right.

A damped pendulum is driven so hard that it goes round, one turn per period of the drive. It may go round
to the left or to the right; the two are mirror images, and their basins are wound into each other. The
left edge of the picture is glued to the right one: an angle lives on a circle.
"""

import math
import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 300
omega, samples = 2 / 3, 72
torque = [1.35 * math.cos(2 * math.pi * k / samples) for k in range(samples)]
case = sx.Case.from_dict(
    {
        "title": "A pendulum that goes round",
        "body": {"mass": 1},
        "restoring": {"law": "pendulum", "moment": 1},
        "friction": {"law": "viscous", "damping": 0.5},
        "drive": {
            "law": "measured_force",
            "interval": 2 * math.pi / omega / samples,
            "force": torque,
            "periodic": 1,
        },
        "run": {"duration": 300.0},
    }
)
last = math.pi * (1 - 2 / points)
result = sx.basin(case, x0=(-math.pi, last, points), v0=(-3.0, 3.0, points))
print(result.separatrix.attractors[["share", "period", "rotation_number", "multiplier"]].to_string())
result.separatrix.save(
    "pendulum", formats=["png"], shade=True, units=["deg"], size=(130, 90), caption="none", dpi=180
)
