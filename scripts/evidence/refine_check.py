# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a map refined and with every point computed, and compare the two point by point.

    scripts/evidence/refine_check.py examples/basin_coulomb_refined.toml --set 'axis[1].count=512'

Ends with code 1 if a point differs.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

TOP = Path(__file__).resolve().parents[2]
MARKS = ("regime", "attractor", "reason", "period", "event_word")
ROWS = 256
LAST_COMPUTED = 2  # of the origins


def main() -> int:
    """Run both maps and print what they have in common."""
    options = arguments()
    text = options.case.read_text()
    without = re.sub(r"(?ms)^\[refine\].*?(?=^\[|\Z)", "", text)
    settings = list(options.set)
    if without == text and not any(setting.startswith("refine") for setting in settings):
        settings.append("refine.step=16")
    plain = [setting for setting in settings if not setting.startswith("refine")]
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        case = Path(folder) / "case.toml"
        case.write_text(without)
        whole, refined = Path(folder) / "whole.h5", Path(folder) / "refined.h5"
        refined_seconds = run(options, options.case, refined, settings)
        whole_seconds = run(options, case, whole, plain)
        return report(whole, refined, whole_seconds, refined_seconds)


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", type=Path)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as for separatrix")
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--program", type=Path, default=TOP / "build" / "bin" / "separatrix")
    parser.add_argument("--folder", type=Path, help="for the two files, which are removed again")
    return parser.parse_args()


def run(options: argparse.Namespace, case: Path, output: Path, settings: list[str]) -> float:
    """Compute a map; return how long it took in seconds."""
    start = time.monotonic()
    command = ["mpirun", "-n", str(options.ranks), options.program, "basin", case, "-q", "-o", output]
    command += [word for setting in settings for word in ("--set", setting)]
    subprocess.run(command, check=True)
    return time.monotonic() - start


def report(whole: Path, refined: Path, whole_seconds: float, refined_seconds: float) -> int:
    """Print shares and differences; return 1 if there are differences."""
    with h5py.File(whole) as one, h5py.File(refined) as other:
        shape = one["regime"].shape
        differing = dict.fromkeys(MARKS, 0)
        points = computed = anywhere = 0
        for first in range(0, shape[0], ROWS):
            rows = slice(first, first + ROWS)
            wrong = np.zeros(one["regime"][rows].shape, dtype=bool)
            for name in MARKS:
                here = one[name][rows] != other[name][rows]
                differing[name] += int(here.sum())
                wrong |= here
            points += wrong.size
            anywhere += int(wrong.sum())
            computed += int((other["origin"][rows] <= LAST_COMPUTED).sum())
        facts = dict(other["refinement"].attrs)
    print(f"{' x '.join(map(str, shape))} = {points} points")
    print(f"computed: {computed} points, {100 * computed / points:.3f} %")
    print(f"probes: {facts['probes_drawn']} drawn, {facts['probes_contradicted']} contradicted")
    limit, confidence = 100 * facts["wrong_share_upper_limit"], 100 * facts["confidence"]
    print(f"wrong, as the file states with {confidence:.0f} % confidence: at most {limit:.3g} %")
    print(f"wrong, as found: {anywhere} points, {100 * anywhere / points:.3g} %")
    print("differing: " + ", ".join(f"{name} {count}" for name, count in differing.items()))
    print(f"seconds: {refined_seconds:.1f} refined, {whole_seconds:.1f} with every point computed")
    return int(anywhere > 0)


if __name__ == "__main__":
    sys.exit(main())
