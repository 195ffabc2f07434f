# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of several bodies beside closed forms: the quick rows of docs/validation.md."""

import importlib
import sys

import numpy as np
import pytest


@pytest.fixture(scope="module")
def rows(source_dir):
    sys.path.insert(0, str(source_dir / "scripts"))
    yield importlib.import_module("validation_structures")
    sys.path.remove(str(source_dir / "scripts"))


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


def test_the_quadratic_gives_orbits_that_come_back(rows):
    """The closed form, by steps of the other simulator: after a period the same state, but for the impact."""
    coupled, damping = np.array([[2, -1], [-1, 1]]), np.diag([0.5, 0.0])
    force, row, frequency = np.array([1, 0]), np.array([0, 1]), 0.6
    found = rows.orbits(frequency, np.eye(2), damping, coupled, force, row, 1, 0.8)
    speed, phase, place, velocity = max(found, key=lambda one: one[0])
    assert speed == pytest.approx(1.418642594893, abs=1e-11)
    machine = rows.Structure(
        [1, 1], lambda t, q, v: -coupled @ q - damping @ v + force * np.cos(frequency * t)
    )
    start = phase / frequency
    end = machine.run(place, velocity, start + 2 * np.pi / frequency, start)
    assert end[:2] == pytest.approx(place, abs=1e-9)
    assert end[3] == pytest.approx(speed, abs=1e-9)
    assert velocity[1] == pytest.approx(-0.8 * speed, abs=1e-12)


def test_a_number_that_is_off_is_told(rows):
    one = rows.Number("somebody", "speed", 1.0, 1.1, 1e-9)
    assert one.verdict == "DIFFERS"
    assert "**DIFFERS**" in rows.section([one])
