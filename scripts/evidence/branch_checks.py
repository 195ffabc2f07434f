#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows the orbits of every example over a parameter, checks what must hold, writes docs/branch_checks.md.

On every branch: a fold has the multiplier +1 and a doubling -1; the multipliers have the product
that damping and impacts allow; a second run from other orbits finds the labels at the same values;
no branch is listed twice. Of the examples with a sweep: where its motion jumps there is a fold or a
graze. What cannot be followed is refused in words.
"""

import argparse
import resource
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from evidence_rows import table
from separatrix import open_result
from separatrix import table as rows_of
from separatrix.open import decode_flags

SOURCE = Path(__file__).resolve().parents[2]
LABELS = ("SN", "PD", "NS", "BP", "GR", "GR-fold", "stick_onset", "stiction_end", "release")
NAMES = {"stick_onset": "stick onset", "stiction_end": "stiction end"}
# Beside a graze derivatives are large, and rounding is with their square.
CALM = 50.0
# A label within this share of the range is the same one; how far the two runs are apart is what is checked.
SAME = 1e-6
# Derivatives over several periods are larger than their eigenvalues; a release is found by halving a step.
BARS = {
    "multiplier": 1e-8,
    "product": 1e-12,
    "product of longer orbits": 1e-10,
    "apart": 1e-10,
    "release": 1e-8,
}


@dataclass(frozen=True)
class Case:
    """An example, a parameter and its range; what the product of the multipliers over a period must be."""

    path: str
    parameter: str
    ends: tuple[float, float]
    searches: tuple[int, int] = (3, 4)
    # of the parameter: trace of the damping over the masses [1/s], restitution, period of the drive [s]
    product: Callable[[float], tuple[float, float, float]] | None = None
    settings: tuple[str, ...] = ()


@dataclass
class Branches:
    """What one run found."""

    labels: np.ndarray
    values: np.ndarray
    period: np.ndarray
    impacts: np.ndarray
    multipliers: np.ndarray
    branch: np.ndarray
    word: np.ndarray
    seconds: float = 0
    labelled: dict[tuple[str, int], np.ndarray] = field(default_factory=dict)


def turn(ratio: float) -> float:
    """Drive period of the machines of the seed [s], natural frequency 3 pi rad/s."""
    return 2 / 3 / ratio


TAU = 2 * np.pi
CASES = (
    Case("sweep_coulomb", "drive.ratio", (0.7, 1.8)),
    Case("sweep_coulomb", "drive.ratio", (0.26, 0.7)),
    Case("sweep_viscous", "drive.ratio", (0.7, 1.8), product=lambda w: (0.2, 0.5, turn(w))),
    Case("sweep_stribeck", "drive.ratio", (0.7, 1.8), (1, 2)),
    Case("basin_effects", "drive.ratio", (1.0, 1.4), (1, 2)),
    Case("basin_coulomb_crank_lever_rod", "drive.ratio", (0.9, 1.4)),
    Case("validation/budd_dux", "contact.upper", (-2.0, 0.1), product=lambda _: (0.0, 0.8, TAU / 2.8)),
    Case("validation/impact_coco", "drive.amplitude", (0.05, 1.2), product=lambda _: (0.1, 0.8, TAU)),
    Case("validation/impact_coco", "contact.restitution", (0, 1), product=lambda e: (0.1, e, TAU)),
    Case("validation/dry_friction", "drive.ratio", (0.5, 1.5)),
    Case("validation/dry_friction", "drive.ratio", (0.1, 0.5)),
    Case("validation/dry_friction_family", "drive.ratio", (0.6, 0.9)),
    Case("validation/soft_impact", "drive.ratio", (0.41, 0.46), (1, 2)),
    Case("validation/soft_impact_rig", "drive.ratio", (0.75, 0.9), (1, 2)),
    Case(
        "structure_two_masses",
        "drive.force.frequency",
        (0.9, 1.2),
        (2, 3),
        product=lambda w: (0.12, 0.8, TAU / w),
    ),
    Case("structure_blocks_on_a_belt", "friction.first.velocity", (0.19, 0.25), (1, 2)),
    Case("structure_beam", "drive.shaker.frequency", (1.4, 1.6), (1, 2)),
    Case("structure_capsule", "drive.inner.frequency", (0.9, 1.0), (1, 2)),
    Case("structure_impact_damper", "drive.shaker.frequency", (0.8, 1.2), (1, 2)),
    Case("basin_woven", "drive.ratio", (5.1, 5.3), (1, 2), product=lambda w: (0.01, 0.95, TAU / w)),
    Case("basin_pair_backlash", "drive.frequency", (10.5, 11.5), (4, 5)),
    Case("sweep_pair_kappa", "body.friction", (0.3, 0.9), (1, 2)),
    Case("own_equation", "force.shaker.f1", (2.0, 6.0), (1, 2)),
)
# Examples with a sweep, and its range.
SWEEPS = ("sweep_coulomb", "sweep_viscous", "sweep_stribeck")
SWEPT = (0.7, 1.8)
# The machines of the sweeps and of other cases at one value.
SAME_MACHINE = {
    *("basin_coulomb", "basin_coulomb_refined", "basin_ratio_stack", "basin_stribeck", "basin_viscous"),
    *("trajectory_coulomb_crank_lever_rod", "pair_backlash", "basin_pair_regimes"),
    # machines with a motor: docs/validation.md
    *("motor_impact", "motor_lever", "motor_unbalance"),
    *(
        f"trajectory_{friction}_{ratio}"
        for friction in ("coulomb", "stribeck", "viscous")
        for ratio in ("0.8", "1.05", "1.2_free", "1.2_impact")
    ),
}
REFUSED = {
    "pair_free": "body.mass",
    "pair_platform": "body.mass",
    "hammer": "body.mass",
    "basin_pendulum": "body.mass",
    "measured_pendulum": "body.mass",
    "measured_platform": "body.mass",
    "measured_positioning": "body.mass",
    "contact_hunt_crossley": "body.mass",
    "contact_kelvin_voigt": "body.mass",
}


def follow(program: Path, folder: Path, case: Case, searches: int) -> Branches:
    """Run the program on a case."""
    out = folder / "branches.h5"
    words = [program, "branches", SOURCE / "examples" / f"{case.path}.toml", "-q", "--force", "-o", out]
    words += ["--parameter", case.parameter, "--from", case.ends[0], "--to", case.ends[1]]
    words += ["--searches", searches, *(word for item in case.settings for word in ("--set", item))]
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run([str(word) for word in words], check=True)
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    with open_result(out) as result:
        names = ("parameter", "period", "impacts", "branch", "event_word")
        values, period, impacts, branch, word = (result[name].values for name in names)
        multipliers = result["multiplier_real"].values + 1j * result["multiplier_imag"].values
        labels = np.asarray(decode_flags(result["label"]).values)
    found = Branches(labels, values, period, impacts, multipliers, branch, word, seconds)
    for name in LABELS:
        for n in np.unique(period):
            found.labelled[name, int(n)] = np.unique(values[(labels == name) & (period == n)])
    return found


def multiplier_misses(found: Branches) -> dict[str, float]:
    """Largest distance of a multiplier from that of its label; a branch may end in a doubling, with +1."""
    ends = np.flatnonzero(np.diff(found.branch, append=0, prepend=0))
    last = set(ends) | set(ends - 1)
    worst = {}
    for k, name in enumerate(found.labels):
        if name not in ("SN", "PD", "BP", "NS"):
            continue
        if name == "NS":
            miss = np.nanmin(np.abs(np.abs(found.multipliers[k]) - 1))
        else:
            wanted = (-1, 1) if name == "PD" and k in last else ((-1,) if name == "PD" else (1,))
            miss = min(np.nanmin(np.abs(found.multipliers[k] - way)) for way in wanted)
        worst[name] = max(worst.get(name, 0.0), float(miss))
    return worst


def product_misses(case: Case, found: Branches) -> tuple[float, float] | None:
    """How far products of multipliers are from those of damping and impacts: of period 1, of longer ones."""
    if case.product is None:
        return None
    sizes = np.abs(found.multipliers)
    # a rest or a completed chatter forgets all: no area is left
    calm = (sizes.max(axis=1) < CALM) & (sizes.max(axis=1) > 0)
    wanted = []
    for value, period, hits in zip(found.values, found.period, found.impacts, strict=True):
        rate, restitution, length = case.product(float(value))
        wanted.append(np.exp(-rate * length * period) * restitution ** (2.0 * hits))
    misses = np.abs(np.prod(found.multipliers, axis=1) - np.array(wanted))
    return tuple(
        float(misses[calm & chosen].max(initial=0.0)) for chosen in (found.period == 1, found.period > 1)
    )


def apart(case: Case, one: Branches, other: Branches) -> tuple[list[float], int, int]:
    """How far labels of two runs are apart, those of a release last; how many both and how many one found."""
    worst, both, alone = [0.0, 0.0], 0, 0
    near = SAME * (case.ends[1] - case.ends[0])
    for key in one.labelled.keys() | other.labelled.keys():
        first, second = one.labelled.get(key, np.empty(0)), other.labelled.get(key, np.empty(0))
        gaps = np.abs(first[:, None] - second[None, :])
        matched = gaps.min(axis=1, initial=np.inf) < near
        if matched.any():
            release = key[0] == "release"
            worst[release] = max(worst[release], float(gaps.min(axis=1)[matched].max()))
        both += int(matched.sum())
        # mirror images have labels at one value to rounding: two of one run may be one of the other
        alone += int((~matched).sum() + (gaps.min(axis=0, initial=np.inf) >= near).sum())
    return worst, both, alone


def twice(found: Branches) -> int:
    """Branches with the same points as another one."""
    seen, repeated = set(), 0
    for number in np.unique(found.branch):
        chosen = found.branch == number
        key = (found.values[chosen][[0, -1]].round(9).tolist(), chosen.sum(), int(found.word[chosen][0]))
        repeated += str(key) in seen
        seen.add(str(key))
    return repeated


def row(case: Case, one: Branches, other: Branches) -> tuple[list[str], list[str]]:
    """The cells of a case, and what is not as it must be."""
    misses, products = multiplier_misses(one), product_misses(case, one)
    worst, both, alone = apart(case, one, other)
    wrong = [
        f"{name}: a multiplier {miss:.1e} off" for name, miss in misses.items() if miss > BARS["multiplier"]
    ]
    for miss, bar in zip(products or (), ("product", "product of longer orbits"), strict=False):
        if miss > BARS[bar]:
            wrong.append(f"{bar} {miss:.1e} off")
    for gap, bar in zip(worst, ("apart", "release"), strict=True):
        if gap > BARS[bar]:
            wrong.append(f"labels {gap:.1e} apart")
    if twice(one) or twice(other):
        wrong.append("a branch twice")
    counts = {name: int((one.labels == name).sum()) for name in LABELS}
    listed = ", ".join(f"{count} {NAMES.get(name, name)}" for name, count in counts.items() if count)
    numbers = [
        f"{np.unique(one.branch).size}",
        f"{one.values.size}",
        listed or "none",
        f"{max(misses.values()):.0e}" if misses else "",
        "" if products is None else "; ".join(f"{miss:.0e}" for miss in products),
        f"{max(worst):.0e} ({both}; {alone})",
        f"{one.seconds:.1f}",
    ]
    return [f"`{case.path}`", f"`{case.parameter}` {case.ends[0]:g} to {case.ends[1]:g}", *numbers], wrong


def jumps(program: Path, folder: Path, name: str, found: Branches) -> tuple[list[list[str]], list[str]]:
    """The brackets in which a sweep jumps, and which labels lie in them."""
    out = folder / "sweep.h5"
    words = ["--set", "sweep.starts=[2,2]", "--set", "sweep.step=0.02"]
    subprocess.run(
        [program, "sweep", SOURCE / "examples" / f"{name}.toml", "-q", "--force", "-o", out, *words],
        check=True,
    )
    with open_result(out) as result:
        limits = rows_of(result, "limits")
        ends = [limits[key].values for key in ("name", "lower", "upper")]
    lines, wrong = [], []
    for what, low, high in zip(*ends, strict=True):
        if not np.isfinite(low + high):
            continue
        inside = [
            f"{label} {value:.12g}"
            for (label, _), values in found.labelled.items()
            if label in ("SN", "GR", "GR-fold", "PD")
            for value in values
            if low <= value <= high
        ]
        lines.append([f"`{name}`", str(what), f"{low:.9g} to {high:.9g}", ", ".join(inside) or "none"])
        if not inside:
            wrong.append(f"{name}: no label in {what}")
    return lines, wrong


def refusals(program: Path) -> tuple[list[list[str]], list[str]]:
    """Messages of the program for examples whose orbits it does not follow."""
    lines, wrong = [], []
    for name, parameter in REFUSED.items():
        words = [program.resolve(), "branches", f"examples/{name}.toml", "--dry-run"]
        words += ["--parameter", parameter, "--from", "1", "--to", "2"]
        # from there, so that the page names no folder of the machine
        ended = subprocess.run(words, capture_output=True, text=True, check=False, cwd=SOURCE)
        message = ended.stderr.strip().removeprefix("separatrix: ")
        lines.append([f"`{name}`", f"`{message}`"])
        if ended.returncode != 65 or "\n" in message:
            wrong.append(f"{name}: code {ended.returncode}")
    return lines, wrong


PAGE = """# Branches of every example

Written by `scripts/evidence/branch_checks.py`; do not edit. Each example is followed over a parameter twice,
starting from orbits at different values. The columns are:

* *multiplier*: largest distance of a multiplier from +1 at an `SN` or `BP`, from -1 at a `PD`, and from the
  unit circle at an `NS`;
* *product*: difference between the product of the multipliers and its value from damping and impacts, for
  cycles of period 1 and of longer periods. It is empty if no formula exists, and excludes points with a
  multiplier above {calm:g};
* *apart*: distance between the labels of the two runs. In parentheses: the number of labels that both runs
  found, and the number that only one found. The second number depends on the initial orbits;
* *s*: CPU time of the first run in seconds.

Tolerances: {bars}.

{cases}

## Jumps of the sweeps

The table lists the brackets that `sweep` finds, and the labels of the branches inside them. In a downward
sweep chaos ends after a transient, not at an orbit; such a bracket contains a label only by chance.

{jumps}

## Examples that are not followed

The command `branches` rejects these examples with the message in the table.

{refused}

## Failed checks

{wrong}
"""


def main() -> None:
    """Run all, write the page, end with 1 if something is not as it must be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=SOURCE / "build")
    parser.add_argument("--folder", type=Path, default=SOURCE / "build" / "branch_checks")
    parser.add_argument("--only", help="cases whose name contains this; writes no page")
    options = parser.parse_args()
    program = options.build / "bin" / "separatrix"
    options.folder.mkdir(parents=True, exist_ok=True)
    lines, brackets, wrong = [], [], []
    for case in CASES:
        if options.only and options.only not in case.path:
            continue
        one, other = (follow(program, options.folder, case, searches) for searches in case.searches)
        cells, missed = row(case, one, other)
        print(*cells, *missed, sep=" | ", flush=True)
        lines.append(cells)
        wrong += [f"{case.path}, {case.parameter}: {item}" for item in missed]
        if case.path in SWEEPS and case.ends == SWEPT:
            more, missed = jumps(program, options.folder, case.path, one)
            brackets += more
            wrong += missed
    if options.only:
        sys.exit(1 if wrong else 0)
    refused, missed = refusals(program)
    wrong += missed
    head = ["example", "parameter", "branches", "points", "labels", "multiplier", "product", "apart", "s"]
    page = PAGE.format(
        calm=CALM,
        bars=", ".join(f"{name} {bar:g}" for name, bar in BARS.items()),
        cases=table(head, lines),
        jumps=table(["example", "limit", "bracket", "labels in it"], brackets),
        refused=table(["example", "message of the program"], refused),
        wrong="\n".join(f"* {item}" for item in wrong) if wrong else "None.",
    )
    (SOURCE / "docs" / "branch_checks.md").write_text(page)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
