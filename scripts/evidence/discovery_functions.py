#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides restitutions of several shapes in records, writes docs/discovery_functions.md: what is found of them.

The records come from the independent simulator (tests/generator), the effect worth 10 or 30 standard errors.
"""

import argparse
import math
import os
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

# one core for each case
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402
from evidence_rows import table  # noqa: E402

SOURCE = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(SOURCE / "tests" / "generator"), str(SOURCE / "scripts/evidence/campaign")]

import design  # noqa: E402
import records  # noqa: E402
from bars import met  # noqa: E402
from rates import rate  # noqa: E402
from simulator import POWER, SATURATING, STEP, Machine  # noqa: E402

SHAPES: dict[str, Callable[[np.random.Generator], dict[str, float]]] = {
    "linear": lambda random: {},
    "power of the speed, 0.25 to 2": lambda random: {
        "restitution_shape": POWER, "restitution_constant": random.uniform(0.25, 2),
    },
    "fifth root (viscoelastic)": lambda random: {"restitution_shape": POWER, "restitution_constant": 0.2},
    "saturating": lambda random: {
        "restitution_shape": SATURATING, "restitution_constant": random.uniform(0.4, 1.5),
    },
    "step": lambda random: {"restitution_shape": STEP, "restitution_constant": random.uniform(0.7, 1.6)},
}  # fmt: skip
"""What the restitution loses over the speed of impact: names and shapes of the generator."""
TARGETS = (10.0, 30.0)
FAMILY = "restitution over impact speed"
FORMS = ("restitution_slope", "restitution_curve")
POINTS = 101
"""Speeds at which the function is compared with its band."""
BAR_FAMILY, BAR_BAND = 0.95, 0.90

PAGE = """# Restitutions of several shapes: the function that is found

Written by `scripts/evidence/discovery_functions.py`; do not edit.

In {asked} cases of seed {seed} the restitution of the generator's machines (`tests/generator`) decreases
with the impact speed. The law has one of several shapes, and its size is 10 or 30 standard errors in two
records; a third record is held out. Noise and sensors are those of [the campaign](discovery.md), without
instrument imperfections. {unreachable} cases were left out: their effect reached this size in no regime.

* *Family*: every effect that the verdict reports belongs to the family "{family}".
* *Function*: the values in the verdict, with their 95 % band, at {points} speeds between its first and last
  knot. This is the range of the observed impacts, in which the hidden law is known. A named closed form is
  represented by the function that the same records determine.

{rows}

| figure | bar | found | met |
| --- | --- | --- | --- |
| family right, of all | >= 95 % | {family_all} | {family_all_met} |
| family right, if there is a name or a set | >= 95 % | {family_named} | {family_named_met} |
| law within the band, share of the support, mean | >= 90 % | {band:.1f} % of {shown} functions | {band_met} |
| functions with the law within the band on 90 % of the support | - | {inside} | |

Where the family is not right:

{others}
"""


@dataclass(frozen=True)
class Found:
    """One case: its shape, the answer, and the share of the support with the law within the band."""

    shape: str
    target: float
    answer: str
    named: bool
    """Whether there is a name or a set."""
    right: bool
    within: float
    """NaN without a function of restitution."""
    relative_width: float
    """Half of the band's width over what the law changes on the support, median."""


def law(machine: Machine, speed: np.ndarray) -> np.ndarray:
    """The restitution that was hidden."""
    constant, shape = machine.restitution_constant, int(machine.restitution_shape)
    loss = {
        POWER: lambda: speed**constant,
        SATURATING: lambda: constant * (1 - np.exp(-speed / constant)),
        STEP: lambda: 0.5 * (1 + np.tanh((speed - constant) / (0.15 * constant))),
    }.get(shape, lambda: speed)()
    return np.clip(machine.restitution - machine.restitution_slope * loss, 0, 1)


def within(verdict: dict, machine: Machine) -> tuple[float, float]:
    """Share of the support on which the law lies in the band, and the band's width beside what it changes."""
    from separatrix.discovery.fitting.shapes import through

    function = verdict["function"]
    if not function or function["effect"] != "restitution_curve":
        return math.nan, math.nan
    part = function["parts"][0]
    at = np.asarray(part["at"])
    speeds = np.linspace(at[0], at[-1], POINTS)
    low, high = (through(at, np.asarray(one))(speeds) for one in part["band_95"])
    true = law(machine, speeds)
    width = np.median(high - low) / 2 / max(np.ptp(true), 1e-12)
    return float(np.mean((low <= true) & (true <= high))), float(width)


def examine(seed: int, number: int) -> Found | None:
    """One case from hiding to verdict; None where no size is worth what is asked for."""
    from separatrix.discovery import Options, discover

    name = list(SHAPES)[number % len(SHAPES)]
    target = TARGETS[number // len(SHAPES) % len(TARGETS)]
    shape = SHAPES[name](np.random.default_rng([seed, 6, number]))
    try:
        case = design.draw_shaped(seed, number, "restitution_slope", shape, target)
    except design.Unreachable:
        return None
    with tempfile.TemporaryDirectory() as folder:
        files = Path(folder)
        records.write_case(files, files / "truth.json", case)
        training = [files / one for one in records.TRAINING]
        try:
            verdict = discover(files / records.BASE, training, [files / records.HELD_OUT], Options(seed=seed))
        except Exception as reason:
            # one broken case must not end the measurement, and counts as a failure
            return Found(name, target, f"failed: {reason}", False, False, math.nan, math.nan)
    answers = ["+".join(verdict["effects"]), *verdict["alternatives"]]
    named = verdict["outcome"] in ("named", "ambiguous")
    right = named and all(one in FORMS for one in answers)
    text = f"{verdict['outcome']} {' or '.join(one for one in answers if one)}".strip()
    return Found(name, target, text, named, right, *within(verdict, case.machine))


def rows_of(found: list[Found]) -> list[list[str]]:
    """Rows of the table, by shape and size."""
    rows = []
    for shape in SHAPES:
        for target in TARGETS:
            group = [one for one in found if (one.shape, one.target) == (shape, target)]
            shown = [one for one in group if not math.isnan(one.within)]
            share = f"{100 * np.mean([one.within for one in shown]):.0f} %" if shown else "-"
            width = f"{100 * np.median([one.relative_width for one in shown]):.0f} %" if shown else "-"
            right = str(sum(one.right for one in group))
            rows.append([shape, f"{target:g}", str(len(group)), right, str(len(shown)), share, width])
    return rows


def main() -> None:
    """Hide, ask, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=60117)
    parser.add_argument("--print", action="store_true", help="prints the page, writes none")
    options = parser.parse_args()
    found = []
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for number, one in enumerate(pool.map(partial(examine, options.seed), range(options.cases))):
            found.append(one)
            print(f"case {number}: {one}", file=sys.stderr, flush=True)
    scored = [one for one in found if one is not None]
    shown = [one.within for one in scored if not math.isnan(one.within)]
    whole = rate([one.right for one in scored])
    of_named = rate([one.right for one in scored if one.named])
    head = ["restitution loss", "d'", "cases", "family right", "functions", "law in the band", "half width"]
    page = PAGE.format(
        asked=options.cases,
        seed=options.seed,
        unreachable=found.count(None),
        family=FAMILY,
        points=POINTS,
        rows=table(head, rows_of(scored))
        + "\n\n*Half width* is the median half width of the band, as a share of the change of the law "
        "over its support.",
        family_all=whole,
        family_all_met=met(whole, BAR_FAMILY, 1),
        family_named=of_named,
        family_named_met=met(of_named, BAR_FAMILY, 1),
        band=100 * float(np.mean(shown)) if shown else math.nan,
        band_met="yes" if shown and np.mean(shown) >= BAR_BAND else "**no**",
        shown=len(shown),
        inside=rate([one >= BAR_BAND for one in shown]),
        others=table(
            ["shape", "d'", "verdict"],
            [[one.shape, f"{one.target:g}", one.answer] for one in scored if not one.right],
        ),
    )
    if options.print:
        sys.stdout.write(page)
        return
    (SOURCE / "docs" / "discovery_functions.md").write_text(page)


if __name__ == "__main__":
    main()
