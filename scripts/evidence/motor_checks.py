#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares machines with a motor with an independent program, writes docs/motor_checks.md.

The values of the other program come from Taylor series of order 36 in quadruple precision. Machines: Y, a
scotch yoke without dry friction and stop; I, that of examples/motor_impact.toml; R, an unbalanced rotor; P,
the lever mechanism of examples/motor_lever.toml.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
from evidence_rows import table
from separatrix import open_result
from separatrix.open import decode_flags

SOURCE = Path(__file__).resolve().parents[2]
EXAMPLES = SOURCE / "examples"
PLAIN = """\
body = { mass = 1, gravity = 1 }
restoring = { law = "linear", stiffness = 88.82643960980423 }
friction = { law = "viscous", damping = 0.5 }
drive = { DRIVE }
start = { x0 = 0.02, v0 = 0 }
run = { duration = 120, window = 20 }
[motor]
law = "dc"
voltage = 7
torque_constant = 0.5
resistance = 5
inertia = 0.05
bearing_damping = 0.002
"""
DRIVES = {"Y": 'law = "harmonic", amplitude = 0.02', "R": 'law = "unbalance", moment = 0.02'}
VOLTAGE, SPEED = "motor.voltage", "motor.no_load_speed"
# machine, what, parameter, range of the search, label, value
LIMITS = (
    ("Y", "end of the slow run-up", VOLTAGE, (8.0, 8.5), "SN", 8.252828124769745),
    ("Y", "end of the slow coast-down", VOLTAGE, (5.5, 5.9), "NS", 5.643766508919115),
    ("Y", "fold below it", VOLTAGE, (5.5, 5.9), "SN", 5.607789442699829),
    ("R", "end of the slow coast-down", VOLTAGE, (5.5, 6.1), "NS", 5.718352946535072),
    ("I", "end of the slow run-up", VOLTAGE, (8.6, 9.0), "SN", 8.864114491727010),
    ("I", "end of the slow coast-down", VOLTAGE, (5.9, 6.2), "NS", 6.019664934380103),
    ("I", "free cycle touches the stop", VOLTAGE, (4.5, 4.65), "GR", 4.611362473527201),
    ("P", "end of the slow run-up", SPEED, (16.0, 16.6), "SN", 16.38442678131826),
)
BAR = 1e-8
# From standstill the least voltage that passes the resonance.
THRESHOLD, THRESHOLD_BAR = 6.383280023598, 1e-7
PAGE = """\
# Machines with a motor compared with another program

Written by `scripts/evidence/motor_checks.py`; do not edit. The values of the other program come from Taylor
series of order 36 in quadruple precision, confirmed by SciPy's DOP853 to 2e-12. Y is a scotch yoke without
dry friction and without a stop; I is the scotch yoke with both of `examples/motor_impact.toml`. R is an
unbalanced rotor, P the lever mechanism of `examples/motor_lever.toml`. Values are voltages in V; those of P
are no-load speeds in rad/s. Labels: `SN` fold, `NS` Neimark-Sacker bifurcation, `GR` grazing.

## Bifurcations, by `branches`

{limits}

## Run-up from standstill, by `trajectory`

The lowest voltage at which Y passes through resonance is {threshold} V in the other program.

{runs}

The suite `test_motor_orbits` compares 16 cycles and their multipliers to 1e-9.
The suite `test_motor_motion` compares lists of events.

## Disagreements

{wrong}
"""


def case_of(machine: str, folder: Path) -> Path:
    """Return the case file of a machine."""
    if machine == "I":
        return EXAMPLES / "motor_impact.toml"
    if machine == "P":
        return EXAMPLES / "motor_lever.toml"
    path = folder / f"{machine}.toml"
    path.write_text(PLAIN.replace("DRIVE", DRIVES[machine]))
    return path


def branches(program: Path, folder: Path, machine: str, parameter: str, ends: tuple[float, float]) -> dict:
    """Return labels and parameters of the points of the branches over a range."""
    path = folder / f"{machine}_{ends[0]}.h5"
    if not path.exists():
        words = ["--parameter", parameter, "--from", repr(ends[0]), "--to", repr(ends[1]), "--searches", "2"]
        command = [program, "branches", case_of(machine, folder), *words, "-q", "--force", "-o", path]
        subprocess.run(command, check=True)
    with open_result(path) as result:
        return {"label": decode_flags(result["label"]).values, "value": result["parameter"].values}


def outcome(program: Path, folder: Path, voltage: float) -> str:
    """Return the outcome of a run-up of Y from standstill."""
    output = ["-o", folder / "run.h5", "--force", "--set", f"motor.voltage={voltage!r}"]
    command = [program, "trajectory", case_of("Y", folder), *output]
    report = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return re.search(r"^crank speed .*: (\w+)$", report, re.MULTILINE)[1]


def main() -> None:
    """Run all, write the page, end with 1 if something is not as it must be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=SOURCE / "build")
    parser.add_argument("--folder", type=Path, default=SOURCE / "build" / "motor_checks")
    options = parser.parse_args()
    program = options.build / "bin" / "separatrix"
    options.folder.mkdir(parents=True, exist_ok=True)
    lines, runs, wrong = [], [], []
    for machine, what, parameter, ends, label, value in LIMITS:
        found = branches(program, options.folder, machine, parameter, ends)
        near = found["value"][found["label"] == label]
        ours = near[np.argmin(np.abs(near - value))] if near.size else np.nan
        lines.append((machine, what, label, f"{value:.15g}", f"{ours:.15g}", f"{ours - value:.1e}"))
        print(*lines[-1], sep=" | ", flush=True)
        if not abs(ours - value) <= BAR:
            wrong.append(f"{machine}, {what}: {ours:.15g}")
    for side, expected in ((-1, "captured"), (1, "passed")):
        voltage = THRESHOLD + side * THRESHOLD_BAR
        runs.append((f"{voltage:.13g}", outcome(program, options.folder, voltage), expected))
        print(*runs[-1], sep=" | ", flush=True)
        if runs[-1][1] != expected:
            wrong.append(f"run-up at {voltage:.13g} V: {runs[-1][1]}")
    page = PAGE.format(
        limits=table(["machine", "what", "label", "other program", "Separatrix", "difference"], lines),
        runs=table(["voltage (V)", "outcome", "expected"], runs),
        threshold=f"{THRESHOLD:.13g}",
        wrong="\n".join(f"* {item}" for item in wrong) if wrong else "None.",
    )
    (SOURCE / "docs" / "motor_checks.md").write_text(page)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
