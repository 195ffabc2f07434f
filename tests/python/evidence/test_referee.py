# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The independent referee: against closed forms, against itself, and a short form of its comparison."""

import importlib
import math
import re
import shutil
import sys

import numpy as np
import pytest

# cases whose comparison takes a second or two, made smaller
SHORT = ("dry_friction", "dry_friction_wall", "fourier", "subharmonics", "two_walls")


@pytest.fixture(scope="module")
def referee(source_dir):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    sys.path.insert(0, str(source_dir / "tests" / "referee"))
    yield importlib.import_module("referee")
    sys.path.remove(str(source_dir / "tests" / "referee"))


@pytest.fixture(scope="module")
def libraries(referee, tmp_path_factory):
    folder = tmp_path_factory.mktemp("referee")
    return referee.build(folder), referee.build(folder, long=True)


def oscillator(amplitude, ratio, damping=0.1, upper=1.0, **friction):
    """Mass and stiffness 1, one wall with restitution 0.8."""
    return {
        "body": {"mass": 1.0, "gravity": 1.0},
        "restoring": {"law": "linear", "stiffness": 1.0},
        "friction": {"damping": damping, **friction},
        "contact": {"law": "newton", "restitution": 0.8, "upper": upper},
        "drive": {"law": "harmonic", "amplitude": amplitude, "ratio": ratio},
    }


def test_it_finds_the_orbit_with_one_impact_and_its_multipliers(referee, libraries):
    for library in libraries:
        machine = referee.machine_of(oscillator(1.0, 1.0))
        (found,) = referee.outcomes(library, machine, np.array([[-0.5, 0.0]]))
        assert (found.period, found.impacts) == (1, 1)
        assert found.slowest == pytest.approx(1.695732937595, abs=1e-11)
        assert found.multipliers[0] == pytest.approx(-0.5842953 + 0.0056004j, abs=1e-7)
        assert np.prod(found.multipliers).real == pytest.approx(0.64 * math.exp(-0.2 * math.pi), abs=1e-12)


def test_it_agrees_with_itself_in_other_steps_and_more_digits(referee, libraries):
    cases = (
        oscillator(1.0, 2.87, 0.04, 0.0),
        oscillator(1.5, 2.26, 0.0, 0.5, kinetic_coefficient=0.2, static_coefficient=0.3),
    )
    for case in cases:
        ends = [
            referee.sections(library, referee.machine_of(case, step), -1.0, 0.3, 30)[-1]
            for library in libraries
            for step in (0.8, 0.31)
        ]
        assert np.ptp(np.array(ends), axis=0).max() < 1e-9


def test_exponents_of_chaos_add_up_to_the_loss_at_impacts(referee, libraries):
    machine = referee.machine_of(oscillator(1.0, 2.8, 0.0, 0.0))
    effort = referee.Effort(most=500, exponents=4000)
    (found,) = referee.outcomes(libraries[0], machine, np.array([[-0.3, 0.2]]), effort)
    assert found.kind == "chaos"
    assert sum(found.exponents) == pytest.approx(2 * math.log(0.8) * found.impacts / 4000, rel=1e-9)


@pytest.mark.parametrize("name", SHORT)
def test_the_program_is_not_contradicted(referee, separatrix, source_dir, tmp_path, name):
    comparison = importlib.import_module("compare")
    text = (comparison.CASES / f"{name}.toml").read_text()
    text = re.sub(r"count = (25|24)\n", "count = 8\n", text).replace("count = 201", "count = 3")
    path = tmp_path / f"{name}.toml"
    path.write_text(text)
    court = comparison.Court.of(separatrix.parents[1], tmp_path)
    report = comparison.compare(court, path)
    assert comparison.wrong_in({name: report}) == 0, comparison.disagreements({name: report})
    assert sum(report["basin"]["counts"].values()) == 64
    assert report["basin"]["counts"]["agrees"] >= 60


def test_a_wrong_claim_is_seen(referee, libraries):
    """Another period, another position, another count of impacts, a cycle called none."""
    comparison = importlib.import_module("compare")
    machine = referee.machine_of(oscillator(1.0, 1.0))
    (found,) = referee.outcomes(libraries[0], machine, np.array([[-0.5, 0.0]]))
    claim, right, aside = comparison.Claim, found.cycle[:1], found.cycle[:1] + 1e-4
    assert comparison.verdict_on(machine, found, claim(1, 1, 1.0), right) == "agrees"
    assert comparison.verdict_on(machine, found, claim(1, 2, 1.0), right) == "wrong"
    assert comparison.verdict_on(machine, found, claim(1, 1, 1.0), aside) == "wrong"
    assert comparison.verdict_on(machine, found, claim(1, 1, 0.9666), right) == "wrong"
    assert comparison.verdict_on(machine, found, claim(1, 0, 1.0, aperiodic=True)) == "wrong"
    assert comparison.verdict_on(machine, found, claim(0, 0, 1.0)) == "not known"
