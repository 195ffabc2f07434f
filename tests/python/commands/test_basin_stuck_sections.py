# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A cycle of slips and sticks is one attractor wherever the section lies.

Also where the body sticks there with more than sliding friction could hold: any kick would set it sliding.
"""

import pytest
import separatrix as sx

CASE = """
body = { mass = 0.8762, gravity = 1 }
restoring = { law = "linear", stiffness = 2.8669 }
friction = { law = "coulomb", kinetic_coefficient = 0.1352, static_coefficient = 0.5538 }
drive = { law = "fourier", cosine = [1.0, -0.3145], sine = [0.0, -0.1936], ratio = 0.137 }
run.duration = 600
"""


@pytest.mark.parametrize("angle", [0.0, 0.4, 0.8, 1.5, 5.5])
def test_a_cycle_is_one_attractor_of_every_section(separatrix, angle):
    case = sx.Case.from_text(CASE).with_(drive__angle=angle)
    result = sx.basin(case, x0=(-2, 2, 5), v0=(-2, 2, 5), progress=False)
    (one,) = result.separatrix.attractors.itertuples()
    assert (one.regime, one.period, one.share) == ("sticking", 1, 1.0)
    # the slips alone contract
    assert one.multiplier == pytest.approx(0.22656, abs=1e-4)
    assert (result["settle_time"] < 600).all()
