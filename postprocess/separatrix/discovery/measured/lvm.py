# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in LabVIEW measurement files (.lvm): text with a header, channels, their starts and steps."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from separatrix.discovery.measured.arrays import Found, column_of, common_times
from separatrix.discovery.measured.header import is_stated
from separatrix.discovery.measured.tables import is_column, real
from separatrix.errors import SeparatrixError

BEGIN = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SPECIAL, _SPECIAL_END = "***Start_Special***", "***End_Special***"
_SEPARATORS = {"Tab": "\t", "Comma": ","}
_X_VALUES = "X_Value"


def read_lvm(path: Path, names: Mapping[str, str]) -> Found:
    """Channels of the only segment by their names; t is the column of x values, or start and step."""
    content = path.read_bytes()
    text = content.decode("utf-8") if _is_utf8(content) else content.decode("latin-1")
    lines = list(enumerate(text.splitlines(), start=1))
    ends = [index for index, (_, line) in enumerate(lines) if line.startswith(_END)]
    if not ends:
        raise SeparatrixError(f"{path}: '{_END}' is missing")
    keys = _keys(lines[: ends[0]], None)
    mark = _SEPARATORS.get(_first(keys, "Separator", "Tab"), "\t")
    rest = _without_special(lines[ends[0] + 1 :])
    ends = [index for index, (_, line) in enumerate(rest) if line.startswith(_END)]
    if len(ends) != 1:
        raise SeparatrixError(
            f"{path}: found {len(ends)} segments, expected one: save each as a file of its own"
        )
    own = _keys(rest[: ends[0]], mark)
    rows = [(number, line.split(mark)) for number, line in rest[ends[0] + 1 :] if line.strip()]
    if len(rows) < 2:
        raise SeparatrixError(f"{path}: no samples")
    return _channels(path, keys, own, rows, names)


def _is_utf8(content: bytes) -> bool:
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _keys(lines: list[tuple[int, str]], mark: str | None) -> dict[str, list[str]]:
    """Keys and their values, one for each channel."""
    found = {}
    for _, line in lines:
        key, *values = line.split(mark or ("\t" if "\t" in line else ","))
        found.setdefault(key.strip(), [value.strip() for value in values])
    return found


def _first(keys: dict[str, list[str]], key: str, absent: str) -> str:
    return next(iter(keys.get(key, [])), absent) or absent


def _without_special(lines: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Lines that are not in blocks of other programs."""
    found, inside = [], False
    for number, line in lines:
        if line.startswith(_SPECIAL):
            inside = True
        if not inside:
            found.append((number, line))
        if line.startswith(_SPECIAL_END):
            inside = False
    return found


def _channels(
    path: Path,
    keys: dict[str, list[str]],
    own: dict[str, list[str]],
    rows: list[tuple[int, list[str]]],
    names: Mapping[str, str],
) -> Found:
    found, times = Found(), {}
    (line, titles), *rows = rows
    titles = [title.strip() for title in titles]
    each = {"No": 0, "One": 1, "Multi": 2}.get(_first(keys, "X_Columns", "One"))
    count = _first(own, "Channels", "0")
    if each is None or not count.isdecimal() or not int(count):
        raise SeparatrixError(f"{path}: found X_Columns {keys.get('X_Columns')} and {count} channels")
    decimal = _first(keys, "Decimal_Separator", ".")
    # without x values LabVIEW leaves their column empty; other programs leave it out
    first = int(titles[0] == _X_VALUES)
    for k in range(int(count)):
        # of x values: none, before the first channel, before each
        over, at = [(None, first + k), (0, k + 1), (2 * k, 2 * k + 1)][each]
        if at >= len(titles):
            raise SeparatrixError(f"{path}:{line}: {len(titles)} names of columns for {count} channels")
        name = column_of(titles[at], names)
        if not is_column(name):
            found.unused.append(titles[at])
            continue
        if name in found.values:
            raise SeparatrixError(f"{path}:{line}: two channels are '{name}'")
        dimension = _of(own, "X_Dimension", k, "Time")
        if dimension != "Time":
            raise SeparatrixError(f"{path}: '{name}' is recorded over '{dimension}', expected over Time")
        values, kept = _numbers(path, rows, at, decimal)
        stated = _of(own, "Samples", k, "")
        # with one header for several writings, it states those of the first one
        if stated.isdecimal() and values.size < int(stated):
            raise SeparatrixError(
                f"{path}: '{name}' has {values.size} samples, expected {stated} as the header states: cut off"
            )
        found.values[name] = values
        unit = _of(own, "Y_Unit_Label", k, "")
        found.units |= {name: unit} if is_stated(unit) else {}
        if over is not None:
            times[name] = _numbers(path, kept, over, decimal)[0]
        else:
            begin, step = (_number(path, own, key, k, decimal) for key in ("X0", "Delta_X"))
            times[name] = begin + step * np.arange(values.size)
    if times and "t" not in found.values:
        found.values["t"], found.units["t"] = common_times(path, times), "s"
    return found


def _of(own: dict[str, list[str]], key: str, k: int, absent: str) -> str:
    values = own.get(key, [])
    return (values[k] if k < len(values) else "") or absent


def _number(path: Path, own: dict[str, list[str]], key: str, k: int, decimal: str) -> float:
    text = _of(own, key, k, "")
    try:
        return real(text.replace(decimal, "."))
    except ValueError:
        raise SeparatrixError(f"{path}: {key} is '{text}', expected a number") from None


def _numbers(path: Path, rows: list[tuple[int, list[str]]], at: int, decimal: str) -> tuple[np.ndarray, list]:
    """Numbers of a column, and the rows that have one: a shorter channel ends before the others."""
    kept = [(number, words) for number, words in rows if at < len(words) and words[at].strip()]
    values = np.empty(len(kept))
    for index, (number, words) in enumerate(kept):
        try:
            values[index] = real(words[at].strip().replace(decimal, "."))
        except ValueError:
            raise SeparatrixError(f"{path}:{number}: '{words[at].strip()}' is no number") from None
    return values, kept
