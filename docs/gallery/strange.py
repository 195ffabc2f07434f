# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A strange motion, seen from the wall.

A little faster, at the ratio 2.8, the machine of the petals never repeats. On the left its motion is
seen once in each period of the drive; on the right at each impact, the speed over the phase of the
drive. Slow impacts are near grazing: there the set is stretched without bound, which is what makes this
chaos another one than that of smooth machines.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import separatrix as sx
from separatrix import style

RATIO = 2.8

periods = 200 * int(sys.argv[1]) if sys.argv[1:] else 20000
case = sx.load("petals.toml").with_({"drive.ratio": RATIO})
period = 2 * np.pi / RATIO
motion = sx.trajectory(case, -1.0, 0.3, 0.0, duration=periods * period, samples=2)
settled = motion.time.values > 100 * period
section = settled & (np.arange(motion.time.size) % 2 == 0)
impact = (motion.event_kind.values == 1) & (motion.event_time.values > 100 * period)
phase = motion.event_time.values[impact] / period % 1 * 360
speed = motion.event_v_before.values[impact]
print(f"{section.sum()} periods of the drive, {impact.sum()} impacts, the slowest at {speed.min():.1e} m/s")
with style.context():
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.4), layout="constrained")
    left.plot(motion.x.values[section], motion.v.values[section], ",", color="#0072b2")
    left.set(xlabel="$x$ (m)", ylabel="$v$ (m/s)", title="once per period")
    right.plot(phase, speed, ",", color="#b04a00")
    right.set(
        xlabel="phase of the drive (deg)",
        ylabel="speed of impact (m/s)",
        title="at each impact",
        xlim=(0, 360),
    )
    figure.savefig("strange.png", dpi=200)
