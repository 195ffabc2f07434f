# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Damage in a result file: checksums of arrays and attributes, arrays that cannot be decompressed."""

import os
import re
import zlib
from pathlib import Path

import h5py
import numpy as np
import xarray as xr
from xarray.backends import BackendArray
from xarray.backends.h5netcdf_ import H5netcdfBackendEntrypoint
from xarray.core import indexing

from separatrix.errors import BAD_DATA, DAMAGE, SeparatrixError

__all__ = ["NamedErrors", "check_named", "compare_checksums", "first_line", "why_unreadable"]

_SEAL = "attributes_checksum"
# version of the format from which a file with checksums has one of its attributes
_SEALED_SINCE = 2
# the seals, and what the dimension scales consist of
_LEFT_OUT = (_SEAL, "checksum", "CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST")


def compare_checksums(path: Path, file: h5py.File) -> None:
    """Refuse a file of which an attribute, or an array that is stored without compression, is damaged.

    HDF5 itself notices damage of compressed arrays when they are read.
    """
    sealed = "provenance" in file and _SEAL in file["provenance"].attrs
    if sealed:
        _compare_attributes(path, file)

    def compare(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if not isinstance(item, h5py.Dataset) or "checksum" not in item.attrs:
            return
        if not sealed and file.attrs["format_version"] >= _SEALED_SINCE:
            raise SeparatrixError(f"{path}: is damaged (the checksum of its attributes is missing)", BAD_DATA)
        if item.dtype.kind not in "iuf":
            return
        if item.id.get_create_plist().get_nfilters() > 0:
            return
        values = np.ascontiguousarray(item[()], item.dtype.newbyteorder("<"))
        if zlib.crc32(values.tobytes()) != np.ravel(item.attrs["checksum"])[0]:
            raise SeparatrixError(
                f"{path}: is damaged (/{name}: its values do not match their checksum)", BAD_DATA
            )

    file.visititems(compare)


def _compare_attributes(path: Path, file: h5py.File) -> None:
    """Compare all attributes with the checksum over them."""
    if np.ravel(file["provenance"].attrs[_SEAL]).tolist() != [_seal_of(file, "/", 0)]:
        raise SeparatrixError(f"{path}: is damaged (its attributes do not match their checksum)", BAD_DATA)


def _seal_of(file: h5py.File, name: str, value: int) -> int:
    """Continue the checksum with the attributes of an object, by name, and with the objects in it."""
    item = file[name]
    for key in sorted(item.attrs, key=str.encode):
        if key not in _LEFT_OUT:
            value = zlib.crc32(f"{name} {key}\0".encode(errors="surrogateescape"), value)
            value = zlib.crc32(_bytes_of(item.attrs[key]), value)
    if isinstance(item, h5py.Group):
        for child in item:
            value = _seal_of(file, f"{name.rstrip('/')}/{child}", value)
    return value


def _bytes_of(value: object) -> bytes:
    """Return a text with its final zero byte, or numbers in the format float64."""
    if isinstance(value, h5py.Empty):
        return b""
    if isinstance(value, bytes | str):
        text = value if isinstance(value, bytes) else value.encode(errors="surrogateescape")
        return text + b"\0"
    return np.ascontiguousarray(value, "<f8").tobytes()


def check_named(path: Path, file: h5py.File, attributes: dict) -> None:
    """Raise if a file that has the provenance of a result does not name its format: that is damaged."""
    is_ours = "provenance" in file and "case_identity" in file["provenance"].attrs
    if is_ours and attributes.get("format") != "separatrix":
        raise SeparatrixError(f"{path}: is damaged (the attribute format is missing or changed)")


def why_unreadable(path: Path, error: OSError) -> str:
    """Return why HDF5 does not read a file: it may not, it is no HDF5 file, it is cut, or it is damaged."""
    if error.errno is not None:
        return f"cannot be read ({os.strerror(error.errno)})"
    if not h5py.is_hdf5(path):
        return f"cannot be read as HDF5 ({first_line(error)})"
    ends = re.search(r"truncated file: eof = (\d+), .*stored_eof = (\d+)", str(error))
    if ends:
        return f"is cut: {ends[1]} of {ends[2]} bytes are left"
    return f"is damaged ({first_line(error)})"


class NamedErrors(H5netcdfBackendEntrypoint):
    """The reader of xarray for HDF5; an unreadable array raises a SeparatrixError with file and name."""

    def open_dataset(self, filename_or_obj: str | Path, **options: object) -> xr.Dataset:
        """Open a group of a file."""
        result = super().open_dataset(filename_or_obj, **options)
        for name, variable in result.variables.items():
            if not isinstance(variable._data, np.ndarray):
                where = f"{options.get('group') or ''}/{name}".lstrip("/")
                lazy = indexing.LazilyIndexedArray(_Named(variable._data, filename_or_obj, where))
                variable._data = lazy
        return result


class _Named(BackendArray):
    """An array in a file."""

    def __init__(self, array: indexing.ExplicitlyIndexed, path: str | Path, name: str) -> None:
        self.array, self.path, self.name = array, path, name
        self.shape, self.dtype = array.shape, array.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> np.ndarray:
        kinds = indexing.IndexingSupport.OUTER_1VECTOR
        return indexing.explicit_indexing_adapter(key, self.shape, kinds, self._read)

    def _read(self, key: tuple) -> np.ndarray:
        try:
            return np.asarray(self.array.oindex[indexing.OuterIndexer(key)].get_duck_array())
        except DAMAGE as error:
            raise SeparatrixError(f"{self.path}: is damaged (/{self.name}: {first_line(error)})") from error


def first_line(error: Exception) -> str:
    """Return the first line of a message, or the name of the exception."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__
