# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The published results: within their bars of the paper, and as docs/published.md prints them."""

import importlib
import subprocess
import sys

import pytest

LAWS = ("coulomb", "viscous", "stribeck")
MOTIONS = ("0.8", "1.05", "1.2_free", "1.2_impact")
# our own result on our own axes, not the paper's: starts of the 50 x 50 grid that end up with impacts
OUR_IMPACTING = {"coulomb": 1643, "viscous": 2119, "stribeck": 1640}


@pytest.fixture(scope="module")
def tables(source_dir):
    sys.path.insert(0, str(source_dir / "scripts" / "evidence"))
    yield importlib.import_module("published_tables")
    sys.path.remove(str(source_dir / "scripts" / "evidence"))


@pytest.fixture(scope="module")
def compute(separatrix, source_dir, tmp_path_factory):
    folder = tmp_path_factory.mktemp("published")

    def run(case, *settings):
        path = folder / f"{case}.h5"
        if not path.exists():
            words = [
                separatrix,
                case.split("_")[0],
                source_dir / "examples" / f"{case}.toml",
                "-q",
                "-o",
                path,
            ]
            subprocess.run([*words, *(word for text in settings for word in ("--set", text))], check=True)
        return path

    return run


@pytest.fixture(scope="module")
def trajectories(compute):
    names = [f"trajectory_{law}_{motion}" for law in LAWS for motion in MOTIONS]
    return {name: compute(name) for name in names}


def test_steady_values_are_within_the_bar_of_the_paper(tables, trajectories):
    rows = tables.steady_rows(trajectories)
    assert len(rows) == 30
    assert [row for row in rows if abs(float(row[-2].removesuffix(" %"))) > 1.5] == []


def test_coulomb_stribeck_agrees_with_coulomb_in_steady_sliding(tables, trajectories):
    rows = tables.stribeck_rows(trajectories)
    assert len(rows) == 10
    assert [row for row in rows if abs(float(row[-2].removesuffix(" %"))) > 0.1] == []


def test_the_page_prints_what_the_program_computes(tables, trajectories, source_dir):
    page = (source_dir / "docs" / "published.md").read_text()
    for row in [*tables.steady_rows(trajectories), *tables.stribeck_rows(trajectories)]:
        assert f"| {' | '.join(row)} |\n" in page


@pytest.mark.parametrize("law", LAWS)
def test_the_window_explains_the_impacts_per_period_of_the_paper(tables, trajectories, law):
    for motion, paper in tables.PAPER["impacts_per_period"].items():
        times, period = tables.impact_times(trajectories[f"trajectory_{law}_{motion}"])
        assert round((times > 37.5).sum() / (12.5 / period), 3) == paper


@pytest.mark.parametrize("law", ("coulomb", "viscous"))
def test_region_limits_are_within_the_bar_of_the_paper(tables, compute, law):
    limits = tables.region_limits(compute(f"sweep_{law}", "sweep.starts=[0, 0]"))
    for name, numbers in tables.PAPER["limits"].items():
        assert sum(limits[name]) / 2 == pytest.approx(numbers[LAWS.index(law)], abs=0.015)


@pytest.mark.parametrize("law", LAWS)
def test_our_basin_shares_stay_what_they_are(tables, compute, law):
    counts = tables.impact_counts(compute(f"basin_{law}", "axis[1].count=50", "axis[2].count=50"))
    assert counts == (2500, OUR_IMPACTING[law], 2500)


@pytest.mark.parametrize("law", LAWS)
def test_settled_motions_with_impacts_have_exactly_one_a_period(compute, law):
    from separatrix import open_result, table

    with open_result(compute(f"basin_{law}", "axis[1].count=50", "axis[2].count=50")) as result:
        impacts = table(result, "catalogue")["impacts_per_period"].values
    assert sorted(impacts) == [0.0, 1.0]
