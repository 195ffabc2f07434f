# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times maps on the GPUs of this machine against one of its cores, compares both, writes a page."""

import argparse
import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import h5py
from evidence_rows import processor
from rows import ROWS

from machine import SOURCE

PAGE = SOURCE / "docs" / "performance_gpu.md"
# A machine of every kind of flights.
MACHINES = {
    "coulomb": "plain",
    "viscous": "damped",
    "stribeck": "layered",
    "kelvin_voigt": "modal",
    "hunt_crossley": "modal, contacts in series",
    "cubic": "in series",
}
SPANS = {"full": ["--set", 'run.stop="duration"'], "settled": []}
RANKS, TILES = (1, 2, 4, 8, 16), (256, 512, 1024)
STAND_IN = "stand-in"


@dataclass
class Size:
    """How much is measured: sides of the coarse map, which is taken off, and of the finest; seconds that a
    fine one takes unless it is the finest; rounds; ranks for the machines; side of the largest map."""

    coarse: int
    finest: int
    seconds: float
    rounds: int
    ranks: int
    largest: int


def size_of(quick: bool, ranks: int) -> Size:
    """What --quick means."""
    return Size(100, 4800, 1.0, 1, ranks, 5000) if quick else Size(100, 9600, 5.0, 5, ranks, 31623)


def case_of(key: str, folder: Path) -> Path:
    """The case of a machine; each law of friction has an example of its own."""
    if key in ("viscous", "stribeck"):
        return SOURCE / "examples" / f"basin_{key}.toml"
    return next(row for row in ROWS if row.key == key).write(folder)


class Runs:
    """Maps by one program."""

    def __init__(self, program: Path, folder: Path) -> None:
        self.program, self.folder = program, folder
        self.log = ""

    def file(self, case: Path, side: int, device: str) -> Path:
        """Where the last map of so many starts is."""
        return self.folder / f"{case.stem}_{side}_{device}.h5"

    def run(self, case: Path, side: int, device: str, ranks: int, *more: str) -> tuple[float, Path]:
        """Seconds that a map of side x side starts takes, and its file."""
        output = self.file(case, side, device)
        launcher = ["mpirun", "--bind-to", "none", "-n", str(ranks)] if ranks > 1 else []
        size = [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count={side}")]
        command = [*launcher, self.program, "basin", case, "-o", output, "--force", "--device", device]
        started = time.perf_counter()
        ended = subprocess.run(
            [*map(str, command), *size, *more],
            check=True,
            stdout=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        seconds = time.perf_counter() - started
        self.log = ended.stdout
        return seconds, output

    def rate(self, case: Path, side: int, device: str, ranks: int, size: Size, *more: str) -> float:
        """Trajectories per second: a fine map less a coarse one, as both search attractors."""
        coarse, fine = (self.run(case, count, device, ranks, *more)[0] for count in (size.coarse, side))
        return (side**2 - size.coarse**2) / max(fine - coarse, 1e-3)

    def sided_rate(self, case: Path, device: str, ranks: int, size: Size, *more: str) -> tuple[float, int]:
        """The median rate of some rounds, and the side of a map that takes long enough to be timed."""
        coarse = self.run(case, size.coarse, device, ranks, *more)[0]
        side, seconds = 3 * size.coarse, 0.0
        while True:
            seconds = self.run(case, side, device, ranks, *more)[0] - coarse
            if seconds >= size.seconds or 2 * side > size.finest:
                break
            side *= 2
        rates = [(side**2 - size.coarse**2) / max(seconds, 1e-3)]
        rates += [self.rate(case, side, device, ranks, size, *more) for _ in range(size.rounds - 1)]
        return statistics.median(rates), side


class GpuMemory:
    """The most memory of a GPU that was in use at some moments [MiB], by nvidia-smi; 0 = not known."""

    def __enter__(self) -> "GpuMemory":
        self.most = 0
        query = ["nvidia-smi", "--query-gpu=memory.used", "--format=csv,noheader,nounits", "-lms", "100"]
        try:
            self.process = subprocess.Popen(query, stdout=subprocess.PIPE, text=True)
        except OSError:
            self.process = None
        return self

    def __exit__(self, *_: object) -> None:
        if self.process is not None:
            self.process.terminate()
            words = self.process.communicate()[0].split()
            self.most = max((int(word) for word in words if word.isdigit()), default=0)


def same_content(one: Path, other: Path) -> bool:
    """Whether all datasets but tiles and provenance agree to the bit."""

    def contents(path: Path) -> dict[str, bytes]:
        found = {}
        with h5py.File(path) as file:
            file.visititems(
                lambda name, item: (
                    found.update({name: item[()].tobytes()})
                    if isinstance(item, h5py.Dataset)
                    and item.dtype.kind in "iuf"
                    and not name.startswith(("tiles", "provenance"))
                    else None
                )
            )
        return found

    return contents(one) == contents(other)


def measure(runs: Runs, size: Size, report: Callable[[str], None]) -> None:
    """The table of machines: rates on one core and on the GPU; does the same map have the same content?"""
    report("| machine | flights | span | one core [1/s] | GPU [1/s] | ratio | content of the same map |")
    report("|---|---|---|---|---|---|---|")
    for key, flights in MACHINES.items():
        case = case_of(key, runs.folder)
        for span, words in SPANS.items():
            core, side = runs.sided_rate(case, "cpu", 1, size, *words)
            gpu = runs.sided_rate(case, "gpu", size.ranks, size, *words)[0]
            by_core = runs.file(case, side, "cpu")
            by_gpu = runs.run(case, side, "gpu", size.ranks, *words)[1]
            same = f"the same, {side} x {side}" if same_content(by_core, by_gpu) else "**different**"
            report(f"| {key} | {flights} | {span} | {core:,.0f} | {gpu:,.0f} | {gpu / core:.1f} | {same} |")


def measure_ranks(runs: Runs, size: Size, report: Callable[[str], None]) -> None:
    """The table of ranks, for Coulomb friction."""
    case = case_of("coulomb", runs.folder)
    report("| ranks | span | processor [1/s] | GPU [1/s] | GPU memory [MiB] |")
    report("|---|---|---|---|---|")
    for span, words in SPANS.items():
        for number in RANKS:
            cores = "not run"
            if number in (1, os.cpu_count()):
                cores = f"{runs.sided_rate(case, 'cpu', number, size, *words)[0]:,.0f}"
            with GpuMemory() as memory:
                gpu = runs.sided_rate(case, "gpu", number, size, *words)[0]
            report(f"| {number} | {span} | {cores} | {gpu:,.0f} | {memory.most or 'not known'} |")


def measure_tiles(runs: Runs, size: Size, report: Callable[[str], None]) -> None:
    """The table of tiles, for Coulomb friction over the full time."""
    case, words = case_of("coulomb", runs.folder), SPANS["full"]
    report("| tile | one rank [1/s] | " + f"{size.ranks} ranks [1/s] |")
    report("|---|---|---|")
    for tile in TILES:
        shape = ["--set", f"grid.tile=[{tile}, {tile}]"]
        rates = [runs.sided_rate(case, "gpu", ranks, size, *words, *shape)[0] for ranks in (1, size.ranks)]
        report(f"| {tile} x {tile} | {rates[0]:,.0f} | {rates[1]:,.0f} |")


def largest_map(runs: Runs, size: Size, report: Callable[[str], None]) -> None:
    """A map of many starts, a sample of it computed again by the processor, and the output of its run."""
    seconds, path = runs.run(case_of("coulomb", runs.folder), size.largest, "gpu", size.ranks)
    log = [line.replace(str(runs.folder), "out") for line in runs.log.strip().splitlines()]
    verified = subprocess.run(
        [runs.program, "verify", path, "--sample", "10000"], capture_output=True, text=True
    )
    last = (verified.stdout.strip().splitlines() or [verified.stderr.strip()])[-1]
    report(
        f"Coulomb, settled, {size.largest} x {size.largest} starts: {seconds:,.1f} s, by {size.ranks} ranks. "
        f"`separatrix verify --sample 10000`: {last}. Output of the run:"
    )
    report("")
    for line in log:
        report(f"    {line}")


def driver() -> str:
    """The version of the GPU's driver."""
    query = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    try:
        ended = subprocess.run(query, capture_output=True, text=True)
    except OSError:
        return "unknown"
    return "; ".join(ended.stdout.strip().splitlines())


def conditions(runs: Runs, device: str, size: Size) -> list[str]:
    """Where and when."""
    threads = max(1, (os.cpu_count() or 1) // size.ranks)
    version = subprocess.run([runs.program, "--version"], capture_output=True, text=True, check=True).stdout
    return [
        "| | |",
        "|---|---|",
        f"| date | {datetime.now(UTC):%Y-%m-%d %H:%M} UTC |",
        f"| computed by | {device} |",
        f"| driver | {driver()} |",
        f"| processor | {processor()['model name']}, {os.cpu_count()} cores |",
        f"| ranks with the GPU | {size.ranks} unless stated otherwise, {threads} threads for each |",
        f"| Separatrix | {', '.join(version.splitlines()[1:3])} |",
        f"| rounds | {size.rounds} |",
        f"| a fine map | takes {size.seconds:g} s or more, or has {size.finest} x {size.finest} starts |",
    ]


def device_of(runs: Runs) -> str:
    """What computes a map that asks for a GPU; '' where there is none."""
    case = case_of("coulomb", runs.folder)
    command = [runs.program, "basin", case, "-o", runs.folder / "asked.h5", "--device", "gpu", "--force"]
    size = ["--set", "axis[1].count=2", "--set", "axis[2].count=2"]
    ended = subprocess.run([*map(str, command), *size], capture_output=True, text=True)
    if ended.returncode != 0:
        print(f"bench: {ended.stderr.strip()}")
        return ""
    return ended.stdout.splitlines()[0].removeprefix("computed by ")


PARTS = {"machines": measure, "ranks": measure_ranks, "largest": largest_map, "tiles": measure_tiles}
TITLES = {
    "machines": "Machines",
    "ranks": "Ranks that share a GPU",
    "tiles": "Tiles",
    "largest": "A large map",
}


def write_page(runs: Runs, device: str, size: Size, parts: list[str], output: Path) -> None:
    """The page in Markdown; after each line, so that a run that is stopped leaves what it has measured."""
    lines = [
        "<!-- Written by scripts/evidence/bench --gpu; do not edit. -->",
        "# Performance on a GPU",
        "",
        "The tables list trajectories per second in double precision, of 50 s each (full) or up to the",
        "capture (settled). Each rate follows from the time of a fine map, with its file written and",
        "checked, minus that of a coarse map.",
        "",
        *conditions(runs, device, size),
    ]

    def report(line: str) -> None:
        lines.append(line)
        output.write_text("\n".join([*lines, ""]))
        print(line, flush=True)

    for part in parts:
        report("")
        report(f"## {TITLES[part]}")
        report("")
        PARTS[part](runs, size, report)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=SOURCE / "build")
    parser.add_argument("--output", type=Path, default=PAGE)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--ranks", type=int, default=max(1, (os.cpu_count() or 1) // 4))
    parser.add_argument("--parts", default=",".join(PARTS), help="what to measure (default: all)")
    arguments = parser.parse_args()
    size = size_of(arguments.quick, arguments.ranks)
    with tempfile.TemporaryDirectory() as folder:
        runs = Runs(arguments.build / "bin" / "separatrix", Path(folder))
        device = device_of(runs)
        if not device or STAND_IN in device:
            print("bench: no GPU: nothing was measured, no page was written")
            return
        write_page(runs, device, size, arguments.parts.split(","), arguments.output)
    print(f"bench: wrote {arguments.output}")


if __name__ == "__main__":
    main()
