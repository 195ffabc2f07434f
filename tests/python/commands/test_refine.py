# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of which not every point is computed."""

import json
import os
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest
from program import STACK, differences, run, succeed, tiles_done, write_case

MARKS = ("regime", "attractor", "reason", "period", "event_word")
COARSE = ["--set", "refine.step=8", "--set", "refine.block=32"]
FINE = ["--set", "axis[1].count=97", "--set", "axis[2].count=131"]
# The last origin that stands for a computed point.
CONTRADICTED = 2


def origins(path):
    with h5py.File(path) as file:
        return file["origin"][()]


def wrong(reference, path):
    """Points of a refined map that are not as in the map of which all points are computed."""
    with h5py.File(reference) as whole, h5py.File(path) as refined:
        return np.any([whole[name][()] != refined[name][()] for name in MARKS], axis=0)


@pytest.mark.parametrize("shape", [FINE, ["--set", STACK.replace("count=7", "count=41")]])
def test_a_refined_map_is_the_whole_map(separatrix, tmp_path, shape):
    write_case(tmp_path)
    succeed(separatrix, "basin", "case.toml", *shape, "-o", "whole.h5", folder=tmp_path)
    succeed(separatrix, "basin", "case.toml", *shape, *COARSE, "-o", "refined.h5", folder=tmp_path)
    assert not wrong(tmp_path / "whole.h5", tmp_path / "refined.h5").any()
    inferred = origins(tmp_path / "refined.h5") > CONTRADICTED
    assert inferred.mean() > 0.4
    with h5py.File(tmp_path / "refined.h5") as file, h5py.File(tmp_path / "whole.h5") as whole:
        assert not {"amplitude", "settle_time", "grazing_margin"} & set(file)
        assert file["catalogue/count"][()].tolist() == whole["catalogue/count"][()].tolist()


def test_the_file_states_how_much_was_computed(separatrix, tmp_path):
    write_case(tmp_path)
    command = ["basin", "case.toml", *FINE, *COARSE, "--json"]
    events = {}
    for line in succeed(separatrix, *command, folder=tmp_path).out.splitlines():
        event = json.loads(line)
        events[event["event"]] = event
    origin = origins(tmp_path / "case.basin.h5")
    with h5py.File(tmp_path / "case.basin.h5") as file:
        facts = dict(file["refinement"].attrs)
        names = file["origin"].attrs["flag_meanings"].split()
    assert facts["points_computed"] == (origin <= CONTRADICTED).sum() == events["refined"]["computed"]
    assert facts["points_inferred"] == (origin > CONTRADICTED).sum()
    assert facts["probes_agreed"] == (origin == names.index("probe_agreed")).sum()
    assert facts["probes_contradicted"] == (origin == names.index("probe_contradicted")).sum() == 0
    # Cells of 8 x 8 points over 97 x 131, one probe each.
    assert facts["probes_drawn"] == 13 * 17
    limit = (1 - 0.05 ** (1 / (13 * 17))) * 13 * 17 * 64 / (97 * 131)
    assert facts["wrong_share_upper_limit"] == pytest.approx(limit, rel=1e-9)
    assert events["wrong"]["share_upper_limit"] == facts["wrong_share_upper_limit"]
    stated = json.loads(succeed(separatrix, "info", "case.basin.h5", "--json", folder=tmp_path).out)[
        "refinement"
    ]
    assert stated["points_computed"] == facts["points_computed"]
    assert stated["percent_computed"] == pytest.approx(100 * (origin <= CONTRADICTED).mean())
    assert "refined:" in succeed(separatrix, "info", "case.basin.h5", folder=tmp_path).out


def test_a_killed_run_goes_on_to_the_same_map(mpi_separatrix, tmp_path):
    write_case(tmp_path)
    # Several times longer than the half second after which the first run of tiles is written.
    slow = ["--set", 'run.stop="duration"', "--set", "run.duration=600"]
    command = [
        mpi_separatrix,
        "basin",
        "case.toml",
        *FINE,
        *slow,
        "--set",
        "refine.step=4",
        "--set",
        "refine.block=8",
    ]
    succeed(*command, "-o", "whole.h5", folder=tmp_path, ranks=2)
    with (tmp_path / "log").open("w") as log:
        process = subprocess.Popen([*command, "-o", "map.h5"], cwd=tmp_path, stdout=log, stderr=log)
    part = tmp_path / "map.h5.part"
    deadline = time.monotonic() + 30
    done = 0
    while done < 5:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
        if part.exists():
            done = tiles_done(part)
    os.kill(process.pid, signal.SIGKILL)
    process.wait(20)
    other = run(*command, "--set", "refine.seed=2", "-o", "map.h5", "--resume", folder=tmp_path)
    assert other.code == 76
    outcome = succeed(*command, "-o", "map.h5", "--resume", folder=tmp_path, ranks=3)
    assert "tiles were done before" in outcome.out
    assert differences(tmp_path / "whole.h5", tmp_path / "map.h5") == []


def test_verify_counts_what_was_inferred_wrongly(separatrix, tmp_path):
    write_case(tmp_path)
    # The corners of the only cell have the same attractor, and a bay of another one lies between two of them.
    bay = [
        "--set",
        "axis[1].to=0.7",
        "--set",
        "axis[2].to=4",
        "--set",
        "axis[1].count=65",
        "--set",
        "axis[2].count=65",
    ]
    blind = ["--set", "refine.step=64", "--set", "refine.contrast=1e9", "--set", "refine.seed=2"]
    succeed(separatrix, "basin", "case.toml", *bay, "-o", "whole.h5", folder=tmp_path)
    succeed(separatrix, "basin", "case.toml", *bay, *blind, "-o", "refined.h5", folder=tmp_path)
    missed = wrong(tmp_path / "whole.h5", tmp_path / "refined.h5")
    with h5py.File(tmp_path / "refined.h5") as file:
        assert 0.01 < missed.mean() <= file["refinement"].attrs["wrong_share_upper_limit"]
    checking = ["verify", "refined.h5", "--sample", 100, "--json"]
    facts = json.loads(succeed(separatrix, *checking, "--max-changes", 50, folder=tmp_path).out)
    assert run(separatrix, *checking, folder=tmp_path).code == 77
    assert facts["differing"] == 0
    assert 1 < facts["inferred_differing"] < facts["inferred"] <= 100
    assert facts["labels_changing"] == facts["inferred_differing"]


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("refine.block=24", "a multiple of the step 16"),
        ("refine.step=1", "an integer from 2 to 256"),
        ("refine.probes=0", "an integer from 1 to 256"),
        ("refine.contrast=0", "more than 0.0"),
        ("refine.stride=4", "unknown"),
    ],
)
def test_settings_that_are_refused(separatrix, tmp_path, setting, message):
    write_case(tmp_path)
    outcome = run(separatrix, "basin", "case.toml", "--set", setting, "--validate", folder=tmp_path)
    assert outcome.code == 65
    assert message in outcome.err
