# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Why nothing is known of the exponents of one body by expressions: rest, growth, no section, no force."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from program import Outcome, run

DRIVE = '[drive]\nlaw = "expression"\nperiod = "2*pi"\n'
WALLS = '[contact]\nlaw = "expression"\nlower = -1\nupper = 1\nrestitution = {e}\n'
FLOOR = '[contact]\nlaw = "expression"\nlower = 0\nrestitution = {e}\n'


def stability(
    separatrix, folder: Path, force: str, more: str = "", x: float = 0.0, v: float = 0.0, *options: str
) -> Outcome:
    (folder / "case.toml").write_text(
        f'[body]\nmass = 1\n[force.f]\nforce = "{force}"\n{more}'
        f"[start]\nx0 = {x}\nv0 = {v}\n[run]\nduration = 100\n"
    )
    return run(separatrix, "stability", "case.toml", "--periods", "400", *options, folder=folder)


@pytest.mark.parametrize(
    ("force", "start", "x", "eigenvalues"),
    [
        ("x - x^3 - 3*v", 0.5, 1, "-1.00000, -2.00000"),
        ("-x - v", 1, 0, "-0.500000+0.866025404i, -0.500000-0.866025404i"),
        ("-x - 0.1*v", 1, 0, "-0.0500000+0.998749218i, -0.0500000-0.998749218i"),
    ],
)
def test_a_motion_comes_to_rest_at_an_equilibrium(separatrix, tmp_path, force, start, x, eigenvalues) -> None:
    ended = stability(separatrix, tmp_path, force, x=start)
    assert ended.code == 0, ended.err
    assert "not known: the motion comes to rest at the stable equilibrium x = " in ended.out
    found = float(ended.out.split("x = ")[1].split(" m")[0])
    assert found == pytest.approx(x, abs=1e-9)
    assert f"eigenvalues {eigenvalues} 1/s" in ended.out


def test_a_start_on_an_equilibrium_is_reported_with_its_stability(separatrix, tmp_path) -> None:
    ended = stability(separatrix, tmp_path, "x - x^3 - 0.3*v")
    assert ended.code == 0, ended.err
    assert "not known: the motion rests at the unstable equilibrium x = 0.0 m, eigenvalues " in ended.out
    found = [float(value) for value in ended.out.split("eigenvalues ")[1].split(" 1/s")[0].split(", ")]
    assert found == pytest.approx(sorted(np.roots([1, 0.3, -1]), reverse=True), rel=1e-5)


def test_states_at_an_equilibrium_are_named(separatrix, tmp_path) -> None:
    more = '[state.z]\nrate = "x - z"\nstart = 1\n'
    ended = stability(separatrix, tmp_path, "2 - x - 3*v - z", more)
    assert ended.code == 0, ended.err
    assert "at the stable equilibrium x = 1.00000000 m, z = 1.00000000," in ended.out


@pytest.mark.parametrize("periods", [64, 400])
def test_a_motion_with_a_state_that_dies_away_is_no_cycle(separatrix, tmp_path, periods) -> None:
    more = '[state.z]\nrate = "x - 2*z"\n'
    force = "(-0.2 - x^2)*v - x + 0.3*z"
    ended = stability(separatrix, tmp_path, force, more, 0.5, 0, "--periods", str(periods))
    assert "periodic" not in ended.out
    assert "comes to rest at the stable equilibrium x = " in ended.out


def test_an_angle_at_rest_has_its_unit(separatrix, tmp_path) -> None:
    (tmp_path / "case.toml").write_text(
        '[body]\nmass = "1 kg m^2"\n[restoring]\nlaw = "pendulum"\nmoment = "1 N m"\n[force.damper]\n'
        'force = "-c*v"\nc = "3 N m s/rad"\n[start]\nx0 = "3 rad"\n[run]\nduration = 100\n'
    )
    ended = run(separatrix, "stability", "case.toml", "--periods", "400", folder=tmp_path)
    assert ended.code == 0, ended.err
    assert " rad, eigenvalues -0.381966, -2.61803 1/s" in ended.out


def test_dry_friction_holds_the_body(separatrix, tmp_path) -> None:
    friction = '[friction]\nlaw = "expression"\nforce = "0.1"\n'
    ended = stability(separatrix, tmp_path, "-x", friction, x=1.05)
    assert ended.code == 0, ended.err
    assert "not known: the motion comes to rest, held by friction at x = -0.05" in ended.out


@pytest.mark.parametrize(("force", "e"), [("-10", 0.5), ("-10", 0.9), ("-10 - x", 0.8)])
def test_a_body_comes_to_rest_on_a_barrier(separatrix, tmp_path, force, e) -> None:
    ended = stability(separatrix, tmp_path, force, FLOOR.format(e=e), x=1)
    assert "periodic" not in ended.out
    assert ended.code == 0, ended.err
    assert "comes to rest, held by the barrier at x = 0.0 m" in ended.out


@pytest.mark.parametrize(
    ("force", "start"), [("x", 1), ("-x + 0.1*v", 1), ("x^3", 1), ("1 - v + 2*x", 1), ("-x + 0.3*v", 1e-8)]
)
@pytest.mark.parametrize("drive", ["", DRIVE])
def test_growth_without_bound_is_no_failure(separatrix, tmp_path, force, start, drive) -> None:
    ended = stability(separatrix, tmp_path, force, drive, x=start)
    assert ended.code == 0, ended.err
    assert "not known: the motion grows without bound, or leaves the domain (run.domain)" in ended.out


def test_between_two_walls_there_is_no_section(separatrix, tmp_path) -> None:
    ended = stability(separatrix, tmp_path, "0*x", WALLS.format(e=1), v=1)
    assert ended.code == 0, ended.err
    assert "not known: the body does not turn round within 256" in ended.out
    assert "128 impacts" in ended.out
    assert "[drive] with a period" in ended.out


def test_with_a_period_there_is_one_between_two_walls(separatrix, tmp_path) -> None:
    """As the message promises; between elastic walls the speed stays at the root of 1/3."""
    more = WALLS.format(e=1) + DRIVE
    ended = stability(separatrix, tmp_path, "0.1*v*(1 - 3*v^2)", more, 0, 0.5)
    assert ended.code == 0, ended.err
    lines = [line for line in ended.out.splitlines() if line.startswith("Lyapunov exponent")]
    assert [float(line.split()[3]) for line in lines] == pytest.approx([0, -0.2], abs=2e-3)


@pytest.mark.parametrize("drive", ["", DRIVE])
@pytest.mark.parametrize(
    ("force", "more", "reason"),
    [
        ("-x + log(x + 0.5)/10", "", "step_failed"),
        ("-x - 1/(x + 0.5)", "", "step_failed"),
        ("-x", FLOOR.format(e='"1 + speed"'), "step_failed"),
        ("-x - 0.3*sign(v)", "", "mode_cycle"),
    ],
)
def test_forces_that_are_not_defined_end_the_motion(separatrix, tmp_path, force, more, reason, drive) -> None:
    ended = stability(separatrix, tmp_path, force, more + drive, x=0.7)
    assert ended.code == 78
    assert f"the motion was given up: {reason}" in ended.out


@pytest.mark.parametrize("force", ["-x - 0.1*v", "-x*(1 + 0.2*cos(phase)) - 0.1*v"])
def test_a_driven_body_on_an_equilibrium_has_its_exponents(separatrix, tmp_path, force) -> None:
    """Nothing holds a body without friction: their sum is minus the damping, none is lost."""
    ended = stability(separatrix, tmp_path, force, DRIVE)
    assert ended.code == 0, ended.err
    assert "-inf" not in ended.out
    lines = [line for line in ended.out.splitlines() if line.startswith("Lyapunov exponent")]
    found = [float(line.split()[3].rstrip(",")) for line in lines]
    assert sum(found) == pytest.approx(-0.1, rel=1e-6)
    if "cos" not in force:
        assert found == pytest.approx([-0.05, -0.05], rel=1e-3)


def test_an_unstable_equilibrium_of_a_driven_body_is_not_periodic(separatrix, tmp_path) -> None:
    """By Floquet's multipliers, exp(2 pi lambda)."""
    ended = stability(separatrix, tmp_path, "x - 0.3*v", DRIVE)
    lines = [line for line in ended.out.splitlines() if line.startswith("Lyapunov exponent")]
    found = [float(line.split()[3].rstrip(",")) for line in lines]
    assert found == pytest.approx([-0.15 + math.sqrt(1.0225), -0.15 - math.sqrt(1.0225)], rel=1e-5)
    assert "the motion is periodic" not in ended.out


def test_the_reason_is_in_the_lines_of_json(separatrix, tmp_path) -> None:
    ended = stability(separatrix, tmp_path, "x - x^3 - 3*v", "", 0.5, 0.0, "--json")
    lines = [json.loads(line) for line in ended.out.splitlines()]
    (line,) = [line for line in lines if line["event"] == "not_known"]
    assert line["rest"] == "equilibrium"
    assert line["x"] == pytest.approx(1)
    assert line["eigenvalues"] == pytest.approx([-1, 0, -2, 0])
