#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times the analysis of machines with impacts beside its bars, writes docs/performance_analysis.md."""

import argparse
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from evidence_rows import processor, table
from separatrix import measures, open_result

SOURCE = Path(__file__).resolve().parents[2]
EXAMPLES = SOURCE / "examples"
IMPACTS = 1_000_000
POINTS = 500
PHASES = 32


@dataclass(frozen=True)
class Figure:
    """What took how long: processor and wall time, scaled to the size that the bar speaks of."""

    what: str
    machine: str
    bar: float
    cpu: float
    wall: float
    size: str


@dataclass(frozen=True)
class Shell:
    """The program and where its files go."""

    program: Path
    folder: Path

    def run(self, *words: object) -> tuple[str, float, float]:
        """Output, processor seconds and wall seconds of a command."""
        cpu, wall = children(), time.monotonic()
        ended = subprocess.run(
            [str(word) for word in (self.program, *words)],
            check=True,
            capture_output=True,
            text=True,
            cwd=self.folder,
        )
        return ended.stdout, children() - cpu, time.monotonic() - wall


def children() -> float:
    """Processor seconds of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def spectrum(shell: Shell) -> Figure:
    """Lyapunov exponents of a chaotic motion with impacts."""
    case = EXAMPLES / "validation" / "budd_dux.toml"
    words = ("stability", case, "--set", "contact.upper=0", "--periods", 950_000)
    output, cpu, wall = shell.run(*words)
    impacts = int(re.search(r"with (\d+) impacts", output)[1])
    share = IMPACTS / impacts
    return Figure(
        "Lyapunov spectrum of 1e6 impacts, with its transient and the 0-1 test",
        "`validation/budd_dux`, wall at 0",
        1,
        cpu * share,
        wall * share,
        f"{impacts} impacts",
    )


def branch(shell: Shell) -> Figure:
    """Branches over the range of a sweep, searched from three values."""
    words = ("branches", EXAMPLES / "sweep_coulomb.toml", "--parameter", "drive.ratio", "-q", "--force")
    _, cpu, wall = shell.run(*words, "-o", "branches.h5", "--searches", 3)
    with open_result(shell.folder / "branches.h5") as result:
        points = result.sizes["point"]
    share = POINTS / points
    return Figure(
        "500 points of branches, with the search for orbits",
        "`sweep_coulomb`",
        1,
        cpu * share,
        wall * share,
        f"{points} points",
    )


def boundary(shell: Shell) -> Figure:
    """The boundary of a map of 1000 x 1000 starts."""
    text = (EXAMPLES / "basin_coulomb.toml").read_text().replace("count = 400", "count = 1000")
    (shell.folder / "map.toml").write_text(text + "\n[refine]\n")
    shell.run("basin", "map.toml", "-q", "--force", "-o", "map.h5")
    output, cpu, wall = shell.run("boundary", "map.h5", "--force", "-o", "boundary.h5")
    points = int(re.search(r"(\d+) boundary points", output)[1])
    return Figure(
        "boundary of a map of 1000 x 1000 starts, named, with the sets of its saddle",
        "`basin_coulomb`",
        10,
        cpu,
        wall,
        f"{points} points",
    )


def integrity(shell: Shell) -> Figure:
    """The local integrity of the orbit over all phases of the drive."""
    text = (EXAMPLES / "basin_coulomb.toml").read_text().replace("count = 400", "count = 100")
    (shell.folder / "small.toml").write_text(text)
    shell.run("basin", "small.toml", "-q", "--force", "-o", "small.h5")
    cpu, wall = time.process_time() + children(), time.monotonic()
    found = measures(shell.folder / "small.h5", ["local_integrity_over_phases"], attractors=2, phases=PHASES)
    cpu, wall = time.process_time() + children() - cpu, time.monotonic() - wall
    value = found["local_integrity_over_phases"].value
    return Figure(
        "LIM over 32 phases, for which 32 maps of 100 x 100 starts are run",
        "`basin_coulomb`, impacting motion",
        300,
        cpu,
        wall,
        f"LIM {value:.4g}",
    )


PAGE = """# Time of the analysis

Written by `scripts/evidence/analysis_speed.py`; do not edit. The release build runs on one core. The column
*processor* is the CPU time, which other work on the machine hardly affects; *wall* is the elapsed time
under the given load.
{machine}

{rows}

A row above its limit is marked. The spectrum is accumulated over 16 motions on the same attractor, computed
together in vectors; its transient is computed event by event.
"""


def main() -> None:
    """Measure, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=SOURCE / "build")
    parser.add_argument("--print", action="store_true", help="prints the table, writes no page")
    options = parser.parse_args()
    kinds: tuple[Callable[[Shell], Figure], ...] = (spectrum, branch, boundary, integrity)
    with tempfile.TemporaryDirectory() as folder:
        shell = Shell((options.build / "bin" / "separatrix").resolve(), Path(folder))
        found = [kind(shell) for kind in kinds]
    rows = [
        [
            one.what,
            one.machine,
            one.size,
            f"{one.cpu:.2g} s",
            f"{one.wall:.2g} s",
            f"{one.bar:g} s{'' if one.cpu <= one.bar else ': missed'}",
        ]
        for one in found
    ]
    rows = table(["work", "machine", "size", "processor", "wall", "limit"], rows)
    if options.print:
        sys.stdout.write(rows + "\n")
        return
    page = PAGE.format(machine=f"Processor: {processor()['model name']}.", rows=rows)
    (SOURCE / "docs" / "performance_analysis.md").write_text(page)


if __name__ == "__main__":
    main()
