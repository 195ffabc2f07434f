# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Matrix Market files (Boisvert, Pozo, Remington, NISTIR 5935, 1996) by the rules of the program.

SciPy drops the exponent of 2.5D+03 and takes a pattern for ones; src/config/matrix_market.f90 is the reader
of cases.
"""

import re
from pathlib import Path

import numpy as np
from scipy import sparse

from separatrix.errors import SeparatrixError
from separatrix.structures.lines import HOW, NUMBER, WHOLE, Rows, check_size, matrix_of, shown, text_of

_ALLOWED = "'%%MatrixMarket matrix coordinate|array real|double|integer general|symmetric|skew-symmetric'"
_IDLE = re.compile(rb"(?:[ \t]*+(?:%[^\n]*+)?+[ \t\r]*+\n)*+")


def is_matrix_market(path: Path) -> bool:
    """Whether the file begins like one."""
    with path.open("rb") as file:
        return file.read(20).removeprefix(b"\xef\xbb\xbf")[:14].lower() == b"%%matrixmarket"


def read_matrix_market(path: Path) -> sparse.csr_array:
    """Return the matrix; what is not a number to the eye is refused with the line."""
    text = text_of(path)
    begin = text.index(b"\n") + 1
    words = text[:begin].decode(errors="replace").lower().split()
    good = len(words) == 5 and words[:2] == ["%%matrixmarket", "matrix"]
    good = good and words[2] in ("coordinate", "array") and words[3] in ("real", "double", "integer")
    if not good or words[4] not in ("general", "symmetric", "skew-symmetric"):
        raise SeparatrixError(f"{path}:1: found {shown(text[:begin])}, allowed {_ALLOWED}")
    coordinate, symmetry = words[2] == "coordinate", words[4]
    form, how = (WHOLE, "whole, as the header states integer") if words[3] == "integer" else (NUMBER, HOW)
    at = begin + _IDLE.match(text[begin:]).end()
    line = 1 + text.count(b"\n", 0, at)
    end = text.find(b"\n", at) + 1 or len(text)
    sizes = text[at:end].split()
    if len(sizes) != 2 + coordinate or not all(re.fullmatch(WHOLE, size) for size in sizes):
        found = shown(text[at:end]) if sizes else "the end of the file"
        more = " and entries" if coordinate else ""
        raise SeparatrixError(f"{path}:{line}: found {found}, allowed the numbers of rows and columns{more}")
    numbers = [int(size) for size in sizes]
    size = numbers[0]
    check_size(f"{path}:{line}", *numbers[:2])
    if coordinate:
        rule = f"row, column and number ({how})"
        entries = Rows(path, text[end:], line + 1, (WHOLE, WHOLE, form), rule)
        _check_count(f"{path}:{line}", len(entries.values), numbers[2])
        indices = entries.values[:, :2] - 1
        return matrix_of((size, size), (*indices.T, entries.values[:, 2]), symmetry, entries.refuse)
    entries = Rows(path, text[end:], line + 1, (form,), f"one number a line ({how})")
    lowest = {"general": 0, "symmetric": 1, "skew-symmetric": 2}[symmetry]
    count = size * size if lowest == 0 else size * (size + 3 - 2 * lowest) // 2
    _check_count(f"{path}:{line}", len(entries.values), count)
    matrix = np.zeros((size, size))
    if symmetry == "general":
        matrix[:] = entries.values.reshape(size, size).T
    else:
        columns, rows = np.triu_indices(size, lowest - 1)
        matrix[rows, columns] = entries.values[:, 0]
        matrix[columns, rows] = entries.values[:, 0] * (1 if symmetry == "symmetric" else -1)
    return sparse.csr_array(matrix)


def _check_count(where: str, found: int, allowed: int) -> None:
    if found != allowed:
        raise SeparatrixError(f"{where}: found {found} entries after this line, allowed {allowed}")
