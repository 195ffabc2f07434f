# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The load is balanced with each one-sided transport of OpenMPI; the shared memory of a node needs `sm`."""

import os
import re
import subprocess

import pytest
from life import run, write_case

SMALL = ["--set", "axis[1].count=8", "--set", "axis[2].count=8", "--set", "attractors.sample=4"]


@pytest.mark.parametrize("chosen", ["pt2pt", "ucx", "^sm,ucx"])
def test_a_choice_without_shared_memory(mpi_separatrix, tmp_path, long_if, monkeypatch, chosen):
    """What the user chose stays chosen, and the run has what it needs besides."""
    long_if(chosen == "ucx")
    monkeypatch.setenv("OMPI_MCA_osc", chosen)
    write_case(tmp_path)
    outcome = run(mpi_separatrix, "basin", "case.toml", *SMALL, "-o", "map.h5", folder=tmp_path, ranks=2)
    assert outcome.code == 0, outcome
    used = {"pt2pt": "pt2pt,sm", "ucx": "ucx,sm", "^sm,ucx": "^ucx"}[chosen]
    assert f"OMPI_MCA_osc={used}" in run(mpi_separatrix, "info", "map.h5", folder=tmp_path).out


@pytest.mark.parametrize("transport", ["sm", "pt2pt,sm", "ucx,sm"])
def test_balance(mpi_separatrix, build_dir, figures, long_if, transport):
    # The suite itself runs with the default, which is sm.
    long_if(transport != "ucx,sm")
    suite = build_dir / "bin" / "tests" / "test_load_balance"
    if not suite.is_file():
        pytest.skip(f"{suite} has not been built")
    ended = subprocess.run(
        ["mpirun", "-n", "4", suite],
        env={**os.environ, "OMPI_MCA_osc": transport},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    found = re.findall(r"ranks per node (\d) idle +([\d.]+) longest +([\d.]+) all +([\d.]+)", ended.stdout)
    assert len(found) == 3
    figures.update(ranks=4, spread="1000:1", longest_position=float(found[0][2]))
    figures.update(idle={f"nodes of {nodes}": float(idle) for nodes, idle, _, _ in found})
