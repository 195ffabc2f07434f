# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The eye.

With the wall off the rest position and a fast drive, a small motion fits in before the wall. The eye is
the set of starts from which it is reached without a single impact. The colour is the grazing margin, the
smallest distance at which a turning point has missed the wall: it falls to zero at the lid, where the
motion grazes. The drive is four times as fast as the spring, so four of its turning points fall on each
free oscillation, and the lid has four sides. Beyond it each start has an impact history of its own.
"""

import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 500
case = sx.load("petals.toml").with_(
    {"contact.restitution": 0.8, "contact.upper": 0.25, "drive.ratio": 4.0, "run.extension": 1}
)
result = sx.basin(case, x0=(-1.2, 0.25, points), v0=(-1.5, 1.5, points))
print(result.separatrix.shares("regime").to_string())
result.separatrix.save(
    "eye",
    "grazing_margin",
    formats=["png"],
    size=(130, 95),
    caption="short",
    dpi=200,
    colour_map="cividis",
)
