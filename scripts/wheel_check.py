# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a new user does with an installed wheel; run by scripts/wheel.

wheel_check.py                     a map in threads, processes and merged shares, a figure, a motion
wheel_check.py --compare ONE TWO   whether two maps have the same bits
"""

import subprocess
import sys
import time
from pathlib import Path

start = time.perf_counter(), time.process_time()
import separatrix as sx  # noqa: E402

IMPORTED, PROCESSOR = time.perf_counter() - start[0], time.process_time() - start[1]


def differing(one, other) -> list[str]:
    """Names of the variables that differ in a bit."""
    names = set(one.variables) | set(other.variables)
    return sorted(
        name
        for name in names
        if name not in one.variables
        or name not in other.variables
        or one[name].values.tobytes() != other[name].values.tobytes()
    )


def main() -> None:
    """Do it; any failure is an exception."""
    if sys.argv[1:2] == ["--compare"]:
        assert differing(*map(sx.open_result, sys.argv[2:4])) == []
        print(f"  {sys.argv[2]} and {sys.argv[3]}: the same bits")
        return
    print(f"  {Path(sx.__file__).parent}, imported in {1000 * IMPORTED:.0f} ms "
          f"({1000 * PROCESSOR:.0f} ms of processor time)")  # fmt: skip
    assert PROCESSOR < 0.1
    case = sx.load("basin_coulomb.toml")
    result = sx.basin(case, x0=60, v0=50)
    print("  " + str(result.separatrix.attractors[["share", "regime", "period"]]).replace("\n", "\n  "))
    assert differing(result, sx.basin(case, x0=60, v0=50, workers=2, output="map.h5", overwrite=True)) == []
    size = ["--set", "axis[1].count=60", "--set", "axis[2].count=50"]
    for number in (1, 2):
        share = ["--shard", f"{number}/2", "-o", "merged.h5", "-q", "--force"]
        subprocess.run(["separatrix", "basin", "basin_coulomb.toml", *size, *share], check=True)
    subprocess.run(
        ["separatrix", "merge", "merged.h5", *sorted(Path().glob("merged.h5.shard*")), "-q", "--force"],
        check=True,
    )
    assert differing(result, sx.open_result("merged.h5")) == []
    print("  in threads, in two processes, and two shares merged: the same bits")
    for path in result.separatrix.save("map"):
        print(f"  wrote {path}, {path.stat().st_size} bytes")
    assert sx.trajectory(case, x0=0.5).sizes["event"] > 0
    began = time.perf_counter()
    version = subprocess.run(["separatrix", "--version"], capture_output=True, text=True, check=True).stdout
    print(f"  {version.splitlines()[0]} (in {1000 * (time.perf_counter() - began):.0f} ms)")
    verified = subprocess.run(["separatrix", "verify", "map.h5"], capture_output=True, text=True, check=True)
    print("  " + verified.stdout.strip().replace("\n", "\n  "))


main()
