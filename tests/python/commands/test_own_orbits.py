# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Orbits and exponents of a body by expressions: by matrices, catalogue laws, differences of motions."""

import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import run, succeed

PERIOD = math.pi / 2
CASE = """
[body]
mass = 1
[restoring]
law = "expression"
force = "-k*x"
k = 25
[friction]
{friction}
[contact]
{contact}
[drive]
law = "expression"
period = "pi/2"
[force.drive]
force = "f*cos(phase) - c*v"
f = {f}
c = {c}
{more}
[start]
x0 = {x}
v0 = {v}
[run]
duration = "{duration} s"
"""
SMOOTH = {"friction": 'law = "none"', "contact": 'law = "none"', "f": 2.5, "c": 0.4, "more": ""}
WALL = 'law = "expression"\nrestitution = "e/(1 + speed)"\ne = 0.8\nupper = 0.1'
STRIBECK = 'law = "expression"\nforce = "0.5 + 0.3*exp(-(speed/0.2)^2)"'
JUMP = '[force.jump]\nforce = "if(x < 0.05, 0, -0.7)"'
STOP = '[force.stop]\nforce = "-400*max(x - 0.1, 0)"'
SQUARE = '[force.square]\nforce = "0.5*if(phase < pi, 1, -1)"'


def write(folder: Path, x: float = 0.01, v: float = 0.0, duration: float = 60, **changes: object) -> Path:
    """A case of the machine with a few keys changed."""
    path = folder / "case.toml"
    path.write_text(CASE.format(**(SMOOTH | changes), x=repr(float(x)), v=repr(float(v)), duration=duration))
    return path


def motion(separatrix, folder: Path, x: float, v: float, **changes: object) -> np.ndarray:
    """Position and velocity after a period."""
    write(folder, x, v, PERIOD, **changes)
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", "-q", folder=folder)
    with h5py.File(folder / "out.h5") as file:
        return np.array([file["x"][-1], file["v"][-1]])


# A force with a corner; one that jumps in place, beside a stop with a law of its own; one that jumps in time,
# beside dry friction.
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({"more": STOP}, marks=pytest.mark.long),
        {"more": JUMP, "contact": WALL},
        {"more": SQUARE, "contact": WALL, "friction": STRIBECK, "c": 0.0},
    ],
)
def test_multipliers_are_those_of_differences_of_motions(separatrix, tmp_path, changes) -> None:
    write(tmp_path, **changes)
    asked = ("--parameter", "force.drive.f", "--from", "2.5", "--to", "2.51", "--searches", "1")
    succeed(
        separatrix, "branches", "case.toml", "-o", "branches.h5", "-q", *asked, folder=tmp_path, timeout=300
    )
    with h5py.File(tmp_path / "branches.h5") as file:
        first = {name: file[name][0] for name in ("parameter", "x", "v", "period")}
        found = file["multiplier_real"][0] + 1j * file["multiplier_imag"][0]
    assert first["period"] == 1
    here = np.array([first["x"], first["v"]])
    changes = changes | {"f": repr(float(first["parameter"]))}
    step = 1e-6
    assert motion(separatrix, tmp_path, *here, **changes) == pytest.approx(here, abs=1e-10)
    ends = [
        motion(separatrix, tmp_path, *(here + side), **changes)
        for side in step * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    ]
    by_start = np.column_stack([ends[0] - ends[1], ends[2] - ends[3]]) / (2 * step)
    expected = sorted(np.linalg.eigvals(by_start), key=lambda value: (abs(value), value.imag))
    assert sorted(found, key=lambda value: (abs(value), value.imag)) == pytest.approx(expected, abs=1e-6)


def test_exponents_are_those_of_the_matrix_of_a_linear_machine(separatrix, tmp_path) -> None:
    """A spring with a damper in series, as a state, beside two states on which the body does not act."""
    states = '[force.series]\nforce = "-9*(x - y)"\n[state.y]\nrate = "(x - y)/0.3"\n'
    states += '[state.s]\nrate = "7*r"\n[state.r]\nrate = "-7*s"\nstart = 1'
    write(tmp_path, more=states)
    lines = succeed(
        separatrix, "stability", "case.toml", "--periods", "400", folder=tmp_path
    ).out.splitlines()
    found = [float(line.split()[3]) for line in lines if line.startswith("Lyapunov exponent")]
    matrix = np.array([[0, 1, 0], [-34, -0.4, 9], [1 / 0.3, 0, -1 / 0.3]])
    expected = sorted([0.0, 0.0, *np.linalg.eigvals(matrix).real], reverse=True)
    assert found == pytest.approx(expected, abs=2e-3)


def test_a_law_of_the_catalogue_has_the_same_fold_by_expressions(separatrix, source_dir, tmp_path) -> None:
    """The impact oscillator of COCO's recipes: its fold beside the graze."""
    text = (source_dir / "examples" / "validation" / "impact_coco.toml").read_text()
    own = text.replace(
        'law = "harmonic"\namplitude = 1 # A\nratio = 1', 'law = "expression"\nperiod = "2*pi"'
    )
    own += '\n[force.drive]\nforce = "a*cos(phase)"\na = 1\n'
    own = own.replace('parameter = "drive.amplitude"', 'parameter = "force.drive.a"')
    (tmp_path / "case.toml").write_text(own)
    asked = ("--parameter", "force.drive.a", "--from", "0.09", "--to", "0.11", "--searches", "2")
    succeed(
        separatrix, "branches", "case.toml", "-o", "branches.h5", "-q", *asked, folder=tmp_path, timeout=300
    )
    theirs = ("--parameter", "drive.amplitude", *asked[2:])
    folder = source_dir / "examples" / "validation"
    succeed(
        separatrix,
        "branches",
        folder / "impact_coco.toml",
        "-o",
        "theirs.h5",
        "-q",
        *theirs,
        folder=tmp_path,
        timeout=300,
    )
    folds = []
    for name in ("branches.h5", "theirs.h5"):
        with h5py.File(tmp_path / name) as file:
            fold = file["label"].attrs["flag_meanings"].split().index("SN")
            folds.append(file["parameter"][()][file["label"][()] == fold])
    assert folds[0] == pytest.approx(folds[1], abs=1e-10)
    assert len(folds[0]) == 1


@pytest.mark.parametrize(
    "command", [("stability",), ("branches", "--parameter", "force.f.k", "--from", "1", "--to", "2")]
)
def test_without_a_period_there_is_no_section(separatrix, tmp_path, command: tuple[str, ...]) -> None:
    (tmp_path / "case.toml").write_text(
        '[body]\nmass = 1\n[force.f]\nforce = "-k*x - v + sin(t)"\nk = 1\n[start]\nx0 = 1\n'
    )
    name, *options = command
    refused = run(separatrix, name, "case.toml", *options, folder=tmp_path)
    assert refused.code == 65
    assert "drive.period: missing, needed here: forces depend on the time t" in refused.err
