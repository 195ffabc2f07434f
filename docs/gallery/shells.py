# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shells.

With restitution 0.9 instead of 0.8 the petals dissolve. The second motion now takes twelve periods of
the drive, and its basin consists of threads within that of the first. Lightness, the time to settle,
shows shells around one attractor that would not be seen in two flat colours.
"""

import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 700
case = sx.load("petals.toml").with_({"contact.restitution": 0.9, "run.duration": 1000.0})
result = sx.basin(case, x0=points, v0=points)
print(result.separatrix.attractors[["share", "regime", "period", "multiplier"]].to_string())
result.separatrix.save("shells", formats=["png"], shade=True, size=(130, 95), caption="short", dpi=200)
