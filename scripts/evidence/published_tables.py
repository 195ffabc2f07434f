# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of docs/published.md: what the paper prints beside what the result files hold.

Only PAPER holds numbers of the paper. `files` are the result files by name.
"""

import math
import sys
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
from separatrix import decode_flags, open_result, table

SOURCE = Path(__file__).resolve().parents[2]

LAWS = {"coulomb": "Coulomb", "viscous": "viscous", "stribeck": "Coulomb-Stribeck"}
MOTIONS = {
    "0.8": "0.8 without impacts",
    "1.05": "1.05 with impacts",
    "1.2_free": "1.2 without impacts",
    "1.2_impact": "1.2 with impacts",
}
QUANTITIES = {
    "amplitude": "amplitude (m)",
    "v_max": "v_max (m/s)",
    "mean_impact_speed": "impact speed (m/s)",
}
LIMITS = {
    "impacts_start_up": "impacts start, run-up",
    "impacts_stop_up": "impacts stop, run-up",
    "impacts_start_down": "impacts start, run-down",
    "impacts_stop_down": "impacts stop, run-down",
}
# what the paper prints for Coulomb, viscous and Coulomb-Stribeck friction
PAPER = {
    "steady": {
        ("0.8", "amplitude"): (0.2637, 0.2722, 0.264),
        ("0.8", "v_max"): (2.008, 2.2549, 2.0173),
        ("1.05", "amplitude"): (0.404, 0.4066, 0.4032),
        ("1.05", "v_max"): (3.8368, 3.8301, 3.8291),
        ("1.05", "mean_impact_speed"): (2.3237, 2.4488, 2.3211),
        ("1.2_free", "amplitude"): (0.2052, 0.2152, 0.2043),
        ("1.2_free", "v_max"): (2.443, 2.6495, 2.4266),
        ("1.2_impact", "amplitude"): (0.4407, 0.4415, 0.4361),
        ("1.2_impact", "v_max"): (5.001, 5.0614, 4.9602),
        ("1.2_impact", "mean_impact_speed"): (3.8765, 4.0997, 3.8685),
    },
    "limits": {
        "impacts_start_up": (0.87, 0.87, 0.87),
        "impacts_start_down": (1.12, 1.12, 1.12),
        "impacts_stop_up": (1.35, 1.38, 1.35),
    },
    "impacts_per_period": {"1.05": 1.016, "1.2_impact": 1.022},
    "share": (65.76, 85.16, 65.6),
}
# per cent, per cent, drive ratio
STEADY_BAR, STRIBECK_BAR, LIMIT_BAR = 1.5, 0.1, 0.015


def case_of(name: str) -> dict:
    """Return a case of examples/."""
    return tomllib.loads((SOURCE / "examples" / f"{name}.toml").read_text())


def resolved(path: Path) -> dict:
    """Return the resolved case of a file."""
    with open_result(path) as result:
        return tomllib.loads(result.attrs["resolved_case"])


def run_of(path: Path) -> dict[str, float]:
    """Return duration and window of a file."""
    return {key: float(resolved(path)["run"][key]) for key in ("duration", "window")}


@cache
def steady_values(path: Path) -> dict[str, float]:
    """Return the steady values of a trajectory file."""
    with open_result(path) as result:
        return {key: float(result.attrs[key]) for key in QUANTITIES}


def impact_times(path: Path) -> tuple[np.ndarray, float]:
    """Return the times of the impacts of a trajectory file and its drive period."""
    with open_result(path) as result:
        kinds = decode_flags(result["event_kind"]).values.astype(str)
        times = result["event_time"].values[np.char.startswith(kinds, "impact")]
        return times, float(result.attrs["drive_period"])


@cache
def impact_counts(path: Path) -> tuple[int, int, int]:
    """Return the points of a basin file, those with impacts, and those that settled."""
    with open_result(path) as result:
        impacting = int((result["impacts_per_period"].values > 0).sum())
        settled = int((decode_flags(result["reason"]).values == "settled").sum())
        return result["regime"].size, impacting, settled


@cache
def region_limits(path: Path) -> dict[str, tuple[float, float]]:
    """Return the brackets in which a sweep file saw the limits in steps, by name, in the order of LIMITS."""
    with open_result(path) as result:
        limits = table(result, "limits")
        names = [str(name) for name in limits["name"].values]
        if len(set(names)) < len(names):
            sys.exit(f"published: {path} has a limit twice; the page expects one of each")
        ends = zip(*(limits[f"observed_{end}"].values.tolist() for end in ("lower", "upper")), strict=True)
        found = dict(zip(names, ends, strict=True))
        return {name: found[name] for name in LIMITS if name in found}


def settled_motion(path: Path, motion: str) -> dict[str, float]:
    """Return the values of a motion's attractor from the many starts of a sweep file."""
    with open_result(path) as result:
        here = result.sel(drive_ratio=float(motion.split("_")[0]), method="nearest")
        impacting = here["branch_impacts_per_period"].values > 0
        settled = decode_flags(here["branch_reason"]).values == "settled"
        index = np.flatnonzero(settled & (impacting == (motion in PAPER["impacts_per_period"])))[0]
        names = [*QUANTITIES, "impacts_per_period"]
        return {key: float(here[f"branch_{key}"].values[index]) for key in names}


def per_cent(ours: float, paper: float) -> float:
    """Return the difference from the paper in per cent."""
    return 100 * (ours / paper - 1)


def steady_rows(files: dict[str, Path]) -> list[list[str]]:
    """Motion, quantity, friction, paper, here, difference, verdict."""
    rows = []
    for (motion, quantity), numbers in PAPER["steady"].items():
        for law, paper in zip(LAWS, numbers, strict=True):
            ours = steady_values(files[f"trajectory_{law}_{motion}"])[quantity]
            cells = [MOTIONS[motion], QUANTITIES[quantity], LAWS[law], f"{paper:g}", f"{ours:.5g}"]
            rows.append([*cells, *assessed(per_cent(ours, paper), STEADY_BAR)])
    return rows


def limit_rows(files: dict[str, Path]) -> list[list[str]]:
    """Friction, limit, paper, bracket, per cent, difference, verdict."""
    rows = []
    for k, law in enumerate(LAWS):
        for name, (lower, upper) in region_limits(files[f"sweep_{law}"]).items():
            cells, middle = [LAWS[law], LIMITS[name]], (lower + upper) / 2
            bracket = f"{lower:.4f} to {upper:.4f}"
            if name in PAPER["limits"]:
                paper = PAPER["limits"][name][k]
                cells += [f"{paper:g}", bracket, f"{per_cent(middle, paper):+.2f} %"]
                rows.append([*cells, *assessed(middle - paper, LIMIT_BAR, "+.4f", "")])
            else:
                rows.append([*cells, "not printed", bracket, "", "", ""])
    return rows


def stribeck_rows(files: dict[str, Path]) -> list[list[str]]:
    """Motion, quantity, Coulomb, Coulomb-Stribeck, difference, verdict."""
    rows = []
    for motion, quantity in PAPER["steady"]:
        plain = steady_values(files[f"trajectory_coulomb_{motion}"])[quantity]
        layer = steady_values(files[f"trajectory_stribeck_{motion}"])[quantity]
        cells = [MOTIONS[motion], QUANTITIES[quantity], f"{plain:.6g}", f"{layer:.6g}"]
        rows.append([*cells, *assessed(per_cent(layer, plain), STRIBECK_BAR, "+.4f")])
    return rows


def count_rows(files: dict[str, Path]) -> list[list[str]]:
    """Motion, friction, paper, settled motion, counts over the last quarter, half and whole of the run."""
    rows = []
    for motion, paper in PAPER["impacts_per_period"].items():
        for law in LAWS:
            path = files[f"trajectory_{law}_{motion}"]
            times, period = impact_times(path)
            duration = run_of(path)["duration"]
            exact = settled_motion(files[f"sweep_{law}"], motion)["impacts_per_period"]
            cells = [MOTIONS[motion], LAWS[law], f"{paper:g}", f"{exact:g}"]
            for part in (4, 2, 1):
                count, periods = int((times > duration - duration / part).sum()), duration / part / period
                cells.append(f"{count} / {periods:.4f} = {count / periods:.4f}")
            rows.append(cells)
    return rows


def share_rows(files: dict[str, Path]) -> list[list[str]]:
    """Friction, paper, share and difference on two grids, points that settled."""
    rows = []
    for law, paper in zip(LAWS, PAPER["share"], strict=True):
        cells = [LAWS[law], f"{paper:g} % = {paper * 25:.0f} / 2500"]
        for kind in ("coarse", "basin"):
            points, impacting, settled = impact_counts(files[f"{kind}_{law}"])
            share = 100 * impacting / points
            cells += [f"{share:.2f} % = {impacting} / {points}", f"{per_cent(share, paper):+.2f} %"]
        rows.append([*cells, f"{settled} of {points}"])
    return rows


def transient_rows(files: dict[str, Path]) -> list[list[str]]:
    """Motion, quantity, window, settled motion, difference; viscous friction."""
    rows = []
    for motion, quantity in PAPER["steady"]:
        ours = steady_values(files[f"trajectory_viscous_{motion}"])[quantity]
        settled = settled_motion(files["sweep_viscous"], motion)[quantity]
        cells = [MOTIONS[motion], QUANTITIES[quantity], f"{ours:.5g}", f"{settled:.5g}"]
        rows.append([*cells, f"{per_cent(ours, settled):+.3f} %"])
    return rows


def lever_rows(files: dict[str, Path]) -> list[list[str]]:
    """Quantity, paper, effective drive, lever geometry, its difference from the paper; Coulomb friction."""
    rows = []
    for (motion, quantity), numbers in PAPER["steady"].items():
        ours = steady_values(files[f"trajectory_coulomb_{motion}"])[quantity]
        lever = lever_values(files, motion)[quantity]
        cells = [
            f"{MOTIONS[motion]}: {QUANTITIES[quantity]}",
            f"{numbers[0]:g}",
            f"{ours:.5g}",
            f"{lever:.5g}",
        ]
        rows.append([*cells, f"{per_cent(lever, numbers[0]):+.2f} %"])
    limits = region_limits(files["sweep_coulomb"]), region_limits(files["lever_sweep"])
    for name, numbers in PAPER["limits"].items():
        ours, lever = (sum(found[name]) / 2 if name in found else math.nan for found in limits)
        cells = [LIMITS[name], f"{numbers[0]:g}", f"{ours:.4f}", f"{lever:.4f}"]
        rows.append([*cells, f"{per_cent(lever, numbers[0]):+.2f} %"])
    paper = PAPER["share"][0]
    counts = [impact_counts(files[name]) for name in ("coarse_coulomb", "coarse_lever")]
    ours, lever = (100 * impacting / points for points, impacting, _ in counts)
    cells = ["impact share, 50 x 50 points", f"{paper:g} %", f"{ours:.2f} %", f"{lever:.2f} %"]
    return [*rows, [*cells, f"{per_cent(lever, paper):+.2f} %"]]


def lever_values(files: dict[str, Path], motion: str) -> dict[str, float]:
    """Return the steady values of a motion of the lever geometry, from the start that leads to it."""
    impacting = PAPER["impacts_per_period"].get(motion) is not None
    for other in MOTIONS:
        values = steady_values(files[f"lever_{other}"])
        if other.split("_")[0] == motion.split("_")[0] and (values["mean_impact_speed"] > 0) == impacting:
            return values
    sys.exit(f"published: no start leads to {MOTIONS[motion]} with the lever geometry")


def assessed(difference: float, bar: float, digits: str = "+.2f", unit: str = " %") -> list[str]:
    """Return a difference and whether it is within its bar."""
    return [f"{difference:{digits}}{unit}", "within" if abs(difference) <= bar else "NOT within"]


def failures(files: dict[str, Path]) -> str:
    """Return what is not within its bar, or how near the steady values come to it."""
    steady = steady_rows(files)
    missed = [row for row in [*steady, *limit_rows(files), *stribeck_rows(files)] if row[-1] == "NOT within"]
    if missed:
        return "\n".join(f"* {', '.join(row[:3])}: {row[-2]}" for row in missed)
    worst = max(steady, key=lambda row: abs(float(row[-2].split()[0])))
    return f"None. The largest difference of a steady value is {worst[-2]} ({', '.join(worst[:3])})."


# name in the page, heads of the columns, rows
TABLES = {
    "steady": ("motion, quantity, friction, paper, here, difference, verdict", steady_rows),
    "limits": ("friction, limit, paper, here (bracket), in per cent, difference, verdict", limit_rows),
    "counts": ("motion, friction, paper, attractor, last quarter, last half, whole run", count_rows),
    "shares": (
        "friction, paper, 50 x 50 points, difference, grid of the case, difference, settled",
        share_rows,
    ),
    "stribeck": ("motion, quantity, Coulomb, Coulomb-Stribeck, difference, verdict", stribeck_rows),
    "transient": ("motion, quantity, window, settled, difference", transient_rows),
    "lever": ("quantity (Coulomb), paper, effective drive, lever geometry, lever - paper", lever_rows),
}
