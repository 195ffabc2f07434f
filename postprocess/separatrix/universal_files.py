# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The data sets of universal files: each begins and ends with a line `-1`."""

import re
from pathlib import Path

from separatrix.errors import SeparatrixError

# behind binary data there is no new line; a line may have blanks up to character 80
_MARK = re.compile(rb" {4}-1(?=[\r\n]|\Z| {74})")
_END = b"-1"


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
