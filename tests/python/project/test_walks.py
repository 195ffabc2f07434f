# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The walks of src/README.md pass procedures that exist, in the files that they name."""

import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[3]
DISCOVERY = SOURCE / "postprocess" / "separatrix" / "discovery"


def steps() -> list[tuple[str, list[str]]]:
    """File and procedures of every row of the two tables."""
    text = (SOURCE / "src" / "README.md").read_text().partition("## A start")[2]
    rows = re.findall(r"^\|[^|]*\| `([\w./]+\.(?:f90|py))` \| (.*) \|$", text, re.M)
    return [(file, re.findall(r"`(\w+)`", names)) for file, names in rows]


@pytest.mark.parametrize("file, names", steps())
def test_a_step_names_what_its_file_has(file: str, names: list[str]) -> None:
    folder, pattern = (
        (DISCOVERY, "^def {}\\b") if file.endswith(".py") else (SOURCE / "src", "^ *end \\w+ {}$")
    )
    text = (folder / file).read_text()
    assert names
    assert [name for name in names if not re.search(pattern.format(name), text, re.M)] == []


def test_both_walks_are_read() -> None:
    files = [file for file, _ in steps()]
    assert sum(file.endswith(".f90") for file in files) >= 10
    assert sum(file.endswith(".py") for file in files) >= 8
