# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What two bodies must show: every line within its bar, and on docs/published_pair.md."""

import importlib
import sys

import pytest

pytestmark = pytest.mark.long
"""Pages of evidence, which change with their scripts alone."""

# the contacts are in tests/integrator/test_contact_flight.pf, and take longer here
SECTIONS = ("pair", "impacts", "books", "hard")


@pytest.fixture(scope="module")
def page(source_dir):
    sys.path.insert(0, str(source_dir / "scripts" / "evidence"))
    yield importlib.import_module("published_pair")
    sys.path.remove(str(source_dir / "scripts" / "evidence"))


@pytest.mark.parametrize("section", SECTIONS)
def test_every_line_is_within_its_bar_and_on_the_page(page, separatrix, source_dir, tmp_path, section):
    text = (source_dir / "docs" / "published_pair.md").read_text()
    program = page.Program(separatrix, tmp_path)
    items = [item for function in page.SECTIONS[section] for item in function(program)]
    assert [item.what for item in items if item.differs] == []
    # differences are rounding, the other cells are printed with digits that do not change
    for item in items:
        cells = item.cells()
        assert f"| {cells['quantity']} | " in text
        if section != "books":
            assert f" | {cells['theirs']} | " in text
