# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log as JSON lines, where ranks run, and the record of how a file was made."""

import json
import os
import subprocess
import time
from pathlib import Path

import h5py
import pytest
from program import FOLD, differences, run, succeed, write_case

COMMAND = ["basin", "case.toml", "-o", "map.h5", "--log", "run.jsonl"]


def events(folder: Path) -> list[dict]:
    """The lines of the log."""
    return [json.loads(line) for line in (folder / "run.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("ranks", [0, 3])
def test_the_log_has_what_stdout_has_and_more(mpi_separatrix, tmp_path, ranks):
    write_case(tmp_path)
    outcome = succeed(mpi_separatrix, *COMMAND, folder=tmp_path, ranks=ranks)
    lines = events(tmp_path)
    messages = [line["message"] for line in lines]
    assert [
        message for message in messages if message in outcome.out.splitlines()
    ] == outcome.out.splitlines()
    named = {line["event"]: line for line in lines}
    assert named["binding"]["ranks"] == max(1, ranks)
    assert named["binding"]["rank_cores"].count(":") == max(1, ranks)
    balance = named["balance"]
    assert len(balance["busy_percent"]) == max(1, ranks)
    assert (
        0 <= balance["busy_percent_min"] <= balance["busy_percent_mean"] <= balance["busy_percent_max"] <= 100
    )
    # 48 bytes a point.
    assert balance["written_bytes"] == 19 * 31 * 48
    assert balance["resident_bytes_max"] > 1e6
    assert ("binding" in outcome.out or "cores" in outcome.out) == (ranks > 1)


def test_bytes_of_a_second_look_are_those_of_its_tiles(mpi_separatrix, tmp_path):
    """The impacting cycle is found by the second look, which writes two tiles of 10 x 10 points again."""
    write_case(tmp_path, FOLD + "[grid]\ntile = [10, 10]\n")
    succeed(mpi_separatrix, *COMMAND, folder=tmp_path, ranks=3)
    balances = [line["written_bytes"] for line in events(tmp_path) if line["event"] == "balance"]
    assert balances == [60 * 60 * 48, (60 * 60 + 200) * 48]


def test_the_log_grows_and_keeps_errors(separatrix, tmp_path):
    write_case(tmp_path)
    succeed(separatrix, *COMMAND, "--quiet", folder=tmp_path)
    first = len(events(tmp_path))
    assert run(separatrix, *COMMAND, folder=tmp_path).code == 73
    assert run(separatrix, *COMMAND, "--force", "--time-limit", "1e-9", folder=tmp_path).code == 75
    lines = events(tmp_path)
    assert [line["event"] for line in lines if line["event"] == "error"] == ["error", "error"]
    assert len(lines) > first
    assert all(line["time"].endswith("Z") and line["seconds"] >= 0 for line in lines)


def test_progress_is_in_a_log_at_once(separatrix, tmp_path):
    write_case(tmp_path)
    fine = ("--set=axis[1].count=4000", "--set=axis[2].count=4000", '--set=run.stop="duration"')
    command = [separatrix, "basin", "case.toml", *fine, "-o", "map.h5", "--progress", "0.05"]
    with (tmp_path / "err.txt").open("w") as log:
        process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=log)
    deadline = time.monotonic() + 30
    while "points" not in (tmp_path / "err.txt").read_text():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.kill()
    process.wait()


def test_progress_of_a_sweep_never_goes_back(separatrix, tmp_path):
    """Both directions are counted as one task."""
    write_case(tmp_path)
    sweep = ("--set=sweep.starts=[0, 0]", "--progress", "1e-6", "--json")
    outcome = succeed(separatrix, "sweep", "case.toml", *sweep, "-o", "sweep.h5", folder=tmp_path)
    events = [json.loads(line) for line in outcome.out.splitlines()]
    done = [(line["done"], line["total"]) for line in events if line.get("of") == "values"]
    assert done == [(number, 14) for number in range(1, 15)]


def test_a_log_that_cannot_be_written(separatrix, tmp_path):
    write_case(tmp_path)
    outcome = run(separatrix, "basin", "case.toml", "--log", "none/run.jsonl", folder=tmp_path)
    assert outcome.code == 73 and "none/run.jsonl" in outcome.err
    outcome = run(separatrix, "basin", "case.toml", "--log", "case.toml", folder=tmp_path)
    assert outcome.code == 64 and "case.toml" in outcome.err
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]


@pytest.mark.parametrize("ranks", [0, 2])
def test_a_log_on_a_full_disk_costs_the_log_alone(mpi_separatrix, tmp_path, ranks):
    """The work is done, and the code reports that not all of what was asked for is there."""
    write_case(tmp_path)
    succeed(mpi_separatrix, *COMMAND, folder=tmp_path)
    full = ["basin", "case.toml", "-o", "full.h5", "--log", "/dev/full"]
    outcome = run(mpi_separatrix, *full, folder=tmp_path, ranks=ranks)
    assert outcome.code == 74
    assert [words in outcome.err for words in ("'/dev/full'", "No space left", "the run is complete")] == [
        True
    ] * 3
    assert "wrote full.h5" in outcome.out
    assert differences(tmp_path / "map.h5", tmp_path / "full.h5") == []
    # What is to be resumed stays so.
    outcome = run(mpi_separatrix, *full, "--force", "--time-limit", "1e-9", folder=tmp_path, ranks=ranks)
    assert outcome.code == 75 and "complete" not in outcome.err


@pytest.mark.parametrize("command", ["basin", "trajectory", "sweep"])
def test_a_debug_build_checks_what_it_has_written(separatrix, build_dir, tmp_path, command):
    write_case(tmp_path)
    debug = "CMAKE_BUILD_TYPE:STRING=Debug" in (build_dir / "CMakeCache.txt").read_text()
    coarse = ["--set", "sweep.step=0.3", "--set", "sweep.starts=[0, 0]"]
    succeed(separatrix, command, "case.toml", *coarse, "--log", "run.jsonl", folder=tmp_path)
    assert ("checked" in {line["event"] for line in events(tmp_path)}) == debug


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_stdout_on_a_full_disk(separatrix, tmp_path, form):
    write_case(tmp_path)
    with Path("/dev/full").open("w") as full:
        command = [separatrix, *COMMAND, *form]
        ended = subprocess.run(command, cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True)
    assert ended.returncode == 74 and "stdout" in ended.stderr
    assert [line["event"] for line in events(tmp_path)][-1] == "error"
    succeed(separatrix, "verify", "map.h5", "--sample", "2", folder=tmp_path)


def test_a_file_states_how_it_was_made(mpi_separatrix, tmp_path):
    write_case(tmp_path)
    os.environ["UCX_TEST_OF_SEPARATRIX"] = "yes"
    succeed(mpi_separatrix, *COMMAND, folder=tmp_path, ranks=2)
    del os.environ["UCX_TEST_OF_SEPARATRIX"]
    with h5py.File(tmp_path / "map.h5") as file:
        record = dict(file["provenance"].attrs)
    assert (record["ranks"], record["host_count"]) == (2, 1)
    assert record["hosts"] == os.uname().nodename
    assert "--log run.jsonl" in record["command_line"]
    assert "-ffp-contract=off" in record["flags"] and "C++" in record["c_flags"]
    variables = record["environment"].split()
    assert "UCX_TEST_OF_SEPARATRIX=yes" in variables
    assert not any(word.startswith("OMPI_MCA_orte_") for word in variables)
    shown = json.loads(succeed(mpi_separatrix, "info", "map.h5", "--json", folder=tmp_path).out)
    for name in ("version", "commit", "compiler", "flags", "c_flags", "mpi", "hosts", "started", "finished"):
        assert shown[name] == record[name]
    assert (shown["ranks"], shown["host_count"]) == (2, 1)
    assert shown["tiles_done"] == shown["tiles"] > 0
