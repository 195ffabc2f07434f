# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Twins.

Two walls at equal distances make the machine its own mirror image: turn it round, shift the drive by
half a period, and nothing has changed. A motion need not share that symmetry. Where it does not, there
are two of it, mirror images of each other. At the ratio 2.8 a pair of motions of period 2 is born like
that, beside the symmetric motion of period 1 and the one without impacts.
"""

import sys

import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 1000
case = sx.load("flow.toml").with_({"drive.ratio": 2.8, "contact.restitution": 0.95})
result = sx.basin(case, x0=points, v0=points)
print(result.separatrix.attractors[["share", "regime", "period", "event_word"]].to_string())
result.separatrix.save("twins", formats=["png"], shade=True, size=(130, 95), caption="short", dpi=200)
