# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results as tables of rows, in memory and as CSV or Parquet files."""

import importlib
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from separatrix.errors import CANNOT_CREATE, NO_INPUT, USAGE, SeparatrixError
from separatrix.open import TABLES, decode_flags, decode_words
from separatrix.whole_files import written_whole

if TYPE_CHECKING:
    import pandas

__all__ = ["SUFFIXES", "frame_of", "write_frame"]

SUFFIXES = (".csv", ".parquet")


def frame_of(result: xr.Dataset, variable: str | None = None) -> "pandas.DataFrame":
    """Return the table of a variable: all variables over the same dimensions.

    If it is None, that of `regime`, of `x` where there is none, else of the first variable.

    A row per point, in the order of the arrays; first the coordinates, and numbers from 0 of dimensions that
    have none. Codes and event words are texts. `attrs["units"]` of the table has the unit of each column.
    """
    whole = [str(name) for name in result.data_vars if not str(name).startswith(_OF_TABLES)]
    if not whole:
        raise SeparatrixError("this result has no variables", USAGE)
    variable = variable or next((name for name in ("regime", "x") if name in whole), whole[0])
    if variable not in whole:
        raise SeparatrixError(f"table: found '{variable}', allowed {', '.join(whole)}", USAGE)
    dims = tuple(str(name) for name in result[variable].dims)
    same = [name for name in whole if set(result[name].dims) == set(dims)]
    if not dims:
        raise SeparatrixError(f"table: '{variable}' is one number", USAGE)
    chosen = result[same]
    chosen = chosen.drop_vars([name for name in chosen.coords if name not in dims])
    chosen = chosen.assign({name: _decoded(chosen[name]) for name in same})
    frame = chosen.to_dataframe(dim_order=dims).reset_index()
    named = {str(name): result[name].attrs.get("units", "") for name in frame.columns if name in result}
    frame.attrs["units"] = {name: str(unit) for name, unit in named.items()}
    return frame


_OF_TABLES = tuple(f"{name}_" for name in TABLES)


def _decoded(variable: xr.DataArray) -> xr.DataArray:
    if str(variable.name).endswith("event_word"):
        return decode_words(variable)
    return decode_flags(variable) if "flag_values" in variable.attrs else variable


def write_frame(frame: "pandas.DataFrame", path: str | Path, overwrite: bool = False) -> Path:
    """Write a table as .csv, at full precision, or as .parquet, whole or not at all.

    Parquet needs the package pyarrow. A SeparatrixError if it is missing, for another suffix, and for a file
    that exists, unless `overwrite`.
    """
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise SeparatrixError(f"{path}: found suffix '{path.suffix}', allowed {', '.join(SUFFIXES)}", USAGE)
    if path.suffix == ".parquet":
        _require_parquet(path)
    if path.exists() and not overwrite:
        raise SeparatrixError(f"{path}: exists; overwrite=True replaces it", CANNOT_CREATE)
    # an index of plain row numbers has no meaning
    named = any(name is not None for name in frame.index.names)
    with written_whole(path) as temporary:
        if path.suffix == ".csv":
            frame.to_csv(temporary, index=named, lineterminator="\n")
        else:
            frame.to_parquet(temporary, engine="pyarrow", index=named)
    return path


def _require_parquet(path: Path) -> None:
    try:
        importlib.import_module("pyarrow.parquet")
    except ImportError:
        raise SeparatrixError(
            f"{path}: Parquet needs the package pyarrow: pip install 'separatrix[parquet]'", NO_INPUT
        ) from None
