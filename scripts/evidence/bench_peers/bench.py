# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times Separatrix and its peers in turn, compares both with quadruple precision, writes a page."""

import argparse
import random
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import limits
import numpy as np
import report
import rows_report
from accuracy import Accuracy, compare
from compiled import Compiled, build
from ours import FULL, ONE_BY_ONE, Maps, Program, Timing, flips, read_points
from python_peers import Heyoka, Scipy
from reference_run import run_on_all_cores
from rows import ROWS, Row
from rows_run import keep, measure

from machine import SEED, SOURCE, TOLERANCE, Outcomes, published_machine, start_points

BATCH = 8
MACHINES = SOURCE / "docs" / "performance_machines.md"


@dataclass
class Sizes:
    """How much of everything; the batch divides that of heyoka."""

    rounds: int = 7
    full: tuple[int, int] = (100, 500)
    full_single: tuple[int, int] = (30, 110)
    stopped: tuple[int, int] = (200, 1000)
    stopped_single: tuple[int, int] = (100, 500)
    viscous: tuple[int, int] = (100, 400)
    stribeck: tuple[int, int] = (50, 200)
    stribeck_single: tuple[int, int] = (15, 35)
    heyoka: int = 2000
    heyoka_batch: int = 4000
    gsl: int = 1500
    cvode: int = 100
    scipy: int = 6
    reference: int = 100000
    stopped_reference: int = 4000
    flips: int = 1000
    stribeck_starts: int = 30000


QUICK = Sizes(
    rounds=3,
    full=(50, 200),
    full_single=(15, 50),
    stopped=(100, 400),
    stopped_single=(50, 200),
    viscous=(50, 150),
    stribeck=(20, 100),
    stribeck_single=(8, 20),
    heyoka=600,
    heyoka_batch=1200,
    gsl=500,
    cvode=30,
    scipy=2,
    reference=2000,
    stopped_reference=500,
    flips=300,
    stribeck_starts=3000,
)


class Peer:
    """A peer and the starts that it runs in every round."""

    def __init__(self, solver: Compiled | Heyoka | Scipy, starts: np.ndarray) -> None:
        self.solver, self.starts = solver, starts
        self.found: Outcomes | None = None
        # the first call compiles, loads and warms up
        self.solver.run(starts[:BATCH] if isinstance(solver, Heyoka) else starts[:1])

    def round(self) -> Timing:
        """All starts once."""
        cpu, wall = time.process_time(), time.perf_counter()
        self.found = self.solver.run(self.starts)
        return Timing(len(self.starts), time.process_time() - cpu, time.perf_counter() - wall)

    def outcomes(self) -> Outcomes:
        """What the last round found."""
        return self.found


@dataclass
class Results:
    """Everything that the page shows."""

    sizes: Sizes
    timings: dict[str, list[Timing]] = field(default_factory=dict)
    accuracy: dict[str, Accuracy] = field(default_factory=dict)
    outcomes: dict[str, Outcomes] = field(default_factory=dict)
    flips: tuple[int, int] = (0, 0)
    """Labels of settle-and-stop that differ from our own full runs, and points compared."""
    stribeck: Accuracy | None = None
    """Coulomb-Stribeck in lanes against one by one."""
    version: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0


def contestants(program: Program, build_folder: Path, sizes: Sizes) -> dict[str, Peer | Maps]:
    """Everybody who is timed, ready to run."""
    machine = published_machine()
    starts = start_points(max(sizes.heyoka_batch, sizes.reference))

    def compiled(peer: str, count: int) -> Peer:
        library = build(peer, build_folder / "bench_peers")
        return Peer(Compiled(library, machine, TOLERANCE), starts[:count])

    return {
        "full": Maps(program, "coulomb", sizes.full, *FULL),
        "full_single": Maps(program, "coulomb", sizes.full_single, *FULL, *ONE_BY_ONE),
        "stopped": Maps(program, "coulomb", sizes.stopped),
        "stopped_single": Maps(program, "coulomb", sizes.stopped_single, *ONE_BY_ONE),
        "heyoka_batch": Peer(Heyoka(machine, TOLERANCE, BATCH), starts[: sizes.heyoka_batch]),
        "heyoka": Peer(Heyoka(machine, TOLERANCE, 0), starts[: sizes.heyoka]),
        "gsl": compiled("gsl", sizes.gsl),
        "cvode": compiled("cvode", sizes.cvode),
        "scipy": Peer(Scipy(machine, TOLERANCE), starts[: sizes.scipy]),
        "flow": Peer(Heyoka(machine, TOLERANCE, BATCH, events=False), starts[: sizes.heyoka_batch]),
        "viscous": Maps(program, "viscous", sizes.viscous, *FULL),
        "stribeck": Maps(program, "stribeck", sizes.stribeck, *FULL),
        "stribeck_single": Maps(program, "stribeck", sizes.stribeck_single, *FULL, *ONE_BY_ONE),
    }


def assess(everybody: dict, library: Path, program: Program, results: Results) -> None:
    """Accuracy of all who ran the Coulomb case."""
    sizes = results.sizes
    print(
        f"bench: {sizes.reference + 2 * sizes.stopped_reference} trajectories in quadruple precision",
        flush=True,
    )
    starts = start_points(sizes.reference)
    truth = run_on_all_cores(library, program.program, starts)
    for name, words in (("full", ()), ("full_single", ONE_BY_ONE)):
        _, path = program.points("coulomb", starts, f"points_{name}", *words)
        results.outcomes[name] = read_points(path)
    for name in ("heyoka_batch", "heyoka", "gsl", "cvode", "scipy"):
        results.outcomes[name] = everybody[name].outcomes()
    for name, found in results.outcomes.items():
        results.accuracy[name] = compare(found, truth)
    for name in ("stopped", "stopped_single"):
        count, size = sizes.stopped_reference, everybody[name].sizes[1]
        chosen = np.array(random.Random(SEED).sample(range(size**2), count))
        starts, labels = everybody[name].labels(chosen)
        wrong = int(np.sum(run_on_all_cores(library, program.program, starts).label != labels))
        results.accuracy[name] = Accuracy(count, None, None, wrong)
    results.flips = flips(program, sizes.flips)
    starts = start_points(sizes.stribeck_starts)
    flown = [
        read_points(program.points("stribeck", starts, f"points_stribeck_{len(words)}", *words)[1])
        for words in ((), ONE_BY_ONE)
    ]
    results.stribeck = compare(*flown)


def main() -> None:
    """Run everything."""
    parser = argparse.ArgumentParser(prog="bench")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--machines", nargs="*", choices=[row.key for row in ROWS])
    parser.add_argument("--limits", action="store_true")
    parser.add_argument("--build", type=Path, default=SOURCE / "build")
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    if options.output and (options.limits or options.machines is not None):
        parser.error("--output: found with --limits or --machines, whose pages have fixed paths")
    options.output = options.output or SOURCE / "docs" / "performance.md"
    began = time.perf_counter()
    results = Results(QUICK if options.quick else Sizes())
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        program = Program(options.build / "bin" / "separatrix", Path(folder))
        results.version = program.version
        if options.limits:
            print(limits.report(program, options.build))
            return
        if options.machines is not None:
            chosen = tuple(row for row in ROWS if not options.machines or row.key in options.machines)
            report_machines(chosen, program, options)
            return
        run_published(program, options.build, results)
    results.seconds = time.perf_counter() - began
    text = report.page(results, options.quick)
    options.output.write_text(text)
    print(text)
    print(f"bench: wrote {options.output}")


def report_machines(chosen: tuple[Row, ...], program: Program, options: argparse.Namespace) -> None:
    """Measures the machines chosen; the page has them and those that were measured before."""
    results = []
    for row in chosen:
        results.append(measure(row, program, options.build, 3, options.quick))
        if not options.quick:
            MACHINES.write_text(rows_report.page(keep(MACHINES.with_suffix(".json"), results)))
    print(rows_report.speed_table(results), rows_report.accuracy_table(results), sep="\n\n")


def run_published(program: Program, build_folder: Path, results: Results) -> None:
    """The published case, by everybody."""
    everybody = contestants(program, build_folder, results.sizes)
    results.timings = {name: [] for name in everybody}
    names = list(everybody)
    for number in range(results.sizes.rounds):
        print(f"bench: round {number + 1} of {results.sizes.rounds}", flush=True)
        # everybody follows everybody else in turn
        for name in names[number % len(names) :] + names[: number % len(names)]:
            results.timings[name].append(everybody[name].round())
    assess(everybody, build_folder / "lib" / "libseparatrix_reference.so", program, results)


if __name__ == "__main__":
    main()
