# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A rank that is lost after the last tile: the wait ends with a reason, and the tiles are enough to finish.

A rank that is late, but within the bound, is waited for.
"""

import subprocess
import time

import life
import pytest

BOUND = 4


def run_with_absent_rank(program, calls, folder, seconds: int) -> tuple[int, float, str]:
    """The code, the seconds and the log of a run whose second rank comes so late to the last barrier."""
    life.write_case(folder)
    absent = {
        "FAULT_NAME": f"{life.NAME}.part",
        "FAULT_RANK": "1",
        "FAULT_AT": str(seconds),
        "FAULT_DO": "arrive",
    }
    variables = {"LD_PRELOAD": str(calls), "SEPARATRIX_LAST_WAIT": str(BOUND), **absent}
    began = time.monotonic()
    code = life.launch(program, folder, 2, variables=variables).wait(180)
    return code, time.monotonic() - began, (folder / "log").read_text()


def test_the_wait_for_a_lost_rank_ends(mpi_separatrix, faulty_calls, reference, tmp_path) -> None:
    code, seconds, log = run_with_absent_rank(mpi_separatrix, faulty_calls, tmp_path, 150)
    assert code == 75, log
    assert f"a rank has not answered for {BOUND} s" in log and "--resume" in log
    assert seconds < 120
    assert life.tiles_of(tmp_path)[0] == life.TILES
    life.resume(mpi_separatrix, tmp_path, 1)
    assert life.content_hash(tmp_path / life.NAME) == life.content_hash(reference)


def test_the_wait_ends_though_rank_0_began_last(mpi_separatrix, faulty_calls, tmp_path) -> None:
    """Rank 0 looks into the working file for a second before it begins; the others do not write meanwhile."""
    life.write_case(tmp_path)
    shared = {"LD_PRELOAD": str(faulty_calls), "SEPARATRIX_LAST_WAIT": str(BOUND)}
    faults = [{"FAULT_DO": "read", "FAULT_AT": "1"}, {"FAULT_DO": "arrive", "FAULT_AT": "150"}]
    command = ["mpirun"]
    for number, fault in enumerate(faults):
        given = {"FAULT_NAME": f"{life.NAME}.part", "FAULT_RANK": str(number), **shared, **fault}
        command += [":"] * number + ["-n", "1", "env", *(f"{key}={value}" for key, value in given.items())]
        command += [str(mpi_separatrix), *life.RUN]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=100)
    assert run.returncode == 75, run.stderr
    assert f"a rank has not answered for {BOUND} s" in run.stderr


@pytest.mark.parametrize("late", [BOUND // 2, 2 * BOUND])
def test_a_late_rank_is_waited_for(mpi_separatrix, faulty_calls, reference, tmp_path, late) -> None:
    """The bound begins when nobody has work left, which rank 0 sees after at most as long."""
    code, _, log = run_with_absent_rank(mpi_separatrix, faulty_calls, tmp_path, late - 1)
    assert code == 0, log
    assert life.content_hash(tmp_path / life.NAME) == life.content_hash(reference)
