# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/scaling.md: every number comes from the run."""

from __future__ import annotations

import datetime
import os
import re
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import file_report
import memory
import model
import packing
import simulation
from costs import spread_of
from evidence_rows import processor, table
from runs import POINTS_PER_TILE, X0_COUNT, Run
from storage import Storage

if TYPE_CHECKING:
    from scaling import Results

BAR_TWO_RANKS = 1.9
BAR_EFFICIENCY = 0.9
BAR_FINISH = 0.05
"""Of the run on two ranks: what the final file takes."""
BAR_MEMORY = 1.1
"""Largest over smallest peak that counts as constant."""
MIB = 2**20
JOBS_BEGIN, JOBS_END = "<!-- jobs -->", "<!-- /jobs -->"
PARTS_BEGIN, PARTS_END = "<!-- parts -->", "<!-- /parts -->"
MOST_TILES = 2**20
"""Of src/config/case_setup.f90."""


def number(value: float) -> str:
    """Thousands apart."""
    return f"{value:,.0f}".replace(",", " ")


def percent(value: float) -> str:
    """One digit."""
    return f"{100 * value:.1f} %"


def middle(runs: list[Run], of: Callable[[Run], float]) -> float:
    """The median of something."""
    return statistics.median(of(run) for run in runs)


def gain(results: Results, ranks: int, of: Callable[[Run], float]) -> float:
    """Median over the repetitions of one rank's time over that of more in the same repetition."""
    pairs = zip(results.strong[1], results.strong[ranks], strict=True)
    return statistics.median(of(one) / of(more) for one, more in pairs)


def ceiling(results: Results, ranks: int) -> float:
    """What so many ranks could gain at most: copies of one map side by side, against one alone."""
    pairs = zip(results.copies[1], results.copies[ranks], strict=True)
    return statistics.median(ranks * one / more for one, more in pairs)


def busy(results: Results) -> bool:
    """Whether the machine did not give two ranks two cores."""
    return ceiling(results, 2) < BAR_TWO_RANKS


def remark(results: Results) -> str:
    """What a busy machine means for the page."""
    if not busy(results):
        return ""
    return (
        "**This machine was busy with other work: two simultaneous independent programs reached "
        f"{ceiling(results, 2):.2f} times\nthe rate of one alone. The times of this run do not apply to two "
        "free cores; the idle shares do.**\n\n"
    )


def strong_table(results: Results) -> str:
    """One map on more and more ranks."""
    rows = []
    for ranks, runs in results.strong.items():
        walls = [run.wall for run in runs]
        rows.append(
            [
                str(ranks),
                f"{statistics.median(walls):.2f} s ({min(walls):.2f} to {max(walls):.2f})",
                f"{gain(results, ranks, lambda run: run.wall):.2f}",
                f"{middle(runs, lambda run: run.tile_phase):.2f} s",
                f"{gain(results, ranks, lambda run: run.tile_phase):.2f}",
                percent(middle(runs, lambda run: run.idle)),
                f"{ceiling(results, ranks):.2f}",
            ]
        )
    header = [
        "ranks",
        "whole program: median (all repetitions)",
        "relative to one rank",
        "tiles alone",
        "relative to one rank",
        "idle while tiles are left",
        "independent copies, relative to one",
    ]
    return table(header, rows)


def weak_table(results: Results) -> str:
    """A map that grows with the ranks."""
    rows = []
    for ranks, runs in results.weak.items():
        pairs = list(zip(results.weak[1], runs, strict=True))
        rows.append(
            [
                str(ranks),
                number(runs[0].points),
                f"{middle(runs, lambda run: run.wall):.2f} s",
                percent(statistics.median(one.wall / more.wall for one, more in pairs)),
                f"{middle(runs, lambda run: run.tile_phase):.2f} s",
                percent(statistics.median(one.tile_phase / more.tile_phase for one, more in pairs)),
            ]
        )
    header = ["ranks", "points", "whole program", "efficiency", "tiles alone", "efficiency"]
    return table(header, rows)


def check_table(results: Results) -> str:
    """Measured beside predicted."""
    rows = []
    for check in results.checks:
        found, expected = check.measured, check.predicted
        asked = str(found.questions.sum()) if len(found.questions) else "not logged"
        rows.append(
            [
                check.what,
                str(check.ranks),
                str(check.per_node),
                asked,
                str(expected.questions.sum()),
                f"{found.tiles.min()} to {found.tiles.max()}",
                f"{expected.tiles.min()} to {expected.tiles.max()}",
                f"{found.makespan:.2f} s",
                f"{expected.makespan:.2f} s",
                percent(found.idle),
                percent(expected.idle),
            ]
        )
    header = ["run", "ranks", "per node", "questions", "model", "tiles per rank", "model"]
    return table([*header, "time", "model", "idle", "model"], rows)


def ranks_table(results: Results) -> str:
    """Efficiency against ranks."""
    found = results.simulated
    rows = [[f"{spread}:1", *map(percent, line)] for spread, line in found.by_ranks.items()]
    rows += [
        [f"{simulation.BAR_SPREAD}:1, written at {rate}", *map(percent, line)]
        for rate, line in found.with_store.items()
    ]
    rows.append([f"{simulation.BAR_SPREAD}:1, the last with the final file", *map(percent, found.with_file)])
    rows.append([f"{simulation.BAR_SPREAD}:1, blocks of neighbours", *map(percent, found.neighbours)])
    return table(["cost spread", *(f"{number(ranks)} ranks" for ranks in simulation.RANKS)], rows)


def tiles_table(results: Results) -> str:
    """Efficiency against tiles per rank."""
    rows = [[f"{spread}:1", *map(percent, line)] for spread, line in results.simulated.by_tiles.items()]
    return table(["cost spread", *map(str, simulation.TILES_PER_RANK)], rows)


def looks_table(results: Results) -> str:
    """Efficiency against the looks of rank 0."""
    rows = [[str(looks), *map(percent, line)] for looks, line in results.simulated.by_looks.items()]
    header = ["polls of rank 0 per tile", *(f"{seconds:g} s per tile" for seconds in simulation.TILE_SECONDS)]
    return table(header, rows)


def seconds(value: float) -> str:
    """Two digits."""
    return f"{value:.2g} s"


@dataclass
class KeptJobs:
    """What a page states of whole jobs."""

    start: float
    search: float
    mean: float
    jobs: dict[int, list[float]]
    made: str
    parts: str
    packing: packing.Constants


def parts_text(parts: dict[int, simulation.Parts], storage: Storage) -> str:
    """Return what the parts of the stated job take, and the rates."""
    tables = [file_report.parts_table(parts), file_report.storage_table(storage)]
    return "\n\n".join([*tables, file_report.storage_text(storage)])


def jobs_made(found: packing.Packing, version: dict[str, str]) -> str:
    """Return what the table of whole jobs was made from, without the search."""
    return (
        f"Obtained with commit {version['commit']}: final file "
        f"{1000 * found.fixed:.0f} ms, {1e9 * found.alone_per_point:.1f} ns of rank 0 alone for each point, "
        f"{1e9 * found.shared_per_point:.0f} ns\nfor each point that a rank packs. The final file of "
        f"{number(found.runs[-1][0].points)} points took {percent(found.middle(-1, 'share'))} of the run on "
        f"{packing.RANKS} ranks."
    )


def jobs_table(jobs: dict[int, list[float]], mean: float) -> str:
    """Return the efficiencies of whole jobs."""
    means = (mean, *simulation.JOB_TILE_SECONDS)
    header = ["mean time of a tile (of the tiles of a rank)"]
    header += [f"{number(ranks)} ranks" for ranks in jobs]
    rows = [
        [
            f"{seconds(value)} ({simulation.USUAL * value:.0f} s)",
            *(percent(line[i]) for line in jobs.values()),
        ]
        for i, value in enumerate(means)
    ]
    lines = [
        f"* {number(ranks)} ranks: {reached(jobs[ranks], bar, means)}"
        for ranks, bar in simulation.JOB_RANKS.items()
    ]
    return "\n".join([table(header, rows), "", *lines])


def with_jobs(page: str, jobs: dict[int, list[float]], parts: str) -> str:
    """Return a page with other efficiencies of whole jobs and parts of one of them, the rest as it was."""
    kept = read_jobs(page)
    before, section = page.split(JOBS_BEGIN)
    section, after = section.split(JOBS_END)
    begin = section[: section.index("| mean time")]
    texts = [jobs_table(jobs, kept.mean), "", PARTS_BEGIN, parts, PARTS_END]
    return before + JOBS_BEGIN + begin + "\n".join(texts) + "\n" + JOBS_END + after


def jobs_section(
    jobs: dict[int, list[float]], mean: float, before: simulation.Before, made: str, parts: str
) -> str:
    """Return the table of whole jobs with what it was made from; `parts`: of `parts_text`."""
    search, points = before.search, before.ranks_points
    taken = (
        f"Start {before.start:.2f} s; search {search.seconds(points):.2f} s: "
        f"{search.per_rank(points):.1f} slices for each rank, "
        f"{search.whole / search.slices:.3f} s each in the mean,\n"
        f"and {search.longest:.2f} s for the slice that takes longest (commit {before.commit})."
    )
    begin = [JOBS_BEGIN, made, "", taken, "", jobs_table(jobs, mean), ""]
    return "\n".join([*begin, PARTS_BEGIN, parts, PARTS_END, JOBS_END])


def read_jobs(page: str) -> KeptJobs:
    """Read the section on whole jobs of a page, whose efficiencies have one digit."""
    section = page.split(JOBS_BEGIN)[1].split(JOBS_END)[0]
    section, parts = section.split(PARTS_BEGIN)
    made = section[: section.index("Start ")].strip()
    fixed = re.search(r"final file ([\d.]+) ms, ([\d.]+) ns of rank 0 alone .*, ([\d.]+) ns", made)
    constants = packing.Constants(1e-3 * float(fixed[1]), 1e-9 * float(fixed[2]), 1e-9 * float(fixed[3]))
    start, search = (float(value) for value in re.findall(r"(?:Start|search) ([\d.]+) s", section))
    rows = re.findall(r"^\| ([\d.]+) s \(.*?\) \|(.*)\|$", section, re.MULTILINE)
    columns = zip(
        *([float(value.strip(" %")) / 100 for value in row.split("|")] for _, row in rows), strict=True
    )
    jobs = dict(zip(simulation.JOB_RANKS, map(list, columns), strict=True))
    return KeptJobs(
        start, search, float(rows[0][0]), jobs, made, parts.split(PARTS_END)[0].strip(), constants
    )


def with_jobs_at_top(page: str) -> str:
    """Return a page whose first table has the rows of whole jobs that its section on them gives."""
    kept = read_jobs(page)
    means = (kept.mean, *simulation.JOB_TILE_SECONDS)
    rows = []
    for ranks, bar in list(simulation.JOB_RANKS.items())[1:]:
        line = kept.jobs[ranks]
        last = means[-1] * simulation.USUAL
        rows.append(
            f"| simulated whole job on {number(ranks)} ranks: start, search, tiles, writing, final file | "
            f">= {100 * bar:.0f} % | {reached(line, bar, means)}; {percent(line[-1])} with {last:.0f} s | "
            f"{'met' if max(line) >= bar else '**not met**'} |"
        )
    top, rest = page.split("\n## The map", 1)
    lines = [line for line in top.splitlines() if not line.startswith("| simulated whole job ")]
    at = next(i for i, line in enumerate(lines) if line.startswith("| memory per rank"))
    return "\n".join([*lines[:at], *rows, *lines[at:], ""]) + "\n## The map" + rest


def reached(line: list[float], bar: float, means: tuple[float, ...]) -> str:
    """Return from which time of a tile on a bar holds."""
    least = None
    for value, found in reversed(list(zip(means, line, strict=True))):
        if found < bar:
            break
        least = value
    if least is None:
        return f"{100 * bar:.0f} % is not reached by these jobs"
    return (
        f"{100 * bar:.0f} % from tiles of {seconds(least)} on, {simulation.USUAL * least:.0f} s for each rank"
    )


def packing_table(found: packing.Packing) -> str:
    """The final file of small and large maps."""
    rows = [
        [
            number(runs[0].points),
            f"{found.middle(size, 'whole'):.2f} s",
            f"{found.middle(size, 'packed'):.3f} s",
            percent(found.middle(size, "share")),
            f"{found.middle(size, 'alone'):.3f} s",
        ]
        for size, runs in enumerate(found.runs)
    ]
    return table(["points", "whole run", "final file", "share", "by rank 0 alone"], rows)


def memory_table(peaks: list[memory.Peak], last: list[int] | None = None) -> str:
    """Peaks."""
    rows = [
        [peak.what, number(peak.points), number(peak.tiles), f"{peak.bytes / MIB:.1f} MiB"] for peak in peaks
    ]
    header = ["run", "points", "tiles", "largest process"]
    if last is not None:
        header.append("attractors in all catalogues")
        rows = [[*row, number(count)] for row, count in zip(rows, last, strict=True)]
    return table(header, rows)


def bar_table(results: Results) -> str:
    """The bars beside what was reached."""
    met = {True: "met", False: "**not met**"}
    simulated, found = results.simulated, results.memory
    two = gain(results, 2, lambda run: run.wall)
    index = simulation.RANKS.index(simulation.MANY_RANKS)
    finish = results.packing.middle(-1, "share")
    many = simulated.by_ranks[simulation.BAR_SPREAD][index]
    groups = [
        f"{min(p.bytes for p in peaks) / MIB:.1f} to {max(p.bytes for p in peaks) / MIB:.1f} MiB ({how})"
        for how, peaks in (("whole runs", found.whole), ("stopped early", found.started))
    ]
    rows = [
        [
            "two ranks against one, whole program, map of very uneven cost",
            f">= {BAR_TWO_RANKS} x",
            f"{two:.2f} x ({gain(results, 2, lambda run: run.tile_phase):.2f} x in the tiles; "
            f"two independent copies: {ceiling(results, 2):.2f} x)",
            met[two >= BAR_TWO_RANKS] if two >= BAR_TWO_RANKS or not busy(results) else "machine busy",
        ],
        [
            f"simulated {number(simulation.MANY_RANKS)} ranks, cost spread {simulation.BAR_SPREAD}:1",
            f">= {100 * BAR_EFFICIENCY:.0f} %",
            f"{percent(many)} with {simulation.USUAL} tiles per rank; "
            + (
                f"at least {100 * BAR_EFFICIENCY:.0f} % from {simulated.least_tiles} tiles per rank on"
                if simulated.least_tiles
                else "no number of tiles per rank"
            ),
            met[many >= BAR_EFFICIENCY],
        ],
        [
            f"the final file, of a run on {packing.RANKS} ranks",
            f"<= {100 * BAR_FINISH:.0f} %",
            f"{percent(finish)} of a map of {number(results.packing.runs[-1][0].points)} points",
            met[finish <= BAR_FINISH] if finish <= BAR_FINISH or not busy(results) else "machine busy",
        ],
        [
            "memory per rank",
            "constant in the map size",
            f"{groups[0]}, {groups[1]}; {found.bytes_per_tile:.0f} bytes per tile",
            met[found.growth <= BAR_MEMORY],
        ],
    ]
    return table(["quantity", "target", "result", ""], rows)


def conditions(results: Results) -> str:
    """Machine, build, date."""
    before, after = results.load
    rows = [
        ["date", datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")],
        ["machine", f"{processor()['model name']}, {os.cpu_count()} cores"],
        ["load (1 min) before and after", f"{before:.1f}, {after:.1f}"],
        ["Separatrix", f"commit {results.version['commit']}, `{results.version['flags']}`"],
        ["repetitions", f"{len(results.strong[1])}, in turn; medians; {results.seconds:.0f} s in all"],
    ]
    return table(["", ""], rows)


def page(results: Results, quick: bool) -> str:
    """The whole page."""
    base, found, simulated = results.base, results.memory, results.simulated
    cheap = statistics.quantiles(base.costs, n=20)
    template = Path(__file__).with_name("scaling.md.in").read_text()
    least = simulated.least_tiles
    return template.format(
        command="scripts/evidence/scaling --quick" if quick else "scripts/evidence/scaling",
        bars=bar_table(results),
        ratios=results.sizes.ratios,
        x0_count=X0_COUNT,
        v0_count=results.v0_count,
        points=number(base.points),
        tiles=len(base.costs),
        tile_points=POINTS_PER_TILE,
        spread=number(spread_of(base.costs)),
        spread_trimmed=number(cheap[-1] / cheap[0]),
        largest=f"{base.costs.max() / base.costs.mean():.1f}",
        remark=remark(results),
        strong=strong_table(results),
        weak=weak_table(results),
        checks=check_table(results),
        by_ranks=ranks_table(results),
        by_tiles=tiles_table(results),
        by_looks=looks_table(results),
        packing=packing_table(results.packing),
        packing_ranks=packing.RANKS,
        fixed=f"{1000 * results.packing.fixed:.0f}",
        alone=f"{1e9 * results.packing.alone_per_point:.1f}",
        shared=f"{1e9 * results.packing.shared_per_point:.0f}",
        usual=simulation.USUAL,
        many=number(simulation.MANY_RANKS),
        per_node=simulation.RANKS_PER_NODE,
        bar_spread=simulation.BAR_SPREAD,
        mean=f"{1000 * simulated.mean:.0f}",
        trajectories=number(simulation.TRAJECTORIES_PER_TILE),
        pause=f"{1e6 * model.PAUSE:.0f}",
        latency=f"{1e6 * model.LATENCY:.0f}",
        service=f"{1e6 * model.SERVICE:.0f}",
        slow=percent(simulated.slow),
        run=f"{model.RUN:g}",
        call=f"{1000 * simulation.CALL:g}",
        record=number(simulation.RECORD_BYTES),
        writes=number(simulated.writes),
        slow_time=f"{1e6 * simulation.SLOW:.0f}",
        questions=number(simulated.questions),
        queue=simulated.longest_queue,
        least=least or "more than " + str(max(simulation.CANDIDATES)),
        least_points=""
        if least is None
        else number(least * simulation.MANY_RANKS * simulation.TRAJECTORIES_PER_TILE / 1e6),
        whole=memory_table(found.whole),
        started=memory_table(found.started),
        most_tiles=number(MOST_TILES),
        tile_list=f"{found.bytes_per_tile * MOST_TILES / MIB:.0f}",
        many_tiles=memory_table(found.tiles),
        catalogues=memory_table(found.catalogue, found.entries),
        per_tile=f"{found.bytes_per_tile:.0f}",
        per_attractor=f"{found.bytes_per_attractor / 1000:.1f}",
        jobs=jobs_section(
            simulated.jobs,
            simulated.mean,
            simulated.before,
            jobs_made(results.packing, results.version),
            parts_text(simulated.parts, simulated.storage),
        ),
        operations=results.operations,
        conditions=conditions(results),
    )
