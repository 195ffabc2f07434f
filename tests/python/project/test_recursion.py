# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""gfortran mixes up lengths of texts in recursive functions (findings/gfortran_deferred_length_static.sh)."""

import re
from pathlib import Path

SOURCES = Path(__file__).parents[3] / "src"
FUNCTION = re.compile(r"^ *(?:pure )?recursive (?:pure )?function (\w+).*?^ *end function", re.M | re.S)


def recursive_texts(source: str) -> list[str]:
    """Names of the recursive functions in which a text has a deferred length."""
    return [found[1] for found in FUNCTION.finditer(source) if "character(len=:)" in found[0]]


def test_recursive_functions_have_no_texts_of_deferred_length() -> None:
    made = "pure recursive function f(n) result(t)\n  character(len=:), allocatable :: t\nend function f\n"
    assert recursive_texts(made) == ["f"]
    assert sum("recursive" in path.read_text() for path in SOURCES.rglob("*.f90")) > 5
    found = {str(path): recursive_texts(path.read_text()) for path in SOURCES.rglob("*.f90")}
    assert {path: names for path, names in found.items() if names} == {}
