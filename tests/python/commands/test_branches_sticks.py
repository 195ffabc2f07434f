# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `branches` where slips and sticks of no duration begin and end."""

from pathlib import Path

import numpy as np
import pytest
from program import succeed
from separatrix import open_result
from separatrix.open import decode_flags

STIFFNESS, MASS = 3.153, 1.767
BODY = """
body = { mass = 1.767, gravity = 0.5659309564233164 }
restoring = { law = "linear", stiffness = 3.153 }
friction = { law = "coulomb_viscous", kinetic_coefficient = 0.743, damping = 0.2551 }
contact = { law = "newton", restitution = 0.679, upper = 0.195, lower = -1.207 }
drive = { law = "harmonic", amplitude = 0.786, ratio = 1.467 }
start = { x0 = -0.506 }
run = { duration = 200 }
axis = [
  { name = "x0", from = -1.207, to = 0.195, count = 20 },
  { name = "v0", from = -4, to = 4, count = 20 },
]
"""
# Its friction force is 0.743 x 0.5659309564233164 x 1.767 N, that of its drive 3.153 x 0.786 N.
STRUCTURE = """
body.b.mass = 1.767
spring.s = { between = ["b"], stiffness = 3.153, damping = 0.2551 }
friction.f = { between = ["b"], force = 0.743 }
contact.w = { between = ["b"], law = "newton", restitution = 0.679, upper = 0.195, lower = -1.207 }
drive.d = { law = "force", body = "b", amplitude = 2.478258, frequency = 1.9596288494264025 }
start = { x0 = -0.506 }
run = { duration = 200 }
axis = [
  { name = "x0", from = -1.207, to = 0.195, count = 20 },
  { name = "v0", from = -4, to = 4, count = 20 },
]
"""
SLIPS_AND_STICKS = """
body = { mass = 1.434, gravity = 0.697350069735007 }
restoring = { law = "linear", stiffness = 3.096 }
friction = { law = "coulomb_viscous", kinetic_coefficient = 0.076, damping = 0.4459 }
contact = { law = "newton", restitution = 0.825, upper = 0.561 }
drive = { law = "harmonic", amplitude = 1.231, ratio = 0.599 }
start = { x0 = -0.05 }
run = { duration = 200 }
axis = [
  { name = "x0", from = -4.693, to = 0.561, count = 20 },
  { name = "v0", from = -4, to = 4, count = 20 },
]
"""


@pytest.fixture
def follow(separatrix: Path, tmp_path: Path):
    """Runs the command on a case text; returns parameters, multipliers, labels of the one branch."""

    def follow_it(case: str, name: str, start: float, end: float, searches: int) -> tuple[np.ndarray, ...]:
        (tmp_path / "case.toml").write_text(case)
        over = ("--parameter", name, "--from", start, "--to", end, "--searches", searches)
        succeed(separatrix, "branches", "case.toml", *over, "--force", "-o", "out.h5", folder=tmp_path)
        with open_result(tmp_path / "out.h5") as result:
            assert result["branch"].values.max() == 1
            labels = decode_flags(result["label"]).values
            return result["parameter"].values, result["multiplier_real"].values, labels

    return follow_it


@pytest.mark.parametrize("searches", [1, 4])
def test_a_body_that_turns_round_may_stop_at_once(follow, searches: int) -> None:
    """The slip after the turning point comes to be none, and later the stick: neither ends the branch.

    One search begins in the motion without a stick, four in that which slips back before it.
    """
    parameter, multipliers, labels = follow(BODY, "drive.ratio", 1.027, 2.054, searches)
    assert set(labels) == {"none", "end_of_range", "stick_onset"}
    onsets = np.flatnonzero(labels == "stick_onset")
    assert parameter[onsets] == pytest.approx([1.171909603843, 1.252342553509], abs=1e-10)
    assert (np.diff(parameter) > 0).all()
    # where the body sticks in between, the map has rank 1
    stuck = (parameter > 1.028) & (parameter < 1.2523)
    assert multipliers[stuck, 1] == pytest.approx(0, abs=1e-15)


def test_a_structure_of_one_body_has_the_same_onsets(follow) -> None:
    """Its events have other guards, and its equations are others."""
    natural = np.sqrt(STIFFNESS / MASS)
    over = (1.027 * natural, 2.054 * natural)
    frequency, multipliers, labels = follow(STRUCTURE, "drive.d.frequency", *over, 4)
    onsets = np.flatnonzero(labels == "stick_onset")
    assert frequency[onsets] / natural == pytest.approx([1.171909603843, 1.252342553509], abs=1e-10)
    assert set(labels) == {"none", "end_of_range", "stick_onset"}
    # the multiplier has a limit where the stick comes to be none, on its side
    assert multipliers[onsets[1], 0] == pytest.approx(multipliers[onsets[1] - 1, 0], abs=0.01)


def test_a_stick_between_two_slips_one_way_begins_and_ends(follow) -> None:
    parameter, _, labels = follow(SLIPS_AND_STICKS, "contact.upper", 0.62, 0.64, 3)
    assert set(labels) == {"none", "end_of_range", "stick_onset"}
    onsets = [0.629976286277, 0.632365114731, 0.633160141939]
    assert parameter[labels == "stick_onset"] == pytest.approx(onsets, abs=1e-10)


def test_slips_within_sticks_end_no_branch(separatrix: Path, source_dir: Path, tmp_path: Path) -> None:
    """Between ratios 0.1 and 0.7 the motion of one period slips up to five times, and is one branch."""
    case = source_dir / "examples" / "sweep_coulomb.toml"
    over = ("--parameter", "drive.ratio", "--from", 0.1, "--to", 0.7, "--searches", 4, "--quiet")
    succeed(separatrix, "branches", case, *over, "-o", "out.h5", folder=tmp_path)
    with open_result(tmp_path / "out.h5") as result:
        labels = decode_flags(result["label"]).values
        parameter, branch = result["parameter"].values, result["branch"].values
    first = branch == branch[np.argmin(parameter)]
    assert parameter[first].max() == pytest.approx(0.7)
    assert not {"not_known", "too_long"} & set(labels)
    onsets = parameter[first & (labels == "stick_onset")]
    # from either side: two runs that begin at other orbits find the same
    for onset in (0.1734021492764, 0.2300775801369, 0.2737123679820, 0.5369014056853):
        assert abs(onsets - onset).min() < 1e-11


@pytest.mark.long
def test_ill_conditioned_equations_end_no_branch(separatrix: Path, source_dir: Path, tmp_path: Path) -> None:
    """The capsule's cycle of two periods, determined to 1e-9 only, continues from its doubling."""
    case = source_dir / "examples" / "structure_capsule.toml"
    over = ("--parameter", "drive.inner.frequency", "--from", 0.9, "--to", 1.0, "--searches", 3, "--quiet")
    succeed(separatrix, "branches", case, *over, "-o", "out.h5", folder=tmp_path)
    with open_result(tmp_path / "out.h5") as result:
        labels = decode_flags(result["label"]).values
        parameter, period = result["parameter"].values, result["period"].values
    doubled = (period == 2) & (parameter > 0.9646) & (parameter < 0.9647)
    onset = parameter[doubled & (labels == "stick_onset")]
    assert onset == pytest.approx([0.9646267953639], abs=1e-9)
    assert "not_known" not in labels
    # a slip of the shell within a stick comes to be none
    assert np.abs(parameter[labels == "stick_onset"] - 0.9576464816674).min() < 1e-11
    doublings = parameter[labels == "PD"]
    assert np.isin(doublings[period[labels == "PD"] == 1], doublings[period[labels == "PD"] == 2]).all()
