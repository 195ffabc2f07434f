# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Slide or stick.

A block on a belt, tied by a spring and shaken. Either it slides for ever, or the belt catches it once in
a while and carries it along. The start decides. The boundary between the two has corners, which that of
a smooth machine has not.
"""

import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 140
case = sx.Case.from_dict(
    {
        "title": "A block on a belt, shaken",
        "body": {"block": {"mass": 1}},
        "spring": {"spring": {"between": ["block"], "stiffness": 1, "damping": 0.05}},
        "friction": {"belt": {"between": ["block"], "force": 1, "static_force": 1.5, "velocity": 1}},
        "drive": {"shaker": {"law": "force", "body": "block", "amplitude": 1.5, "frequency": 0.5}},
        "run": {"duration": 750.0},
        "attractors": {"sample": 64},
    }
)
result = sx.basin(case, x0=(-4.0, 4.0, points), v0=(-4.0, 4.0, points))
print(result.separatrix.attractors[["share", "regime", "period", "amplitude"]].to_string())
result.separatrix.save("belt", formats=["png"], shade=True, size=(130, 90), caption="none", dpi=180)
