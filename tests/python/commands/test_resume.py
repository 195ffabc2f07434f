# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A run that was stopped or killed goes on to the same file."""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from program import change_tile, differences, listing, run, succeed, tiles_done, write_case

# A map that takes two ranks some seconds, in many tiles: one by one, because lanes would be done too soon.
LONG = [
    *("basin", "case.toml", "--set", 'run.stop="duration"', "--set", "grid.tile=[8, 8]"),
    *("--set", 'integrator.lanes="off"'),
    *("--set", "axis[1].count=120", "--set", "axis[2].count=104", "--set", "run.duration=50"),
]
TILES = 15 * 13
SHORT = ["basin", "case.toml"]


@pytest.fixture(scope="module")
def reference(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the long run when nothing disturbs it."""
    folder = tmp_path_factory.mktemp("reference")
    write_case(folder)
    succeed(separatrix, *LONG, "-o", "map.h5", folder=folder)
    return folder / "map.h5"


def start(program: Path, folder: Path, ranks: int, *more: str) -> subprocess.Popen:
    """Start the long run and wait until it has its working file and some tiles."""
    command = ["mpirun", "-n", str(ranks)] if ranks else []
    log = (folder / "log").open("w")
    process = subprocess.Popen(
        [*command, program, *LONG, *more, "-o", "map.h5"],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=subprocess.STDOUT,
    )
    deadline = time.monotonic() + 30
    part = folder / "map.h5.part"
    while not part.exists() or tiles_done(part) < 5:
        assert process.poll() is None, (folder / "log").read_text()
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return process


def children(process: subprocess.Popen) -> list[int]:
    """The ranks that an mpirun has started."""
    return list(map(int, Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()))


def finish(program: Path, folder: Path, reference: Path, ranks: int, least: int = 5) -> None:
    """Resume the run; it must not begin anew and must end with the reference's content."""
    done = tiles_done(folder / "map.h5.part")
    assert least <= done < TILES
    outcome = succeed(program, *LONG, "-o", "map.h5", "--resume", folder=folder, ranks=ranks)
    assert f"{done} of {TILES} tiles were done before" in outcome.out
    assert differences(reference, folder / "map.h5") == []
    assert not (folder / "map.h5.part").exists()


@pytest.mark.parametrize("number", [signal.SIGUSR1, pytest.param(signal.SIGUSR2, marks=pytest.mark.long)])
def test_a_signal_to_mpirun_stops_all_ranks(mpi_separatrix, tmp_path, reference, number):
    write_case(tmp_path)
    process = start(mpi_separatrix, tmp_path, 2)
    process.send_signal(number)
    assert process.wait(10) == 75
    assert "stopped early" in (tmp_path / "log").read_text()
    assert not (tmp_path / "map.h5").exists()
    finish(mpi_separatrix, tmp_path, reference, 3)


def test_a_signal_stops_a_process_alone(separatrix, tmp_path, reference):
    write_case(tmp_path)
    process = start(separatrix, tmp_path, 0)
    process.terminate()
    assert process.wait(10) == 75
    assert not (tmp_path / "map.h5").exists()
    finish(separatrix, tmp_path, reference, 0)


def test_the_time_limit_stops_the_run(mpi_separatrix, tmp_path, reference):
    write_case(tmp_path)
    command = [*LONG, "-o", "map.h5", "--json"]
    limit = 0.2
    # A slow build still searches the attractors then.
    while not (tmp_path / "map.h5.part").exists():
        outcome = run(mpi_separatrix, *command, "--time-limit", limit, folder=tmp_path, ranks=2)
        assert outcome.code == 75
        limit *= 2
    assert '"event": "stopped"' in outcome.out
    assert outcome.messages == []
    assert not (tmp_path / "map.h5").exists()
    finish(mpi_separatrix, tmp_path, reference, 2, least=0)


@pytest.mark.parametrize("ranks", [0, 2])
def test_a_killed_run_goes_on(mpi_separatrix, tmp_path, reference, ranks):
    write_case(tmp_path)
    process = start(mpi_separatrix, tmp_path, ranks)
    for victim in children(process) if ranks else [process.pid]:
        os.kill(victim, signal.SIGKILL)
    assert process.wait(20) == (137 if ranks else -9)
    assert not (tmp_path / "map.h5").exists()
    finish(mpi_separatrix, tmp_path, reference, 2 - ranks)


@pytest.mark.parametrize("stops", [pytest.param(["0.000001"], marks=pytest.mark.long), ["0.5", "0.6"]])
def test_a_run_can_be_stopped_again_and_again(separatrix, tmp_path, reference, stops):
    write_case(tmp_path)
    before = 0
    for i, limit in enumerate(stops):
        more = ["--resume"] if i else []
        outcome = run(separatrix, *LONG, "-o", "map.h5", "--time-limit", limit, *more, folder=tmp_path)
        assert outcome.code == 75
        # Stopped while attractors are searched there is no working file yet.
        part = tmp_path / "map.h5.part"
        done = tiles_done(part) if part.exists() else 0
        assert done >= before
        before = done
    succeed(separatrix, *LONG, "-o", "map.h5", "--resume", folder=tmp_path)
    assert differences(reference, tmp_path / "map.h5") == []


@pytest.mark.parametrize("kind", ["sweep", pytest.param("points", marks=pytest.mark.long)])
def test_sweeps_and_lists_go_on_as_well(mpi_separatrix, tmp_path, kind):
    write_case(tmp_path)
    starts = [f"{i / 600},{i % 7 - 3}" for i in range(600)]
    (tmp_path / "starts.csv").write_text("\n".join(["x0,v0", *starts]) + "\n")
    command = [kind, "case.toml"]
    if kind == "points":
        command += ["--list", "starts.csv", "--csv", "out.csv"]
    succeed(mpi_separatrix, *command, "-o", "whole.h5", folder=tmp_path)
    table = tmp_path / "out.csv"
    whole = table.read_bytes() if table.exists() else b""
    table.unlink(missing_ok=True)
    stopped = run(mpi_separatrix, *command, "-o", "map.h5", "--time-limit", "0.01", folder=tmp_path, ranks=2)
    assert stopped.code == 75
    assert not (tmp_path / "map.h5").exists()
    assert not table.exists()
    succeed(mpi_separatrix, *command, "-o", "map.h5", "--resume", folder=tmp_path, ranks=2)
    assert differences(tmp_path / "whole.h5", tmp_path / "map.h5") == []
    assert whole == (table.read_bytes() if table.exists() else b"")


@pytest.fixture(scope="module")
def half_done(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run that was stopped half-way."""
    folder = tmp_path_factory.mktemp("half_done")
    write_case(folder)
    process = start(separatrix, folder, 0)
    process.terminate()
    assert process.wait(10) == 75
    (folder / "log").unlink()
    return folder


@pytest.fixture
def stopped(half_done: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    shutil.copytree(half_done, tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.mark.parametrize(
    "change", ["contact.restitution=0.6", "axis[1].count=119", "attractors.seed=2", "grid.tile=[8, 9]"]
)
def test_another_case_cannot_go_on(separatrix, stopped, change):
    before = listing(stopped)
    command = [*LONG, "--set", change, "-o", "map.h5", "--resume"]
    outcome = run(separatrix, *command, folder=stopped)
    assert outcome.code == 76
    assert "'map.h5.part'" in outcome.messages[0]
    assert listing(stopped) == before


def test_another_command_cannot_go_on(separatrix, stopped):
    before = listing(stopped)
    outcome = run(separatrix, "sweep", "case.toml", "-o", "map.h5", "--resume", folder=stopped)
    assert outcome.code == 76
    assert listing(stopped) == before


def test_a_stopped_run_is_not_thrown_away(separatrix, stopped, reference):
    before = listing(stopped)
    outcome = run(separatrix, *LONG, "-o", "map.h5", folder=stopped)
    assert (outcome.code, outcome.out) == (73, "")
    assert "--resume" in outcome.err
    assert "--force" in outcome.err
    assert listing(stopped) == before
    outcome = succeed(separatrix, *LONG, "-o", "map.h5", "--force", folder=stopped)
    assert "done before" not in outcome.out
    assert differences(reference, stopped / "map.h5") == []


def test_a_new_title_does_not_hinder(separatrix, stopped, reference):
    succeed(separatrix, *LONG, "--set", 'title="New"', "-o", "map.h5", "--resume", folder=stopped)
    assert set(differences(reference, stopped / "map.h5")) <= {"@title"}


def test_damaged_tiles_are_computed_again(separatrix, stopped, reference):
    part = stopped / "map.h5.part"
    before = tiles_done(part)
    change_tile(part, "amplitude")
    outcome = succeed(separatrix, *LONG, "-o", "map.h5", "--resume", folder=stopped)
    assert f"{before - 1} of {TILES} tiles were done before" in outcome.out
    assert differences(reference, stopped / "map.h5") == []


def test_the_working_file_can_be_looked_at_but_is_not_a_result(separatrix, stopped):
    outcome = succeed(separatrix, "info", "map.h5.part", folder=stopped)
    assert "complete: 0" in outcome.out
    outcome = run(separatrix, "verify", "map.h5.part", folder=stopped)
    assert (outcome.code, outcome.out) == (74, "")
    assert "not complete" in outcome.err


def test_without_a_run_to_resume_one_begins(separatrix, tmp_path):
    write_case(tmp_path)
    succeed(separatrix, *SHORT, "--resume", folder=tmp_path)
    before = listing(tmp_path)
    outcome = run(separatrix, *SHORT, "--resume", folder=tmp_path)
    assert outcome.code == 73
    assert "'case.basin.h5' exists" in outcome.err
    assert listing(tmp_path) == before


def test_a_stop_in_time_is_no_stop(separatrix, tmp_path):
    write_case(tmp_path)
    succeed(separatrix, *SHORT, "--time-limit", 1000, folder=tmp_path)
    assert (tmp_path / "case.basin.h5").exists()
