# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every machine of docs/performance_machines.md: the same map, bit for bit, for other vectors, ranks and
tiles, and after a stop."""

import sys
from pathlib import Path

import pytest
from program import differences, run, succeed

SOURCE = Path(__file__).resolve().parents[3]
sys.path.append(str(SOURCE / "scripts/evidence/bench_peers"))
import rows  # noqa: E402

SMALL = ("axis[1].count=9", "axis[2].count=11", "run.duration=12", "run.window=3", "attractors.sample=16")
STOPPED = 75


ROWS = [pytest.param(row, marks=[pytest.mark.long] * (index % 2)) for index, row in enumerate(rows.ROWS)]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.key)
def test_nothing_but_the_case_matters(separatrix, mpi_separatrix, tmp_path, monkeypatch, row):
    command = ["basin", row.write(tmp_path).name, *(f"--set={word}" for word in SMALL)]
    succeed(separatrix, *command, "-o", "one.h5", folder=tmp_path)
    monkeypatch.setenv("SEPARATRIX_LANE_WIDTH", "2")
    shared = [*command, "--set=grid.tile=[2, 3]", "-o", "two.h5"]
    stopped = run(separatrix, *shared, "--time-limit", "0.01", folder=tmp_path)
    assert stopped.code in (0, STOPPED), stopped
    how = "--resume" if stopped.code == STOPPED else "--force"
    succeed(mpi_separatrix, *shared, how, folder=tmp_path, ranks=2)
    assert differences(tmp_path / "one.h5", tmp_path / "two.h5") == []
