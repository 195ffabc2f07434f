# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The load is balanced with each one-sided transport of OpenMPI; the shared memory of a node needs `sm`."""

import os
import re
import subprocess

import pytest


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
