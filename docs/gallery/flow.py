# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Flow between two walls.

The same oscillator between two walls, harder and with less damping. Three motions share the plane: one
that never touches a wall, one that hits both once a period, and one that takes three periods. The smooth
folds are starts whose way to the motion is short; where the folds are drawn out into threads, a start
has bounced many times before it was caught.
"""

import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 1000
result = sx.basin("flow.toml", x0=points, v0=points)
print(result.separatrix.attractors[["share", "regime", "period", "event_word", "multiplier"]].to_string())
result.separatrix.save(
    "flow",
    formats=["png"],
    shade=True,
    size=(130, 95),
    caption="short",
    dpi=200,
)
