# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/performance.md: every number comes from the run."""

from __future__ import annotations

import datetime
import importlib.metadata
import os
import statistics
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import compiled
from evidence_rows import processor, table
from rows_report import number

from machine import SEED, SOURCE, TOLERANCE, fingerprint, start_points

if TYPE_CHECKING:
    from accuracy import Accuracy
    from bench import Results

NAMES = {
    "full": "Separatrix, lanes, full 50 s",
    "full_single": "Separatrix, one by one, full 50 s",
    "stopped": "Separatrix, lanes, settle-and-stop",
    "stopped_single": "Separatrix, one by one, settle-and-stop",
    "heyoka_batch": "heyoka, batches of 8",
    "heyoka": "heyoka, one by one",
    "gsl": "GSL rk8pd",
    "cvode": "SUNDIALS CVODE",
    "scipy": "SciPy DOP853",
}
PEERS = ("heyoka_batch", "heyoka", "gsl", "cvode", "scipy")
ISA = ("avx2", "fma", "avx512f", "avx512dq", "avx512vl")
PACKAGES = ("libsundials-dev", "libgsl-dev")


def rates(results: Results, name: str, clock: str = "cpu") -> list[float]:
    """Trajectories per second and core of every round."""
    return [timing.points / getattr(timing, clock) for timing in results.timings[name]]


def rate(results: Results, name: str, clock: str = "cpu") -> float:
    """The median."""
    return statistics.median(rates(results, name, clock))


def ratio(results: Results, name: str, peer: str) -> float:
    """Median over the rounds of our rate over the peer's in the same round."""
    pairs = zip(rates(results, name), rates(results, peer), strict=True)
    return statistics.median(mine / other for mine, other in pairs)


def speed_table(results: Results) -> str:
    """Rates and how many times ours are higher."""
    rows = []
    for name, title in NAMES.items():
        cpu = rates(results, name)
        peer = name in PEERS
        rows.append(
            [
                title,
                number(statistics.median(cpu)),
                f"{number(min(cpu))} to {number(max(cpu))}",
                number(rate(results, name, "wall")),
                f"{number(results.timings[name][0].points)} x {results.sizes.rounds}",
                number(ratio(results, "full", name)) if peer else "",
                number(ratio(results, "stopped", name)) if peer else "",
            ]
        )
    header = [
        "program",
        "trajectories/s/core (CPU time)",
        "all rounds",
        "by wall time",
        "timed trajectories",
        "speed-up of our full runs",
        "speed-up of our settle-and-stop",
    ]
    return table(header, rows)


def accuracy_table(results: Results) -> str:
    """Deviations from quadruple precision."""
    rows = []
    for name, title in NAMES.items():
        found, outcomes = results.accuracy[name], results.outcomes.get(name)
        rows.append(
            [
                title,
                str(found.points),
                "no final state" if found.deviation is None else f"{found.deviation:.1e}",
                "not counted" if found.counts is None else str(found.counts),
                str(found.labels),
                *("" if value is None else str(value) for value in extras(outcomes)),
            ]
        )
    header = [
        "program",
        "starts compared",
        "largest relative deviation of a final state",
        "differing impact counts",
        "differing labels",
        "stick phases",
        "impacts missed by event location",
    ]
    return table(header, rows)


def extras(outcomes: object) -> tuple[int | None, int | None]:
    """Stick phases and repaired impacts, where known."""
    return (None, None) if outcomes is None else (outcomes.sticks, outcomes.repaired)


def on_sample(differing: int, points: int, wanted: float) -> str:
    """Whether nothing differs, and whether that was asked of as many points as wanted."""
    if differing:
        return "**not met**"
    return "met" if points >= wanted else "on the sample"


def bar_table(results: Results) -> str:
    """The bars of the work on speed beside what was reached."""
    best = max(PEERS, key=lambda peer: rate(results, peer))
    full, stopped = results.accuracy["full"], results.accuracy["stopped"]
    away = "see [scaling.md](scaling.md)"
    met = {True: "met", False: "**not met**"}
    times = ratio(results, "full", best)
    coulomb, viscous = rate(results, "full"), rate(results, "viscous")
    rows = [
        [
            "full 50 s, Coulomb and viscous [trajectories/s/core]",
            ">= 100 000",
            f"{number(coulomb)} and {number(viscous)}",
            met[min(coulomb, viscous) >= 1e5],
        ],
        [
            "relative to the fastest peer at 1e-9",
            ">= 60",
            f"{number(times)} ({NAMES[best]})",
            met[times >= 60],
        ],
        [
            "settle-and-stop [trajectories/s/core]",
            ">= 300 000",
            number(rate(results, "stopped")),
            met[rate(results, "stopped") >= 3e5],
        ],
        [
            "Coulomb-Stribeck, v_s = 1 mm/s, full 50 s [trajectories/s/core]",
            ">= 30 000",
            number(rate(results, "stribeck")),
            met[rate(results, "stribeck") >= 3e4],
        ],
        [
            "deviation from quadruple precision after 50 s, relative",
            "<= 1e-11",
            f"{full.deviation:.1e}",
            met[full.deviation <= 1e-11],
        ],
        [
            "impact counts equal",
            "on 100 000 starts",
            f"{full.counts} differ on {full.points}",
            on_sample(full.counts, full.points, 1e5),
        ],
        [
            "labels of settle-and-stop against full runs",
            "0 flips in 1 000 000",
            f"{results.flips[0]} flips in {results.flips[1]}, "
            f"{stopped.labels} in {stopped.points} against quadruple precision",
            on_sample(results.flips[0] + stopped.labels, results.flips[1], 1e6),
        ],
        ["boundary-adaptive maps", "<= 5 % of the trajectories", "see scripts/evidence/refine_check.py", ""],
        ["two ranks against one", ">= 1.9 x", away, ""],
        ["simulated 10 000 ranks", ">= 90 % efficiency", away, ""],
        ["memory per rank", "constant in the map size", away, ""],
    ]
    return table(["quantity", "target", "result", ""], rows)


def agreement(found: Accuracy) -> str:
    """What two ways to fly the same starts have in common."""
    return (
        f"of {found.points} starts {found.counts} differ in the number of impacts and {found.labels} in the "
        f"label, and final states by at most {found.deviation:.1e}, relative"
    )


def first_line(*command: str) -> str:
    """What a command answers first."""
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]


def conditions(results: Results) -> str:
    """Machine, versions, date, tolerance."""
    fields = processor()
    flags = fields.get("flags", "").split()
    model = (
        f"{fields['model name']}, family {fields.get('cpu family', '?')}, model {fields.get('model', '?')}"
    )
    isa = " ".join(flag for flag in ISA if flag in flags)
    version = results.version
    packages = [first_line("dpkg-query", "-W", "-f=${Package} ${Version}\n", name) for name in PACKAGES]
    modules = [f"{name} {importlib.metadata.version(name)}" for name in ("heyoka", "scipy", "numpy")]
    points = max(results.sizes.heyoka_batch, results.sizes.reference)
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    rows = [
        ["date", datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")],
        ["machine", f"{model}; {os.cpu_count()} cores; {isa}; load at the end (1, 5, 15 min): {load}"],
        ["Separatrix", f"commit {version['commit']}, {version['compiler']}, `{version['flags']}`"],
        ["peers", ", ".join(packages + modules)],
        ["C drivers", f"{first_line(compiled.COMPILER, '--version')}, `{' '.join(compiled.FLAGS)}`"],
        ["tolerance of the peers", f"{TOLERANCE:g} relative and absolute (heyoka: its one tolerance)"],
        [
            "start points",
            f"{points} with seed {SEED}, SHA-256 of their bits: {fingerprint(start_points(points))}...",
        ],
        ["rounds", f"{results.sizes.rounds}, medians; {results.seconds:.0f} s in all"],
    ]
    return table(["", ""], rows)


def page(results: Results, quick: bool) -> str:
    """The whole page."""
    template = (Path(__file__).with_name("performance.md.in")).read_text()
    viscous, stribeck = rate(results, "viscous"), rate(results, "stribeck")
    return template.format(
        command="scripts/evidence/bench --quick" if quick else "scripts/evidence/bench",
        case=f"examples/{(SOURCE / 'examples' / 'basin_coulomb.toml').name}",
        speed=speed_table(results),
        accuracy=accuracy_table(results),
        bars=bar_table(results),
        conditions=conditions(results),
        viscous=number(viscous),
        stribeck=number(stribeck),
        stribeck_single=number(rate(results, "stribeck_single")),
        stribeck_agreement=agreement(results.stribeck),
        flow=number(rate(results, "flow")),
    )
