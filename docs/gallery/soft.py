# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How hard is hard?

The rigid wall is an idealisation. Here the wall is a spring and a damper that take the same part of the
energy, stiffer from panel to panel. At thirty times the stiffness of the spring there are no petals. At a
thousand times they open, but the second motion is not periodic. At thirty thousand times they look like
those of the rigid wall, yet half of the starts settle on a motion of another period. Restitution and
stiffness have to be known before a map can be relied on.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import separatrix as sx
from separatrix import style

points = int(sys.argv[1]) if sys.argv[1:] else 120
case = sx.load("petals.toml")
colours = np.array([[0.85, 0.85, 0.85], [0.0, 0.447, 0.698], [0.0, 0.62, 0.45], [0.902, 0.624, 0.0]])
stiffness = (30.0, 1000.0, 30000.0)
cases = [
    case.with_(
        contact={
            "law": "kelvin_voigt_restitution",
            "stiffness": k,
            "restitution": 0.8,
            "tension": 0,
            "upper": 0,
        }
    )
    for k in stiffness
]
with style.context():
    figure, panels = plt.subplots(2, 2, figsize=(6.9, 5.6), layout="constrained", sharex=True, sharey=True)
    rigid = sx.basin(case, x0=points, v0=points).period.values
    names = [*(f"wall {k:g} times as stiff as the spring" for k in stiffness), "rigid wall"]
    for panel, one, name in zip(panels.flat, [*cases, None], names, strict=True):
        period = rigid if one is None else sx.basin(one, x0=points, v0=points).period.values
        panel.imshow(
            colours[np.clip(period, 0, 3)].transpose(1, 0, 2),
            origin="lower",
            extent=(-2.5, 0, -3, 3),
            aspect="auto",
        )
        panel.set_title(name)
        print(f"{name}: {np.mean(period != rigid):.1%} of the starts settle on another period")
    for panel in panels[1]:
        panel.set_xlabel("$x_0$ (m)")
    for panel in panels[:, 0]:
        panel.set_ylabel("$v_0$ (m/s)")
    labels = ("not periodic up to 16", "period 1", "period 2", "period 3 and more")
    handles = [plt.Rectangle((0, 0), 1, 1, color=colour) for colour in colours]
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    figure.savefig("soft.png", dpi=180)
