# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times maps on the GPUs of this machine against one of its cores, compares both, writes a page."""

import argparse
import os
import statistics
import subprocess
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

import h5py
from rows import ROWS

from machine import SOURCE

PAGE = SOURCE / "docs" / "performance_gpu.md"
MACHINES = ("coulomb", "viscous", "stribeck", "hunt_crossley", "cubic")
SPANS = {"full": ["--set", 'run.stop="duration"'], "settled": []}
# Starts along either axis: of the coarse map, which is taken off, of the fine one, and on the GPU.
SIDES, QUICK_SIDES, LARGEST = (100, 400, 3000), (20, 60, 300), 31623
STAND_IN = "stand-in"


def case_of(key: str, folder: Path) -> Path:
    """The case of a machine; each law of friction has an example of its own."""
    if key in ("viscous", "stribeck"):
        return SOURCE / "examples" / f"basin_{key}.toml"
    return next(row for row in ROWS if row.key == key).write(folder)


class Runs:
    """Maps by one program, with so many ranks where a GPU computes."""

    def __init__(self, program: Path, folder: Path, ranks: int) -> None:
        self.program, self.folder, self.ranks = program, folder, ranks

    def run(self, case: Path, side: int, device: str, *more: str) -> tuple[float, Path]:
        """Seconds that a map of side x side starts takes, and its file."""
        output = self.folder / f"{case.stem}_{side}_{device}.h5"
        launcher = ["mpirun", "-n", str(self.ranks)] if device == "gpu" and self.ranks > 1 else []
        size = [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count={side}")]
        command = [
            *launcher,
            self.program,
            "basin",
            case,
            "-o",
            output,
            "--force",
            "--quiet",
            "--device",
            device,
        ]
        started = time.perf_counter()
        subprocess.run([*map(str, command), *size, *more], check=True)
        return time.perf_counter() - started, output

    def rate(self, case: Path, sides: tuple[int, int], device: str, rounds: int, *more: str) -> float:
        """Trajectories per second: a fine map less a coarse one, as both search attractors; a median."""
        rates = []
        for _ in range(rounds):
            coarse, fine = (self.run(case, side, device, *more)[0] for side in sides)
            rates.append((sides[1] ** 2 - sides[0] ** 2) / (fine - coarse))
        return statistics.median(rates)


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


def measure(runs: Runs, sides: tuple[int, int, int], rounds: int, machines: tuple = MACHINES) -> list[str]:
    """Rows of the table: rates on one core and on the GPU, and whether the same map has the same content."""
    rows = []
    for key in machines:
        case = case_of(key, runs.folder)
        for span, words in SPANS.items():
            core = runs.rate(case, sides[:2], "cpu", rounds, *words)
            gpu = runs.rate(case, (sides[0], sides[2]), "gpu", rounds, *words)
            maps = [runs.run(case, sides[1], device, *words)[1] for device in ("cpu", "gpu")]
            same = "the same" if same_content(*maps) else "**different**"
            rows.append(f"| {key} | {span} | {core:,.0f} | {gpu:,.0f} | {gpu / core:.1f} | {same} |")
            print(f"bench: {key}, {span}: {gpu:,.0f} trajectories/s on the GPU, {core:,.0f} on a core")
    return rows


def largest_map(runs: Runs, side: int) -> str:
    """The map of 10^9 starts, of which a sample is computed again by the processor."""
    seconds, path = runs.run(case_of("coulomb", runs.folder), side, "gpu")
    verified = subprocess.run(
        [runs.program, "verify", path, "--sample", "10000"], capture_output=True, text=True
    )
    last = verified.stdout.strip().splitlines()[-1]
    map_words = f"Coulomb, settled, {side} x {side} starts: {seconds:,.0f} s"
    return f"{map_words}. `separatrix verify --sample 10000`: {last}"


def page(rows: list[str], largest: str, device: str, runs: Runs) -> str:
    """The page in Markdown."""
    version = subprocess.run([runs.program, "--version"], capture_output=True, text=True, check=True).stdout
    conditions = [
        f"| date | {datetime.now(UTC):%Y-%m-%d %H:%M} UTC |",
        f"| computed by | {device}; {runs.ranks} ranks; {os.cpu_count()} cores |",
        f"| Separatrix | {', '.join(version.splitlines()[1:3])} |",
    ]
    table = "| machine | span | one core [1/s] | GPU [1/s] | ratio | content of the same map |"
    return "\n".join(
        [
            "<!-- Written by scripts/bench --gpu; do not edit. -->",
            "# Performance on a GPU",
            "",
            "Trajectories per second in double precision: 50 s each (full), or up to the capture (settled).",
            "",
            table,
            "|---|---|---|---|---|---|",
            *rows,
            "",
            largest,
            "",
            "| | |",
            "|---|---|",
            *conditions,
            "",
        ]
    )


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=SOURCE / "build")
    parser.add_argument("--output", type=Path, default=PAGE)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--ranks", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        runs = Runs(arguments.build / "bin" / "separatrix", Path(folder), arguments.ranks)
        device = device_of(runs)
        if not device or STAND_IN in device:
            print("bench: no GPU: nothing was measured, no page was written")
            return
        rows = measure(runs, QUICK_SIDES if arguments.quick else SIDES, 1 if arguments.quick else 5)
        largest = largest_map(runs, 3000 if arguments.quick else LARGEST)
        arguments.output.write_text(page(rows, largest, device, runs))
    print(f"bench: wrote {arguments.output}")


if __name__ == "__main__":
    main()
