# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Duffing's two motions.

A spring that stiffens as it is stretched bends the resonance over: at one drive there is a small motion
and a large one. Nearly all starts find the large one here. The basin of the small one is a drop with a
tail that winds round the plane, thinner with each turn.
"""

import math
import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 90
omega, samples = 2.0, 200
force = [2.0 * math.cos(2 * math.pi * k / samples) for k in range(samples)]
case = sx.Case.from_dict(
    {
        "title": "Duffing's oscillator",
        "body": {"mass": 1},
        "restoring": {"law": "linear", "stiffness": 1},
        "effect": {"cubic_spring": {"stiffness": 1}},
        "friction": {"law": "viscous", "damping": 0.1},
        "drive": {
            "law": "measured_force",
            "interval": 2 * math.pi / omega / samples,
            "force": force,
            "periodic": 1,
        },
        "run": {"duration": 400.0},
    }
)
result = sx.basin(case, x0=(-4.0, 4.0, points), v0=(-6.0, 6.0, points))
print(result.separatrix.attractors[["share", "period", "amplitude", "multiplier"]].to_string())
result.separatrix.save("duffing", formats=["png"], shade=True, size=(130, 90), caption="none", dpi=180)
