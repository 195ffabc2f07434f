# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The map of a body whose equations are on a tape has the same bits for every width of the vectors: two
batches of lanes, one, and a part of one at a time."""

import h5py
import numpy as np
import pytest
from program import differences, succeed

TWO_WELLS = """
[body]
mass = 1
[force.all]
force = "x - x^3 - c*v + f*cos(phase)"
c = 0.3
f = 0.1
[drive]
law = "expression"
period = 5
[[axis]]
name = "x0"
from = -1.5
to = 1.5
count = 15
[[axis]]
name = "v0"
from = -1.2
to = 1.2
count = 14
[run]
duration = 300
"""


@pytest.mark.parametrize("tile", [[15, 14], [3, 6], [3, 11]], ids=str)
def test_same_bits_of_two_batches(separatrix, tmp_path, monkeypatch, tile):
    (tmp_path / "case.toml").write_text(TWO_WELLS)
    for width in (8, 4, 2):
        monkeypatch.setenv("SEPARATRIX_LANE_WIDTH", str(width))
        shape = [] if width == 2 else [f"--set=grid.tile={tile}"]
        succeed(separatrix, "basin", "case.toml", "-o", f"{width}.h5", *shape, folder=tmp_path)
    with h5py.File(tmp_path / "8.h5") as file:
        assert len(np.unique(file["attractor"])) > 1
    assert differences(tmp_path / "8.h5", tmp_path / "2.h5") == []
    assert differences(tmp_path / "4.h5", tmp_path / "2.h5") == []
