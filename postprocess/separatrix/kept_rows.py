# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results that take long: rows that are done are kept beside the output, which is written whole."""

import json
from pathlib import Path
from threading import Lock

import h5py
import xarray as xr

from separatrix.errors import CANNOT_CREATE, USAGE, SeparatrixError

__all__ = ["KeptRows", "write_dataset"]


class KeptRows:
    """Rows that are done, kept beside the output until it is written."""

    def __init__(self, target: Path | None, identity: str, resume: bool, other: str) -> None:
        """Take up the rows of a run that was stopped; `other` ends the message for a file of another."""
        self.path = None if target is None else target.with_name(target.name + ".part")
        self.rows: dict[int, list] = {}
        self._lock = Lock()
        if self.path is None:
            return
        if resume and self.path.exists():
            lines = self.path.read_text().splitlines()
            if not lines or lines[0] != identity:
                raise SeparatrixError(f"{self.path}: {other}", USAGE)
            for line in lines[1:]:
                try:
                    number, row = json.loads(line)
                except ValueError:
                    # the last line of a run that was killed
                    break
                self.rows[number] = row
        self.path.write_text("\n".join([identity, *(json.dumps(item) for item in self.rows.items())]) + "\n")

    def row(self, number: int) -> list | None:
        """Return a row that is done, None if it is not."""
        return self.rows.get(number)

    def keep(self, number: int, row: list) -> list:
        """Keep a row; return it as it is read again."""
        with self._lock:
            return self._keep(number, row)

    def _keep(self, number: int, row: list) -> list:
        text = json.dumps([number, row])
        if self.path is not None:
            with self.path.open("a") as file:
                file.write(text + "\n")
        return json.loads(text)[1]

    def remove(self) -> None:
        """Remove the file of the rows."""
        if self.path is not None:
            self.path.unlink()


def write_dataset(data: xr.Dataset, target: Path) -> None:
    """Write a file that `open_result` reads; the case is kept where result files have it."""
    part = target.with_name(target.name + ".writing")
    try:
        plain = data.drop_attrs(deep=False).assign_attrs(
            {key: value for key, value in data.attrs.items() if key != "resolved_case"}
        )
        # of the map, not of what is written here
        for variable in plain.variables.values():
            variable.attrs.pop("checksum", None)
        plain.to_netcdf(
            part, engine="h5netcdf", encoding={name: {"_FillValue": None} for name in plain.variables}
        )
        with h5py.File(part, "a") as file:
            file.create_group("provenance").attrs["resolved_case"] = data.attrs["resolved_case"]
        part.replace(target)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise SeparatrixError(f"{target}: cannot be written ({error})", CANNOT_CREATE) from error
