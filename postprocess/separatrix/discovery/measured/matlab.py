# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in arrays of MATLAB (.mat, all versions) and NumPy (.npz): t, x, ... and keys as variables."""

from pathlib import Path

import h5py
import numpy as np
from scipy.io import loadmat

from separatrix.discovery.measured.arrays import Found


def read_mat(path: Path) -> Found:
    """A .mat file of version 5; those of 7.3 are HDF5."""
    found = loadmat(path, squeeze_me=True, struct_as_record=True)
    return Found({key: value for key, value in found.items() if not key.startswith("__")})


def read_mat73(path: Path) -> Found:
    """A .mat file of version 7.3."""
    with h5py.File(path) as file:
        return Found({name: _of_matlab(file[name]) for name in file if not name.startswith("#")})


def read_npz(path: Path) -> Found:
    """Arrays written by numpy.savez."""
    with np.load(path, allow_pickle=False) as file:
        return Found({name: file[name] for name in file.files})


def _of_matlab(node: h5py.Dataset | h5py.Group) -> object:
    """A variable as MATLAB writes it into HDF5: texts are numbers of characters, structures are groups."""
    if isinstance(node, h5py.Group):
        return {name: _of_matlab(node[name]) for name in node}
    if node.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, np.asarray(node[()], int).ravel(order="F")))
    return node[()]
