#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times the segments that the discovery fits records with, in lanes and in the event loop, law by law.

Writes docs/performance_segments.md.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from evidence_rows import processor, table
from separatrix.library import Model, Segments

SOURCE = Path(__file__).resolve().parents[2]
SEGMENTS, SAMPLES, ROUNDS = 480, 50, 5
BASE = (
    "restoring.stiffness friction.kinetic_coefficient contact.restitution contact.upper drive.ratio".split()
)
LAWS = (
    ("Coulomb friction", None, {}),
    ("cubic spring of size 0", "cubic_spring", {"stiffness": 0.0}),
    ("cubic spring, 20 N/m^3", "cubic_spring", {"stiffness": 20.0}),
    ("quadratic drag, 0.05 N s^2/m^2", "quadratic_drag", {"coefficient": 0.05}),
    ("asymmetric friction", "asymmetric_friction", {"coulomb": 0.3}),
    ("position-dependent friction", "position_dependent_friction", {"slope": 0.2}),
    ("Stribeck effect, 0.2 m/s", "stribeck", {"excess": 0.5, "velocity": 0.2}),
    ("Dahl's friction, 300 N/m", "dahl", {"stiffness": 300.0}),
    ("restitution falls linearly", "restitution_slope", {"slope": 0.05}),
    ("Kelvin-Voigt wall, no tension", "kelvin_voigt_contact", {"stiffness": 1e5, "damping": 20.0}),
    ("Hunt-Crossley wall, 1e6 N/m^1.5", "compliant_contact", {"stiffness": 1e6}),
)

PAGE = """# Time of the segments

Written by `scripts/evidence/segments_speed.py`; do not edit. The discovery compares segments of a motion with
records. The table is for {segments} segments of half a drive period with {samples} samples each, of the
published machine with one additional law. Times are microseconds of processor time per segment, the
minimum of {rounds} rounds in which both methods alternate. The column *apart* is the largest difference
of a position relative to the largest position. An adaptive event loop has a tolerance of 1e-9.

Derivatives are with respect to the parameters of the machine, in {directions} directions or one more, and
with respect to the start. Each direction requires a neighbouring trajectory.

{processor}

{rows}

In all rows both methods find the same impacts and classify the same segments as steady. A segment that a
lane leaves to the event loop is computed there with all its neighbours, as are all segments with
`integrator.lanes = "off"`. Structures, measured forces and comparisons in force also use the event loop.
"""


def segments_of(model: Model, active: list[str], derivatives: bool = True) -> Segments:
    """Segments of half a period from random starts."""
    random = np.random.default_rng(1)
    low, high = [0.1, -5.0, 0.0], [1.09, 5.0, 2 * np.pi]
    start = random.uniform(low, high, (SEGMENTS, 3))
    times = np.tile(np.arange(SAMPLES) * 0.5 * model.period / SAMPLES, SEGMENTS)
    first = np.arange(SEGMENTS + 1) * SAMPLES
    values = np.array([model.parameters[path].value for path in active])
    return model.segments(active, values, start, first, times, derivatives=derivatives)


def seconds(model: Model, active: list[str], derivatives: bool) -> float:
    """Processor seconds of a call."""
    began = time.process_time()
    segments_of(model, active, derivatives)
    return time.process_time() - began


def row(title: str, effect: str | None, values: dict[str, float]) -> list[str]:
    """A law in both."""
    text = (SOURCE / "examples" / "basin_coulomb.toml").read_text()
    models = [Model.from_text(f'{text}\n[integrator]\nlanes = "{lanes}"\n') for lanes in ("off", "auto")]
    active = list(BASE)
    if effect:
        models = [one.with_effect(effect, values) for one in models]
        active += [f"effect.{effect}.{name}" for name in values]
    loop, lanes = (segments_of(one, active) for one in models)
    if not (np.array_equal(loop.impacts, lanes.impacts) and np.array_equal(loop.steady, lanes.steady)):
        sys.exit(f"segments_speed: {title}: lanes and event loop meet other impacts, or hold others steady")
    times = np.array(
        [[[seconds(one, active, d) for d in (False, True)] for one in models] for _ in range(ROUNDS)]
    ).min(axis=0)
    plain, full = 1e6 * times.T / SEGMENTS
    alike = np.repeat(loop.steady, SAMPLES)
    apart = np.abs(loop.x - lanes.x)[alike].max() / np.abs(loop.x).max()
    figures = [f"{one:.2g}" if one < 10 else f"{one:.0f}" for one in (*plain, *full)]
    return [title, *figures, f"{full[0] / full[1]:.1f}", f"{apart:.1e}"]


def main() -> None:
    """Measure, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--print", action="store_true", help="prints the table, writes no page")
    options = parser.parse_args()
    head = ["law", "loop", "lanes", "loop, derivatives", "lanes, derivatives", "times as fast", "apart"]
    rows = table(head, [row(*law) for law in LAWS])
    if options.print:
        sys.stdout.write(rows + "\n")
        return
    page = PAGE.format(
        segments=SEGMENTS,
        samples=SAMPLES,
        directions=len(BASE),
        rounds=ROUNDS,
        processor=f"Processor: {processor()['model name']}.",
        rows=rows,
    )
    (SOURCE / "docs" / "performance_segments.md").write_text(page)


if __name__ == "__main__":
    main()
