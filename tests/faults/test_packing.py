# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A kill or a full disk while the ranks pack the final file costs nothing: going on gives the same bytes."""

import errno
import os
import random
import subprocess
from collections import Counter

import h5py
import life
import pytest

SEED = 20261126
# Several slabs of compressed chunks, and soon computed.
RUN = [
    *("basin", "case.toml", "-o", life.NAME, "--force"),
    *("--set", "axis[1].count=270", "--set", "axis[2].count=260", "--set", "attractors.sample=16"),
]
NEW = f"{life.NAME}.new"


def packed(path):
    """Every chunk of the map as it is stored."""
    found = {}
    with h5py.File(path, locking=False) as file:
        for name, data in file.items():
            if isinstance(data, h5py.Dataset) and data.chunks:
                for number in range(data.id.get_num_chunks()):
                    corner = data.id.get_chunk_info(number).chunk_offset
                    found[name, corner] = data.id.read_direct_chunk(corner)
    return found


def start(program, folder, ranks, variables, *more):
    """Compute the map with faults; the exit code."""
    command = ["mpirun", "-n", str(ranks)] if ranks else []
    with (folder / "log").open("a") as log:
        return subprocess.run(
            [*command, program, *RUN, *more],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, **variables},
            timeout=60,
        ).returncode


@pytest.fixture(scope="module")
def whole(mpi_separatrix, tmp_path_factory):
    """The map of one process that nothing disturbs."""
    folder = tmp_path_factory.mktemp("whole")
    life.write_case(folder)
    life.succeed(mpi_separatrix, *RUN, folder=folder)
    return folder / life.NAME


def test_the_same_chunks_for_any_ranks(mpi_separatrix, tmp_path, whole):
    life.write_case(tmp_path)
    expected = packed(whole)
    assert len(expected) >= 13
    for ranks in (2, 3):
        life.succeed(mpi_separatrix, *RUN, folder=tmp_path, ranks=ranks)
        assert packed(tmp_path / life.NAME) == expected
        assert life.content_hash(tmp_path / life.NAME) == life.content_hash(whole)


def test_a_rank_without_a_slab_leaves_the_file_alone(mpi_separatrix, faulty_calls, tmp_path):
    """With thousands of ranks, each that syncs the file asks every server for it."""
    life.write_case(tmp_path)
    count = tmp_path / "count"
    variables = {"LD_PRELOAD": str(faulty_calls), "FAULT_NAME": NEW, "FAULT_COUNT": str(count)}
    one_slab = ["--set", "axis[1].count=80"]
    assert start(mpi_separatrix, tmp_path, 3, variables, *one_slab) == 0
    assert len(count.read_text().split()) == 1


def test_rank_0_reads_a_tile_at_most_once(mpi_separatrix, faulty_calls, tmp_path):
    """A look at each tile before the first one would take minutes for a million on a slow file system."""
    life.write_case(tmp_path)
    count = tmp_path / "count"
    variables = {"LD_PRELOAD": str(faulty_calls), "FAULT_NAME": f"{life.NAME}.part", "FAULT_RANK": "0"}
    variables |= {"FAULT_COUNT": str(count), "FAULT_DO": "reads"}
    tiles = ["--set", "axis[1].count=80", "--set", "grid.tile=[5, 5]"]
    assert start(mpi_separatrix, tmp_path, 2, variables, *tiles) == 0
    assert 16 * 52 < sum(map(int, count.read_text().split())) < 1.5 * 16 * 52


@pytest.mark.parametrize(("ranks", "rank"), [(0, 0), (2, 0), (2, 1)])
def test_a_fault_at_any_call(mpi_separatrix, faulty_calls, tmp_path, whole, amount, figures, ranks, rank):
    life.write_case(tmp_path)
    count = tmp_path / "count"
    variables = {"LD_PRELOAD": str(faulty_calls), "FAULT_NAME": NEW, "FAULT_RANK": str(rank)}
    assert start(mpi_separatrix, tmp_path, ranks, {**variables, "FAULT_COUNT": str(count)}) == 0
    calls = max(map(int, count.read_text().split()))
    # Each rank writes chunks of its own.
    assert calls >= 6
    chance = random.Random(f"{SEED} {ranks} {rank}")
    codes = Counter()
    for moment in sorted(chance.sample(range(1, calls + 1), min(calls, amount(3, 40)))):
        for path in tmp_path.glob(f"{life.NAME}*"):
            path.unlink()
        action = chance.choice(["kill", "tear", errno.ENOSPC])
        fault = {**variables, "FAULT_AT": str(moment), "FAULT_DO": str(action)}
        code = start(mpi_separatrix, tmp_path, ranks, fault)
        codes["killed" if action in ("kill", "tear") and code else code] += 1
        if action == errno.ENOSPC:
            # After the last write only sync and rename are left.
            assert code in (0, 74), (moment, (tmp_path / "log").read_text())
        if code:
            assert not (tmp_path / life.NAME).exists()
            more = [word for word in RUN if word != "--force"]
            ranks_then = chance.choice([0, 1, 3])
            outcome = life.succeed(mpi_separatrix, *more, "--resume", folder=tmp_path, ranks=ranks_then)
            assert "tiles were done before" in outcome.out
        assert packed(tmp_path / life.NAME) == packed(whole)
        assert life.content_hash(tmp_path / life.NAME) == life.content_hash(whole)
        assert life.stage(tmp_path) == "done"
    assert codes.keys() - {0}
    figures.update(seed=SEED, ranks=ranks, rank=rank, calls=calls)
    figures.update(codes={str(code): count for code, count in codes.items()})
