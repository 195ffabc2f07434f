#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of starts on the two sides of a basin boundary: how many carry the two labels, and the time it took.

    scripts/boundary_pairs.py [CASE] [--points 1000] [--distance 1e-8]

Computes the map of the case (default examples/basin_coulomb.toml) with POINTS points along each axis and its
boundary into a temporary folder.
"""

import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import separatrix as sx
from separatrix.cases import linspace
from separatrix.library import Model
from separatrix.open import open_result
from separatrix.program import program_path
from separatrix.simulate import search_slices


def main() -> int:
    """Print the numbers; 1 where a pair has other labels."""
    top = Path(__file__).resolve().parents[1]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", nargs="?", default=str(top / "examples" / "basin_coulomb.toml"))
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--distance", type=float, default=1e-8)
    options = parser.parse_args()
    case = sx.load(options.case)
    ends = {axis["name"]: (axis["from"], axis["to"]) for axis in case.resolved["axis"]}
    with tempfile.TemporaryDirectory() as folder:
        basins, curves = Path(folder) / "map.h5", Path(folder) / "curves.h5"
        axes = {name: linspace(*ends[name], options.points) for name in ("x0", "v0")}
        sx.basin(case, axes, output=basins)
        command = [str(program_path()), "boundary", str(basins), "-o", str(curves), "-q"]
        start = time.perf_counter()
        subprocess.run(command, check=True)
        seconds = time.perf_counter() - start
        with open_result(curves) as result:
            return report(result, options.distance, options.points, seconds)


def report(result: object, distance: float, points: int, seconds: float) -> int:
    """Label the pairs and print what came out."""
    catalogue = search_slices(Model.from_text(result.attrs["resolved_case"]), [{}], ())[0]
    found = result["across"].values >= 0
    right = np.ones(int(found.sum()), dtype=bool)
    for sign, side in ((-1, "below"), (1, "above")):
        starts = np.zeros((right.size, 3))
        for k, name in enumerate(("x0", "v0")):
            starts[:, k] = result[name].values[found] + sign * distance * (
                result["across"].values[found] == k
            )
        right &= catalogue.labels(starts)["attractor"] == result[side].values[found]
    print(f"map of {points} x {points}: {right.size} boundary points in {seconds:.1f} s")
    print(f"pairs at +-{distance:g}: {int(right.sum())} of {right.size} carry the two labels")
    return int(not right.all())


if __name__ == "__main__":
    raise SystemExit(main())
