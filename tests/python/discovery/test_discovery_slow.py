# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Slow stick-slip, sampled fast: long rests cost few rows, and the laws of friction are distinguished."""

import time

import numpy as np
import pytest
from separatrix.discovery import Options, discover
from separatrix.discovery.fitting.catalogue import candidate
from separatrix.discovery.fitting.data import gather, scales_of
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import read_record
from separatrix.discovery.measured.smoother import in_intervals, stick_intervals
from separatrix.errors import STOPPED, SeparatrixError
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")
FILES = ("first.csv", "second.csv", "held_out.csv")
STRIBECK = {"excess": 1.4715, "velocity": 0.2}


@pytest.fixture
def slow_case(source_dir, tmp_path):
    """A function that writes a case of slow stick-slip with an effect and gives its folder."""

    def write(name: str, seed: int, small: bool = False):
        with pytest.MonkeyPatch.context() as patch:
            patch.syspath_prepend(str(source_dir / "tests" / "generator"))
            import slow

            slow.write_slow(tmp_path, slow.draw_slow(seed, 1, name, small))
        return tmp_path

    return write


def test_the_right_machine_leaves_noise_of_rests_that_cost_few_rows(slow_case):
    folder = slow_case("stribeck", 19)
    base = Model.read(folder / "base.toml")
    data = gather([prepare(read_record(folder / name), base) for name in FILES[:2]], 1.0, None)
    for one, seen in zip(data.prepared, data.smoothed, strict=True):
        rest = stick_intervals(seen)
        resting = in_intervals(one.record.t, rest).sum()
        assert resting > 0.1 * one.record.t.size
        assert in_intervals(one.samples.t, rest).sum() < resting / 4
    found = candidate(base, data.unknowns(base), (), "stribeck", scales_of(data, base))
    values = np.array([one.value for one in found.free])
    for i in found.added:
        one = found.free[i]
        size = STRIBECK[one.path.rpartition(".")[2]]
        values[i] = np.log(size) if one.positive else size
    problem = data.problem(found.model, data.last, found.free)
    fit = minimise(problem, values, data.smoothed_starts(data.last), patient=True)
    assert fit.good.all()
    assert fit.reduced_chi2 < 1 + 4 * np.sqrt(2 / fit.freedom)
    for i in found.added:
        assert found.free[i].physical(fit.values[i]) == pytest.approx(
            STRIBECK[found.free[i].path.rpartition(".")[2]], rel=1e-3
        )


def test_sizes_of_a_body_that_mostly_rests_are_those_of_its_motion(slow_case):
    folder = slow_case("static_excess", 23, small=True)
    base = Model.read(folder / "base.toml")
    data = gather([prepare(read_record(folder / name), base) for name in FILES[:2]], 1.0, None)
    scales = scales_of(data, base)
    assert scales.force >= scales.friction
    found = candidate(base, data.unknowns(base), (), "static_excess", scales)
    (one,) = (found.free[i] for i in found.added)
    assert one.lower < np.log(1.4715) < one.upper
    assert any(abs(start[0] - np.log(1.4715)) < np.log(2) for start in found.starts)


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "name", "small"),
    [
        ("stribeck", "stribeck", False),
        ("stribeck", "stribeck", True),
        ("position_dependent_friction", "friction_position_curve", False),
        ("static_excess", "static_excess", False),
        ("static_excess", "static_excess", True),
        ("dahl", "dahl", False),
    ],
)
def test_laws_of_friction_are_distinguished_in_slow_stick_slip(slow_case, hidden, name, small):
    folder = slow_case(hidden, 23, small)
    paths = [folder / one for one in FILES]
    verdict = discover(folder / "base.toml", paths[:2], paths[2:], rest=folder / "rest.csv")
    assert (verdict["outcome"], verdict["effects"]) == ("named", [name])


@pytest.mark.long
def test_a_time_limit_in_real_seconds_ends_a_long_record(slow_case):
    """Its work is bounded in processor time, which nothing else on the machine lengthens."""
    folder = slow_case("stribeck", 19)
    paths = [folder / one for one in FILES]
    begun = time.process_time()
    try:
        verdict = discover(folder / "base.toml", paths[:2], paths[2:], Options(time_limit=8.0))
    except SeparatrixError as error:
        assert error.code == STOPPED and "time limit of 8 s" in str(error)
    else:
        assert any("time limit of 8 s" in one for one in verdict["reasons"])
    assert time.process_time() - begun < 20
