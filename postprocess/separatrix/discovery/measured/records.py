# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured records: columns t, x [, v, force, phi] from CSV or HDF5, in SI units, checked row by row."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import count
from pathlib import Path

import numpy as np

from separatrix.discovery.measured.clock import pieces_of
from separatrix.discovery.measured.faults import check_clipping, left_out
from separatrix.discovery.measured.tables import CHANNELS, KEYS, NUMBERS, Table, read_table
from separatrix.errors import SeparatrixError

_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "rad": 1.0, "deg": np.pi / 180, "mrad": 1e-3}
_ANGLES = ("rad", "deg", "mrad")
_FEWEST_SAMPLES = 60
# likeness of a header key to a known one that makes it a misspelling
_NEAR = 0.7


@dataclass
class Record:
    """One record in SI units; `pieces` are the stretches without gaps as (first, last + 1)."""

    name: str
    t: np.ndarray
    x: np.ndarray
    v: np.ndarray | None = None
    force: np.ndarray | None = None
    phi: np.ndarray | None = None
    header: dict[str, float] = field(default_factory=dict)
    pieces: list[tuple[int, int]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    # as it was given
    file: str = ""
    # which of its rows, for messages
    part: str = ""

    @property
    def interval(self) -> float:
        """The usual time between samples [s]."""
        return float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.t[-1] - self.t[0])


def read_record(path: Path, at_rest: bool = False) -> Record:
    """Read and check one record; whatever is wrong is refused with file, row and reason.

    `at_rest`: of a body that does not move, whose positions may all be the same.
    """
    path = Path(path)
    return _checked(path, read_table(path), at_rest)


def make_record(
    name: str, columns: dict[str, np.ndarray], header: dict | None = None, at_rest: bool = False
) -> Record:
    """Check arrays that did not come from a file as if they had."""
    texts = {key: str(value) for key, value in (header or {}).items()}
    used = {key: column for key, column in columns.items() if key in ("t", *CHANNELS)}
    return _checked(Path(name), Table(texts, used, unused=sorted(columns.keys() - used.keys())), at_rest)


def _checked(path: Path, table: Table, at_rest: bool) -> Record:
    header, columns = table.header, dict(table.columns)
    kept = np.arange(columns["t"].size)

    def where(row: int) -> str:
        return f"{path}, row {kept[row] + 1}" if table.lines is None else f"{path}:{table.lines[kept[row]]}"

    warnings: list[str] = []
    numbers = _header_numbers(path, header, warnings)
    _doubt_header(header, numbers, warnings)
    unit = _scale(path, header, columns, warnings)
    for name, column in columns.items():
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise SeparatrixError(f"{where(bad[0])}: '{name}' is {column[bad[0]]}; {bad.size} such values")
    t, x = columns["t"], columns["x"]
    if t.size < _FEWEST_SAMPLES:
        raise SeparatrixError(f"{path}: {t.size} samples, at least {_FEWEST_SAMPLES} are needed")
    steps = np.diff(t)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        row = int(back[0]) + 1
        raise SeparatrixError(
            f"{where(row)}: time does not increase ({t[row]:.9g} s after {t[row - 1]:.9g} s)"
        )
    if not at_rest:
        if np.ptp(x) == 0:
            raise SeparatrixError(f"{path}: 'x' is constant")
        kept = np.delete(kept, left_out(t, x, unit, where, warnings))
        columns = {name: column[kept] for name, column in columns.items()}
        x = columns["x"]
    t, pieces = pieces_of(columns["t"], x, _FEWEST_SAMPLES, where, warnings)
    usual = float(np.median(np.diff(t)))
    rate = numbers.get("sampling_rate_hz")
    if rate is not None and not 0.99 < rate * usual < 1.01:
        raise SeparatrixError(
            f"{path}: sampling_rate_hz is {rate:g}, t advances by {usual:.6g} s per row: wrong unit of time?"
        )
    if not at_rest:
        check_clipping(x, unit, where, warnings)
    if table.unused:
        warnings.append(f"columns that are not used: {', '.join(table.unused)}")
    channels = {name: columns[name] for name in CHANNELS if name in columns}
    return Record(path.stem, t, header=numbers, pieces=pieces, warnings=warnings, file=str(path), **channels)


def _header_numbers(path: Path, header: dict[str, str], warnings: list[str]) -> dict[str, float]:
    numbers = {}
    for key in sorted(NUMBERS & header.keys()):
        try:
            numbers[key] = float(header[key])
        except ValueError:
            raise SeparatrixError(f"{path}: '{key}' is '{header[key]}', expected a number") from None
        if not np.isfinite(numbers[key]):
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}")
    for key in ("sampling_rate_hz", "drive_ratio", "drive_frequency_rad_s", "drive_scale"):
        if key in numbers and numbers[key] <= 0:
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}, expected more than 0")
    for key in ("sensor_noise_sigma_m", "sensor_noise_sigma_m_s", "sensor_resolution_m"):
        if key in numbers and numbers[key] < 0:
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}, expected at least 0")
        if numbers.get(key) == 0 and key != "sensor_resolution_m":
            warnings.append(f"{key} is 0: measured instead")
    return numbers


def _doubt_header(header: dict[str, str], numbers: dict[str, float], warnings: list[str]) -> None:
    """Warn of keys that look like misspelt ones, and of an angle that looks like degrees."""
    for key in header:
        near = [] if key in KEYS else get_close_matches(key, sorted(KEYS), 1, _NEAR)
        if near:
            warnings.append(f"header key '{key}' is not used: '{near[0]}'?")
    if abs(numbers.get("phase", 0.0)) > 2 * np.pi:
        warnings.append(f"phase is {numbers['phase']:g} rad, more than a turn: degrees?")


def _scale(path: Path, header: dict[str, str], columns: dict[str, np.ndarray], warnings: list[str]) -> str:
    """Turn time and position into SI, as the other channels and the header are; return the unit of x."""
    if "units" not in header:
        warnings.append("no 'units': read as s and m (rad of an angle)")
        return "m"
    words = [word.strip() for word in header["units"].split(",")]
    if len(words) < 2 or words[0] not in _TIME or words[1] not in _LENGTH:
        raise SeparatrixError(
            f"{path}: units '{header['units']}', expected one of {', '.join(_TIME)} and one of "
            f"{', '.join(_LENGTH)}"
        )
    columns["t"] = columns["t"] * _TIME[words[0]]
    columns["x"] = columns["x"] * _LENGTH[words[1]]
    return "rad" if words[1] in _ANGLES else "m"


def unique_names(records: Iterable[Record]) -> None:
    """Number the records whose files have the same name."""
    records = list(records)
    taken = {record.name for record in records}
    seen: set[str] = set()
    for record in records:
        if record.name in seen:
            record.name = next(name for k in count(2) if (name := f"{record.name}_{k}") not in taken)
            taken.add(record.name)
        seen.add(record.name)
