# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the batch scripts do without a batch system, with stubs of the commands that they call."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def set_stripes(folder: Path, code: int, **variables: str) -> tuple[subprocess.CompletedProcess, str]:
    """Call `set_stripes` for an output, where `lfs` ends with this code; also what it was asked for."""
    stub = folder / "lfs"
    stub.write_text(f'#!/bin/sh\necho "$@" >> {folder}/asked\nexit {code}\n')
    stub.chmod(0o755)
    script = f'source {ROOT}/scripts/slurm/common.sh; set_stripes "$1"; echo goes on'
    environment = os.environ | {"PATH": f"{folder}:{os.environ['PATH']}", "SEPARATRIX_ROOT": str(ROOT)}
    command = ["bash", "-uc", script, "script", "results/map.h5"]
    ended = subprocess.run(command, env=environment | variables, capture_output=True, text=True)
    asked = (folder / "asked").read_text() if (folder / "asked").exists() else ""
    return ended, asked


@pytest.mark.parametrize(("size", "used"), [({}, "4M"), ({"SEPARATRIX_STRIPE_SIZE": "16M"}, "16M")])
def test_the_folder_of_the_output_gets_stripes(tmp_path, size, used):
    ended, asked = set_stripes(tmp_path, 0, SEPARATRIX_STRIPES="8", **size)
    assert asked == f"setstripe -c 8 -S {used} results\n"
    assert ended.stdout == "goes on\n"


def test_without_the_variable_nothing_is_set(tmp_path):
    ended, asked = set_stripes(tmp_path, 1)
    assert asked == "" and ended.stdout == "goes on\n"


def test_a_file_system_without_stripes_ends_the_job_with_the_reason(tmp_path):
    ended, _ = set_stripes(tmp_path, 1, SEPARATRIX_STRIPES="8")
    assert ended.returncode == 73 and ended.stdout == ""
    assert "unset SEPARATRIX_STRIPES where it is not on Lustre" in ended.stderr


def test_one_share_of_an_array_again(tmp_path):
    """Submitted alone, an element needs the number of shares; SLURM counts those of this array only."""
    for name, text in {"srun": 'echo "$@"', "scontrol": "exit 1", "sleep": ""}.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    (tmp_path / "map.h5.shard-1-of-8.part").touch()
    variables = {
        "PATH": f"{tmp_path}:{os.environ['PATH']}",
        "SEPARATRIX_ROOT": str(ROOT),
        "SLURM_JOB_ID": "1",
    }
    variables |= {"SLURM_ARRAY_JOB_ID": "1", "SLURM_ARRAY_TASK_ID": "3", "SLURM_ARRAY_TASK_COUNT": "1"}
    command = ["bash", ROOT / "scripts/slurm/array.sh", "case.toml", "map.h5"]
    alone = subprocess.run(command, cwd=tmp_path, env=os.environ | variables, capture_output=True, text=True)
    assert alone.returncode == 66 and "SEPARATRIX_SHARES" in alone.stderr
    variables["SEPARATRIX_SHARES"] = "8"
    known = subprocess.run(command, cwd=tmp_path, env=os.environ | variables, capture_output=True, text=True)
    assert known.returncode == 0, known
    assert "--shard 3/8" in known.stdout and "--catalogue map.h5.shard-1-of-8.part" in known.stdout
