# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/evidence/branch_checks.py: its quick cases, every example, and that errors are seen."""

import importlib
import sys
from dataclasses import replace

import numpy as np
import pytest


@pytest.fixture(scope="module")
def checks(source_dir):
    sys.path.insert(0, str(source_dir / "scripts" / "evidence"))
    yield importlib.import_module("branch_checks")
    sys.path.remove(str(source_dir / "scripts" / "evidence"))


@pytest.mark.parametrize("name", ["validation/impact_coco", "structure_two_masses"])
def test_what_must_hold_on_branches_holds(checks, separatrix, tmp_path, name):
    case = next(case for case in checks.CASES if case.path == name)
    one, other = (checks.follow(separatrix, tmp_path, case, searches) for searches in (2, 3))
    cells, wrong = checks.row(case, one, other)
    assert wrong == []
    assert "1 SN" in cells[4]
    gaps, both, _ = checks.apart(case, one, other)
    assert both > 0 and max(gaps) < 1e-10
    # and is seen where it does not
    moved = replace(one, labelled={key: values + 1e-9 for key, values in one.labelled.items()})
    assert any("apart" in item for item in checks.row(case, moved, other)[1])
    off = replace(one, multipliers=one.multipliers * (1 + 1e-6))
    assert any("a multiplier" in item for item in checks.row(case, off, other)[1])
    assert any("product" in item for item in checks.row(case, off, other)[1])
    # labels of mirror images are one value to rounding, in one run or in the other
    key, values = next((key, values) for key, values in one.labelled.items() if values.size)
    doubled = replace(one, labelled={**one.labelled, key: np.append(values, values + 1e-15)})
    assert checks.apart(case, doubled, one)[1:] == (both_of(checks, case, one) + values.size, 0)
    assert checks.apart(case, one, doubled)[1:] == (both_of(checks, case, one), 0)


def both_of(checks, case, found):
    """Labels of a run that it has itself."""
    return checks.apart(case, found, found)[1]


def test_every_example_without_a_measured_drive_is_followed_or_refused_in_words(
    checks, separatrix, source_dir
):
    lines, wrong = checks.refusals(separatrix)
    assert wrong == []
    assert len(lines) == len(checks.REFUSED)
    # the page that they are written to names no folder of a machine
    assert not any(str(source_dir) in message for _, message in lines)
    known = {case.path for case in checks.CASES} | checks.REFUSED.keys() | checks.SAME_MACHINE
    there = {path.stem for path in (source_dir / "examples").glob("*.toml")}
    assert there <= known
