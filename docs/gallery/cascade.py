# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two ways along the ratio.

The stroboscopic section of the oscillator while the drive is slowly made faster, and then slower again.
A single line is a motion of one period; it divides into two, four and more and ends in the grey bands of
chaos, with windows of order among them. Where orange and blue part, the machine does on the way back
what it did not do on the way there.
"""

import sys

import separatrix as sx

count = int(sys.argv[1]) if sys.argv[1:] else 600
case = sx.load("petals.toml").with_(
    {
        "run.duration": 400.0,
        "start.x0": -1.0,
        "sweep": {"from": 2.58, "to": 3.1, "count": count, "samples": 60, "starts": [0, 0]},
    }
)
result = sx.sweep(case, "drive.ratio", (2.58, 3.1, count))
period = result.period.values
print(f"periods on the way up: {sorted(set(period[0].tolist()) - {0})}")
print(
    f"values at which the two ways settle on motions of other periods: {int((period[0] != period[1]).sum())}"
)
result.separatrix.save(
    "cascade",
    "bifurcation",
    formats=["png"],
    title="Up and down the ratio",
    size=(175, 110),
    caption="short",
    dpi=170,
)
