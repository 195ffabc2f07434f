# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quick rows of docs/validation.md on measures of basins."""

import importlib
import sys

import pytest


@pytest.fixture(scope="module")
def rows(source_dir):
    sys.path.insert(0, str(source_dir / "scripts" / "evidence"))
    yield importlib.import_module("validation_measures")
    sys.path.remove(str(source_dir / "scripts" / "evidence"))


@pytest.mark.parametrize(("name", "count"), [("spheres", 4), ("boxes", 2)])
def test_numbers_agree(rows, name, count):
    found = getattr(rows, name)()
    assert len(found) == count
    assert [row for row in found if row.verdict != "agrees"] == []


def test_a_number_that_differs_is_reported(rows):
    off = rows.Row("somebody", "a number", 1.0, 1.2, 0.1)
    assert off.differs and off.cells()["verdict"] == "**DIFFERS**"
