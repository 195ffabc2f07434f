# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers in text files by the rules of the program (src/core/text.f90): a word is one number, or is refused.

A number has decimal digits, a point and an exponent behind E or, of Fortran programs, D.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import sparse

from separatrix.errors import SeparatrixError

WHOLE = rb"[+-]?\d++"
NUMBER = rb"[+-]?(?:\d++\.?\d*+|\.\d++)(?:[eEdD][+-]?\d++)?+"
HOW = "finite, with a decimal point: 2.75, 2.5e3, 2.5D+03"
_EXPONENT = bytes.maketrans(b"dD", b"ee")
# Most coordinates that a file may claim; a matrix of so many fills no memory by its zeros.
_MOST = 10_000_000
# lines at the end of a file that are looked at, and how many numbers of one length make a fixed format
_LAST_LINES, _LAST_BYTES, _ALIKE = 4, 10_000, 3
_MARK = b"\xef\xbb\xbf"


def text_of(path: Path) -> bytes:
    """Return what a text file holds, with an end of line after its last line."""
    text = path.read_bytes().removeprefix(_MARK)
    if b"\0" in text:
        raise SeparatrixError(f"{path}: found a binary file, allowed a text")
    if text.endswith(b"\n"):
        return text
    _check_last(path, text)
    return text + b"\n"


def _check_last(path: Path, text: bytes) -> None:
    """Refuse a last line without an end whose number is shorter than those before, all of one length."""
    lines = text[-_LAST_BYTES:].split(b"\n")[-_LAST_LINES:]
    words = [re.split(rb"[\s,]+", line.strip())[-1].lstrip(b"+-") for line in lines]
    *others, last = words
    others = others[-_ALIKE:]
    fixed = len(others) == _ALIKE and len({len(word) for word in others}) == 1
    fixed = fixed and all(re.fullmatch(rb"\d*\.\d*[eEdD][+-]?\d+", word) for word in others)
    if fixed and last and len(last) < len(others[0]):
        line = text.count(b"\n") + 1
        raise SeparatrixError(
            f"{path}:{line}: found {shown(lines[-1])} without an end of the line, its last "
            "number shorter than those before: cut off? Where it is whole, end the line"
        )


def number(text: str) -> float | None:
    """Return the finite number that a word is, None if it is none."""
    word = text.strip().encode(errors="replace")
    if not re.fullmatch(NUMBER, word):
        return None
    value = float(word.translate(_EXPONENT))
    return value if np.isfinite(value) else None


def shown(line: bytes) -> str:
    """Return the beginning of a line for messages."""
    text = line.strip()[:60].decode(errors="replace")
    return "'" + "".join(one if one.isprintable() else "?" for one in text) + "'"


class Style(NamedTuple):
    """What parts the columns of a file, and what begins a comment."""

    gap: bytes
    comment: bytes


BLANKS = Style(rb"[ \t]++", b"%")
COMMAS = Style(rb"[ \t]*+,[ \t]*+", b"*")


class Rows:
    """Rows of numbers: `values`, and where in the file each of them stands."""

    def __init__(
        self, path: Path, text: bytes, first: int, forms: Sequence[bytes], allowed: str, style: Style = BLANKS
    ) -> None:
        """Read `text`, whose first line has the number `first` in its file.

        `forms` are those of the columns, WHOLE or NUMBER; `allowed` states this to the user.
        """
        self.path, self._text, self._first, self._style = path, text, first, style
        comment = re.escape(style.comment) + rb"[^\n]*+"
        line = rb"[ \t]*+(?:" + style.gap.join(forms) + rb"|" + comment + rb")?+[ \t\r]*+\n"
        end = re.match(rb"(?:" + line + rb")*+", text).end()
        if end < len(text):
            where = first + text.count(b"\n", 0, end)
            found = shown(text[end : text.index(b"\n", end)])
            raise SeparatrixError(f"{path}:{where}: found {found}, allowed {allowed}")
        data = re.sub(comment, b"", text) if style.comment in text else text
        words = data.translate(_EXPONENT).replace(b",", b" ").split()
        self.values = np.array(words, dtype=float).reshape(-1, len(forms))
        infinite = ~np.isfinite(self.values).all(axis=1)
        if infinite.any():
            self.refuse(int(infinite.argmax()), f"allowed {allowed}")

    def refuse(self, row: int, why: str) -> None:
        """Refuse a row, counted from 0."""
        for line_number, line in enumerate(self._text.split(b"\n"), self._first):
            if not line.strip() or line.strip().startswith(self._style.comment):
                continue
            if row == 0:
                raise SeparatrixError(f"{self.path}:{line_number}: found {shown(line)}, {why}")
            row -= 1


def matrix_of(
    shape: tuple[int, int],
    entries: tuple[np.ndarray, np.ndarray, np.ndarray],
    symmetry: str,
    refuse: Callable[[int, str], None],
) -> sparse.csr_array:
    """Return the matrix of `entries`: rows and columns from 0, and values.

    `symmetry` is general, symmetric or skew-symmetric: one triangle is the whole. `refuse` takes the number
    of an entry and what is wrong with it.
    """
    rows, columns, values = (np.asarray(one) for one in entries)
    rows, columns = rows.astype(np.int64), columns.astype(np.int64)
    outside = (np.minimum(rows, columns) < 0) | (rows >= shape[0]) | (columns >= shape[1])
    if outside.any():
        refuse(int(outside.argmax()), f"allowed rows up to {shape[0]}, columns up to {shape[1]}")
    ones, others = rows, columns
    if symmetry != "general":
        ones, others = np.minimum(rows, columns), np.maximum(rows, columns)
    key = ones * shape[1] + others
    order = np.argsort(key, kind="stable")
    again = order[1:][key[order][1:] == key[order][:-1]]
    if len(again):
        triangle = "" if symmetry == "general" else f" ({symmetry}: one triangle is the whole)"
        refuse(int(again.min()), f"this row and column again{triangle}, allowed each entry once")
    diagonal = rows == columns
    if symmetry == "skew-symmetric" and values[diagonal].any():
        wrong = np.flatnonzero(diagonal & (values != 0))
        refuse(int(wrong[0]), "on the diagonal of a skew-symmetric matrix, allowed 0")
    if symmetry != "general":
        sign = -1.0 if symmetry == "skew-symmetric" else 1.0
        rows, columns = (
            np.concatenate([rows, columns[~diagonal]]),
            np.concatenate([columns, rows[~diagonal]]),
        )
        values = np.concatenate([values, sign * values[~diagonal]])
    return sparse.csr_array((values, (rows, columns)), shape=shape)


def check_size(where: str, rows: int, columns: int) -> None:
    """Refuse a size that no structure has."""
    if rows != columns or not 1 <= rows <= _MOST:
        raise SeparatrixError(
            f"{where}: found {rows} rows and {columns} columns, allowed as many of both, at most {_MOST}"
        )
