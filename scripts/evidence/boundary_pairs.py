#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of starts on the two sides of basin boundaries: how many carry the two labels, by machine.

    scripts/evidence/boundary_pairs.py [CASE ...] [--points 4096] [--step 16] [--distance 1e-8] [--referee 50]

Computes the map of each case (default examples/basin_coulomb.toml) with POINTS points along each axis, from a
lattice of STEP, and its boundary into a temporary folder. REFEREE of the pairs are also checked by the
integrator of tests/referee/, which shares no code with the program: do its two motions end on two
attractors?
"""

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import separatrix as sx
from evidence_rows import table
from separatrix.cases import linspace
from separatrix.library import Model
from separatrix.open import decode_flags, open_result
from separatrix.program import program_path
from separatrix.simulate import search_slices

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tests" / "referee"))
HEAD = [
    "case",
    "map",
    "pairs",
    "carry the two labels",
    "by the referee",
    "what they lead to",
    "boundary, CPU s",
]


def main() -> int:
    """Print the table; 1 where a pair has other labels."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", default=[str(TOP / "examples" / "basin_coulomb.toml")])
    parser.add_argument("--points", type=int, default=4096)
    parser.add_argument(
        "--step", type=int, default=16, help="lattice of the refined map; 0: every point is computed"
    )
    parser.add_argument("--distance", type=float, default=1e-8)
    parser.add_argument("--referee", type=int, default=0, help="pairs that the referee checks")
    options = parser.parse_args()
    lines, wrong = [], 0
    for path in options.cases:
        line, missed = row(Path(path), options)
        lines.append(line)
        wrong += missed
    print(table(HEAD, lines))
    return int(wrong > 0)


def row(path: Path, options: argparse.Namespace) -> tuple[list[str], int]:
    """The cells of a case, and how many of its pairs have other labels."""
    case = sx.load(path)
    if options.step:
        case = case.with_({"refine.step": options.step})
    ends = {axis["name"]: (axis["from"], axis["to"]) for axis in case.resolved["axis"]}
    with tempfile.TemporaryDirectory() as folder:
        basins, curves = Path(folder) / "map.h5", Path(folder) / "curves.h5"
        axes = {name: linspace(*ends[name], options.points) for name in ("x0", "v0")}
        sx.basin(case, axes, output=basins, progress=False)
        command = [str(program_path()), "boundary", str(basins), "-o", str(curves), "-q", "--grow", "0"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run(command, check=True)
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        with open_result(curves) as result:
            starts, sides = pairs(result, options.distance)
            catalogue = search_slices(Model.from_text(result.attrs["resolved_case"]), [{}], ())[0]
            labels = [catalogue.labels(start)["attractor"] for start in starts]
            right = (np.stack(labels) == sides).all(axis=0)
            names = decode_flags(result["name"]).values[result["across"].values >= 0]
    refereed = "not asked"
    if options.referee:
        chosen = np.random.default_rng(1).permutation(right.size)[: options.referee]
        refereed = f"{parted(case, starts[:, chosen])} of {chosen.size}"
    kinds = ", ".join(
        f"{name} {count}" for name, count in zip(*np.unique(names, return_counts=True), strict=True)
    )
    size = f"{options.points}^2" + (f", refined from {options.step}" if options.step else "")
    line = [f"`{path.stem}`", size, str(right.size), str(int(right.sum())), refereed, kinds, f"{seconds:.1f}"]
    return line, int((~right).sum())


def pairs(result: object, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Starts below and above every boundary point along its edge, and the labels that the file has there."""
    found = result["across"].values >= 0
    starts = np.zeros((2, int(found.sum()), 3))
    for side, sign in enumerate((-1, 1)):
        for k, name in enumerate(("x0", "v0")):
            shift = sign * distance * (result["across"].values[found] == k)
            starts[side, :, k] = result[name].values[found] + shift
    return starts, np.stack([result[side].values[found] for side in ("below", "above")])


def parted(case: sx.Case, starts: np.ndarray) -> int:
    """How many pairs end on two attractors as the referee has it."""
    import compare
    import referee

    machine = referee.machine_of(case.resolved)
    with tempfile.TemporaryDirectory() as folder:
        library = referee.build(Path(folder))
        one, other = (referee.outcomes(library, machine, side[:, :2]) for side in starts)
    return sum(not compare.same_motion(machine, *pair) for pair in zip(one, other, strict=True))


if __name__ == "__main__":
    raise SystemExit(main())
