# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of a file by their names as a table of columns, and the times that channels have in common."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from separatrix.discovery.measured.tables import (
    KEYS,
    SAME,
    Table,
    check_length,
    has_motion,
    is_column,
    is_noise,
)
from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError

_MOST_NAMES = 30


@dataclass
class Found:
    """Content of a file: arrays and keys by name; units of columns, where the file states them; notes."""

    values: dict[str, object] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    # channels that are no columns and are not read
    unused: list[str] = field(default_factory=list)

    def key(self, name: str, value: object) -> None:
        """Keep a key of the header, and nothing else."""
        if is_key(name):
            self.values[name] = value


def is_key(name: str) -> bool:
    """Whether a name is a key of the header."""
    return name in KEYS or is_noise(name)


def column_of(name: str, names: Mapping[str, str]) -> str:
    """The column of a channel: as the user states, else by its own name."""
    return names.get(name, SAME.get(name, name))


def table_of(path: Path, found: Found, names: Mapping[str, str]) -> Table:
    """Columns and header of the content of a file, or of the one structure in it that has them."""
    values = _looked_into(path, found.values)
    values = {column_of(name, names): value for name, value in values.items()}
    missing = [] if "t" in values else ["t"]
    missing += [] if has_motion(values) else ["x"]
    if missing:
        raise SeparatrixError(
            f"{path}: found {_listed([*values, *found.unused])}; '{missing[0]}' is missing of "
            "t, x[, v, force, phi]; which channel is which "
            f"may be stated in {path.name}.keys, as in 'columns: {missing[0]} = NAME'"
        )
    notes = list(found.notes)
    columns = {}
    for name in (one for one in values if is_column(one)):
        column = np.squeeze(np.asarray(values[name]))
        if name == "t" and column.dtype.kind in "mM":
            column = _seconds(column, notes)
        if column.ndim != 1 or column.dtype.kind not in "fiu":
            raise SeparatrixError(f"{path}: '{name}' is no list of numbers (shape {column.shape})")
        check_length(path, column.size)
        columns[name] = column.astype(float)
    if len({column.size for column in columns.values()}) != 1:
        sizes = ", ".join(f"{name} {column.size}" for name, column in columns.items())
        raise SeparatrixError(f"{path}: the columns are not equally long ({sizes})")
    # in this order, whatever that of the file is
    order = [name for name in ("t", "x", "v", "force", "phi") if name in columns]
    columns = {name: columns[name] for name in dict.fromkeys([*order, *columns])}
    header = {key: _word(value) for key, value in values.items() if is_key(key)}
    unused = sorted({*values.keys() - columns.keys() - header.keys(), *found.unused})
    units = {name: unit for name, unit in found.units.items() if name in columns}
    return Table(header, columns, None, unused, list(columns), units, notes)


def _listed(names: list[str]) -> str:
    """Names in a message, of which a file may have thousands."""
    names = sorted(names)
    more = [f"and {len(names) - _MOST_NAMES} more"] if len(names) > _MOST_NAMES else []
    return ", ".join(names[:_MOST_NAMES] + more) or "nothing"


def _looked_into(path: Path, values: dict[str, object]) -> dict[str, object]:
    """The members of the only structure that has a column t, where t is none of the variables."""
    if "t" in values:
        return values
    inside = {name: _members(value) for name, value in values.items()}
    inside = {name: members for name, members in inside.items() if "t" in members}
    if len(inside) > 1:
        raise SeparatrixError(f"{path}: found records in {', '.join(sorted(inside))}, expected one in a file")
    if not inside:
        return values
    ((name, members),) = inside.items()
    return {key: value for key, value in values.items() if key != name} | members


def _members(value: object) -> Mapping[str, object]:
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
        return {name: value[name].item() for name in value.dtype.names}
    return value if isinstance(value, dict) else {}


def _seconds(stamps: np.ndarray, notes: list[str]) -> np.ndarray:
    """Time stamps as seconds since the first one, durations as they are."""
    late = np.atleast_1d(stamps)
    if stamps.dtype.kind == "M":
        notes += [f"t counts from {first}" for first in late.ravel()[:1]]
        late = late - late.ravel()[:1]
    seconds = late / np.timedelta64(1, "s")
    return np.where(np.isnat(late), np.nan, seconds)


def _word(value: object) -> str:
    """A key of the header as text."""
    value = np.asarray(value).squeeze()
    return str(value.item()) if value.size == 1 else "".join(str(one) for one in value.ravel())


def common_times(path: Path, times: Mapping[str, np.ndarray]) -> np.ndarray:
    """The times at which all channels were sampled; channels with times of their own are refused."""
    (first, t), *others = times.items()
    step = float(np.median(np.abs(np.diff(t)))) if t.size > 1 else 0.0
    for name, other in others:
        if other.size != t.size:
            raise SeparatrixError(
                f"{path}: '{name}' is not sampled at the times of '{first}': {other.size} samples beside "
                f"{t.size}; export both with one clock"
            )
        apart = np.abs(other - t)
        row = int(np.argmax(apart)) if t.size else 0
        if t.size and not apart[row] <= RECORDS.channels_apart * step:
            raise SeparatrixError(
                f"{path}: '{name}' is not sampled at the times of '{first}': at {other[row]:.9g} s beside "
                f"{t[row]:.9g} s, row {row + 1}; export both with one clock"
            )
    return t
