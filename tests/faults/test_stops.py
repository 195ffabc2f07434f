# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A signal or the time limit stops a run with code 75, soon; after a death the others name the next step."""

import json
import os
import random
import signal
import subprocess
import time
from collections import Counter
from pathlib import Path

import life
import pytest

SEED = 20261124
# A trajectory of this case takes a millisecond; the promise is 2 s and one trajectory.
SOON = 2.0
# So long that a run outlives the second that mpirun takes before it passes SIGTERM on.
SLOW = ["--set", "run.duration=2000"]
# mpirun waits about two seconds when a process has returned another code than 0.
MPIRUN = 2.5


def alive(rank):
    """Whether a process still works."""
    try:
        return Path(f"/proc/{rank}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def stop(process, ranks, send):
    """Send a signal; the code, and the seconds until the ranks have ended and until mpirun has."""
    computing = life.ranks_of(process, ranks)
    started = time.monotonic()
    send(computing)
    while process.poll() is None and any(map(alive, computing)):
        time.sleep(0.002)
    ended = time.monotonic() - started
    return process.wait(20), ended, time.monotonic() - started


def start_and_wait(program, folder, ranks, chance, *more):
    """Start the run and wait for a random moment after its beginning; the seconds since then."""
    life.write_case(folder)
    process = life.launch(program, folder, ranks, *more)
    while process.poll() is None and len(life.ranks_of(process, ranks)) < max(ranks, 1):
        time.sleep(0.001)
    part = folder / f"{life.NAME}.part"
    while process.poll() is None and not part.exists():
        time.sleep(0.001)
    time.sleep(chance.uniform(0, 0.15))
    return process


def check_stopped(program, folder, code, reference, chance):
    """Code 75 and a resumable file, or the whole file if it was too late to stop."""
    log = (folder / "log").read_text()
    if code == 0:
        assert life.stage(folder) == "done"
    else:
        assert code == 75, log
        assert "--resume" in log
        assert not (folder / life.NAME).exists()
        life.resume(program, folder, chance.choice([0, 1, 2, 3]))
    assert life.content_hash(folder / life.NAME) == life.content_hash(reference)


@pytest.mark.parametrize("number", [signal.SIGUSR1, signal.SIGUSR2, signal.SIGTERM])
def test_a_signal_stops_soon(mpi_separatrix, tmp_path, reference, amount, figures, long_if, number):
    long_if(number == signal.SIGUSR2)
    chance = random.Random(f"{SEED} {number}")
    codes = Counter()
    longest = returned = 0.0
    for trial in range(amount(2, 15)):
        folder = tmp_path / str(trial)
        folder.mkdir()
        # mpirun has its own way with SIGTERM.
        ranks = 0 if number == signal.SIGTERM else trial % 4
        process = start_and_wait(mpi_separatrix, folder, ranks, chance)
        code, ended, over = stop(process, ranks, lambda _, target=process: target.send_signal(number))
        longest, returned = max(longest, ended), max(returned, over)
        codes[code] += 1
        check_stopped(mpi_separatrix, folder, code, reference, chance)
    assert codes[75]
    assert longest < SOON
    assert returned < SOON + MPIRUN
    figures.update(
        seed=SEED, stops=codes.total(), codes=codes, longest=round(longest, 2), mpirun=round(returned, 2)
    )


def test_sigterm_to_all_ranks_stops_soon(mpi_separatrix, tmp_path, reference, amount, figures, long_if):
    """As srun and batch systems send it: to the ranks, not to mpirun."""
    long_if(True)
    chance = random.Random(SEED)
    codes = Counter()
    longest = returned = 0.0
    for trial in range(amount(1, 8)):
        folder = tmp_path / str(trial)
        folder.mkdir()
        ranks = 1 + trial % 4
        process = start_and_wait(mpi_separatrix, folder, ranks, chance)
        code, ended, over = stop(process, ranks, lambda pids: [os.kill(pid, signal.SIGTERM) for pid in pids])
        longest, returned = max(longest, ended), max(returned, over)
        codes[code] += 1
        check_stopped(mpi_separatrix, folder, code, reference, chance)
    assert longest < SOON
    assert returned < SOON + MPIRUN
    figures.update(
        seed=SEED, stops=codes.total(), codes=codes, longest=round(longest, 2), mpirun=round(returned, 2)
    )


def test_sigterm_to_mpirun_leaves_a_resumable_file(mpi_separatrix, tmp_path, figures):
    """mpirun ends its ranks itself and returns 1; they have a second to report how to continue."""
    chance, done, folder = random.Random(SEED), 0, tmp_path
    while done == 0:  # on a busy machine a stop may come before the first tile is done
        folder = folder / "run"
        folder.mkdir()
        process = start_and_wait(mpi_separatrix, folder, 2, chance, *SLOW)
        started = time.monotonic()
        process.terminate()
        code = process.wait(20)
        seconds = time.monotonic() - started
        log = (folder / "log").read_text()
        assert code in (1, 75), log
        assert "--resume" in log
        done, _ = life.tiles_of(folder)
    limit, outcome = 0.1, None
    # On a busy machine the attractors are still searched then.
    while outcome is None or "tiles were done before" not in outcome.out:
        again = [*life.RUN, *SLOW, "--resume", "--time-limit", limit]
        outcome = life.run(mpi_separatrix, *again, folder=folder, ranks=3)
        # Where the search took long, the next limit may be enough for the rest.
        assert outcome.code in (0, 75)
        limit *= 2
    assert f"{done} of {life.TILES} tiles were done before" in outcome.out
    if outcome.code == 0:
        assert life.stage(folder) == "done"
    else:
        assert life.tiles_of(folder)[0] >= done
    figures.update(code=code, end=round(seconds, 2))


def test_the_time_limit_is_kept(mpi_separatrix, tmp_path, reference, amount, figures):
    chance = random.Random(SEED)
    codes = Counter()
    longest, reported = 0.0, 0
    for trial in range(amount(2, 30)):
        folder = tmp_path / str(trial)
        folder.mkdir()
        life.write_case(folder)
        limit = round(chance.uniform(0.02, 0.5), 3)
        command = [*life.RUN, "--time-limit", str(limit), "--json"]
        outcome = life.run(mpi_separatrix, *command, folder=folder, ranks=trial % 4)
        codes[outcome.code] += 1
        lines = [json.loads(line) for line in outcome.out.splitlines() if line.startswith("{")]
        stopped = [line["seconds"] for line in lines if line["event"] == "stopped"]
        if stopped:
            reported += 1
            longest = max(longest, stopped[0] - limit)
        assert outcome.code in (0, 75)
        life.resume(mpi_separatrix, folder, chance.choice([0, 2])) if outcome.code else None
        assert life.content_hash(folder / life.NAME) == life.content_hash(reference)
    assert codes[75]
    # The others were stopped in the search for attractors.
    assert reported >= amount(0, 5)
    assert longest < SOON
    figures.update(
        seed=SEED, stops=codes.total(), codes=codes, with_tiles=reported, longest_excess=round(longest, 2)
    )


@pytest.mark.parametrize("dead", [0, 1, 2])
def test_a_dead_rank_ends_the_job_and_the_others_report_how_to_continue(
    mpi_separatrix, tmp_path, amount, figures, long_if, dead
):
    long_if(dead > 0)
    chance = random.Random(f"{SEED} {dead}")
    longest = 0.0
    deaths, reported = amount(1, 5), 0
    for trial in range(deaths):
        folder = tmp_path / str(trial)
        folder.mkdir()
        process = start_and_wait(mpi_separatrix, folder, 3, chance, *SLOW)
        ranks = life.ranks_of(process, 3)
        assert len(ranks) == 3
        # mpirun passes on the messages of its ranks.
        time.sleep(0.2)
        longest = max(longest, life.kill(process, [ranks[dead]]))
        assert process.returncode == 137
        log = (folder / "log").read_text()
        assert "after an interruption the same command with --resume" in log
        reported += "was asked to end (SIGTERM); the tiles done are kept" in log
        assert life.stage(folder) == "fill"
        life.tiles_of(folder)
    assert longest < 10
    figures.update(seed=SEED, deaths=deaths, survivors_spoke=reported, longest=round(longest, 2))


@pytest.mark.parametrize("ranks", [0, 2])
def test_a_signal_within_one_long_trajectory(mpi_separatrix, tmp_path, long_if, ranks):
    """It ends with code 75 and reports how to go on, though nobody looks for signals meanwhile."""
    long_if(ranks == 2)
    life.write_case(tmp_path)
    # The pilot points of a dry run take minutes each.
    long = ["--set", "run.duration=2e6", "--set", "integrator.event_budget=1000000000"]
    process = life.launch(mpi_separatrix, tmp_path, ranks, *long, "--dry-run")
    time.sleep(1)
    code, ended, _ = stop(
        process, ranks, lambda computing: [os.kill(one, signal.SIGTERM) for one in computing]
    )
    log = (tmp_path / "log").read_text()
    assert code == 75, log
    assert ended < 8
    assert "stopped" in log


@pytest.mark.parametrize("ranks", [0, 2])
def test_the_time_limit_within_one_long_trajectory(mpi_separatrix, tmp_path, long_if, ranks):
    """It ends the run soon after, though nobody looks at the clock meanwhile."""
    long_if(ranks == 2)
    life.write_case(tmp_path)
    # Every trajectory takes minutes.
    long = ["--set", "run.duration=2e6", "--set", "integrator.event_budget=1000000000"]
    process = life.launch(mpi_separatrix, tmp_path, ranks, *long, "--time-limit", "0.5")
    began = time.monotonic()
    code = process.wait(60)
    log = (tmp_path / "log").read_text()
    assert code == 75, log
    assert time.monotonic() - began < 12
    assert "stopped within one long trajectory" in log


@pytest.mark.long
@pytest.mark.parametrize("more", [[], ["--resume"]])
def test_the_time_limit_while_a_map_is_read(separatrix, faulty_calls, reference, tmp_path, more):
    """The command reports what it did not come to, also while HDF5 is silent."""
    slow = {
        "LD_PRELOAD": str(faulty_calls),
        "FAULT_NAME": reference.name,
        "FAULT_AT": "9",
        "FAULT_DO": "read",
    }
    words = ["boundary", reference, "-o", "b.h5", "--time-limit", "0.1", *more]
    slow = os.environ | slow
    done = subprocess.run([separatrix, *words], cwd=tmp_path, env=slow, capture_output=True, text=True)
    assert done.returncode == 75, done
    assert done.stderr == (
        "separatrix: stopped while the map was read; this run has written nothing yet; "
        "the same command starts again\n"
    )
    assert not (tmp_path / "b.h5").exists()


@pytest.mark.parametrize(("ranks", "moved"), [pytest.param(0, False, marks=pytest.mark.long), (2, True)])
def test_a_working_file_that_is_taken_away_is_noticed(mpi_separatrix, tmp_path, ranks, moved):
    """The run does not go on to its end for nothing; a file that was moved can be put back."""
    life.write_case(tmp_path)
    long = ["--set", "run.duration=20000"]
    process = life.launch(mpi_separatrix, tmp_path, ranks, *long)
    part, elsewhere = tmp_path / f"{life.NAME}.part", tmp_path / "elsewhere"
    while process.poll() is None and not part.exists():
        time.sleep(0.001)
    # All ranks have opened it.
    time.sleep(2)
    if moved:
        part.rename(elsewhere)
    else:
        part.unlink()
    assert process.wait(60) == 74
    assert "has been removed or moved" in (tmp_path / "log").read_text()
    if moved:
        elsewhere.rename(part)
        process = life.launch(mpi_separatrix, tmp_path, ranks, *long, "--resume", "--time-limit", "8")
        assert process.wait(60) in (0, 75)
        assert "tiles were done before" in (tmp_path / "log").read_text()


@pytest.mark.parametrize(("ranks", "share"), [pytest.param(0, 0.95, marks=pytest.mark.long), (2, 0.1)])
def test_a_working_file_that_is_truncated_keeps_what_is_whole(mpi_separatrix, tmp_path, ranks, share):
    """The run reports it, writes the description back, and --resume goes on with the other tiles."""
    life.write_case(tmp_path)
    long = ["--set", "run.duration=2000"]
    process = life.launch(mpi_separatrix, tmp_path, ranks, *long)
    part = tmp_path / f"{life.NAME}.part"
    while not part.exists() or life.tiles_of(tmp_path)[0] < 5:
        assert process.poll() is None
        time.sleep(0.01)
    size = part.stat().st_size
    # The last tile of the file may be one of those that are done: it is computed again.
    os.truncate(part, int(share * size))
    code = process.wait(60)
    if share > 0.5 and code == 0:
        # The last tile was written behind the cut before anyone looked: nothing that was done is lost.
        life.succeed(mpi_separatrix, *life.RUN[:-1], "whole.h5", *long, folder=tmp_path)
        assert not life.differences(tmp_path / life.NAME, tmp_path / "whole.h5")
        return
    assert code == 74
    log = (tmp_path / "log").read_text()
    assert f"'{life.NAME}.part' has been truncated or overwritten" in log and "--resume" in log
    assert part.stat().st_size == size
    outcome = life.run(mpi_separatrix, *life.RUN, *long, "--resume", "--time-limit", "1", folder=tmp_path)
    assert outcome.code in (0, 75), outcome
    assert "tiles were done before" in outcome.out
