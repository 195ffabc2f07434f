# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Calls of libseparatrix: where it is, what its functions answer, arrays as it reads them."""

import ctypes
import functools
import os
import shutil
from pathlib import Path

import numpy as np

from separatrix.errors import CaseError
from separatrix.program import NATIVE, SOURCE_TREE

#: Characters of a text that the library writes.
TEXT = 4096


def library_path() -> Path:
    """Return where the library is: $SEPARATRIX_LIBRARY, in this package, beside the program, in build/lib."""
    asked = os.environ.get("SEPARATRIX_LIBRARY")
    if asked:
        return Path(asked)
    program = shutil.which("separatrix")
    folders = [NATIVE / "lib"]
    folders += [Path(program).resolve().parent.parent / "lib"] if program else []
    folders.append(SOURCE_TREE / "build" / "lib")
    for folder in folders:
        path = folder / "libseparatrix.so"
        if path.is_file():
            return path
    tried = ", ".join(str(folder) for folder in folders)
    raise CaseError(
        f"no libseparatrix.so in {tried}; build it (cmake --build build --target separatrix_library) "
        "or name it in SEPARATRIX_LIBRARY"
    )


@functools.cache
def loaded() -> ctypes.CDLL:
    """Return the library; a CaseError if there is none that can be loaded."""
    path = library_path()
    try:
        library = ctypes.CDLL(str(path))
    except OSError as reason:
        raise CaseError(f"{path}: cannot be loaded: {reason}") from reason
    library.separatrix_model_free.restype = None
    return library


def call(name: str, *arguments: object) -> None:
    """Call a function that ends with a buffer for its message; refusals become a CaseError."""
    message = ctypes.create_string_buffer(TEXT)
    code = getattr(loaded(), name)(*arguments, message, size_of(message))
    if code:
        raise CaseError(message.value.decode(errors="replace"), code)


def size_of(buffer: ctypes.Array) -> ctypes.c_size_t:
    """Return the characters of a buffer, as the library takes them."""
    return ctypes.c_size_t(len(buffer))


def array_of(values: np.ndarray, shape: tuple[int, ...], name: str) -> np.ndarray:
    """Return values as a contiguous array of doubles; a CaseError if it has another shape."""
    array = np.ascontiguousarray(values, float)
    if array.shape != shape:
        raise CaseError(f"{name}: found shape {array.shape}, allowed {shape}")
    return array


def pointer(array: np.ndarray | None) -> ctypes.c_void_p | None:
    """Return where the numbers of an array are; None where there is none."""
    return None if array is None else ctypes.c_void_p(array.ctypes.data)
