# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times bodies by expressions beside heyoka and built-in laws, and writes a page.

All run in turn on one core, round by round; rates are trajectories per second of processor time.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import h5py
import heyoka
import numpy as np
from expressions_peers import DURATION, MACHINES, Machine, Peer

from motor import FEW, SOURCE, bold, peer_rate, processor_time, three_digits

if TYPE_CHECKING:
    from collections.abc import Callable

TOLERANCE = 1e-9
RATIOS = (
    ("expression to heyoka's batches of 8", "expression", "heyoka, batches of 8", 5),
    ("expression to heyoka one by one", "expression", "heyoka, one by one", 10),
)


class Case:
    """A case that the program runs from a list of starts, on one core."""

    def __init__(self, program: Path, folder: Path, text: str, starts: np.ndarray, *words: str) -> None:
        self.program, self.starts, self.words = program, starts, words
        self.case, self.path, self.listed = folder / "case.toml", folder / "ends.h5", folder / "starts.csv"
        self.text = text

    def seconds(self, count: int) -> float:
        """Processor time of the first starts."""
        self.case.write_text(self.text, encoding="utf-8")
        rows = [",".join(map(repr, start)) for start in self.starts[:count].tolist()]
        self.listed.write_text("x0,v0\n" + "\n".join(rows) + "\n", encoding="utf-8")
        words = [
            "points",
            self.case,
            "--list",
            self.listed,
            "-o",
            self.path,
            "--force",
            "--quiet",
            *self.words,
        ]
        return processor_time(self.program, *words)

    def rate(self) -> float:
        """Trajectories per second, without the time of the program's start."""
        before = self.seconds(FEW)
        return (len(self.starts) - FEW) / (self.seconds(len(self.starts)) - before)

    def ends(self) -> np.ndarray:
        """Positions and velocities at the end."""
        self.seconds(len(self.starts))
        with h5py.File(self.path) as file:
            return np.column_stack([file["x"][()], file["v"][()]])


def runs_of(
    machine: Machine, program: Path, folder: Path, starts: np.ndarray
) -> dict[str, Callable[[], float]]:
    """The runs that are timed."""
    lane = Case(program, folder, machine.case, starts)
    loop = Case(program, folder, machine.case, starts[:100], "--set", 'integrator.lanes="off"')
    runs: dict[str, Callable[[], float]] = {"expression": lane.rate, "expression, event loop": loop.rate}
    if machine.built_in:
        runs["built-in law"] = Case(program, folder, machine.built_in, starts).rate
    for batch, name in ((8, "heyoka, batches of 8"), (0, "heyoka, one by one")):
        peer = Peer(machine, TOLERANCE, batch)
        peer.run(starts[:8])
        runs[name] = lambda peer=peer, batch=batch: peer_rate(peer, starts[: 400 if batch else 200])
    return runs


def accuracy(machine: Machine, program: Path, folder: Path, starts: np.ndarray) -> str:
    """Deviations from the event loop, whose steps are proven."""
    few = starts[:100]
    exact = Case(program, folder, machine.case, few, "--set", 'integrator.lanes="off"').ends()
    ends = {"lanes": Case(program, folder, machine.case, few).ends()}
    if machine.built_in:
        ends["built-in law"] = Case(program, folder, machine.built_in, few).ends()
    for tolerance in (TOLERANCE, 1e-15):
        ends[f"heyoka at {tolerance:g}"] = Peer(machine, tolerance, 0).run(few)
    texts = [f"{name} {np.max(np.abs(values - exact)):.1e}" for name, values in ends.items()]
    return f"* {machine.name}: {', '.join(texts)}"


def page_of(rates: dict[str, dict[str, list[float]]], text: list[str], commit: str, rounds: int) -> str:
    """The page."""
    names = list(dict.fromkeys(name for runs in rates.values() for name in runs))
    best = {key: {name: median(values) for name, values in runs.items()} for key, runs in rates.items()}
    lines = [
        "<!-- Written by scripts/bench/expressions; do not edit. -->",
        "# Speed: bodies by expressions",
        "",
        f"Driven bodies over {DURATION:g} s, from starts of -1 to 1 m and -1 to 1 m/s.",
        f"heyoka {heyoka.__version__} has the tolerance {TOLERANCE:g}.",
        f"The medians are of {rounds} rounds in which all run in turn. Commit {commit}.",
        "",
        "Trajectories/s/core:",
        "",
        "| run | " + " | ".join(best) + " |",
        "| --- |" + " --- |" * len(best),
        *(
            f"| {name} | "
            + " | ".join(three_digits(runs[name]) if name in runs else "" for runs in best.values())
            + " |"
            for name in names
        ),
        "",
        "| ratio | " + " | ".join(best) + " | goal |",
        "| --- |" + " --- |" * (len(best) + 1),
        *(
            f"| {name} | {' | '.join(bold(runs[a] / runs[b], goal) for runs in best.values())} | {goal} |"
            for name, a, b, goal in RATIOS
        ),
        "| expression to built-in law | "
        + " | ".join(
            bold(runs["expression"] / runs["built-in law"], 1 / 1.3) if "built-in law" in runs else ""
            for runs in best.values()
        )
        + " | 0.77 |",
        "",
        "A ratio in bold is below its goal.",
        "Largest deviations at the end from the event loop, whose steps are proven, over 100 starts.",
        "heyoka steps over the thin layer of the tanh friction at either tolerance:",
        "",
        *text,
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer starts; prints only")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--program", type=Path, default=SOURCE / "build/bin/separatrix")
    parser.add_argument("--page", type=Path, default=SOURCE / "docs/performance_expressions.md")
    given = parser.parse_args()
    words = ["git", "-C", str(SOURCE), "describe", "--always", "--dirty"]
    commit = subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    starts = np.random.default_rng(43).uniform(-1, 1, (1000 if given.quick else 6000, 2))
    with tempfile.TemporaryDirectory() as folder:
        runs = {machine.name: runs_of(machine, given.program, Path(folder), starts) for machine in MACHINES}
        rates: dict[str, dict[str, list[float]]] = {key: {name: [] for name in runs[key]} for key in runs}
        for _ in range(given.rounds):
            for key, several in runs.items():
                for name, run in several.items():
                    rates[key][name].append(run())
        text = [accuracy(machine, given.program, Path(folder), starts) for machine in MACHINES]
    made = page_of(rates, text, commit, given.rounds)
    print(made, end="")
    if not given.quick:
        given.page.write_text(made, encoding="utf-8")


if __name__ == "__main__":
    main()
