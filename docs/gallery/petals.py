# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Petals.

A mass on a spring oscillates against a wall that stands at its rest position; the drive is 2.6 times as fast
as the spring. Two motions are stable. Both hit the wall once in each period of the drive; one repeats
after a period, the other only after three. Which one a start leads to is shown by its colour; how soon,
by its lightness. Petals are rolled up within petals.

The circle and the squares are the two motions themselves, at the instants at which the foot of the
spring is farthest forward.
"""

import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 1000
result = sx.basin("petals.toml", x0=points, v0=points)
print(result.separatrix.attractors[["share", "regime", "period", "event_word", "multiplier"]].to_string())
result.separatrix.save(
    "petals", formats=["png"], title="Petals", shade=True, size=(130, 95), caption="short", dpi=200
)
