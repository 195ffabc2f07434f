# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Assembled real matrices in the Harwell-Boeing and Rutherford-Boeing formats (Ansys HBMAT writes them).

Duff, Grimes, Lewis, User's guide for the Harwell-Boeing sparse matrix collection, RAL-92-086 (1992).
"""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import sparse

from separatrix.errors import SeparatrixError
from separatrix.structures.lines import check_size, matrix_of, number, shown, text_of

_SYMMETRY = {"S": "symmetric", "U": "general", "Z": "skew-symmetric"}
_FORMAT = re.compile(r"\((?:(\d)P,?)?(\d*)([IEDFG])(\d+)(?:\.(\d+)(?:E\d+)?)?\)")
# Fortran leaves the letter out where an exponent has three digits.
_LONG_EXPONENT = re.compile(r"([+-]?(?:\d+\.\d*|\.\d+))([+-]\d{3})")


class _Format(NamedTuple):
    text: str
    count: int
    width: int
    whole: bool
    scaled: bool


def read_harwell_boeing(path: Path) -> sparse.csr_array:
    """Return the matrix; right-hand sides are passed over."""
    lines = [line.rstrip(b"\r") for line in text_of(path).split(b"\n")[:-1]]
    if len(lines) < 5:
        raise SeparatrixError(
            f"{path}: found {len(lines)} lines, allowed a Harwell-Boeing file of at least 5"
        )
    counts = _counts(path, 2, lines[1].decode(errors="replace").split())
    words = lines[2].decode(errors="replace").upper().split()
    kind = words[0] if words else ""
    if len(kind) != 3 or kind[0] != "R" or kind[1] not in _SYMMETRY or kind[2] != "A":
        raise SeparatrixError(
            f"{path}:3: found the type '{kind[:20]}', allowed RSA, RUA or RZA: real, assembled, square"
        )
    size = _counts(path, 3, words[1:])
    check_size(f"{path}:3", size[0], size[1])
    forms = [_format(path, text) for text in re.findall(r"\([^()]*\)", lines[3].decode(errors="replace"))[:3]]
    if len(forms) < 3:
        raise SeparatrixError(
            f"{path}:4: found {shown(lines[3])}, allowed three formats like (10I8) (4D20.12)"
        )
    at = 4 + (len(counts) > 4 and counts[4] > 0)
    pointers, at = _take(path, lines, at, size[0] + 1, forms[0], counts[1])
    rows, at = _take(path, lines, at, size[2], forms[1], counts[2])
    values, at = _take(path, lines, at, size[2], forms[2], counts[3])
    starts = pointers.astype(int)
    if starts[0] != 1 or starts[-1] != size[2] + 1 or np.any(np.diff(starts) < 0):
        raise SeparatrixError(
            f"{path}:5: found column pointers from {starts[0]} to {starts[-1]}, "
            f"allowed ascending ones from 1 to {size[2] + 1}"
        )
    columns = np.repeat(np.arange(size[0]), np.diff(starts))

    def refuse(entry: int, why: str) -> None:
        found = f"row {int(rows[entry])} of column {int(columns[entry]) + 1}"
        raise SeparatrixError(f"{path}: found {found}, {why}")

    return matrix_of((size[0], size[0]), (rows - 1, columns, values), _SYMMETRY[kind[1]], refuse)


def _counts(path: Path, line: int, words: list[str]) -> list[int]:
    if len(words) not in ((4, 5) if line == 2 else (3, 4)) or not all(word.isdecimal() for word in words):
        what = "numbers of lines" if line == 2 else "type, rows, columns and entries"
        raise SeparatrixError(f"{path}:{line}: found '{' '.join(words)[:60]}', allowed {what}")
    return [int(word) for word in words]


def _format(path: Path, text: str) -> _Format:
    found = _FORMAT.fullmatch(text.upper().replace(" ", ""))
    if not found or int(found[4]) == 0 or found[2] == "0":
        raise SeparatrixError(
            f"{path}:4: found the format '{text}', allowed ones like (10I8), (4D20.12), (1P,5E16.8)"
        )
    return _Format(text, int(found[2] or 1), int(found[4]), found[3] == "I", found[1] not in (None, "0"))


def _take(
    path: Path, lines: list[bytes], at: int, count: int, form: _Format, announced: int
) -> tuple[np.ndarray, int]:
    """Return `count` numbers in a format from line `at` on, counted from 0, and the line behind them."""
    needed = -(-count // form.count)
    if announced != needed:
        raise SeparatrixError(
            f"{path}:2: found {announced} lines of {count} numbers in the format {form.text}, "
            f"allowed {needed}"
        )
    if at + needed > len(lines):
        raise SeparatrixError(
            f"{path}: found the end of the file after line {len(lines)}, allowed {at + needed} lines"
        )
    values = []
    for index in range(at, at + needed):
        line = lines[index].decode(errors="replace")
        here = min(form.count, count - len(values))
        # SciPy writes narrower columns than it announces; others leave no blank between columns.
        fields = line.split()
        if len(fields) != here:
            fields = [line[k * form.width : (k + 1) * form.width] for k in range(here)]
            fields += [rest] if (rest := line[here * form.width :].strip()) else []
        found = [_number(field, form) for field in fields]
        if None in found or len(found) > here:
            wrong = fields[found.index(None)] if None in found else line
            raise SeparatrixError(
                f"{path}:{index + 1}: found '{wrong.strip()[:40]}', "
                f"allowed {here} numbers in the format {form.text}"
            )
        values += found
    if not form.whole:
        _check_last(
            path, [line.decode(errors="replace") for line in lines[at : at + needed]], at + needed, form
        )
    return np.array(values), at + needed


def _check_last(path: Path, lines: list[str], number: int, form: _Format) -> None:
    """Refuse a last field that is shorter than all others: its number is cut off."""
    ends = [
        (column, field.end()) for line in lines for column, field in enumerate(re.finditer(r"\S+", line), 1)
    ]
    *others, (column, end) = ends
    widths = {end / column for column, end in others} or {end}
    if len(lines) > 1 and all(len(line) == form.count * form.width for line in lines[:-1]):
        # there may be no blanks between the columns
        widths, end = {form.width}, len(lines[-1])
        column = -(-end // form.width)
    if len(widths) == 1 and end < column * min(widths):
        raise SeparatrixError(
            f"{path}:{number}: found the last number in {end} characters of the line, allowed "
            f"{column * min(widths):g} as of the others: cut off"
        )


def _number(field: str, form: _Format) -> float | None:
    """Return the number in a field, None if there is none or if its point is implied."""
    word = field.strip()
    if form.whole:
        return float(word) if word.isdecimal() and word.isascii() and len(word) < 16 else None
    exponent = re.search(r"[eEdD]|\d[+-]", word)
    if "." not in word or (form.scaled and not exponent):
        return None
    return number(_LONG_EXPONENT.sub(r"\1e\2", word) if _LONG_EXPONENT.fullmatch(word) else word)
