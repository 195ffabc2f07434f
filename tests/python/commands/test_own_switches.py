# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Forces by expressions in which several functions switch at one position, as those of a damped stop."""

import h5py
import numpy as np
import pytest
from program import succeed

STOP = """
[body]
mass = 1
[force.weight]
force = "-0.5*body.mass"
[force.spring]
force = "-k*x - c*v"
k = "20 N/m"
c = "0.2 N s/m"
[force.stop]
force = "{force}"
k = "5000 N/m"
d = "0.3 s/m"
[force.shaker]
force = "f*cos(phase)"
f = "2 N"
[drive]
law = "expression"
period = "1 s"
[start]
x0 = 0.1
[run]
duration = {duration}
[attractors]
sample = 16
[[axis]]
name = "x0"
from = 0.02
to = 0.2
count = 4
[[axis]]
name = "v0"
from = -1
to = 1
count = 4
"""
ONCE = "max(-k*x*(1 - d*v), 0)"
#: The same force: where the first function switches, others are zero as well, and their signs are rounding.
TWICE = [
    "if(x < 0, max(-k*x*(1 - d*v), 0), 0)",
    "max(if(x < 0, -k*x*(1 - d*v), 0), 0)",
    "if(x > 0, 0, if(2*x > 0, 5, -k*x*(1 - d*v)))",
    "if(sin(x) < 0, max(-k*x*(1 - d*v), 0), 0)",
    "if(x - 1 < -1, max(-k*((x - 1) + 1)*(1 - d*v), 0), 0)",
    "if(x < 0, max(-k*x*(1 - d*v), 0)*if(x*3 < 0, 1, 7), max(k*min(x, 0), 0))",
]


@pytest.mark.parametrize("force", TWICE)
def test_functions_that_switch_at_one_position(separatrix, tmp_path, force) -> None:
    last = []
    for one in (ONCE, force):
        (tmp_path / "case.toml").write_text(STOP.format(force=one, duration=5))
        succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", folder=tmp_path)
        with h5py.File(tmp_path / "out.h5") as file:
            last.append([file["x"][-1], file["v"][-1]])
    np.testing.assert_allclose(last[1], last[0], rtol=0, atol=1e-13)


@pytest.mark.parametrize("lanes", ["auto", "off"])
def test_lanes_leave_such_positions_to_the_event_loop(separatrix, tmp_path, lanes) -> None:
    labels = []
    for one in (ONCE, TWICE[0]):
        (tmp_path / "case.toml").write_text(STOP.format(force=one, duration=40))
        output = succeed(
            separatrix,
            "basin",
            "case.toml",
            "-o",
            "map.h5",
            "--force",
            "--set",
            f'integrator.lanes="{lanes}"',
            folder=tmp_path,
        )
        with h5py.File(tmp_path / "map.h5") as file:
            labels.append(file["attractor"][()])
        assert "given up" not in output.out
    np.testing.assert_array_equal(labels[1], labels[0])
