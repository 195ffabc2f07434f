# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A rank that comes late to the working file: the others wait for it, and the file is not called damaged.

A waiting rank spins, so that waiting is time of the processor.
"""

import life

SECONDS = 9


def test_the_others_wait(mpi_separatrix, faulty_calls, tmp_path) -> None:
    life.write_case(tmp_path)
    variables = {"LD_PRELOAD": str(faulty_calls), "FAULT_NAME": f"{life.NAME}.part", "FAULT_RANK": "1"}
    late = {**variables, "FAULT_AT": str(SECONDS), "FAULT_DO": "late"}
    process = life.launch(mpi_separatrix, tmp_path, 2, variables=late)
    code = process.wait(120)
    log = (tmp_path / "log").read_text()
    assert code == 0, log
    assert "damaged" not in log
