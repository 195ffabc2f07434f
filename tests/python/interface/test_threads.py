# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Several threads of a process use the library at once."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import separatrix as sx


def changed(path: str, ratio: float) -> str:
    """The case with another drive, or the message that refuses it."""
    case = sx.load(path)
    try:
        return case.with_({"drive.ratio": ratio}).to_toml()
    except sx.CaseError as error:
        return str(error)


def test_cases_are_read_changed_and_written_by_four_threads(source_dir: Path) -> None:
    """Texts of one thread must not be those of another; it runs apart, since it crashed before."""
    case = source_dir / "examples" / "basin_coulomb.toml"
    done = subprocess.run([sys.executable, __file__, case], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "True\n"


if __name__ == "__main__":
    ratios = [0.5 + 0.01 * i if i % 3 else -(10.0**i) for i in range(20)]
    change = partial(changed, sys.argv[1])
    alone = [change(ratio) for ratio in ratios] * 3
    with ThreadPoolExecutor(4) as pool:
        print(list(pool.map(change, ratios * 3)) == alone)
