# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures scaling here, simulates it beyond, writes a page."""

import argparse
import os
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import file_report
import numpy as np
import plots
import report
import slow_files
from costs import stretched
from memory import Memory, measure
from model import Model, setting
from packing import CASE, Packing, time_files
from runs import POINTS_PER_TILE, SOURCE, TILE, Program, Replay, Run
from simulation import (
    CHUNKS_PER_SLAB,
    RECORD_BYTES,
    TRAJECTORIES_PER_TILE,
    Before,
    Simulated,
    Simulation,
    jobs_after,
)
from storage import Storage, job_of
from traced import trace

BAR = 0.9
MOST_SECONDS = 240.0
"""Of all repetitions."""
REPLAY_POLLS = 16
TRACED_RANKS = (1, 2, 4, 8, 16, 32)
SIDE, TILE_SIDE = 1024, 32
"""Of the map whose calls are counted."""


@dataclass
class Sizes:
    """How much of everything."""

    repetitions: int = 3
    ratios: int = 41
    seconds: float = 24.0
    """Of the map on one rank."""
    replay_seconds: float = 24.0
    whole: tuple[int, ...] = (256, 1024)
    """Rows of maps run as a whole."""
    started: tuple[int, ...] = (2048, 4096, 8192)
    tiles: tuple[int, ...] = (32, 8, 4, 2)
    """Sides, on the first of the maps stopped early."""
    slices: tuple[int, ...] = (128, 4096)
    packed: tuple[int, ...] = (512, 2048)
    """Sides of the maps whose final file is timed."""


QUICK = Sizes(1, 21, 4.0, 8.0, (256, 512), (2048, 4096), (32, 4), (128, 1024), (256, 1024))


@dataclass
class Check:
    """A run beside the model's prediction for the costs of that run."""

    what: str
    ranks: int
    per_node: int
    measured: Replay
    predicted: Replay


@dataclass
class Results:
    """Everything that the page shows."""

    sizes: Sizes
    ranks: list[int] = field(default_factory=list)
    v0_count: int = 0
    strong: dict[int, list[Run]] = field(default_factory=dict)
    weak: dict[int, list[Run]] = field(default_factory=dict)
    copies: dict[int, list[float]] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    simulated: Simulated | None = None
    memory: Memory | None = None
    packing: Packing | None = None
    operations: str = ""
    """The section on calls, as it was."""
    version: dict[str, str] = field(default_factory=dict)
    load: tuple[float, float] = (0.0, 0.0)
    seconds: float = 0.0

    @property
    def base(self) -> Run:
        """The run on one rank whose tile phase is the median."""
        return sorted(self.strong[1], key=lambda run: run.tile_phase)[(len(self.strong[1]) - 1) // 2]


def progress(text: str) -> None:
    """One line of progress."""
    print(f"scaling: {text}", flush=True)


def ranks_here() -> list[int]:
    """1, 2, 4, ... and all cores."""
    cores = os.cpu_count() or 1
    powers = [2**k for k in range(cores.bit_length()) if 2**k <= cores]
    return sorted({*powers, cores, 2})


def measure_here(program: Program, results: Results) -> None:
    """Strong and weak scaling, all in turn."""
    sizes = results.sizes
    small = 2 * TILE
    pilot = program.uneven(1, sizes.ratios, small)
    widths = round(small / TILE * sizes.seconds / pilot.tile_phase / 2)
    half = TILE * min(max(widths, 1), 64)
    results.v0_count = 2 * half
    began = time.perf_counter()
    for number in range(sizes.repetitions):
        # a busy machine gets fewer repetitions
        if number > 0 and (time.perf_counter() - began) * (number + 1) / number > MOST_SECONDS:
            break
        for ranks in results.ranks:
            progress(f"repetition {number + 1} of {sizes.repetitions}, {ranks} ranks")
            strong = program.uneven(ranks, sizes.ratios, results.v0_count)
            results.strong.setdefault(ranks, []).append(strong)
            # the map on two ranks is already there
            weak = strong if ranks == 2 else program.uneven(ranks, sizes.ratios, ranks * half)
            results.weak.setdefault(ranks, []).append(weak)
            results.copies.setdefault(ranks, []).append(program.copies(ranks, sizes.ratios, TILE))


def predict(model: Model, ranks: int, per_node: int, costs: np.ndarray, polls: int) -> Replay:
    """Prediction of the model for these tiles on this machine."""
    found = model.run(setting(ranks, per_node, polls_per_tile=polls), costs)
    return Replay(found.tiles, found.questions, found.makespan, 1 - found.efficiency)


def check_model(program: Program, model: Model, results: Results) -> None:
    """The model beside the bare scheduler and the program."""
    costs = stretched(results.base.costs, 4 * 84)
    costs *= results.sizes.replay_seconds / costs.sum()
    for ranks, per_node in ((2, 1), (4, 1), (4, 2), (8, 2), (8, 4), (16, 4)):
        progress(f"the scheduler on {ranks} sleeping ranks, {per_node} to a node")
        found = program.replay(ranks, per_node, costs, REPLAY_POLLS)
        expected = predict(model, ranks, per_node, costs, REPLAY_POLLS)
        results.checks.append(Check("scheduler", ranks, per_node, found, expected))
    for ranks, per_node in ((2, 1), (4, 2), (8, 4)):
        progress(f"the program on {ranks} ranks, {per_node} to a node")
        run = program.uneven(ranks, results.sizes.ratios, 2 * TILE, "--ranks-per-node", per_node)
        found = Replay(run.tiles, np.zeros(0, int), run.tile_phase, run.idle)
        expected = predict(model, ranks, per_node, run.costs, POINTS_PER_TILE)
        results.checks.append(Check("program", ranks, per_node, found, expected))


def only_jobs(build: Path, page: Path, storage: Storage) -> None:
    """Measure what the section on whole jobs needs, and replace that section."""
    with tempfile.TemporaryDirectory(prefix="scaling-") as name:
        folder = Path(name)
        program = Program(build, folder)
        base = program.uneven(1, Sizes.ratios, 32 * TILE)
        packing = time_files(program, Sizes.packed, Sizes.repetitions)
        mean = float(base.costs.mean()) * TRAJECTORIES_PER_TILE / POINTS_PER_TILE
        simulation = Simulation(Model(folder), base.costs, mean, packing.constants, storage)
        before = time_before(program, base, 32 * TILE)
        jobs = simulation.whole_jobs(before.seconds)
        made = report.jobs_made(packing, program.version)
        parts = report.parts_text(simulation.stated_jobs(), storage)
        section = report.jobs_section(jobs, mean, before, made, parts)
    put_jobs(page, section)


def only_search(build: Path, page: Path) -> None:
    """Measure the search again, and change the section on whole jobs by what it takes more or less."""
    kept = report.read_jobs(page.read_text())
    with tempfile.TemporaryDirectory(prefix="scaling-") as name:
        program = Program(build, Path(name))
        search = program.search(Sizes.ratios, 32 * TILE)
    before = Before(kept.start, search, program.version["commit"])
    jobs = jobs_after(kept.jobs, kept.mean, kept.start + kept.search, before.seconds)
    put_jobs(page, report.jobs_section(jobs, kept.mean, before, kept.made, kept.parts))


def only_model(build: Path, page: Path, storage: Storage) -> None:
    """Simulate the whole jobs again, with the durations that the page has and the shape of costs now."""
    kept = report.read_jobs(page.read_text())
    with tempfile.TemporaryDirectory(prefix="scaling-") as name:
        program = Program(build, Path(name))
        # the least of some: other work on the machine would make the costs more even
        runs = [program.uneven(1, QUICK.ratios, 32 * TILE).costs for _ in range(Sizes.repetitions)]
        costs = np.min(runs, axis=0)
        simulation = Simulation(Model(Path(name)), costs, kept.mean, kept.packing, storage)
        jobs = simulation.whole_jobs(kept.start + kept.search)
        parts = report.parts_text(simulation.stated_jobs(), storage)
    page.write_text(report.with_jobs_at_top(report.with_jobs(page.read_text(), jobs, parts)))


def only_operations(build: Path, page: Path) -> None:
    """Count the calls on files here, time runs on a slow file system, and replace the section on them."""
    load = os.getloadavg()[0]
    words = ["--set", f"axis[1].count={SIDE}", "--set", f"axis[2].count={SIDE}"]
    words += ["--set", f"grid.tile=[{TILE_SIDE}, {TILE_SIDE}]"]
    tiles = (SIDE // TILE_SIDE) ** 2
    with tempfile.TemporaryDirectory(prefix="scaling-") as name:
        program = Program(build, Path(name))
        model = Model(Path(name))
        jobs = {
            ranks: job_of(ranks, tiles, SIDE**2, CHUNKS_PER_SLAB, ranks)
            for ranks in {*TRACED_RANKS, *slow_files.RANKS}
        }
        traced = []
        for ranks in TRACED_RANKS:
            progress(f"the calls of {ranks} ranks")
            run = trace(program, ranks, CASE, *words)
            writes = model.run(setting(ranks, ranks), run.costs).writes
            traced.append((run, jobs[ranks], writes))
        slow = []
        if Path("/dev/fuse").exists():
            progress("a slow file system")
            slow = slow_files.compare(program, model, words, {n: jobs[n] for n in slow_files.RANKS})
        section = file_report.section(traced, slow, RECORD_BYTES, program.version["commit"], load)
    before, rest = page.read_text().split(file_report.BEGIN)
    page.write_text(before + section + rest.split(file_report.END)[1])
    print(section)


def operations_of(page: Path) -> str:
    """Return the section on calls of a page that exists."""
    if page.exists() and file_report.BEGIN in (text := page.read_text()):
        return (
            file_report.BEGIN + text.split(file_report.BEGIN)[1].split(file_report.END)[0] + file_report.END
        )
    return f"{file_report.BEGIN}\n{file_report.END}"


def time_before(program: Program, base: Run, v0_count: int) -> Before:
    """What a job does before its first tile; the final file of the base is part of the start."""
    search = program.search(Sizes.ratios, v0_count)
    return Before(max(base.around - search.whole, 0.0), search, program.version["commit"])


def put_jobs(page: Path, section: str) -> None:
    """Replace the section on whole jobs and what the table at the top has of it."""
    before, rest = page.read_text().split(report.JOBS_BEGIN)
    page.write_text(report.with_jobs_at_top(before + section + rest.split(report.JOBS_END)[1]))
    print(section)


def main() -> None:
    """Run everything."""
    parser = argparse.ArgumentParser(prog="scaling")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--build", type=Path, default=SOURCE / "build")
    parser.add_argument("--output", type=Path, default=SOURCE / "docs" / "scaling.md")
    parser.add_argument("--jobs", action="store_true", help="only the section on whole jobs")
    parser.add_argument(
        "--search", action="store_true", help="only the search for attractors of that section"
    )
    parser.add_argument("--model", action="store_true", help="only the simulation of whole jobs")
    parser.add_argument("--operations", action="store_true", help="only the section on calls on files")
    parser.add_argument("--storage", action="append", default=[], metavar="NAME=VALUE", help="another rate")
    options = parser.parse_args()
    try:
        storage = Storage().other(options.storage)
    except ValueError as error:
        parser.error(str(error))
    if options.operations:
        only_operations(options.build, options.output)
        return
    if options.model:
        only_model(options.build, options.output, storage)
        return
    if options.search:
        only_search(options.build, options.output)
        return
    if options.jobs:
        only_jobs(options.build, options.output, storage)
        return
    began = time.perf_counter()
    results = Results(QUICK if options.quick else Sizes(), ranks_here())
    results.operations = operations_of(options.output)
    before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="scaling-") as name:
        folder = Path(name)
        program = Program(options.build, folder)
        if program.version["mpi"] == "none":
            parser.error(f"{options.build} was built without MPI")
        results.version = program.version
        measure_here(program, results)
        model = Model(folder)
        check_model(program, model, results)
        progress("the final file")
        results.packing = time_files(program, results.sizes.packed, results.sizes.repetitions)
        progress("simulating up to 100 000 ranks")
        base = results.base
        mean = float(base.costs.mean()) * TRAJECTORIES_PER_TILE / POINTS_PER_TILE
        results.simulated = Simulation(
            model, base.costs, mean, results.packing.constants, storage
        ).everything(BAR, time_before(program, base, results.v0_count))
        progress("memory")
        sizes = results.sizes
        results.memory = measure(program, sizes.whole, sizes.started, sizes.tiles, sizes.slices)
        results.load = before, os.getloadavg()[0]
    results.seconds = time.perf_counter() - began
    plots.draw(options.output.parent / "figures", results.simulated, base, results.sizes.ratios, BAR)
    text = report.page(results, options.quick)
    text = report.with_jobs_at_top(text)
    options.output.write_text(text)
    print(text)
    progress(f"wrote {options.output}")


if __name__ == "__main__":
    main()
