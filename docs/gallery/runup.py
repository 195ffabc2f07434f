# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor that the machine slows down.

A lever mechanism shakes a body that may hit a stop. Grey dots are the amplitudes at given drive speed,
in sweeps up and down. A motor of limited power does not reach them all. As its no-load speed rises slowly,
the crank speed lags behind until it jumps past the resonance. On the way down it jumps back at another
no-load speed. This is the Sommerfeld effect. Lines are means of nine turns.
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


def smooth(values):
    """Return means of nine turns: where impacts are irregular, turns differ."""
    width = min(9, values.size)
    return np.convolve(values, np.full(width, 1 / width), "valid") if width else values


figure, (left, right) = plt.subplots(1, 2, figsize=(6.9, 3.2), layout="constrained")
ratio = ideal["drive_ratio"].values
for half in ((ideal["x_max"] - ideal["x_min"]).values / 2).reshape(-1, ratio.size):
    right.plot(ratio, half, "o", color="0.8", markersize=4, label="given speed")
left.plot([8, 20], np.array([8, 20]) / natural, ":", color="0.5", linewidth=1, label="without load")
for case, colour, line, name in ((up, "black", "-", "run-up"), (down, "0.35", (0, (4, 1.5)), "coast-down")):
    motion = sx.trajectory(case)
    begin, _, speed, half = turns(motion)
    motor = case.resolved["motor"]
    first, last = motor["ramp_from"], motor["no_load_speed"]
    supply = smooth(first + (last - first) * begin / motor["ramp_time"])
    speed, half = smooth(speed) / natural, smooth(half)
    left.plot(supply, speed, color=colour, linestyle=line, linewidth=1.3, label=name)
    right.plot(speed, half, color=colour, linestyle=line, linewidth=1.3, label=name)
    jump = np.argmax(np.abs(np.convolve(speed, [1] * 5 + [-1] * 5, "valid"))) + 5 if speed.size > 10 else 0
    if speed.size:
        print(f"{name}: fastest change near no-load speed {supply[jump]:.1f} rad/s")
        for axes, at in ((left, supply), (right, speed)):
            values = speed if axes is left else half
            ends = [np.clip(jump + step, 0, speed.size - 1) for step in (-3, 3)]
            tail, head = ((at[k], values[k]) for k in ends)
            arrow = {"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0, "linewidth": 0}
            axes.annotate("", head, tail, arrowprops=arrow)
left.set(xlabel="no-load speed (rad/s)", ylabel="crank speed / natural frequency", xlim=(8, 20))
right.set(xlabel="crank speed / natural frequency", ylabel="amplitude (m)", xlim=(0.7, 2.0), ylim=(0, None))
for axes, letter in ((left, "(a)"), (right, "(b)")):
    axes.set_title(letter, loc="left", fontsize="medium")
shown = {}
for axes in (right, left):
    shown |= dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=4, frameon=False)
figure.savefig("runup.png", dpi=170)
