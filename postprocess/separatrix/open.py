# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Open a result file: HDF5 -> xarray, codes -> text."""

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import xarray as xr

from separatrix.errors import BAD_DATA, DAMAGE, NO_INPUT, SeparatrixError, why_absent
from separatrix.locks import lock_options
from separatrix.stored import NamedErrors, check_named, compare_checksums, first_line, why_unreadable
from separatrix.trial import CASE_GIVEN, try_first
from separatrix.variables import FORMAT_VERSION, RENAMED, RENAMED_EVENTS
from separatrix.version import __version__
from separatrix.words import decode_word

FORMAT = "separatrix"
# the oldest that is read
_OLDEST = 1
KINDS = (
    "basin", "sweep", "trajectory", "points", "branches", "boundary", "measures", "noise", "first_passage"
)  # fmt: skip
_TEXTS = ("case_text", "resolved_case")
TABLES = ("catalogue", "limits", "saddles", "sets")


def open_result(path: str | Path) -> xr.Dataset:
    """Open a result file as an xarray Dataset whose arrays are read when they are used.

    The groups `/catalogue` and `/limits` are part of it as `catalogue_*` and `limits_*` (see `table`),
    the texts and attributes of `/provenance` are attributes (`resolved_case`, `provenance_version`, ...).
    Raises SeparatrixError for a missing, foreign, incomplete, damaged or too new file.

    Examples
    --------
    >>> _ = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20, output="map.h5")
    >>> with sx.open_result("map.h5") as result:
    ...     dict(result["attractor"].sizes)
    {'x0': 20, 'v0': 20}
    """
    if Path(path).is_file():
        try_first(path, lambda: _read_header(Path(path)))
    with reading(path):
        attributes, texts, groups = _read_header(Path(path))
    parts: list[xr.Dataset] = []
    with reading(path):
        try:
            parts.append(_open_group(path, None))
            parts += [_open_table(path, name) for name in groups]
            result = xr.merge(parts, join="exact", compat="no_conflicts")
            result = result.rename({old: new for old, new in RENAMED.items() if old in result.variables})
        except Exception:
            _close(parts)
            raise
    result.attrs = attributes | texts
    result.encoding["source"] = str(Path(path).absolute())
    # results have their accessor, however they were made
    importlib.import_module("separatrix.accessor")
    result.set_close(lambda: _close(parts))
    return result


@contextmanager
def reading(path: str | Path) -> Iterator[None]:
    """Turn what the libraries raise for a damaged file into a SeparatrixError."""
    try:
        yield
    except SeparatrixError:
        raise
    except KeyError as error:
        # h5py raises it also for what it finds and cannot read
        if str(error.args[0]).startswith(("Unable to", "Can't")):
            raise SeparatrixError(f"{path}: is damaged ({error.args[0]})") from error
        raise SeparatrixError(f"{path}: lacks what is needed of it ({error.args[0]})") from error
    except DAMAGE as error:
        raise SeparatrixError(f"{path}: is damaged ({first_line(error)})") from error


def table(result: xr.Dataset, name: str) -> xr.Dataset:
    """Return the catalogue or the limits of an opened file as a Dataset; empty if there is none.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> sx.table(result, "catalogue")["period"].values.tolist()
    [1, 1]
    """
    prefix = f"{name}_"
    return xr.Dataset(
        {key.removeprefix(prefix): var for key, var in result.data_vars.items() if key.startswith(prefix)}
    )


def flag_names(variable: xr.DataArray) -> dict[int, str]:
    """Return the meaning of each code of a coded variable.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> sx.flag_names(result["regime"])[2]
    'impact'
    """
    values = np.atleast_1d(variable.attrs.get("flag_values", []))
    names = [
        RENAMED_EVENTS.get(name, name) for name in _text(variable.attrs.get("flag_meanings", "")).split()
    ]
    try:
        return dict(zip((int(value) for value in values), names, strict=True))
    except (TypeError, ValueError, OverflowError) as error:
        raise SeparatrixError(
            f"variable {variable.name}: flag_values and flag_meanings do not belong together", BAD_DATA
        ) from error


def decode_flags(variable: xr.DataArray) -> xr.DataArray:
    """Return a coded variable as text: `regime` 1 -> 'non_impact'. Unknown codes are shown as numbers.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> str(sx.decode_flags(result["regime"]).values[0, 0])
    'impact'
    """
    names = flag_names(variable)
    codes, where = np.unique(variable.values, return_inverse=True)
    texts = np.array([names.get(code, str(code)) for code in codes.tolist()], dtype=object)
    return variable.copy(data=texts[where].reshape(variable.shape))


def decode_words(variable: xr.DataArray) -> xr.DataArray:
    """Return a variable of event words as text.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> str(sx.decode_words(result["event_word"]).values[0, 0])
    'R.'
    """
    words, where = np.unique(variable.values, return_inverse=True)
    texts = np.array([decode_word(word) for word in words], dtype=object)
    return variable.copy(data=texts[where].reshape(variable.shape))


def _close(parts: list[xr.Dataset]) -> None:
    for part in parts:
        part.close()


def _open_group(path: str | Path, name: str | None) -> xr.Dataset:
    options = lock_options(path)
    return xr.open_dataset(path, engine=NamedErrors, group=name, decode_times=False, driver_kwds=options)


def _open_table(path: str | Path, name: str) -> xr.Dataset:
    group = _open_group(path, name)
    for key, variable in list(group.variables.items()):
        # in files of version 1 they are strings
        if variable.dtype.kind in "SO":
            group[key] = (variable.dims, np.array([_text(v) for v in variable.values], dtype=object))
        elif name == "limits" and "flag_meanings" in variable.attrs:
            text = decode_flags(group[key])
            group[key] = (text.dims, text.values.astype(str), {"long_name": text.attrs["long_name"]})
    group = group.reset_coords()
    if name == "sets" and "piece" in group.data_vars:
        group = group.rename(piece="part")
    return group.rename({key: f"{name}_{key}" for key in group.data_vars})


def _read_header(path: Path) -> tuple[dict, dict, list[str]]:
    """Check that the file is one that this package reads; return what describes it."""
    if not path.is_file():
        raise SeparatrixError(f"{path}: {why_absent(path)}", NO_INPUT)
    try:
        with h5py.File(path, "r", **lock_options(path)) as file:
            attributes = {key: _plain(value) for key, value in file.attrs.items()}
            check_named(path, file, attributes)
            try:
                _check_header(path, attributes)
            except SeparatrixError:
                # a damaged attribute is no other kind or version
                if attributes.get("format") == FORMAT:
                    compare_checksums(path, file)
                raise
            compare_checksums(path, file)
            return attributes, _read_provenance(file), [name for name in TABLES if name in file]
    except OSError as error:
        reason = why_unreadable(path, error)
        if path.suffix == ".toml" and not h5py.is_hdf5(path):
            reason = f"cannot be read as HDF5 ({CASE_GIVEN})"
        raise SeparatrixError(f"{path}: {reason}", BAD_DATA) from error


def _check_header(path: Path, attributes: dict) -> None:
    if attributes.get("format") != FORMAT:
        raise SeparatrixError(f"{path}: not a Separatrix file (no attribute format = '{FORMAT}')")
    version = attributes.get("format_version")
    if not isinstance(version, int) or not _OLDEST <= version <= FORMAT_VERSION:
        raise SeparatrixError(
            f"{path}: has format_version {version}; "
            f"separatrix {__version__} reads {_OLDEST} to {FORMAT_VERSION}"
        )
    if attributes.get("kind") not in KINDS:
        raise SeparatrixError(
            f"{path}: unknown kind '{attributes.get('kind')}'; known kinds: {', '.join(KINDS)}"
        )
    if attributes.get("complete") != 1:
        raise SeparatrixError(f"{path}: is not complete; resume the run that writes it")


def _read_provenance(file: h5py.File) -> dict:
    group = file.get("provenance")
    if group is None:
        return {}
    facts = {key: _plain(value) for key, value in group.attrs.items()}
    # in files of version 1 they are datasets
    texts = {key: _text(group[key][()]) for key in _TEXTS if key in group}
    texts |= {key: facts.pop(key) for key in _TEXTS if key in facts}
    return texts | {f"provenance_{key}": value for key, value in facts.items()}


def _plain(value: object) -> object:
    if isinstance(value, bytes | str):
        return _text(value)
    if isinstance(value, np.ndarray) and value.size == 1:
        return _plain(value.reshape(-1)[0])
    return value.item() if isinstance(value, np.generic) else value


def _text(value: object) -> str:
    # Fortran pads fixed-length strings with blanks
    return (value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)).rstrip(" \0")
