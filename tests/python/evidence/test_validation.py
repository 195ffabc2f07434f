# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/validation.md: its cheap rows computed again, and that it has every row."""

import importlib
import sys

import numpy as np
import pytest


@pytest.fixture(scope="module")
def rows(source_dir):
    sys.path.insert(0, str(source_dir / "scripts" / "evidence"))
    yield importlib.import_module("validation_rows")
    sys.path.remove(str(source_dir / "scripts" / "evidence"))


@pytest.fixture(scope="module")
def numbers(rows):
    return importlib.import_module("validation_numbers")


@pytest.fixture
def program(rows, library, separatrix, build_dir, tmp_path):
    return rows.Program(build_dir, tmp_path)


@pytest.mark.long
def test_orbits_of_budd_and_dux_are_theirs_and_stand_in_the_page(rows, program, source_dir):
    page = (source_dir / "docs" / "validation.md").read_text()
    found = [*rows.budd_dux(program), *rows.family(program)]
    assert [row for row in found if row.verdict != "agrees"] == []
    assert len(found) == 20
    for row in found:
        start = f"| {row.what} | {row.theirs:.12g} |"
        (line,) = [item for item in page.splitlines() if item.startswith(start)]
        printed = float(line.split("|")[3])
        assert abs(printed - row.ours) <= row.bar, line


def test_the_saddle_is_one(rows, program):
    saddle = rows.Map(program.models["budd_dux"]).orbits((-3, -0.4), (-2, 2), 1)[1]
    assert abs(saddle.multipliers[0]) > 1 > abs(saddle.multipliers[1])
    # flights keep areas, an impact shrinks them by the square of the restitution
    assert saddle.multipliers.prod().real == pytest.approx(0.64, abs=1e-9)


def test_every_row_and_every_case_is_in_the_page(numbers, source_dir):
    page = (source_dir / "docs" / "validation.md").read_text()
    for source, what, theirs, _ in numbers.THEIRS.values():
        assert f"### {source}" in page
        assert f"| {what} | {theirs:.12g} |" in page
    for path in (source_dir / "examples" / "validation").glob("*.toml"):
        assert f"examples/validation/{path.name}" in page


def test_machines_with_a_motor_stand_in_the_page(rows, program, source_dir):
    """Events, the cycle with rests and the run-up computed again; the page has every machine."""
    motors = importlib.import_module("validation_motors")
    page = motors.between((source_dir / "docs" / "validation.md").read_text())
    found = [row for compute in (motors.events, motors.stick, motors.run_up) for row in compute(program)]
    assert len(found) == 11
    assert [row for row in found if row.verdict != "agrees"] == []
    for row in found:
        assert f"| {row.source} | {row.what} | " in page
    assert {line.split(" | ")[0] for line in page.splitlines() if "agrees" in line} == {
        f"| {name}" for name in ("Y", "I", "R", "RI", "P")
    }
    assert "DIFFERS" not in page


def test_a_cycle_of_a_motor_is_not_one_at_another_voltage(rows, library):
    """The rows of the cycles can differ: half a volt more moves them by far more than the tolerance."""
    motors = importlib.import_module("validation_motors")
    machine, value, _, _, speed, point, *_ = motors.theirs.CYCLES[0]
    found = motors.closed(motors.case_of(machine, value + 0.5).model, np.array(point), 2 * np.pi / speed)
    assert abs(found.speed - speed) > 1e-3
