# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A file system without locks is reported and used; a living run is the reason of its working file."""

import fcntl
import os
import subprocess
import sys

import life
import pytest


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_file_system_without_locks(mpi_separatrix, faulty_calls, reference, tmp_path, ranks) -> None:
    life.write_case(tmp_path)
    variables = {"LD_PRELOAD": str(faulty_calls), "FAULT_NAME": life.NAME, "FAULT_DO": "unlockable"}
    process = life.launch(mpi_separatrix, tmp_path, ranks, variables=variables)
    code = process.wait(120)
    log = (tmp_path / "log").read_text()
    assert code == 0, log
    assert f"'{life.NAME}.part.lock' cannot be locked (No locks available)" in log
    assert life.content_hash(tmp_path / life.NAME) == life.content_hash(reference)


def test_the_locks_of_hdf5_can_be_asked_for(separatrix, faulty_calls, tmp_path) -> None:
    """So can their error where the file system has none."""
    life.write_case(tmp_path)
    variables = {"LD_PRELOAD": str(faulty_calls), "FAULT_NAME": life.NAME, "FAULT_DO": "unlockable"}
    process = life.launch(separatrix, tmp_path, 0, variables=variables | {"HDF5_USE_FILE_LOCKING": "TRUE"})
    assert process.wait(120) == 73, (tmp_path / "log").read_text()


def test_a_result_is_read_without_locks(faulty_calls, reference) -> None:
    variables = {"LD_PRELOAD": str(faulty_calls), "FAULT_NAME": life.NAME, "FAULT_DO": "unlockable"}
    script = (
        "import sys, separatrix as sx; from separatrix.view.files import ResultFile\n"
        "print(sx.open_result(sys.argv[1]).sizes['x0'], ResultFile(sys.argv[1]).kind)"
    )
    command = [sys.executable, "-c", script, reference]
    ended = subprocess.run(command, env=os.environ | variables, capture_output=True, text=True)
    assert ended.stdout == "44 basin\n", ended.stderr


@pytest.mark.parametrize("option", ["", "--resume", "--force"])
def test_a_run_beside_a_living_one(separatrix, tmp_path, option) -> None:
    """No working file of a living run is called that of an interrupted one."""
    life.write_case(tmp_path)
    (tmp_path / f"{life.NAME}.part").touch()
    lock = os.open(tmp_path / f"{life.NAME}.part.lock", os.O_RDWR | os.O_CREAT)
    fcntl.flock(lock, fcntl.LOCK_EX)
    command = [separatrix, *life.RUN, *filter(None, [option])]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    os.close(lock)
    assert ended.returncode == 73
    assert "another run is at work on this file" in ended.stderr
    assert "interrupted" not in ended.stderr
