#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# heyoka 7.13.2, taylor_adaptive. A driven block with smoothed dry friction, v' = cos(1.2 t) - x - 0.3 tanh(v/w), the usual way to
# give a smooth integrator stick-slip. The right-hand side is analytic.
#
# Guess before trying: with tolerances of 1e-9 and 1e-15 the ends agree with a reference to some multiple of these; the steps get
# short where the velocity passes zero.
# Seen: no warning, and x at 50 s wrong by 0.0008 and 0.035 for w = 0.1, by 0.27 and 0.62 for w = 0.01, of an amplitude of about 2:
# the smaller tolerance is the worse one. Outside the layer tanh is 1 to the last bits, so that the Taylor coefficients at the start of a step, from which its length
# follows, do not know of the layer ahead, and a step goes over it. A cap on the step (max_delta_t) gives the reference.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check heyoka==7.13.2 numpy==2.4.6 scipy==1.17.1
cd "$folder"
venv/bin/python > seen.txt << 'PYTHON'
import heyoka as hy
import numpy as np
from scipy.integrate import solve_ivp

DURATION = 50.0


def taylor(width, tolerance, **cap):
    x, v = hy.make_vars("x", "v")
    force = hy.cos(1.2 * hy.time) - x - 0.3 * hy.tanh(v / width)
    flight = hy.taylor_adaptive([(x, v), (v, force)], [0.0, 0.0], tol=tolerance)
    outcome = flight.propagate_until(DURATION, **cap)[0]
    return flight.state[0], str(outcome).split(".")[-1]


def reference(width):
    def rates(t, y):
        return [y[1], np.cos(1.2 * t) - y[0] - 0.3 * np.tanh(y[1] / width)]

    return solve_ivp(rates, (0, DURATION), [0, 0], "DOP853", rtol=1e-12, atol=1e-13, max_step=2e-3).y[0, -1]


print("heyoka", hy.__version__)
for width in (0.1, 0.01):
    expected = reference(width)
    print(f"width {width}: reference x = {expected:.3f}")
    for tolerance, least in ((1e-9, 1e-4), (1e-15, 1e-2)):
        end, outcome = taylor(width, tolerance)
        print(f"  tolerance {tolerance:g}: {outcome}, error above {least:g}: {abs(end - expected) > least}")
    end, _ = taylor(width, 1e-15, max_delta_t=2e-3)
    print(f"  tolerance 1e-15, steps of at most 0.002: error below 1e-9: {abs(end - expected) < 1e-9}")
PYTHON
cat seen.txt
diff seen.txt - << 'EXPECTED'
heyoka 7.13.2
width 0.1: reference x = 1.835
  tolerance 1e-09: time_limit, error above 0.0001: True
  tolerance 1e-15: time_limit, error above 0.01: True
  tolerance 1e-15, steps of at most 0.002: error below 1e-9: True
width 0.01: reference x = 1.826
  tolerance 1e-09: time_limit, error above 0.0001: True
  tolerance 1e-15: time_limit, error above 0.01: True
  tolerance 1e-15, steps of at most 0.002: error below 1e-9: True
EXPECTED
