# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A film strip.

The basins of the oscillator at twelve ratios of the drive, four per cent from the first to the last. A
single motion takes all, until the petals of period 3 open all at once: a fold. Then that motion doubles
its period to 6, to 12, and becomes chaotic. One step on it is gone, and the single motion takes all again.
A machine that is safe at one speed may not be at the next.
"""

import sys

import numpy as np
import separatrix as sx

points = int(sys.argv[1]) if sys.argv[1:] else 200
ratios = np.linspace(2.545, 2.655, 12).round(3)
result = sx.basin("petals.toml", {"drive.ratio": ratios}, x0=points, v0=points)
table = result.separatrix.attractors.reset_index()
for index, group in table.groupby("slice"):
    found = ", ".join(f"period {one.period} {one.share:.1%}" for one in group.itertuples())
    print(f"ratio {ratios[index]:.3f}: {found}")
result.separatrix.save(
    "ratios", "period", formats=["png"], title="The petals open and close", caption="short", dpi=170
)
