# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of a motor that are killed go on, on other ranks, to the same bits."""

import time
from pathlib import Path

import life
import pytest
from program import succeed

CASE = Path(__file__).resolve().parents[2] / "examples/motor_impact.toml"
STARTS = ("axis[1].count=8", "axis[2].count=8")
PLANE = (
    "axis=[{name='motor.voltage', from=6, to=8, count=4},"
    " {name='motor.inertia', from=0.04, to=0.06, count=4}]",
)
SETTINGS = (
    "grid.tile=[2, 2]", "run.duration=8", "run.window=2", 'run.stop="duration"', "attractors.sample=8",
)  # fmt: skip


@pytest.mark.parametrize(("ranks", "axes"), [(2, STARTS), (3, PLANE)], ids=["starts", "plane"])
def test_killed_maps_go_on(separatrix, mpi_separatrix, tmp_path, monkeypatch, ranks, axes):
    """One rank is killed in the middle of a map, over starts and over voltage and inertia."""
    command = ["basin", "case.toml", *(f"--set={one}" for one in (*axes, *SETTINGS)), "-o", life.NAME]
    monkeypatch.setattr(life, "RUN", command)
    whole, folder = tmp_path / "whole", tmp_path / "killed"
    for path in (whole, folder):
        path.mkdir()
        (path / "case.toml").write_text(CASE.read_text())
    succeed(separatrix, *command, folder=whole, timeout=300)
    process = life.launch(mpi_separatrix, folder, ranks)
    while process.poll() is None and not (life.stage(folder) == "fill" and life.tiles_of(folder)[0] > 0):
        time.sleep(0.02)
    life.kill(process, life.ranks_of(process, ranks)[-1:])
    assert life.stage(folder) in ("fill", "finalise", "done")
    if life.stage(folder) != "done":
        life.resume(mpi_separatrix, folder, 5 - ranks)
    assert life.content_hash(folder / life.NAME) == life.content_hash(whole / life.NAME)
