# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times the motor-driven machine of examples/motor_impact.toml beside heyoka and writes a page.

All run in turn on one core, round by round; rates are trajectories per second of processor time.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import h5py
import heyoka
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

SOURCE = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).resolve().parent))

from motor_peers import DURATION, Peer  # noqa: E402

TOLERANCES = (1e-9, 1e-11)
FEW = 16
"""Starts of the short run, whose time is taken off."""
OTHER_ATTRACTOR = 1e-3
"""Distance [m, m/s] of ends on different attractors."""


class Ours:
    """The program, on one core, without the time of its start."""

    def __init__(self, program: Path, folder: Path, starts: np.ndarray, *words: str) -> None:
        self.program, self.folder, self.starts, self.words = program, folder, starts, words
        text = (SOURCE / "examples/motor_impact.toml").read_text(encoding="utf-8")
        text = text.partition("[[axis]]")[0]
        text = text.replace('duration = "150 s"', f'duration = "{DURATION:g} s"\nstop = "duration"')
        self.case = folder / "motor.toml"
        self.case.write_text(text, encoding="utf-8")

    def seconds(self, count: int) -> float:
        """Processor time of the first starts."""
        listed = self.folder / "starts.csv"
        rows = [",".join(map(repr, start)) for start in self.starts[:count].tolist()]
        listed.write_text("motor.crank_speed,x0,v0\n" + "\n".join(rows) + "\n", encoding="utf-8")
        words = ["points", self.case, "--list", listed, "-o", self.path, "--force", "--quiet", *self.words]
        return processor_time(self.program, *words)

    @property
    def path(self) -> Path:
        """The file of the ends."""
        return self.folder / "points.h5"

    def rate(self) -> float:
        """Trajectories per second."""
        before = self.seconds(FEW)
        return (len(self.starts) - FEW) / (self.seconds(len(self.starts)) - before)

    def ends(self) -> np.ndarray:
        """Positions and velocities at the end."""
        self.seconds(len(self.starts))
        with h5py.File(self.path) as file:
            return np.column_stack([file["x"][()], file["v"][()]])


def processor_time(*words: object) -> float:
    """User and system time of a command [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(word) for word in words], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return sum(after[:2]) - sum(before[:2])


def settled_rate(program: Path, folder: Path, sizes: tuple[int, int]) -> float:
    """Points per second of a map that ends trajectories where they settle: a fine map minus a coarse one."""
    times = []
    for count in sizes:
        words = [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count={count}")]
        case = SOURCE / "examples/motor_impact.toml"
        path = folder / "map.h5"
        times.append(processor_time(program, "basin", case, "-o", path, "--force", "--quiet", *words))
    return (sizes[1] ** 2 - sizes[0] ** 2) / (times[1] - times[0])


def peer_rate(peer: Peer, starts: np.ndarray) -> float:
    """Trajectories per second of a peer."""
    begin = time.process_time()
    peer.run(starts)
    return len(starts) / (time.process_time() - begin)


def starts_of(count: int) -> np.ndarray:
    """Starts (crank speed, x, v), drawn evenly."""
    draw = np.random.default_rng(42)
    return draw.uniform((5.0, -0.11, -1.5), (18.0, 0.119, 1.5), (count, 3))


def deviation(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, int, int]:
    """Largest deviation where both are on the same attractor, ends on another one, and ends compared."""
    known = np.isfinite(theirs[:, 0])
    distance = np.max(np.abs(ours[known] - theirs[known, :2]), axis=1)
    other = distance > OTHER_ATTRACTOR
    return float(distance[~other].max()), int(other.sum()), int(known.sum())


def measure(
    program: Path, folder: Path, rounds: int, quick: bool
) -> tuple[dict[str, list[float]], list[str]]:
    """Rates of everybody, and sentences about accuracy."""
    starts = starts_of(1000 if quick else 4000)
    lanes = Ours(program, folder, starts)
    loop = Ours(program, folder, starts[: 60 if quick else 150], "--set", 'integrator.lanes="off"')
    peers = {(tolerance, batch): Peer(tolerance, batch) for tolerance in TOLERANCES for batch in (0, 8)}
    runs: dict[str, Callable[[], float]] = {
        "lanes, full 50 s": lanes.rate,
        "event loop, full 50 s": loop.rate,
    }
    sizes = (21, 81) if quick else (41, 201)
    runs["lanes, settle and stop"] = lambda: settled_rate(program, folder, sizes)
    for (tolerance, batch), peer in peers.items():
        peer.run(starts[:8])
        name = f"heyoka, {'batches of 8' if batch else 'one by one'}, {tolerance:g}"
        runs[name] = lambda peer=peer, batch=batch: peer_rate(peer, starts[: 400 if batch else 200])
    rates: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            rates[name].append(run())
    reference = Peer(1e-15, 0).run(starts)
    far, other, compared = deviation(lanes.ends(), reference)
    text = [
        "Reference: heyoka at 1e-15. "
        f"At the end of the full runs lanes deviate by at most {far:.1e} (m, m/s).\n"
        f"Of {compared} starts {other} ended on another attractor. Starts whose body sticks are left out."
    ]
    for tolerance in TOLERANCES:
        theirs = peers[tolerance, 0].run(starts[:400])
        known = np.isfinite(theirs[:, 0]) & np.isfinite(reference[:400, 0])
        far, _, _ = deviation(theirs[known, :2], reference[:400][known])
        text.append(f"At {tolerance:g} heyoka deviates by at most {far:.1e} over 400 starts.")
    return rates, text


def page_of(rates: dict[str, list[float]], text: list[str], commit: str) -> str:
    """The page."""
    best = {name: median(values) for name, values in rates.items()}
    single, batch = (best[f"heyoka, {kind}, {TOLERANCES[0]:g}"] for kind in ("one by one", "batches of 8"))
    full, loop, settled = (best[name] for name in list(best)[:3])
    lines = [
        "<!-- Written by scripts/bench/motor; do not edit. -->",
        "# Speed: a body driven by a motor",
        "",
        "The machine of `examples/motor_impact.toml` at 8 V, over 50 s.",
        "Its starts are drawn from crank speeds of 5 to 18 rad/s, positions of -0.11 to 0.119 m and",
        f"velocities of -1.5 to 1.5 m/s. Numbers after heyoka {heyoka.__version__} are its tolerance.",
        f"Rates are medians of {len(next(iter(rates.values())))} rounds in which all run in turn.",
        "The run `settle and stop` is a map; it ends each trajectory as soon as its attractor is known.",
        f"Commit {commit}.",
        "",
        "| run | trajectories/s/core |",
        "| --- | --- |",
        *(f"| {name} | {three_digits(value)} |" for name, value in best.items()),
        "",
        "| ratio | reached | goal |",
        "| --- | --- | --- |",
        *(
            f"| {name} | {bold(value, goal)} | {goal} |"
            for name, value, goal in (
                ("lanes, full 50 s, to heyoka's batches of 8", full / batch, 5),
                ("lanes, full 50 s, to heyoka one by one", full / single, 10),
                ("settle and stop to heyoka one by one", settled / single, 50),
                ("event loop to heyoka one by one", loop / single, 1),
            )
        ),
        "",
        f"The ratios are to heyoka at a tolerance of {TOLERANCES[0]:g}; bold ratios are below the goal.",
        *text,
    ]
    return "\n".join(lines) + "\n"


def bold(value: float, goal: float) -> str:
    """A ratio, bold below its goal."""
    return f"{value:.2g}" if value >= goal else f"**{value:.2g}**"


def three_digits(value: float) -> str:
    """A rate to three digits, thousands apart."""
    return (
        f"{float(f'{value:.3g}'):,.4g}" if value < 1000 else f"{float(f'{value:.3g}'):,.0f}".replace(",", " ")
    )


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer starts; prints only")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--program", type=Path, default=SOURCE / "build/bin/separatrix")
    parser.add_argument("--page", type=Path, default=SOURCE / "docs/performance_motor.md")
    given = parser.parse_args()
    words = ["git", "-C", str(SOURCE), "describe", "--always", "--dirty"]
    commit = subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    with tempfile.TemporaryDirectory() as folder:
        rates, text = measure(given.program, Path(folder), given.rounds, given.quick)
    made = page_of(rates, text, commit)
    print(made, end="")
    if not given.quick:
        given.page.write_text(made, encoding="utf-8")


if __name__ == "__main__":
    main()
