# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A kill at any moment costs at most the tiles in flight, and a final file is always complete."""

import math
import random
import time
from collections import Counter

import life
import pytest

SEED = 20261121


def assert_kept(program, folder, ranks_so_far, reference):
    """What a killed run has left behind is either the whole file or a working file with all its tiles."""
    stage = life.stage(folder)
    if stage in ("renamed", "done"):
        life.sound(program, folder)
        assert life.content_hash(folder / life.NAME) == life.content_hash(reference)
    if stage in ("fill", "finalise", "renamed"):
        done, begun = life.tiles_of(folder)
        assert begun <= ranks_so_far
        return stage, done, begun
    return stage, 0, 0


def test_random_kills(mpi_separatrix, tmp_path, reference, amount, figures):
    chance = random.Random(SEED)
    wanted = amount(4, 210)
    stages, victims_of, hung = Counter(), Counter(), Counter()
    kills = lives = 0
    longest = most_lost = 0.0
    expected = life.content_hash(reference)
    while kills < wanted:
        folder = tmp_path / f"life_{lives}"
        folder.mkdir()
        life.write_case(folder)
        lives += 1
        done, ranks_so_far = 0, 0
        for _ in range(chance.randint(1, 6)):
            ranks = chance.choice([0, 1, 2, 3, 4])
            process = life.launch(
                mpi_separatrix, folder, ranks, *(["--resume"] if done or ranks_so_far else [])
            )
            wait_for(process, folder, chance)
            victims = life.ranks_of(process, ranks)
            everybody = chance.random() < 0.5
            if victims and not everybody:
                victims = [chance.choice(victims)]
            if process.poll() is not None:
                break
            seconds = life.kill(process, victims)
            if math.isinf(seconds):
                hung[life.stage(folder)] += 1
            else:
                longest = max(longest, seconds)
            ranks_so_far += max(ranks, 1)
            stage, kept, lost = assert_kept(mpi_separatrix, folder, ranks_so_far, reference)
            assert kept >= done or stage in ("renamed", "done"), "tiles that were done are gone"
            kills += 1
            stages[stage] += 1
            victims_of["all ranks" if everybody else "one rank"] += 1
            most_lost = max(most_lost, lost - ranks_so_far + max(ranks, 1))
            done = kept
            if stage == "done":
                break
        if life.stage(folder) != "done":
            outcome = life.resume(mpi_separatrix, folder, chance.choice([0, 1, 2, 3, 4]))
            if done:
                assert f"{done} of {life.TILES} tiles were done before" in outcome.out
        assert life.content_hash(folder / life.NAME) == expected
        assert life.stage(folder) == "done"
    assert longest < 10
    # At least one of these was killed while it connected to mpirun.
    assert hung.total() <= 0.02 * kills
    figures.update(seed=SEED, kills=kills, lives=lives, stages=stages, victims=victims_of)
    figures.update(mpirun_hung=hung.total(), longest_end=round(longest, 2), content=expected)


def wait_for(process, folder, chance):
    """Wait for a random moment of the run, or for one just after a file of the next stage appears."""
    sign = chance.choice([None, ".part.new", ".part", ".part", ".new", ""])
    if sign is None:
        time.sleep(chance.uniform(0, 0.8))
        return
    while process.poll() is None and not (folder / f"{life.NAME}{sign}").exists():
        time.sleep(0.0005)
    time.sleep(chance.uniform(0, 0.4 if sign == ".part" else 0.02))


@pytest.mark.parametrize("action", ["kill", "tear"])
@pytest.mark.parametrize("ranks", [0, 2])
def test_a_kill_at_any_call(
    mpi_separatrix, faulty_calls, tmp_path, reference, amount, figures, long_if, action, ranks
):
    long_if((action == "kill") != bool(ranks))
    folder, count = tmp_path, tmp_path / "count"
    life.write_case(folder)
    variables = {"LD_PRELOAD": str(faulty_calls), "FAULT_NAME": life.NAME, "FAULT_RANK": "0"}
    variables["FAULT_COUNT"] = str(count)
    process = life.launch(mpi_separatrix, folder, ranks, variables=variables)
    assert process.wait(60) == 0, (folder / "log").read_text()
    calls = max(map(int, count.read_text().split()))
    assert calls > 100
    chance = random.Random(f"{SEED} {action} {ranks}")
    # The last calls are those of the final file and its renaming.
    moments = sorted(
        chance.sample(range(1, calls - 12), amount(2, 24)) + list(range(calls - 12, calls + 1, amount(6, 1)))
    )
    stages = Counter()
    kills = 0
    for moment in moments:
        for path in [count, *folder.glob(f"{life.NAME}*")]:
            path.unlink(missing_ok=True)
        process = life.launch(
            mpi_separatrix,
            folder,
            ranks,
            variables={**variables, "FAULT_AT": str(moment), "FAULT_DO": action},
        )
        code = process.wait(60)
        if code == 0:
            # Writes are timed, so that the number of calls varies a little.
            assert max(map(int, count.read_text().split())) < moment
        else:
            kills += 1
            stage, _, _ = assert_kept(mpi_separatrix, folder, max(ranks, 1), reference)
            stages[stage] += 1
            if stage != "done":
                life.resume(mpi_separatrix, folder, chance.choice([0, 1, 3]))
        assert life.content_hash(folder / life.NAME) == life.content_hash(reference)
        assert life.stage(folder) == "done"
    assert kills
    figures.update(calls=calls, moments=len(moments), kills=kills, stages=stages)
