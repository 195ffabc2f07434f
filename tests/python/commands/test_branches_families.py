# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `branches` where orbits are not isolated, or only just."""

from pathlib import Path

import numpy as np
import pytest
from program import Outcome, run
from separatrix import open_result

# At half the natural frequency free orbits of any size are periodic between turning points; those of
# the rim of their family just stick, and motions creep to them like 1/n. With damping one is left.
HALF_THE_FREQUENCY = """
body = {{ mass = 1, gravity = 1 }}
restoring = {{ law = "linear", stiffness = 1 }}
friction = {{ law = "{law}", kinetic_coefficient = 0.02{more} }}
drive = {{ law = "harmonic", amplitude = 0.5, ratio = 0.5 }}
start = {{ x0 = 0.1 }}
run = {{ duration = 60 }}
axis = [{{ name = "x0", from = -2, to = 2, count = 12 }}, {{ name = "v0", from = -2, to = 2, count = 12 }}]
"""
OVER_FRICTION = ("--parameter", "friction.kinetic_coefficient", "--from", "0.01", "--to", "0.05", "--force")


@pytest.fixture
def follow(separatrix: Path, tmp_path: Path):
    """Runs the command on a case text; returns what ended, and the file."""

    def follow_it(case: str, *options: str) -> tuple[Outcome, Path]:
        (tmp_path / "case.toml").write_text(case)
        out = tmp_path / "out.h5"
        return run(separatrix, "branches", "case.toml", *options, "-o", out, folder=tmp_path), out

    return follow_it


@pytest.mark.parametrize("searches", [1, 3, 5])
def test_a_motion_that_creeps_to_the_rim_of_a_family_is_no_orbit(follow, searches: int) -> None:
    """None is isolated: nothing is followed, whatever the values at which orbits are searched."""
    case = HALF_THE_FREQUENCY.format(law="coulomb", more="")
    ended, out = follow(case, *OVER_FRICTION, "--searches", searches)
    assert ended.code == 65
    assert "orbits that are not isolated (a multiplier within 1e-6 of 1: a family) were met" in ended.out
    assert "0 branches from 0 seeds" in ended.out
    assert "no isolated periodic orbit was found" in ended.err
    assert not out.exists()


def test_with_damping_one_orbit_of_the_family_is_left(follow) -> None:
    """Free and symmetric; the larger multiplier is that of the damping over a period, exp(-2 pi d)."""
    case = HALF_THE_FREQUENCY.format(law="coulomb_viscous", more=", damping = 0.001")
    ended, out = follow(case, *OVER_FRICTION, "--searches", 3)
    assert ended.code == 0, ended
    with open_result(out) as result:
        assert result["branch"].values.max() == 1
        assert result["stable"].values.all()
        assert result["multiplier_real"].values[:, 0] == pytest.approx(np.exp(-2e-3 * np.pi), abs=1e-9)
