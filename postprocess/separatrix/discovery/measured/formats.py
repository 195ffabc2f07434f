# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in the files of any program: CSV, HDF5, MATLAB (.mat, all versions), NumPy (.npz), UFF 58, TDMS.

In the last four columns are the arrays named t, x, v, force, phi, in this order for `units`; keys of the
header are numbers and texts of their names.
"""

import importlib
import re
import zlib
from pathlib import Path
from types import ModuleType
from zipfile import BadZipFile

import h5py
import numpy as np
from scipy.io import loadmat

from separatrix.discovery.measured.tables import (
    CHANNELS,
    KEYS,
    SAME,
    Table,
    check_length,
    read_csv,
    read_hdf5,
)
from separatrix.errors import NO_INPUT, SeparatrixError
from separatrix.trial import try_first

_COLUMNS = ("t", *CHANNELS)
# what a file that is damaged or of another kind raises in its reader
_UNREADABLE = (
    ArithmeticError,
    AttributeError,
    BadZipFile,
    LookupError,
    MemoryError,
    NotImplementedError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    zlib.error,
)
# specific data types of UFF 58 (displacement, velocity, force) and the columns that they are
_OF_UFF = {8: "x", 11: "v", 9: "force", 13: "force"}
_HDF5 = b"\x89HDF\r\n\x1a\n"
# bytes that MATLAB puts before HDF5
_MATLAB_HEAD = 512
_EXTRAS = "pip install 'separatrix[formats]'"


def read_mat(path: Path) -> Table:
    """A .mat file of version 5; those of 7.3 are HDF5."""
    try:
        found = loadmat(path, squeeze_me=True, struct_as_record=True)
    except _UNREADABLE as error:
        raise _damaged(path, "MATLAB", error) from None
    return _of_arrays(path, {key: value for key, value in found.items() if not key.startswith("__")})


def read_mat73(path: Path) -> Table:
    """A .mat file of version 7.3."""
    try_first(path, lambda: list(h5py.File(path)))
    try:
        with h5py.File(path) as file:
            return _of_arrays(path, {name: _of_matlab(file[name]) for name in file if name != "#refs#"})
    except _UNREADABLE as error:
        raise _damaged(path, "MATLAB 7.3", error) from None


def read_npz(path: Path) -> Table:
    """Arrays written by numpy.savez."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return _of_arrays(path, {name: file[name] for name in file.files})
    except _UNREADABLE as error:
        raise _damaged(path, "NumPy", error) from None


def read_uff(path: Path) -> Table:
    """Functions of type 58 over time; displacement is x, velocity v, force force, or as `id1` says."""
    pyuff = _library("pyuff", path)
    try:
        file = pyuff.UFF(str(path))
        sets = file.read_sets()
    except _UNREADABLE as error:
        raise _damaged(path, "UFF", error) from None
    header: dict[str, object] = {}
    columns: dict[str, object] = {}
    for one in [sets] if isinstance(sets, dict) else sets:
        if one.get("type") != 58:
            continue
        for line in (one.get(f"id{k}", "") for k in range(1, 6)):
            key, colon, value = (word.strip() for word in line.partition(":"))
            if colon and key in KEYS:
                header[key] = value
        said = str(one.get("id1", "")).strip()
        name = said if said in _COLUMNS else _OF_UFF.get(one.get("ordinate_spec_data_type"), said)
        if name in columns:
            raise SeparatrixError(f"{path}: two functions are '{name}': say which in their first line (id1)")
        columns.setdefault("t", np.asarray(one["x"], float))
        if len(one["data"]) != len(columns["t"]) or not np.allclose(one["x"], columns["t"]):
            raise SeparatrixError(f"{path}: '{name}' is not sampled at the times of the others")
        columns[name] = np.asarray(one["data"])
    return _of_arrays(path, columns | header)


def read_tdms(path: Path) -> Table:
    """Channels named t, x, ..., of any group; times may be those of the waveform of x."""
    nptdms = _library("nptdms", path)
    try:
        file = nptdms.TdmsFile.read(path)
        header = {key: value for key, value in file.properties.items() if key in KEYS}
        columns: dict[str, object] = {}
        for group in file.groups():
            header |= {key: value for key, value in group.properties.items() if key in KEYS}
            for channel in group.channels():
                if channel.name in columns:
                    raise SeparatrixError(f"{path}: two channels are named '{channel.name}'")
                columns[channel.name] = channel[:]
                if channel.name == "x" and "t" not in columns and "wf_increment" in channel.properties:
                    columns["t"] = channel.time_track()
    except _UNREADABLE as error:
        raise _damaged(path, "TDMS", error) from None
    return _of_arrays(path, columns | header)


def _of_arrays(path: Path, found: dict[str, object]) -> Table:
    """Columns and header of what a file holds; one structure that holds it all is looked into."""
    if "t" not in found and len(found) == 1:
        (only,) = found.values()
        if isinstance(only, np.ndarray) and only.dtype.names:
            found = {name: only[name].item() for name in only.dtype.names}
        elif isinstance(only, dict):
            found = only
    found = {SAME.get(name, name): value for name, value in found.items()}
    missing = [name for name in ("t", "x") if name not in found]
    if missing:
        has = ", ".join(sorted(found)) or "nothing"
        raise SeparatrixError(f"{path}: found {has}; '{missing[0]}' is missing of t, x[, v, force, phi]")
    columns = {}
    for name in (one for one in _COLUMNS if one in found):
        column = np.squeeze(np.asarray(found[name]))
        if column.ndim != 1 or column.dtype.kind not in "fiu":
            raise SeparatrixError(f"{path}: '{name}' is no list of numbers (shape {column.shape})")
        check_length(path, column.size)
        columns[name] = column.astype(float)
    if len({column.size for column in columns.values()}) != 1:
        sizes = ", ".join(f"{name} {column.size}" for name, column in columns.items())
        raise SeparatrixError(f"{path}: the columns are not equally long ({sizes})")
    header = {key: _word(value) for key, value in found.items() if key in KEYS}
    unused = sorted(found.keys() - columns.keys() - header.keys())
    return Table(header, columns, unused=unused, names=list(columns))


def _word(value: object) -> str:
    """A key of the header as text."""
    value = np.asarray(value).squeeze()
    return str(value.item()) if value.size == 1 else "".join(str(one) for one in value.ravel())


def _of_matlab(node: h5py.Dataset | h5py.Group) -> object:
    """A variable as MATLAB writes it into HDF5: texts are numbers of characters, structures are groups."""
    if isinstance(node, h5py.Group):
        return {name: _of_matlab(node[name]) for name in node}
    if node.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, np.asarray(node[()], int).ravel(order="F")))
    return node[()]


def _library(name: str, path: Path) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise SeparatrixError(f"{path}: reading it needs the package {name}: {_EXTRAS}") from None


def _damaged(path: Path, kind: str, error: Exception) -> SeparatrixError:
    if isinstance(error, SeparatrixError):
        return error
    said = re.sub(r"\s+", " ", str(error)) or type(error).__name__
    return SeparatrixError(f"{path}: not a {kind} file that can be read: {said}")


READERS = {".npz": read_npz, ".uff": read_uff, ".unv": read_uff, ".uf58": read_uff, ".tdms": read_tdms}
"""By the end of the name; .mat and HDF5 are told by their content."""


def read_table(path: Path) -> Table:
    """Read one file of any kind; what cannot be read is refused with the line and the reason."""
    if path.is_dir():
        raise SeparatrixError(f"{path}: a folder, expected a record", NO_INPUT)
    if not path.is_file():
        raise SeparatrixError(f"{path}: no such file", NO_INPUT)
    ending = path.suffix.lower()
    if ending in READERS:
        return READERS[ending](path)
    with path.open("rb") as file:
        begin = file.read(_MATLAB_HEAD + 8)
    if ending == ".mat":
        return read_mat73(path) if _HDF5 in (begin[:8], begin[_MATLAB_HEAD:]) else read_mat(path)
    return read_hdf5(path) if begin[:8] == _HDF5 else read_csv(path)
