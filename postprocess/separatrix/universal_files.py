# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The data sets of universal files: each begins and ends with a line `-1`."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from separatrix.errors import SeparatrixError

# behind binary data there is no new line; a line may have blanks up to character 80
_MARK = re.compile(rb" {4}-1(?=[\r\n]|\Z| {74})")
_END = b"-1"
# Numbers of units of length and force in one metre and one newton, by the units codes of data set 164.
_POUND_FORCE, _KILOGRAM_FORCE = 1 / 4.4482216152605, 1 / 9.80665
_OF_CODE = {
    1: (1.0, 1.0),
    2: (1 / 0.3048, _POUND_FORCE),
    3: (1.0, _KILOGRAM_FORCE),
    4: (1 / 0.3048, 1 / 0.138254954376),
    5: (1000.0, 1000.0),
    6: (100.0, 100.0),
    7: (1 / 0.0254, _POUND_FORCE),
    8: (1000.0, _KILOGRAM_FORCE),
    10: (1000.0, 1.0),
}


@dataclass(frozen=True)
class FileUnits:
    """Numbers of units of length and force in one metre and one newton, and what contradicts them ('')."""

    length: float
    force: float
    problem: str


def check_whole(path: Path) -> None:
    """Refuse a file with a data set without its beginning or its end: readers pass over what is not whole."""
    content = path.read_bytes()
    if not content.rstrip().endswith(_END):
        raise SeparatrixError(f"{path}: is cut off: its last data set has no end")
    marks = list(_MARK.finditer(content))
    if len(marks) % 2:
        raise SeparatrixError(
            f"{path}: found {len(marks)} lines '-1', allowed an even number: a data set has no beginning or "
            "no end"
        )
    for end, begin in zip(marks[1::2], marks[2::2], strict=False):
        if content[end.end() : begin.start()].strip():
            line = content.count(b"\n", 0, end.end()) + 2
            raise SeparatrixError(
                f"{path}:{line}: found lines between two data sets: one of them has no beginning or no end"
            )


def units_of(sets: Sequence[Mapping]) -> FileUnits | None:
    """Return the units that the data sets 164 of a file state, None where it has none.

    Raises SeparatrixError where they differ, or where a factor is not above 0.
    """
    found = {(int(one["units_code"]), float(one["length"]), float(one["force"])) for one in sets}
    if not found:
        return None
    if len(found) > 1:
        raise SeparatrixError(f"found {len(found)} data sets 164 with units that differ, allowed one")
    code, length, force = found.pop()
    stated = f"data set 164: found the factors {length:g} of length and {force:g} of force"
    if not (0 < length < np.inf and 0 < force < np.inf):
        raise SeparatrixError(f"{stated}, allowed ones above 0")
    of_code = _OF_CODE.get(code, (length, force))
    problem = ""
    if not np.allclose((length, force), of_code, rtol=1e-3, atol=0):
        problem = (
            f"{stated} with the units code {code}, allowed {of_code[0]:g} and {of_code[1]:g}, "
            "or the code 9 of other units"
        )
    return FileUnits(length, force, problem)
