# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The first hold of a sweep begins at the start of the case: of all bodies, and of states by expressions."""

from pathlib import Path

import h5py
import pytest
from program import succeed

RUN = """
[run]
duration = 60
window = 12
[sweep]
parameter = "{parameter}"
from = {lowest}
to = {highest}
count = 3
starts = [0, 0]
"""
SHAKER = """
[drive.shaker]
law = "force"
body = "{body}"
frequency = 2
amplitude = 0.1
"""
STUCK = """
[body.block]
mass = 1
[spring.frame]
between = ["block"]
stiffness = 10
[friction.ground]
between = ["block"]
force = 5
[start]
x0 = 0.05
"""
BESIDE = """
[watch]
body = "light"
[body.light]
mass = 1
[body.held]
mass = 1
x0 = 0.3
[spring.frame]
between = ["light"]
stiffness = 10
damping = 2
[spring.coupling]
between = ["light", "held"]
stiffness = 10
[friction.ground]
between = ["held"]
force = 50
"""
STATE = """
[body]
mass = 1
[state.pressure]
rate = "0*v"
start = 0.5
[restoring]
law = "linear"
stiffness = 10
[friction]
law = "viscous"
damping = 2
[force.pushed]
force = "area*pressure"
area = 4
[drive]
law = "expression"
frequency = 2
"""


def largest_positions(
    separatrix: Path, folder: Path, case: str, parameter: str, ends: tuple[float, float]
) -> list[list[float]]:
    """Of the holds of a parameter, up and down."""
    run = RUN.format(parameter=parameter, lowest=ends[0], highest=ends[1])
    (folder / "case.toml").write_text(case + run)
    succeed(separatrix, "sweep", "case.toml", "-o", "out.h5", folder=folder)
    with h5py.File(folder / "out.h5") as file:
        return file["x_max"][:].tolist()


def shaken(separatrix: Path, folder: Path, case: str, body: str) -> list[list[float]]:
    """The same of a body that is shaken, over the amplitude."""
    case += SHAKER.format(body=body)
    return largest_positions(separatrix, folder, case, "drive.shaker.amplitude", (0.1, 0.3))


def test_a_block_that_friction_holds_stays_where_it_starts(separatrix: Path, tmp_path: Path) -> None:
    """The spring pulls with 0.5 N, the shaker with at most 0.3 N, friction holds up to 5 N."""
    for way in shaken(separatrix, tmp_path, STUCK, "block"):
        assert way == pytest.approx([0.05] * 3, abs=1e-15)


def test_another_body_starts_at_its_own_position(separatrix: Path, tmp_path: Path) -> None:
    """The watched body comes to rest half way to the other one, which friction holds at 0.3 m."""
    for way in shaken(separatrix, tmp_path, BESIDE, "held"):
        assert way == pytest.approx([0.15] * 3, abs=1e-9)


def test_a_state_by_an_expression_starts_with_its_value(separatrix: Path, tmp_path: Path) -> None:
    """A constant pressure of 0.5: x = area 0.5/10 in every hold."""
    for way in largest_positions(separatrix, tmp_path, STATE, "force.pushed.area", (4, 6)):
        assert way == pytest.approx([0.2, 0.25, 0.3], abs=1e-9)
