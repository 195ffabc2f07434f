# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of several bodies beside closed forms: the quick rows of docs/validation.md."""

import importlib
import json
import sys

import numpy as np
import pytest

pytestmark = pytest.mark.long
"""Pages of evidence, which change with their scripts alone."""


@pytest.fixture(scope="module")
def rows(source_dir):
    sys.path.insert(0, str(source_dir / "scripts" / "evidence"))
    yield importlib.import_module("validation_structures")
    sys.path.remove(str(source_dir / "scripts" / "evidence"))


@pytest.mark.parametrize(
    ("name", "count"), [("nonsmooth_modes", 3), ("others", 3), ("ball", 6), ("rattle", 1)]
)
def test_numbers_agree(rows, separatrix, build_dir, tmp_path, name, count):
    found = getattr(rows, name)(rows.Program(build_dir, tmp_path))
    assert len(found) == count
    assert [number for number in found if number.verdict != "agrees"] == []


@pytest.mark.parametrize(
    ("name", "count"), [("grazes", 3), ("single_impacts", 3), ("beads", 15), ("stack", 4), ("pair", 2)]
)
def test_benchmarks_agree(rows, separatrix, build_dir, tmp_path, name, count):
    benchmarks = {compute.__name__: compute for compute in rows.BENCHMARKS}
    found = benchmarks[name](rows.Program(build_dir, tmp_path))
    assert len(found) == count
    assert [number for number in found if number.verdict != "agrees"] == []


@pytest.mark.parametrize(
    ("name", "count"),
    [
        pytest.param("cantilever", 18, marks=pytest.mark.long),
        pytest.param("capture", 5, marks=pytest.mark.long),
        ("chatter", 8),
    ],
)
def test_impact_by_impact(rows, separatrix, build_dir, tmp_path, name, count):
    benchmarks = {compute.__name__: compute for compute in rows.IMPACTS}
    found = benchmarks[name](rows.Program(build_dir, tmp_path))
    assert len(found) == count
    assert [number for number in found if number.verdict != "agrees"] == []


@pytest.fixture(scope="module")
def public(rows):
    return importlib.import_module("validation_public")


@pytest.mark.parametrize(
    ("name", "count"),
    [("siconos", 7), ("modelica_force", 5), ("modelica_stop", 2), ("modelica_clutch", 5), ("rao", 3)]
    + [("sciml", 1), ("pendulum", 2), ("hertz", 4), ("rocking", 2), ("springs", 2), ("stacked", 2)]
    + [("vibrated_ball", 3), ("bungee", 2)],
)
def test_public_problems_agree_and_stand_in_the_page(
    public, separatrix, build_dir, tmp_path, source_dir, name, count
):
    sections = importlib.import_module("validation_sections")
    page = sections.section_of((source_dir / "docs" / "validation.md").read_text(), public.HEADING)
    problems = {compute.__name__: compute for compute in public.COMPUTED}
    found = problems[name](public.Program(build_dir, tmp_path))
    assert len(found) == count
    assert [number for number in found if number.verdict != "agrees"] == []
    for number in found:
        assert f"| {number.source} | {number.what} | {number.theirs:.12g} |" in page


def test_what_is_off_is_settled_by_a_closed_form(public, separatrix, build_dir, tmp_path):
    *found, rest = public.PRINTED[0](public.Program(build_dir, tmp_path))
    assert [number.verdict.split(",")[0] for number in found] == ["theirs is off"] * 5
    assert rest.verdict == "agrees"
    assert not any(number.differs for number in found)


def test_every_public_case_is_run(source_dir):
    scripts = "".join(
        path.read_text() for path in (source_dir / "scripts/evidence").glob("validation_public_*.py")
    )
    for path in (source_dir / "examples" / "validation" / "public").glob("*.toml"):
        assert f'"{path.stem}"' in scripts or f'"{path.name}"' in scripts


def test_the_quadratic_gives_orbits_that_come_back(rows):
    """The closed form, by steps of the other simulator: after a period the same state, but for the impact."""
    coupled, damping = np.array([[2, -1], [-1, 1]]), np.diag([0.5, 0.0])
    force, row, frequency = np.array([1, 0]), np.array([0, 1]), 0.6
    found = rows.orbits(frequency, np.eye(2), damping, coupled, force, row, 1, 0.8)
    speed, phase, position, velocity = max(found, key=lambda one: one[0])
    assert speed == pytest.approx(1.418642594893, abs=1e-11)
    machine = rows.Structure(
        [1, 1], lambda t, q, v: -coupled @ q - damping @ v + force * np.cos(frequency * t)
    )
    start = phase / frequency
    end = machine.run(position, velocity, start + 2 * np.pi / frequency, start)
    assert end[:2] == pytest.approx(position, abs=1e-9)
    assert end[3] == pytest.approx(speed, abs=1e-9)
    assert velocity[1] == pytest.approx(-0.8 * speed, abs=1e-12)


def test_a_number_that_is_off_is_reported(rows):
    one = rows.Row("somebody", "speed", 1.0, 1.1, 1e-9)
    assert one.differs
    assert one.cells()["verdict"] == "**DIFFERS**"
    assert json.loads(one.to_json())["verdict"] == "DIFFERS"
    many = rows.Row("somebody", "speeds", [1.0, 2.0], [1.0, 1.9], 0.06, relative=True)
    assert many.difference == pytest.approx(0.05) and not many.differs
    settled = rows.Row("somebody", "speed", 1.0, 1.1, 1e-9, closed=1.1)
    assert settled.verdict == "theirs is off, closed form 1.1" and not settled.differs
    assert rows.Row("somebody", "speed", 1.0, float("nan"), 1e-9).differs
