# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Result files that HDF5 reads well and that are wrong all the same: objects missing, of another type."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np


def wrong_files(files: list[Path], folder: Path) -> Iterator[Path]:
    """Copies of the files, each with one thing wrong."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in files:
        with h5py.File(path) as file:
            names: list[str] = []
            file.visit(names.append)
            attributes = [
                (name, key) for name in ["/", *names] for key in file[name].attrs if key.isidentifier()
            ]
        number = 0
        for name in names:
            for change in [*OBJECT_CHANGES, *map(unsealed, OBJECT_CHANGES)]:
                number += 1
                made = changed(path, folder / f"{path.stem}-{number}.h5", change, name)
                if made:
                    yield made
        for name, key in attributes:
            for change in ATTRIBUTE_CHANGES:
                number += 1
                made = changed(path, folder / f"{path.stem}-{number}.h5", change, name, key)
                if made:
                    yield made


def changed(path: Path, copy: Path, change: Callable, *what: str) -> Path | None:
    """A copy with the change, or None where HDF5 does not let it be made."""
    shutil.copy(path, copy)
    try:
        with h5py.File(copy, "r+") as file:
            change(file, *what)
    except (AttributeError, TypeError, ValueError, OSError, RuntimeError, KeyError, OverflowError):
        copy.unlink()
        return None
    return copy


def unsealed(change: Callable) -> Callable:
    """The same change without the checksum that reveals it."""

    def change_and_unseal(file: h5py.File, name: str) -> None:
        change(file, name)
        del file[name].attrs["checksum"]

    return change_and_unseal


def remove(file: h5py.File, name: str) -> None:
    """The object is not there."""
    del file[name]


def replace(file: h5py.File, name: str, **how: object) -> None:
    """Another dataset has its name, with the same attributes."""
    attributes = {
        key: value for key, value in file[name].attrs.items() if key in ("checksum", "units", "flag_values")
    }
    del file[name]
    new = file.create_dataset(name, **how)
    for key, value in attributes.items():
        new.attrs[key] = value


def make_text(file: h5py.File, name: str) -> None:
    """Text in place of numbers."""
    replace(file, name, data=np.array(["one", "two"], dtype=h5py.string_dtype()))


def make_numbers(file: h5py.File, name: str) -> None:
    """Numbers in place of text."""
    replace(file, name, data=np.arange(3.0))


def make_scalar(file: h5py.File, name: str) -> None:
    """One value without a dimension."""
    replace(file, name, data=np.float64(np.nan))


def make_empty(file: h5py.File, name: str) -> None:
    """No values."""
    replace(file, name, shape=(0,), dtype="f8")


def make_null(file: h5py.File, name: str) -> None:
    """A dataspace without values."""
    replace(file, name, data=h5py.Empty("f8"))


def make_huge(file: h5py.File, name: str) -> None:
    """More values than any memory holds, none of them stored."""
    replace(file, name, shape=(2**31, 2**31), dtype="f8", chunks=(1024, 1024))


def make_other_rank(file: h5py.File, name: str) -> None:
    """A dimension more."""
    replace(file, name, data=np.zeros((2, 3, 4, 1), dtype="i2"))


def make_compound(file: h5py.File, name: str) -> None:
    """A type that no file of Separatrix has."""
    replace(file, name, data=np.zeros(3, dtype=[("a", "f8"), ("b", "i4")]))


def make_group(file: h5py.File, name: str) -> None:
    """A group in place of a dataset."""
    del file[name]
    file.create_group(name)


def fill(file: h5py.File, name: str, value: float) -> None:
    """The same dataset with other values."""
    file[name][...] = value


def fill_nan(file: h5py.File, name: str) -> None:
    """Not a number everywhere."""
    fill(file, name, np.nan)


def fill_large(file: h5py.File, name: str) -> None:
    """The largest value of the type."""
    kind = file[name].dtype
    fill(file, name, np.finfo(kind).max if kind.kind == "f" else np.iinfo(kind).max)


def fill_negative(file: h5py.File, name: str) -> None:
    """Codes below the table."""
    fill(file, name, -7)


def fill_text(file: h5py.File, name: str) -> None:
    """Another text."""
    file[name][...] = "\u00e9[[[ = nan"


OBJECT_CHANGES = [
    *(remove, make_text, make_numbers, make_scalar, make_empty, make_null, make_huge, make_other_rank),
    *(make_compound, make_group, fill_nan, fill_large, fill_negative, fill_text),
]


def drop(file: h5py.File, name: str, key: str) -> None:
    """The attribute is not there."""
    del file[name].attrs[key]


def set_to(value: object) -> Callable:
    """The attribute has another value."""

    def change(file: h5py.File, name: str, key: str) -> None:
        del file[name].attrs[key]
        file[name].attrs[key] = value

    return change


ATTRIBUTE_CHANGES = [
    drop,
    set_to("text"),
    set_to(np.float64(np.nan)),
    set_to(np.zeros(0)),
    set_to(h5py.Empty("f8")),
    set_to(np.array([1, 2, 3], dtype="i8")),
    set_to(np.array([b"fixed"], dtype="S5")),
    set_to(np.array(["a", "b"], dtype=h5py.string_dtype())),
]
