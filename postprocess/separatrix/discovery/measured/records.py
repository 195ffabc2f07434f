# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured records: columns t, x [, v, force, phi] of any file, in SI units, checked row by row."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from separatrix.discovery.measured.clock import pieces_of
from separatrix.discovery.measured.formats import read_table
from separatrix.discovery.measured.header import numbers_of, to_si
from separatrix.discovery.measured.sensor_imperfections import check_clipping, left_out
from separatrix.discovery.measured.tables import CHANNELS, Table, is_column, is_kind, is_sensor
from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError


@dataclass
class Record:
    """One record in SI units; `pieces` are the intervals without gaps as (first, last + 1)."""

    name: str
    t: np.ndarray
    x: np.ndarray
    v: np.ndarray | None = None
    force: np.ndarray | None = None
    phi: np.ndarray | None = None
    # of several bodies: columns by kind and body or joint, as `x.BODY`
    sensors: dict[str, np.ndarray] = field(default_factory=dict)
    # whether x is a column itself, and not the first position among the sensors or the integral of a speed
    own_x: bool = True
    header: dict[str, float] = field(default_factory=dict)
    pieces: list[tuple[int, int]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    # as it was given
    file: str = ""
    # which of its rows, for messages
    part: str = ""

    @property
    def has_position(self) -> bool:
        """Whether a position was measured: else x is the integral of a speed."""
        return self.own_x or any(name[0] == "x" for name in self.sensors)

    @property
    def interval(self) -> float:
        """The usual time between samples [s]."""
        return float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.t[-1] - self.t[0])


def read_record(path: Path, at_rest: bool = False) -> Record:
    """Read and check one record; errors are reported with file, row and reason.

    `at_rest`: of a body that does not move, whose positions may all be the same.
    """
    path = Path(path)
    return _checked(path, read_table(path), at_rest)


def make_record(
    name: str, columns: dict[str, np.ndarray], header: dict | None = None, at_rest: bool = False
) -> Record:
    """Check arrays that did not come from a file as if they had."""
    texts = {key: str(value) for key, value in (header or {}).items()}
    used = {key: column for key, column in columns.items() if is_column(key)}
    unused = sorted(columns.keys() - used.keys())
    return _checked(Path(name), Table(texts, used, unused=unused, names=list(columns)), at_rest)


def _checked(path: Path, table: Table, at_rest: bool) -> Record:
    header = table.header
    kept = np.arange(table.columns["t"].size)

    def where(row: int) -> str:
        return f"{path}, row {kept[row] + 1}" if table.lines is None else f"{path}:{table.lines[kept[row]]}"

    notes: list[str] = []
    columns, unit, of_time = to_si(path, table, notes)
    numbers = numbers_of(path, header, of_time, notes)
    for name, column in columns.items():
        bad = np.flatnonzero(~(np.abs(column) < RECORDS.largest_value))
        if bad.size:
            raise SeparatrixError(f"{where(bad[0])}: '{name}' is {column[bad[0]]}; {bad.size} such values")
    if kept.size < RECORDS.fewest_samples:
        raise SeparatrixError(f"{path}: {kept.size} samples, at least {RECORDS.fewest_samples} are needed")
    sensors = [name for name in columns if is_sensor(name)]
    positions = [name for name in sensors if is_kind(name, "x")]
    own_x = "x" in columns
    if own_x:
        positions.insert(0, "x")
    elif positions:
        columns["x"] = columns[positions[0]]
    else:
        columns["x"] = _integrated(columns, sensors, notes)
    t, x = columns["t"], columns["x"]
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
        if positions:
            kept = np.delete(kept, left_out(t, x, unit, where, notes))
        columns = {name: column[kept] for name, column in columns.items()}
        x = columns["x"]
    t, pieces = pieces_of(columns["t"], x, RECORDS.fewest_samples, where, notes)
    usual = float(np.median(np.diff(t)))
    rate = numbers.get("sampling_rate_hz")
    if rate is not None and not 0.99 < rate * usual < 1.01:
        raise SeparatrixError(
            f"{path}: sampling_rate_hz is {rate:g}, t advances by {usual:.6g} s per row: wrong unit of time?"
        )
    if not at_rest:
        for name in positions:
            check_clipping(columns[name], unit, where, notes)
    if table.unused:
        notes.append(f"columns that are not used: {', '.join(table.unused)}")
    channels = {name: columns[name] for name in CHANNELS if name in columns}
    of_bodies = {name: columns[name] for name in sensors}
    described = {"header": numbers, "pieces": pieces, "notes": notes, "file": str(path)}
    return Record(path.stem, t, sensors=of_bodies, own_x=own_x, **described, **channels)


def _integrated(columns: dict[str, np.ndarray], sensors: list[str], notes: list[str]) -> np.ndarray:
    """A position where none was measured: the integral of a speed, else of an acceleration."""
    speeds = [name for name in ("v", *sensors) if name in columns and is_kind(name, "v")]
    if speeds:
        notes.append(f"no position: x is the integral of {speeds[0]} from 0 and is not compared")
        return cumulative_trapezoid(columns[speeds[0]], columns["t"], initial=0)
    name = next(name for name in sensors if is_kind(name, "a"))
    notes.append(
        f"no position and no speed: x is integrated from {name} without its drift and is not compared"
    )
    t = columns["t"]
    once = cumulative_trapezoid(columns[name] - np.mean(columns[name]), t, initial=0)
    twice = cumulative_trapezoid(once - np.polyval(np.polyfit(t, once, 1), t), t, initial=0)
    return twice - np.polyval(np.polyfit(t, twice, 3), t)


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
