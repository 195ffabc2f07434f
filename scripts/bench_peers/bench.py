# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times Separatrix and its peers in turn, compares both with quadruple precision, writes a page."""

import argparse
import random
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import report
from compiled import Compiled, build
from ours import FullRuns, Program, StoppedRuns, Timing, read_points
from published_case import SEED, SOURCE, TOLERANCE, Outcomes, published_machine, start_points
from python_peers import Heyoka, Scipy
from reference_run import Reference

BATCH = 8


@dataclass
class Sizes:
    """How much of everything; the batch divides that of heyoka."""

    rounds: int = 7
    full: tuple[int, int] = (2000, 22000)
    stopped: tuple[int, int] = (100, 600)
    viscous: tuple[int, int] = (1000, 6000)
    stribeck: tuple[int, int] = (200, 1200)
    heyoka: int = 2000
    heyoka_batch: int = 4000
    gsl: int = 1500
    cvode: int = 100
    scipy: int = 6
    reference: int = 10000
    stopped_reference: int = 4000
    stopped_full: int = 50000


QUICK = Sizes(3, (1000, 6000), (100, 300), (500, 2500), (100, 500), 600, 1200, 500, 30, 2, 2000, 500, 5000)


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
class Accuracy:
    """A contestant against quadruple precision."""

    points: int
    deviation: float | None
    """Largest of |dx|/max|x| and |dv|/max|v| of final states, where the numbers of impacts agree."""
    counts: int | None
    labels: int


@dataclass
class Results:
    """Everything that the page shows."""

    sizes: Sizes
    timings: dict[str, list[Timing]] = field(default_factory=dict)
    accuracy: dict[str, Accuracy] = field(default_factory=dict)
    outcomes: dict[str, Outcomes] = field(default_factory=dict)
    flips: int = 0
    """Labels of settle-and-stop that differ from our own full runs."""
    version: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0


def compare(found: Outcomes, reference: Outcomes) -> Accuracy:
    """Compare as many starts as both have."""
    points = min(len(found.x), len(reference.x))
    same = found.impacts[:points] == reference.impacts[:points]
    deviation = max(
        float(np.max(np.abs(mine[:points] - true[:points])[same]) / np.max(np.abs(true)))
        for mine, true in ((found.x, reference.x), (found.v, reference.v))
    )
    labels = int(np.sum(found.label[:points] != reference.label[:points]))
    return Accuracy(points, deviation, int(np.sum(~same)), labels)


def contestants(
    program: Program, build_folder: Path, sizes: Sizes
) -> dict[str, Peer | FullRuns | StoppedRuns]:
    """Everybody who is timed, ready to run."""
    machine = published_machine()
    starts = start_points(max(sizes.full[1], sizes.reference))

    def full(law: str, size: tuple[int, int]) -> FullRuns:
        return FullRuns(program, law, starts[: size[1]], size[0])

    def compiled(peer: str, count: int) -> Peer:
        library = build(peer, build_folder / "bench_peers")
        return Peer(Compiled(library, machine, TOLERANCE), starts[:count])

    return {
        "full": full("coulomb", sizes.full),
        "stopped": StoppedRuns(program, *sizes.stopped),
        "heyoka_batch": Peer(Heyoka(machine, TOLERANCE, BATCH), starts[: sizes.heyoka_batch]),
        "heyoka": Peer(Heyoka(machine, TOLERANCE, 0), starts[: sizes.heyoka]),
        "gsl": compiled("gsl", sizes.gsl),
        "cvode": compiled("cvode", sizes.cvode),
        "scipy": Peer(Scipy(machine, TOLERANCE), starts[: sizes.scipy]),
        "flow": Peer(Heyoka(machine, TOLERANCE, BATCH, events=False), starts[: sizes.heyoka_batch]),
        "viscous": full("viscous", sizes.viscous),
        "stribeck": full("stribeck", sizes.stribeck),
    }


def judge(everybody: dict, reference: Reference, program: Program, results: Results) -> None:
    """Accuracy of all who ran the Coulomb case."""
    sizes = results.sizes
    print(
        f"bench: {sizes.reference + sizes.stopped_reference} trajectories in quadruple precision", flush=True
    )
    truth = reference.run(start_points(sizes.reference))
    for name in ("full", "heyoka_batch", "heyoka", "gsl", "cvode", "scipy"):
        results.outcomes[name] = everybody[name].outcomes()
        results.accuracy[name] = compare(results.outcomes[name], truth)
    stopped = everybody["stopped"]
    chosen = np.array(random.Random(SEED).sample(range(stopped.long**2), sizes.stopped_full))
    starts, labels = stopped.labels(chosen)
    _, path = program.points("coulomb", starts, "points_of_map")
    results.flips = int(np.sum(read_points(path).label != labels))
    count = sizes.stopped_reference
    wrong = int(np.sum(reference.run(starts[:count]).label != labels[:count]))
    results.accuracy["stopped"] = Accuracy(count, None, None, wrong)


def main() -> None:
    """Run everything."""
    parser = argparse.ArgumentParser(prog="bench")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--build", type=Path, default=SOURCE / "build")
    parser.add_argument("--output", type=Path, default=SOURCE / "docs" / "performance.md")
    options = parser.parse_args()
    began = time.perf_counter()
    results = Results(QUICK if options.quick else Sizes())
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        program = Program(options.build / "bin" / "separatrix", Path(folder))
        results.version = program.version
        reference = Reference(options.build / "lib" / "libseparatrix_reference.so", program.program)
        everybody = contestants(program, options.build, results.sizes)
        results.timings = {name: [] for name in everybody}
        names = list(everybody)
        for number in range(results.sizes.rounds):
            print(f"bench: round {number + 1} of {results.sizes.rounds}", flush=True)
            # everybody follows everybody else in turn
            for name in names[number % len(names) :] + names[: number % len(names)]:
                results.timings[name].append(everybody[name].round())
        judge(everybody, reference, program, results)
    results.seconds = time.perf_counter() - began
    text = report.page(results, options.quick)
    options.output.write_text(text)
    print(text)
    print(f"bench: wrote {options.output}")


if __name__ == "__main__":
    main()
