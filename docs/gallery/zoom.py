# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Into the boundary.

The map of the shells, then a tenth of its width, then a hundredth: each step shows as much as the one
before it. The uncertainty exponent measures what this costs a prediction. If a start is known to within
$\\varepsilon$, the share of starts whose end is uncertain is proportional to $\\varepsilon^\\alpha$,
with $\\alpha$ as printed below. A start measured ten times better leaves $10^{-\\alpha}$ of the
uncertainty; with a smooth boundary a tenth would remain. The boundary of the petals is smooth; that of
the shells is not.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import separatrix as sx
from separatrix import style

points = int(sys.argv[1]) if sys.argv[1:] else 360
centre, widths = (-1.26, 0.57), (2.4, 0.24, 0.024)
colours = np.array([[0.0, 0.447, 0.698], [0.902, 0.624, 0.0]])


case = sx.load("petals.toml").with_({"contact.restitution": 0.9, "run.duration": 1000.0})


def window(width, count):
    half = width / 2
    return sx.basin(
        case,
        x0=(centre[0] - half, centre[0] + half, count),
        v0=(centre[1] - half, centre[1] + half, count),
    )


def uncertain(labels, distance):
    """The share of starts with another label at this distance, in points of the map."""
    return np.mean(labels[distance:] != labels[:-distance])


with style.context():
    figure, panels = plt.subplots(1, 3, figsize=(7.5, 2.9), layout="constrained")
    for panel, width, inner in zip(panels, widths, (*widths[1:], None), strict=True):
        result = window(width, points)
        period = result.period.values
        image = np.where((period == 12)[..., None], colours[1], colours[0])
        box = [float(result[name][k]) for name in ("x0", "v0") for k in (0, -1)]
        panel.imshow(image.transpose(1, 0, 2), origin="lower", extent=box, interpolation="nearest")
        panel.set_xlabel("$x_0$ (m)")
        panel.locator_params(nbins=4)
        if inner:
            corner = (centre[0] - inner / 2, centre[1] - inner / 2)
            panel.add_patch(plt.Rectangle(corner, inner, inner, fill=False, color="black", linewidth=1.2))
        distances = np.unique(np.geomspace(1, max(points // 8, 2), 8).astype(int))
        shares = [uncertain(period, distance) for distance in distances]
        exponent = np.polyfit(np.log(distances), np.log(np.maximum(shares, 1e-9)), 1)[0]
        panel.set_title(f"width {width:g} m, exponent {exponent:.2f}")
        share = np.mean(period == 12)
        print(f"width {width:g} m: period 12 from {share:.1%} of the starts, exponent {exponent:.2f}")
    panels[0].set_ylabel("$v_0$ (m/s)")
    figure.savefig("zoom.png", dpi=200)
