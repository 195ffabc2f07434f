# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of numbers with a header of keys, and those of text: CSV."""

import codecs
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError

CHANNELS = ("x", "v", "force", "phi")
"""Columns that are used, next to `t`."""
READ = (
    "CSV (text in UTF-8), HDF5 and netCDF-4, MATLAB .mat, NumPy .npz, LabVIEW .lvm, WAV; UFF 58 and TDMS "
    "with pip install 'separatrix[formats]'; MDF with pip install 'separatrix[mdf]'"
)
"""What is read, for messages."""
SAME = {"F": "force"}
"""Other names of columns."""
NUMBERS = {
    "sampling_rate_hz",
    "sensor_noise_sigma_m",
    "sensor_noise_sigma_m_s",
    "sensor_resolution_m",
    "sensor_delay_s",
    "drive_ratio",
    "drive_frequency_rad_s",
    "drive_scale",
    "x0_m",
    "v0_m_s",
    "phase",
    "phi_noise_sigma_rad",
    "force_noise_sigma_n",
    "motor_voltage_v",
    "motor_speed_rad_s",
}
"""Header keys with one number."""
OF_MOTOR = ("pulse", "current", "voltage")
"""Columns of a machine with a motor: a pulse per turn of the crank, current and voltage of the motor."""
_SENSOR = re.compile(r"[xvaF]\.[A-Za-z_][\w.]*|" + "|".join(OF_MOTOR))
_NOISE = "noise."
KEYS = NUMBERS | {"units"}
"""All known header keys."""


def is_sensor(name: str) -> bool:
    """Whether a column is of a sensor: `x.BODY`, `v.BODY`, `a.BODY`, `F.JOINT`, or one of a motor."""
    return _SENSOR.fullmatch(name) is not None


def is_column(name: str) -> bool:
    """Whether a column is known."""
    return name in ("t", *CHANNELS) or is_sensor(name)


def kind_of(name: str) -> str:
    """Kind of a column: `x` of `x.BODY`, `force` of `F.JOINT`."""
    kind = name.partition(".")[0]
    kind = kind if is_sensor(name) else name
    return SAME.get(kind, kind)


def is_kind(name: str, kind: str) -> bool:
    """Whether a column, of a body or not, is of this kind."""
    return kind_of(name) == kind


def has_position(names: Iterable[str]) -> bool:
    """Whether a position is among the columns."""
    return any(kind_of(name) == "x" for name in names)


def has_motion(names: Iterable[str]) -> bool:
    """Whether a position, a speed or an acceleration is among the columns."""
    return any(kind_of(name) in ("x", "v", "a") for name in names)


def is_noise(key: str) -> bool:
    """Whether a key of the header states the noise of a sensor: `noise.x.BODY`."""
    return key.startswith(_NOISE) and is_sensor(key.removeprefix(_NOISE))


@dataclass
class Table:
    """Texts of the header, columns by name, and the line of each row where the file has lines.

    `units`: of columns, as the file states them beside these; `own_units`: whether the units of the header
    are those of the user, which override the file.
    """

    header: dict[str, str]
    columns: dict[str, np.ndarray]
    lines: np.ndarray | None = None
    unused: list[str] = field(default_factory=list)
    # of all columns in the order of the file; without those not used where a file has no such order
    names: list[str] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    own_units: bool = False


def is_text(path: Path) -> bool:
    """Whether a file may be text of any encoding: only UTF-16 has zero bytes."""
    with path.open("rb") as file:
        begin = file.read(RECORDS.chunk)
    return begin.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" not in begin


def read_csv(path: Path) -> Table:
    """Read a text: comments with keys, a row of names, rows of numbers."""
    lines, comments = _count_lines(path)
    # but for the row of names
    check_length(path, lines - comments - 1)
    return _read_plain(path, lines) or _read_by_lines(path)


def _count_lines(path: Path) -> tuple[int, int]:
    """Lines of a text, and how many of them are comments; they end as on any system."""
    ends, comments, last = {b"\n": 0, b"\r": 0}, 0, b"\n"
    with path.open("rb") as file:
        while chunk := file.read(RECORDS.chunk):
            for end in ends:
                ends[end] += chunk.count(end)
                comments += (last + chunk).count(end + b"#")
            last = chunk[-1:]
    return max(ends.values()) + (last not in ends), comments


def _read_plain(path: Path, count: int) -> Table | None:
    """A well-formed file of so many lines at once; None if anything in it needs parsing by lines."""
    begun: list[str] = []
    with path.open(encoding="utf-8", errors="surrogateescape") as file:
        for line in file:
            begun.append(line)
            if line.strip() and not line.startswith("#"):
                break
            if len(begun) > RECORDS.most_header:
                return None
        first = file.readline()
    names = [_named(name)[0] for name in begun[-1].split(",")] if begun else []
    if "t" not in names or not has_motion(names) or not first.strip():
        return None
    used = [name for name in names if is_column(name)]
    try:
        # any comment, blank line or short row among the numbers needs parsing by lines
        table = np.loadtxt(path, delimiter=",", comments=None, skiprows=len(begun), ndmin=2)
    except ValueError:
        return None
    if table.shape[1] != len(names) or len(set(names)) != len(names):
        return None
    head = _parsed(path, begun)
    lines = np.arange(len(begun) + 1, len(begun) + 1 + len(table))
    if count != lines[-1]:
        return None
    columns = {name: table[:, names.index(name)].copy() for name in used}
    unused = [name for name in names if name not in used]
    return Table(head.header, columns, lines, unused, names, head.units)


def check_length(path: Path, samples: int) -> None:
    """Refuse a record of more samples than fit into the memory of a usual machine."""
    if samples > RECORDS.most_samples:
        raise SeparatrixError(
            f"{path}: about {samples:.3g} samples, at most {RECORDS.most_samples:.0e} a record are read: "
            f"keep a part of it, or every {int(-(-samples // RECORDS.most_samples))}th row"
        )


def _read_by_lines(path: Path) -> Table:
    return _parsed(path, _lines(path), whole=True)


def _parsed(path: Path, text_lines: list[str], whole: bool = False) -> Table:
    """Header, names and (of a `whole` file) rows, line by line."""
    header: dict[str, str] = {}
    units: dict[str, str] = {}
    stands: dict[str, int] = {}
    names: list[str] | None = None
    separator = ","
    rows: list[list[float]] = []
    lines: list[int] = []
    for number, line in enumerate(text_lines, start=1):
        text = line.strip(" \r\n")
        if not text.strip():
            continue
        if text.startswith("#"):
            text = text.encode(errors="surrogateescape").decode(errors="replace")
            key, colon, value = (word.strip() for word in text[1:].partition(":"))
            if not colon:
                continue
            if key in KEYS:
                _check_line(path, number, key, stands, names is not None)
            if names is None:
                header[key], stands[key] = value, number
            continue
        _check_encoding(path, number, text)
        if names is None:
            separator = next((mark for mark in ";,\t" if _has_t_and_motion(text, mark)), ",")
            names = _names(path, number, text, separator)
            used = [name for name in names if is_column(name)]
            units = _units_of_names(text, separator, used)
        else:
            lines.append(number)
            rows.append(_numbers(path, number, text, separator, names, used))
    if not whole:
        return Table(header, {}, units=units)
    if names is None or not rows:
        raise SeparatrixError(f"{path}: no samples; expected a header row 't,x' and rows of numbers")
    table = np.array(rows)
    columns = {name: table[:, i].copy() for i, name in enumerate(used)}
    unused = [name for name in names if name not in used]
    return Table(header, columns, np.array(lines), unused, names, units)


def _lines(path: Path) -> list[str]:
    """Lines of a text; bytes that are no UTF-8 are kept, because comments may hold anything."""
    content = path.read_bytes()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise SeparatrixError(f"{path}: text in UTF-16, expected UTF-8")
    text = content.removeprefix(codecs.BOM_UTF8).decode("utf-8", errors="surrogateescape")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _check_encoding(path: Path, number: int, text: str) -> None:
    try:
        text.encode()
    except UnicodeEncodeError:
        raise SeparatrixError(f"{path}:{number}: no text in UTF-8; supported are {READ}") from None


def _check_line(path: Path, number: int, key: str, stands: dict[str, int], below: bool) -> None:
    """Refuse a key below the row of names, or given twice: it holds for all rows."""
    if below:
        raise SeparatrixError(f"{path}:{number}: '{key}' stands below the row of names, expected above it")
    if key in stands:
        raise SeparatrixError(f"{path}:{number}: '{key}' is given again, first in line {stands[key]}")


def _has_t_and_motion(text: str, separator: str) -> bool:
    names = {_named(name)[0] for name in text.split(separator)}
    return "t" in names and has_motion(names)


def _named(text: str) -> tuple[str, str]:
    """Name of a column and its unit, '' where there is none, from `x`, `x [mm]` or `x (mm)`."""
    found = re.fullmatch(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]", text.strip())
    name, unit = (found.group(1), found.group(2)) if found else (text.strip(), "")
    return SAME.get(name, name), unit


def _units_of_names(text: str, separator: str, used: list[str]) -> dict[str, str]:
    """Units beside the names of columns."""
    units = [_named(name) for name in text.split(separator)]
    return {name: unit for name, unit in units if unit and name in used}


def _names(path: Path, number: int, text: str, separator: str) -> list[str]:
    names = [_named(name)[0] for name in text.split(separator)]
    if "t" not in names or not has_motion(names):
        raise SeparatrixError(
            f"{path}:{number}: found the header row '{text}', expected 't,x[,v,force,phi]' or, of "
            "several bodies, "
            "'t,x.BODY[,x.BODY,v.BODY,a.BODY,F.JOINT,phi]'"
        )
    if len(set(names)) != len(names):
        raise SeparatrixError(f"{path}:{number}: a column is named twice in '{text}'")
    return names


def real(word: str) -> float:
    """The number that a word is; `float` also takes 1_000 for one, and digits of other scripts."""
    if "_" in word or not word.isascii():
        raise ValueError(word)
    return float(word)


def _numbers(
    path: Path, number: int, text: str, separator: str, names: list[str], used: list[str]
) -> list[float]:
    words = text.split(separator)
    if len(words) != len(names):
        raise SeparatrixError(f"{path}:{number}: {len(words)} values for {len(names)} columns")
    words = [word for word, name in zip(words, names, strict=True) if name in used]
    if separator != ",":
        # a comma can only be that of decimals
        words = [word.replace(",", ".") for word in words]
    try:
        return [real(word) for word in words]
    except ValueError:
        raise SeparatrixError(f"{path}:{number}: '{text}' is not a row of numbers") from None
