# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of the user for a file that an instrument has written: RECORD.keys, lines `key: value` beside it."""

from dataclasses import dataclass, field
from pathlib import Path

from separatrix.discovery.measured.arrays import is_key
from separatrix.discovery.measured.tables import KEYS, SAME, Table, is_column
from separatrix.errors import SeparatrixError

ENDING = ".keys"
_COLUMNS = "columns"


@dataclass
class UserKeys:
    """Keys of the header, and which channel is which column."""

    path: Path
    header: dict[str, str] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)

    def added_to(self, table: Table) -> Table:
        """The table with these keys; except for units they may not contradict those of the file."""
        for key, value in self.header.items():
            if table.header.get(key, value).strip() != value:
                raise SeparatrixError(
                    f"{self.path}: '{key}' is '{value}', in the record itself '{table.header[key]}'"
                )
        table.own_units = "units" in self.header
        table.header |= self.header
        missing = [channel for channel, name in self.names.items() if name not in table.columns]
        if missing:
            has = ", ".join(table.unused) or "none that is not used"
            raise SeparatrixError(f"{self.path}: columns: '{missing[0]}' is not in the record; it has {has}")
        return table


def read_keys(record: Path) -> UserKeys:
    """The keys beside a record; none where there is no such file."""
    path = record.with_name(record.name + ENDING)
    found = UserKeys(path)
    if not path.is_file():
        return found
    for number, line in enumerate(path.read_bytes().decode("utf-8", errors="replace").splitlines(), start=1):
        line = line.strip().removeprefix("\ufeff")
        text = line.lstrip("#").strip()
        key, colon, value = (word.strip() for word in text.partition(":"))
        # without a colon it is a comment
        if not text or (line.startswith("#") and not colon):
            continue
        if not colon or (key != _COLUMNS and not is_key(key)):
            allowed = ", ".join([_COLUMNS, *sorted(KEYS)])
            raise SeparatrixError(f"{path}:{number}: found '{text}', allowed lines 'key: value' of {allowed}")
        if key in found.header or (key == _COLUMNS and found.names):
            raise SeparatrixError(f"{path}:{number}: '{key}' is given again")
        if key == _COLUMNS:
            found.names = _names(path, number, value)
        else:
            found.header[key] = value
    return found


def _names(path: Path, number: int, text: str) -> dict[str, str]:
    """Channels by name and the columns that they are, from `x = Laser 1, force = Load cell`."""
    found = {}
    for entry in (entry.strip() for entry in text.split(",") if entry.strip()):
        column, equals, channel = (word.strip() for word in entry.partition("="))
        column = SAME.get(column, column)
        if not equals or not channel or not is_column(column) or column in found.values() or channel in found:
            raise SeparatrixError(
                f"{path}:{number}: found '{entry}', expected columns and channels, as in "
                "'columns: x = Laser 1, force = Load cell'"
            )
        found[channel] = column
    return found
