# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor that the machine slows down.

A lever mechanism shakes a body that may hit a stop. Grey dots are the amplitudes at prescribed drive speed,
in sweeps up and down. A motor of limited power does not reach them all. As its no-load speed rises slowly,
the crank speed lags behind until it jumps past the resonance. On the way down it jumps back at another
no-load speed. This is the Sommerfeld effect.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import separatrix as sx
from separatrix.figures.motor import turns

count = int(sys.argv[1]) if sys.argv[1:] else 240
natural = 3 * np.pi
ramp = {"run.duration": float(count), "motor.ramp_time": float(count), "run.window": 5.0}
up = sx.load("runup.toml").with_(ramp)
down = up.with_({"motor.no_load_speed": 8.0, "motor.ramp_from": 20.0, "motor.crank_speed": 20.0})
# the same mechanism with a given speed
text = Path("runup.toml").read_text()
given = sx.Case.from_text(text[: text.index("[motor]")].replace("[drive]", "[drive]\nratio = 1"))
points = min(count, 131)
swept = {"from": 0.7, "to": 2.0, "count": points, "starts": [0, 0]}
ideal = sx.sweep(given.with_({"run.duration": 60.0, "sweep": swept}), "drive.ratio", (0.7, 2.0, points))

figure, (left, right) = plt.subplots(1, 2, figsize=(6.9, 3.2), layout="constrained")
ratio = ideal["drive_ratio"].values
for half in ((ideal["x_max"] - ideal["x_min"]).values / 2).reshape(-1, ratio.size):
    right.plot(ratio, half, ".", color="0.75", markersize=5, label="given speed")
for case, colour, line, name in ((up, "black", "-", "run-up"), (down, "C0", "--", "coast-down")):
    motion = sx.trajectory(case)
    begin, _, speed, half = turns(motion)
    motor = case.resolved["motor"]
    first, last = motor["ramp_from"], motor["no_load_speed"]
    supply = first + (last - first) * begin / motor["ramp_time"]
    left.plot(supply, speed / natural, line, color=colour, linewidth=1, label=name)
    right.plot(speed / natural, half, line, color=colour, linewidth=1, label=name)
    jump = np.argmax(np.abs(np.convolve(speed, [1] * 5 + [-1] * 5, "valid"))) + 5 if speed.size > 10 else 0
    if speed.size:
        print(f"{name}: fastest change near no-load speed {supply[jump]:.1f} rad/s")
left.plot([8, 20], np.array([8, 20]) / natural, color="0.6", linewidth=0.7, label="without load")
left.set(xlabel="no-load speed (rad/s)", ylabel="mean speed of a turn / natural")
right.set(xlabel="mean speed of a turn / natural", ylabel="amplitude of a turn (m)", xlim=(0.7, 2.0))
shown = dict(zip(*right.get_legend_handles_labels()[::-1], strict=True))
figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=3, frameon=False)
left.legend(*(part[-1:] for part in left.get_legend_handles_labels()), frameon=False)
figure.savefig("runup.png", dpi=170)
