# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A run that is killed while it looks at points a second time ends, resumed, with the bits of a whole one."""

import os
import random
import subprocess

import life
from program import FOLD

SEED = 20261122
# The impacting cycle has a basin so small that no start of the sample is in it; several tiles.
CASE = FOLD + "[grid]\ntile = [10, 10]\n"
RUN = ["basin", "case.toml", "-o", life.NAME]


def test_a_kill_around_a_second_look(mpi_separatrix, faulty_calls, tmp_path, amount, figures):
    folder, count = tmp_path, tmp_path / "count"
    (folder / "case.toml").write_text(CASE)
    variables = {**os.environ, "LD_PRELOAD": str(faulty_calls), "FAULT_NAME": life.NAME, "FAULT_RANK": "0"}

    def flown(**fault: str) -> subprocess.CompletedProcess:
        return subprocess.run(
            [mpi_separatrix, *RUN],
            cwd=folder,
            env={**variables, **fault},
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )

    whole = flown(FAULT_COUNT=str(count))
    assert whole.returncode == 0, whole.stderr
    assert "second look" in whole.stdout
    assert "1 more found" in whole.stdout
    expected = life.content_hash(folder / life.NAME)
    calls = max(map(int, count.read_text().split()))
    chance = random.Random(SEED)
    kills = looks = 0
    # The second look comes after the tiles, in the last part of the calls.
    for moment in sorted(chance.sample(range(calls // 2, calls), amount(6, 60))):
        for path in folder.glob(f"{life.NAME}*"):
            path.unlink()
        if flown(FAULT_AT=str(moment), FAULT_DO="kill").returncode == 0:
            continue
        kills += 1
        if life.stage(folder) != "done":
            ranks = chance.choice([0, 1, 3])
            outcome = life.succeed(mpi_separatrix, *RUN, "--resume", folder=folder, ranks=ranks)
            looks += "second look" in outcome.out
        assert life.content_hash(folder / life.NAME) == expected, moment
    assert kills
    assert looks
    figures.update(seed=SEED, calls=calls, kills=kills, looks=looks)
