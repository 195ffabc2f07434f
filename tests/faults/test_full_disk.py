# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Without space a run ends at once with code 74 (73 before it has begun), and goes on when there is space."""

import errno
import os
import random
import resource
import subprocess
import time
from collections import Counter

import life
import pytest
from program import STARTS

SEED = 20261123
# Longest wait for the end after the first failure.
AT_ONCE = 10


def goes_on(program, folder, reference, ranks):
    """With space the run ends with the reference's content."""
    life.resume(program, folder, ranks)
    assert life.content_hash(folder / life.NAME) == life.content_hash(reference)
    assert life.stage(folder) == "done"


def clean(folder):
    """Remove what earlier runs have left."""
    for path in [*folder.glob(f"{life.NAME}*"), *folder.glob("log")]:
        path.unlink()


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
def test_every_write_can_fail(
    separatrix, faulty_calls, tmp_path, reference, amount, figures, long_if, number
):
    long_if(number != errno.ENOSPC)
    life.write_case(tmp_path)
    count = tmp_path / "count"
    variables = {"LD_PRELOAD": str(faulty_calls), "FAULT_NAME": life.NAME}
    assert (
        life.launch(separatrix, tmp_path, 0, variables={**variables, "FAULT_COUNT": str(count)}).wait(60) == 0
    )
    calls = int(count.read_text())
    chance = random.Random(f"{SEED} {number}")
    codes, stages = Counter(), Counter()
    moments = chance.sample(range(1, calls - 20), amount(2, 20)) + chance.sample(
        range(calls - 20, calls), amount(1, 6)
    )
    longest = 0.0
    for moment in moments:
        clean(tmp_path)
        fault = {**variables, "FAULT_AT": str(moment), "FAULT_DO": str(number)}
        started = time.monotonic()
        code = life.launch(separatrix, tmp_path, 0, variables=fault).wait(AT_ONCE)
        longest = max(longest, time.monotonic() - started)
        stage = life.stage(tmp_path)
        # After the last write only sync, rename and remove are left.
        assert code == (73 if stage == "start" else 0 if stage == "done" else 74), (
            moment,
            (tmp_path / "log").read_text(),
        )
        codes[code] += 1
        stages[stage] += 1
        if code:
            assert "separatrix: " in (tmp_path / "log").read_text()
            goes_on(separatrix, tmp_path, reference, chance.choice([0, 2]))
    assert codes[74]
    figures.update(
        seed=SEED,
        calls=calls,
        moments=len(moments),
        codes=codes,
        stages=stages,
        longest_run=round(longest, 1),
    )


def test_a_file_size_limit(mpi_separatrix, tmp_path, reference, amount, figures):
    """The limit (RLIMIT_FSIZE) falls on all ranks in the middle of the run."""
    life.write_case(tmp_path)
    chance = random.Random(SEED)
    codes, stages = Counter(), Counter()
    longest = 0.0
    points = amount(2, 20)
    for point in range(points):
        clean(tmp_path)
        ranks = 1 + point % 3
        process = life.launch(mpi_separatrix, tmp_path, ranks)
        wanted = (point + chance.random()) / points * life.TILES
        while process.poll() is None and not reached(tmp_path, wanted):
            time.sleep(0.001)
        for rank in life.ranks_of(process, ranks):
            try:
                resource.prlimit(rank, resource.RLIMIT_FSIZE, (4096, 4096))
            except ProcessLookupError:
                continue
        started = time.monotonic()
        code = process.wait(AT_ONCE)
        longest = max(longest, time.monotonic() - started)
        stage = life.stage(tmp_path)
        assert code in ((0,) if stage == "done" else (73, 74)), (tmp_path / "log").read_text()
        codes[code] += 1
        stages[stage] += 1
        if code:
            assert "separatrix: " in (tmp_path / "log").read_text()
            goes_on(mpi_separatrix, tmp_path, reference, chance.choice([1, 2, 3]))
    assert codes[74]
    figures.update(seed=SEED, moments=points, codes=codes, stages=stages, longest_wait=round(longest, 2))


def reached(folder, wanted):
    """Whether so many tiles are done."""
    return (folder / f"{life.NAME}.part").exists() and life.tiles_of(folder)[0] >= wanted


@pytest.fixture
def small_disk(tmp_path):
    """A function that gives a folder on a file system of so many bytes."""
    mounted = []

    def mount(size: int):
        folder = tmp_path / f"disk_{size}"
        folder.mkdir()
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], capture_output=True
        )
        if done.returncode:
            pytest.skip("a file system can be mounted by root only")
        mounted.append(folder)
        return folder

    yield mount
    for folder in mounted:
        subprocess.run(["umount", folder], check=True)


def test_a_small_disk(mpi_separatrix, tmp_path, small_disk, reference, amount, figures):
    """The disk is too small for the working file, for the final file beside it, or fills up meanwhile."""
    life.write_case(tmp_path)
    process = life.launch(mpi_separatrix, tmp_path, 0)
    part = tmp_path / f"{life.NAME}.part"
    while not part.exists():
        time.sleep(0.001)
    needed = part.stat().st_size
    assert process.wait(60) == 0
    both = needed + reference.stat().st_size
    codes = Counter()
    longest = 0.0
    sizes = amount(3, 12)
    for point in range(1, sizes + 1):
        folder = small_disk(int(1.2 * both * point / sizes) // 4096 * 4096)
        life.write_case(folder)
        ranks = 1 + point % 3
        started = time.monotonic()
        outcome = life.run(
            *("mpirun", "-n", str(ranks), mpi_separatrix, *life.RUN), folder=folder, timeout=AT_ONCE + 5
        )
        longest = max(longest, time.monotonic() - started)
        codes[outcome.code] += 1
        if outcome.code:
            assert outcome.code in (73, 74), outcome
            assert outcome.messages
            assert not (folder / life.NAME).exists()
            subprocess.run(["mount", "-o", f"remount,size={3 * both}", folder], check=True)
            goes_on(mpi_separatrix, folder, reference, ranks)
        else:
            assert life.content_hash(folder / life.NAME) == life.content_hash(reference)
    assert codes[74]
    assert codes[0]
    figures.update(disks=sizes, codes=codes, longest_run=round(longest, 1))


def test_a_trajectory_beyond_the_limit(separatrix, faulty_calls, tmp_path):
    life.write_case(tmp_path)
    command = ["trajectory", "case.toml", "-o", "t.h5", "--csv", "t.csv", "--record", "record.csv", "--force"]
    for name in ("t.h5", "t.csv", "record.csv"):
        ended = without_space(separatrix, faulty_calls, tmp_path, name, command)
        assert ended.returncode in (73, 74), (name, ended)
        assert name in ended.stderr


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("times.csv", ["basin", "case.toml", "-o", "m.h5", "--tile-times", "times.csv"]),
        ("p.csv", ["points", "case.toml", "--list", "starts.csv", "-o", "p.h5", "--csv", "p.csv"]),
    ],
)
def test_a_table_beyond_the_limit(separatrix, faulty_calls, tmp_path, name, command):
    life.write_case(tmp_path)
    (tmp_path / "starts.csv").write_text(STARTS)
    ended = without_space(separatrix, faulty_calls, tmp_path, name, command)
    assert ended.returncode == 74 and name in ended.stderr, ended


def without_space(program, faulty_calls, folder, name, command):
    """Run a command for whose file `name` there is no space."""
    fault = {
        "LD_PRELOAD": str(faulty_calls),
        "FAULT_NAME": name,
        "FAULT_AT": "1",
        "FAULT_DO": str(errno.ENOSPC),
    }
    return subprocess.run(
        [program, *command], cwd=folder, env=os.environ | fault, capture_output=True, text=True, timeout=60
    )
