#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times the discovery workflow on records as long as a rig's, writes docs/performance_discovery.md.

Records come from the independent simulator (tests/generator). Each verdict is a process of its own, whose
processor time and largest memory the system reports.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from evidence_rows import processor, table

SOURCE = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "tests" / "generator"))

import design  # noqa: E402
import effects  # noqa: E402
import records  # noqa: E402

SEED = 5
HIDDEN = (
    ("nothing", "", 0.0, {}),
    ("quadratic drag", "quadratic_drag", 0.05, {}),
    ("hardening spring, power 2.2", "cubic_spring", 20.0, {"cubic_exponent": 2.2}),
    ("Maxwell element", "maxwell_element", 1.0, {"maxwell_time": 0.1}),
)
"""What is hidden, its name, its size, and its shape."""
LENGTHS = ((20.0, 500.0), (20.0, 2000.0), (60.0, 10000.0))
"""Length of each of the three records [s] and its sampling rate [Hz]."""
BAR_WALL, BAR_QUICK, BAR_MEMORY = 600.0, 60.0, 2000.0
"""For the longest records: wall time of a verdict and of one with --quick [s], memory [MB]."""

PAGE = """# Time of a verdict on missing physics

Written by `scripts/evidence/discovery_speed.py`; do not edit. The program `separatrix-discover` is run on
three records of the published machine, two for training and one held out. They have a noise of 0.5 % and the
crank angle from a mark. The independent simulator of `tests/generator` produced them (seed {seed}). Each
verdict is computed in a separate process. The table lists wall time, processor time and peak resident
memory. {processor} {load}

{rows}

Limits for 3 records of 60 s at 10 kHz (1.8 million samples): {bar_wall:.0f} s, with `--quick`
{bar_quick:.0f} s, and {bar_memory:.0f} MB. {met}
"""


@dataclass(frozen=True)
class Run:
    """What a verdict took."""

    outcome: str
    wall: float
    cpu: float
    memory: float
    """Largest resident memory [MB]."""


def case_of(name: str, size: float, shape: dict[str, float], seconds: float, rate: float) -> design.Case:
    """The published machine with an effect, in records of some length."""
    drawn = (design.draw(SEED, n, plain=True) for n in range(400) if design.plan(SEED, n)[0] == "none")
    case = next(one for one in drawn if one.regime == "published")
    case.level, case.colour, case.velocity, case.crank_angle = 0.005, "white", False, False
    if name:
        effect = effects.CATALOGUE.get(name) or effects.OUTSIDE[name]
        case.hidden = [design.Hidden(name, effect, shape, 1.0, size)]
        case.machine = case.hidden[0].on(case.base)
    for one in (*case.training, case.held_out):
        period = one.interval * one.samples_per_period
        one.samples_per_period, one.periods = round(rate * period), round(seconds / period)
    return case


def run(folder: Path, out: Path, *words: str) -> Run:
    """A verdict in a process of its own."""
    command = [sys.executable, "-m", "separatrix.discovery.cli", folder / records.BASE]
    command += [folder / name for name in records.TRAINING]
    command += ["--hold-out", folder / records.HELD_OUT, "--out", out, *words]
    began = time.monotonic()
    with (folder / "log").open("w") as log:
        started = subprocess.Popen([str(word) for word in command], stdout=log, stderr=log)
        _, status, used = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    wall = time.monotonic() - began
    if not (out / "verdict.json").is_file():
        sys.exit(f"discovery_speed: no verdict, exit code {started.returncode}: see {folder / 'log'}")
    verdict = json.loads((out / "verdict.json").read_text())
    outcome = f"{verdict['outcome']} {', '.join(verdict['effects'] or verdict['added'])}".strip()
    return Run(outcome, wall, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e6)


def main() -> None:
    """Measure, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--print", action="store_true", help="prints the table, writes no page")
    parser.add_argument("--short", action="store_true", help="leaves the longest records out")
    options = parser.parse_args()
    rows, longest = [], []
    for title, name, size, shape in HIDDEN:
        for seconds, rate in LENGTHS[: -1 if options.short else None]:
            with tempfile.TemporaryDirectory() as folder:
                case = case_of(name, size, shape, seconds, rate)
                records.write_case(Path(folder), Path(folder) / "truth.json", case)
                megabytes = sum(path.stat().st_size for path in Path(folder).glob("*.csv")) / 1e6
                runs = [
                    run(Path(folder), Path(folder) / f"out{i}", *w) for i, w in enumerate(((), ("--quick",)))
                ]
            samples = sum(one.count for one in (*case.training, case.held_out))
            cells = [f"{number:.0f}" for one in runs for number in (one.wall, one.cpu, one.memory)]
            rows.append([title, f"{samples}", f"{megabytes:.0f}", runs[0].outcome, *cells])
            print(" | ".join(rows[-1]), file=sys.stderr, flush=True)
            longest = [*longest, runs] if (seconds, rate) == LENGTHS[-1] else longest
    head = "hidden,samples,files (MB),verdict,wall (s),processor (s),memory (MB)".split(",")
    text = table([*head, *(f"quick: {one}" for one in head[-3:])], rows)
    if options.print or options.short:
        sys.stdout.write(text + "\n")
        return
    met = all(
        one.wall <= BAR_WALL and quick.wall <= BAR_QUICK and max(one.memory, quick.memory) <= BAR_MEMORY
        for one, quick in longest
    )
    page = PAGE.format(
        seed=SEED,
        processor=f"Processor: {processor()['model name']}, {os.cpu_count()} cores.",
        load=f"Load of the machine at the end: {os.getloadavg()[1]:.1f}.",
        rows=text,
        bar_wall=BAR_WALL,
        bar_quick=BAR_QUICK,
        bar_memory=BAR_MEMORY,
        met="All are met." if met else "**Not all are met.**",
    )
    (SOURCE / "docs" / "performance_discovery.md").write_text(page)


if __name__ == "__main__":
    main()
