# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in HDF5 and netCDF-4: datasets with the names of the columns, keys and units as attributes."""

from pathlib import Path

import h5py
import numpy as np

from separatrix.discovery.measured.tables import SAME, Table, check_length, has_motion, is_column
from separatrix.errors import SeparatrixError

_UNIT = ("units", "unit")
# of packed values, by the CF conventions
_FILL = ("_FillValue", "missing_value")


def read_hdf5(path: Path) -> Table:
    """Read datasets with the names of the columns; keys are attributes of the file, units of the datasets."""
    with h5py.File(path) as file:
        header = {key: _text(value) for key, value in file.attrs.items()}
        if isinstance(file.get("t"), h5py.Dataset):
            check_length(path, file["t"].size)
        used = [name for name in file if is_column(SAME.get(name, name))]
        used = [name for name in used if isinstance(file[name], h5py.Dataset)]
        for name in used:
            if SAME.get(name, name) != name and SAME[name] in used:
                raise SeparatrixError(
                    f"{path}: '{name}' and '{SAME[name]}' are the same column, expected one"
                )
        columns = {SAME.get(name, name): _values(path, name, file[name]) for name in used}
        units = {SAME.get(name, name): unit for name in used if (unit := _unit(path, name, file[name]))}
        unused = sorted(set(file) - set(used))
    missing = [] if "t" in columns else ["t"]
    missing += [] if has_motion(columns) else ["x"]
    if missing:
        raise SeparatrixError(f"{path}: dataset '{missing[0]}' is missing")
    if len({column.shape for column in columns.values()}) != 1 or columns["t"].ndim != 1:
        raise SeparatrixError(f"{path}: the datasets are not equally long lists")
    return Table(header, columns, unused=unused, names=list(columns), units=units)


def _unit(path: Path, name: str, dataset: h5py.Dataset) -> str:
    stated = list(dict.fromkeys(_text(dataset.attrs[key]) for key in _UNIT if key in dataset.attrs))
    if len(stated) > 1:
        raise SeparatrixError(f"{path}: '{name}' has two units, {' and '.join(stated)}")
    return stated[0] if stated else ""


def _values(path: Path, name: str, dataset: h5py.Dataset) -> np.ndarray:
    """Numbers of a dataset, unpacked; those that are missing are no numbers."""
    raw = np.asarray(dataset[()])
    if raw.dtype.kind not in "fiu":
        raise SeparatrixError(f"{path}: '{name}' is no list of numbers (it has the type {raw.dtype})")
    values = raw.astype(float)
    for key in _FILL:
        if key in dataset.attrs:
            values[raw == np.ravel(dataset.attrs[key])[0]] = np.nan
    for key, combine in (("scale_factor", np.multiply), ("add_offset", np.add)):
        if key in dataset.attrs:
            values = combine(values, float(np.ravel(dataset.attrs[key])[0]))
    return values


def _text(value: object) -> str:
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.ravel()[0]
    return value.decode() if isinstance(value, bytes) else str(value)
