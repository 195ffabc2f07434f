# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The same map of a structure in lanes, bit for bit, however the work is shared, stopped and gone on with."""

import subprocess
import time
from pathlib import Path

import h5py
import pytest
from program import differences, succeed, tiles_done, write_case

# The first body rubs on the ground; the last meets a stop, and the chatter there is left to the event loop.
CHAIN = """
title = "Chain of three"

[body.first]
mass = 1.0

[body.second]
mass = 1.0

[body.third]
mass = 1.0

[spring.ground]
between = ["first"]
stiffness = 400.0
damping = 0.2

[spring.left]
between = ["first", "second"]
stiffness = 400.0
damping = 0.2

[spring.right]
between = ["second", "third"]
stiffness = 400.0
damping = 0.2

[friction.base]
between = ["first"]
force = 2.0

[contact.stop]
between = ["third"]
law = "newton"
restitution = 0.6
upper = 0.05

[drive.shaker]
law = "force"
body = "third"
amplitude = 8.0
frequency = 8.0

[watch]
body = "third"

[run]
duration = 30.0
window = 7.5

[[axis]]
name = "x0"
from = -0.2
to = 0.05
count = 23

[[axis]]
name = "v0"
from = -2.0
to = 2.0
count = 31
"""
COMMAND = ["basin", "case.toml"]
FINE = [
    *COMMAND,
    *(f"--set={word}" for word in ("axis[1].count=230", "axis[2].count=310", "grid.tile=[5, 5]")),
]


@pytest.fixture(scope="module")
def reference(separatrix, tmp_path_factory) -> Path:
    """The map by one process with the widest vectors."""
    folder = tmp_path_factory.mktemp("structure")
    write_case(folder, CHAIN)
    succeed(separatrix, *COMMAND, "-o", "map.h5", folder=folder)
    return folder / "map.h5"


@pytest.mark.parametrize("width", [2, 4])
def test_the_width_of_the_vectors_does_not_matter(separatrix, tmp_path, monkeypatch, reference, width):
    monkeypatch.setenv("SEPARATRIX_LANE_WIDTH", str(width))
    write_case(tmp_path, CHAIN)
    succeed(separatrix, *COMMAND, "-o", "map.h5", folder=tmp_path)
    assert differences(reference, tmp_path / "map.h5") == []


@pytest.mark.parametrize(("ranks", "tile"), [(2, "[1, 31]"), (3, "[4, 5]"), (0, "[7, 3]")])
def test_neither_ranks_nor_tiles_matter(mpi_separatrix, tmp_path, reference, ranks, tile):
    write_case(tmp_path, CHAIN)
    command = [*COMMAND, "--set", f"grid.tile={tile}", "-o", "map.h5"]
    succeed(mpi_separatrix, *command, folder=tmp_path, ranks=ranks)
    assert differences(reference, tmp_path / "map.h5") == []


def test_a_run_that_is_stopped_and_goes_on_gives_the_same(separatrix, tmp_path):
    write_case(tmp_path, CHAIN)
    succeed(separatrix, *FINE, "-o", "whole.h5", folder=tmp_path)
    process = subprocess.Popen([separatrix, *FINE, "-o", "map.h5"], cwd=tmp_path, stdout=subprocess.DEVNULL)
    part, deadline = tmp_path / "map.h5.part", time.monotonic() + 30
    while not part.exists() or tiles_done(part) < 5:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.terminate()
    assert process.wait(10) == 75
    assert 5 <= tiles_done(part) < 46 * 62
    succeed(separatrix, *FINE, "-o", "map.h5", "--resume", folder=tmp_path)
    assert differences(tmp_path / "whole.h5", tmp_path / "map.h5") == []


def test_lanes_and_the_event_loop_report_the_same(separatrix, tmp_path, reference):
    write_case(tmp_path, CHAIN)
    alone = ["--set", 'integrator.lanes="off"', "-o", "map.h5"]
    succeed(separatrix, *COMMAND, *alone, folder=tmp_path)
    with h5py.File(reference) as one, h5py.File(tmp_path / "map.h5") as other:
        for name in ("attractor", "period", "settle_time"):
            assert (one[name][()] == other[name][()]).all()
        assert len(set(one["settle_time"][()].ravel())) > 3
