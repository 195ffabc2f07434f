# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts of `points`: columns of a table, a mapping or an array."""

import warnings
from collections.abc import Mapping

import numpy as np
import xarray as xr

from separatrix.cases import Case
from separatrix.errors import USAGE, SeparatrixError, SeparatrixWarning

# Columns of a table of initial conditions, and other names of the drive ratio.
_COLUMNS = ("x0", "v0", "ratio")
_RATIO = {"drive.ratio": "ratio", "drive_ratio": "ratio", "drive__ratio": "ratio"}


def table_of_starts(case: Case, starts: object, columns: Mapping[str, object]) -> dict[str, np.ndarray]:
    """Return the columns of a table of starts, equally long."""
    if starts is None:
        given = {_RATIO.get(name, name): values for name, values in columns.items()}
    elif hasattr(starts, "keys"):
        # a table may have further columns, a mapping is written for this
        further = hasattr(starts, "to_dict")
        named = [(_RATIO.get(str(key), str(key)), key) for key in starts.keys()]  # noqa: SIM118
        if [name for name, _ in named].count("ratio") > 1:
            raise SeparatrixError("starts: found two columns of the drive ratio, allowed one", USAGE)
        given = {name: starts[key] for name, key in named if not further or name in _COLUMNS}
        if further:
            _warn_of_unused(case, starts, [str(key) for name, key in named if name not in _COLUMNS])
    else:
        array = np.asarray(starts)
        if array.dtype.kind not in "iuf":
            raise SeparatrixError("starts: found an array of texts or objects, allowed one of numbers", USAGE)
        if array.ndim != 2 or array.shape[1] not in (2, 3):
            raise SeparatrixError(f"starts: found shape {array.shape}, allowed (n, 2) or (n, 3)", USAGE)
        given = dict(zip(("x0", "v0", "ratio"), array.T, strict=False))
    unknown = set(given) - set(_COLUMNS)
    if unknown or not {"x0", "v0"} <= set(given):
        raise SeparatrixError(
            f"starts: found the columns {', '.join(given) or 'none'}, allowed x0, v0 and optionally ratio",
            USAGE,
        )
    columns = {name: np.atleast_1d(_column(case, name, value)) for name, value in given.items()}
    try:
        arrays = np.broadcast_arrays(*columns.values())
    except ValueError:
        sizes = ", ".join(f"{name} {column.size}" for name, column in columns.items())
        raise SeparatrixError(f"starts: found {sizes} values, allowed equally many", USAGE) from None
    if arrays[0].ndim != 1:
        raise SeparatrixError(f"starts: found columns of shape {arrays[0].shape}, allowed lists", USAGE)
    return dict(zip(given, arrays, strict=True))


def _warn_of_unused(case: Case, starts: object, names: list[str]) -> None:
    """Warn of columns that are not used: all of a table, of a Dataset those that are a parameter."""
    if isinstance(starts, xr.Dataset):
        parameters = {path.replace(".", "_") for path in case.parameters}
        names = [name for name in names if name.replace(".", "_") in parameters]
    if names:
        warnings.warn(
            f"starts: the columns {', '.join(names)} are not used; used are x0, v0 and ratio",
            SeparatrixWarning,
            stacklevel=4,
        )


def _column(case: Case, name: str, values: object) -> np.ndarray:
    """Return a column of starts in SI units."""
    column = np.asarray(values)
    if column.dtype.kind in "iuf":
        return column.astype(float)
    path = "drive.ratio" if name == "ratio" else f"start.{name}"
    numbers = [case.in_si(path, value) for value in np.asarray(values, object).ravel()]
    return np.array(numbers, float).reshape(column.shape)
