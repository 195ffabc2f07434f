# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Islands of periods.

One start, two parameters: the ratio of the drive and the restitution of the wall. Each point of the
plane is a machine of its own; its colour is the period of the motion that it settles on. Broad bands of
period 1, 2 and 3 follow one another as the drive gets faster, hardly aware of the restitution. Between
them lie chaos, which has no period, and islands of every other one.
"""

import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 70
case = sx.load("petals.toml").with_({"start.x0": -1.0, "attractors.max_period": 12})
result = sx.basin(
    case,
    {"drive.ratio": (1.5, 7.5, points), "contact.restitution": (0.3, 0.95, points)},
    x0=None,
    v0=None,
)
print(result.separatrix.shares("period").nlargest(8).round(4).to_string())
result.separatrix.save(
    "islands", "period", formats=["png"], title="Islands of periods", size=(140, 95), caption="short", dpi=180
)
