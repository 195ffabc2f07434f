# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in the files of any program: which reader a file has, by its content or the end of its name."""

from collections.abc import Callable, Mapping
from pathlib import Path

from separatrix.discovery.measured.arrays import Found, table_of
from separatrix.discovery.measured.hdf5 import read_hdf5
from separatrix.discovery.measured.keys_file import read_keys
from separatrix.discovery.measured.lvm import BEGIN, read_lvm
from separatrix.discovery.measured.matlab import read_mat, read_mat73, read_npz
from separatrix.discovery.measured.mdf import read_mdf
from separatrix.discovery.measured.tables import READ, Table, is_text, read_csv
from separatrix.discovery.measured.tdms import read_tdms
from separatrix.discovery.measured.uff import read_uff
from separatrix.discovery.measured.wav import read_wav
from separatrix.errors import NO_INPUT, SeparatrixError
from separatrix.extras import library
from separatrix.trial import read_apart

_HDF5 = b"\x89HDF\r\n\x1a\n"
# bytes that MATLAB puts before HDF5
_MATLAB_HEAD = 512
# what each kind of file begins with
_BEGINS = {b"TDSm": "TDMS", b"MDF ": "MDF", b"UnFinMF ": "MDF", BEGIN.encode(): "LVM", b"    -1": "UFF"}
_WAVE = (b"RIFF", b"RIFX", b"RF64")
_ENDINGS = {".npz": "NumPy", ".uff": "UFF", ".unv": "UFF", ".uf58": "UFF", ".mat": "MATLAB"}
_ENDINGS |= {".tdms": "TDMS", ".mf4": "MDF", ".mdf": "MDF", ".lvm": "LVM", ".wav": "WAV"}
_ENDINGS |= {".h5": "HDF5", ".hdf5": "HDF5", ".nc": "HDF5"}
_READERS: Mapping[str, Callable[[Path, Mapping[str, str]], Found]] = {
    "NumPy": lambda path, _: read_npz(path),
    "MATLAB": lambda path, _: read_mat(path),
    "MATLAB 7.3": lambda path, _: read_mat73(path),
    "UFF": read_uff,
    "TDMS": read_tdms,
    "MDF": read_mdf,
    "LVM": read_lvm,
    "WAV": read_wav,
}
# packages of others, and the extra that brings them
_PACKAGES = {"UFF": ("pyuff", "formats"), "TDMS": ("nptdms", "formats"), "MDF": ("asammdf", "mdf")}


def read_table(path: Path) -> Table:
    """Read one file of any kind; an unreadable one is refused with line and reason."""
    if path.is_dir():
        raise SeparatrixError(f"{path}: a folder, expected a record", NO_INPUT)
    if not path.is_file():
        raise SeparatrixError(f"{path}: no such file", NO_INPUT)
    user, kind = read_keys(path), _kind(path)
    if kind in _READERS:
        if kind in _PACKAGES:
            # before a process of its own, which would have to import it each time
            library(_PACKAGES[kind][0], path, _PACKAGES[kind][1])
        table = read_apart(path, kind, lambda: table_of(path, _READERS[kind](path, user.names), user.names))
        return user.added_to(table)
    if user.names:
        raise SeparatrixError(
            f"{user.path}: 'columns' is for files of channels; name the columns in {path.name}"
        )
    return user.added_to(
        read_apart(path, kind, lambda: read_hdf5(path)) if kind == "HDF5" else read_csv(path)
    )


def _kind(path: Path) -> str:
    """Kind of a file, by its content, else by the end of its name."""
    with path.open("rb") as file:
        begin = file.read(_MATLAB_HEAD + 8)
    ending = _ENDINGS.get(path.suffix.lower(), "")
    if _HDF5 in (begin[:8], begin[_MATLAB_HEAD:]):
        return "MATLAB 7.3" if ending == "MATLAB" else "HDF5"
    for mark, kind in _BEGINS.items():
        if begin.startswith(mark):
            return kind
    if begin[:4] in _WAVE and begin[8:12] == b"WAVE":
        return "WAV"
    if ending:
        return ending
    if not is_text(path):
        raise SeparatrixError(f"{path}: a file of an unknown kind; supported are {READ}")
    return "CSV"
