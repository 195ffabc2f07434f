# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame that pounds.

Three storeys sway in the wind beside a neighbour. Free swaying and pounding against the neighbour, once
in each period, are both possible in the same wind. The map is over position and velocity of the roof; the
lower storeys start at rest.
"""

import sys

import numpy as np
import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 120
springs = {
    "ground_1": {"between": ["floor1"], "stiffness": 1e4, "damping": 10.0},
    "first_2": {"between": ["floor1", "floor2"], "stiffness": 1e4, "damping": 10.0},
    "second_3": {"between": ["floor2", "roof"], "stiffness": 1e4, "damping": 10.0},
}
case = sx.Case.from_dict(
    {
        "title": "A frame of three storeys beside a neighbour",
        "body": {"floor1": {"mass": 10.0}, "floor2": {"mass": 10.0}, "roof": {"mass": 8.0}},
        "spring": springs,
        "contact": {"neighbour": {"between": ["roof"], "law": "newton", "restitution": 0.6, "upper": 0.06}},
        "drive": {"wind": {"law": "force", "body": "roof", "amplitude": 40.0, "frequency": 17.0}},
        "watch": {"body": "roof"},
        "run": {"duration": 100.0, "extension": 1},
        "attractors": {"sample": 64},
    }
)
result = sx.basin(case, x0=(-0.1, 0.06, points), v0=(-2.0, 2.0, points))
print(result.separatrix.attractors[["share", "regime", "period", "amplitude"]].to_string())
print(f"without a label: {np.mean(result.attractor.values == 0):.2%}")
result.separatrix.save(
    "pounding", formats=["png"], shade=True, units=["mm"], size=(130, 90), caption="full", dpi=180
)
