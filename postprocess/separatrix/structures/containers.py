# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files with several named arrays: MATLAB .mat of all versions, NumPy and SciPy .npz and .npy, Nastran op4.

Their readers are those of others, so they run in a process of their own.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import h5py
import numpy as np
from scipy import io, sparse

from separatrix.errors import SeparatrixError
from separatrix.extras import library
from separatrix.trial import read_apart

# Names of matrices, in the order in which they are looked for.
_USUAL = {
    "mass": ("mass", "M", "MAA", "MXX", "MGG", "Mr"),
    "stiffness": ("stiffness", "K", "KAA", "KXX", "KGG", "Kr"),
    "damping": ("damping", "C", "D", "BAA", "BXX", "BGG", "Cr"),
}

# The name of a matrix that is alone in its file.
ALONE = ""


def read_containers(path: Path) -> dict[str, sparse.coo_array]:
    """Return the real matrices of a file by name; those of a structure are "STRUCTURE.NAME"."""
    return read_apart(path, "structure", lambda: _READERS[path.suffix.lower()](path))


def find_matrix(
    content: Mapping[str, sparse.coo_array], path: Path, role: str, name: str | None, required: bool
) -> sparse.csr_array | None:
    """Return the matrix of a role, None if there is none and none is required."""
    if ALONE in content:
        return sparse.csr_array(content[ALONE])
    wanted = [name] if name else _USUAL[role]
    for key in wanted:
        # as it is, else inside a structure
        for part in (lambda one: one, lambda one: one.rpartition(".")[2]):
            found = [one for one in content if part(one).lower() == key.lower()]
            exact = [one for one in found if part(one) == key]
            found = exact if len(exact) == 1 else found
            if len(found) > 1:
                raise SeparatrixError(
                    f"{path}: found {', '.join(found)}, allowed one {role} matrix: --names {role}=NAME"
                )
            if found:
                return sparse.csr_array(content[found[0]])
    if name or required:
        raise SeparatrixError(
            f"{path}: no {role} matrix named {' or '.join(wanted)}; "
            f"found {', '.join(content) or 'no matrix'} (--names {role}=NAME)"
        )
    return None


def _matlab(path: Path) -> dict[str, sparse.coo_array]:
    if h5py.is_hdf5(path):
        with h5py.File(path) as file:
            return dict(_of_hdf5("", file))
    return dict(_of_arrays("", io.loadmat(path)))


def _of_arrays(above: str, content: Mapping[str, object]) -> Iterator[tuple[str, sparse.coo_array]]:
    """Give the matrices among arrays and MATLAB structures."""
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            one = value.reshape(-1)[0]
            yield from _of_arrays(f"{above}{name}.", {key: one[key] for key in value.dtype.names})
        elif sparse.issparse(value) or (isinstance(value, np.ndarray) and value.ndim == 2):
            matrix = _real(above + name, value)
            if matrix is not None:
                yield above + name, matrix


def _of_hdf5(above: str, group: h5py.Group) -> Iterator[tuple[str, sparse.coo_array]]:
    """Give the matrices as MATLAB writes them into HDF5: transposed, sparse ones as groups."""
    for name, node in group.items():
        if name.startswith("#"):
            continue
        if isinstance(node, h5py.Group) and "MATLAB_sparse" in node.attrs:
            starts = node["jc"][()].astype(np.int64)
            shape = (int(node.attrs["MATLAB_sparse"]), len(starts) - 1)
            none = np.zeros(0)
            values, rows = (node[part][()] if part in node else none for part in ("data", "ir"))
            value = sparse.csc_array((values, rows.astype(np.int64), starts), shape=shape)
        elif isinstance(node, h5py.Group):
            yield from _of_hdf5(f"{above}{name}.", node)
            continue
        elif node.ndim == 2 and "MATLAB_empty" not in node.attrs:
            value = node[()].T
        else:
            continue
        matrix = _real(above + name, value)
        if matrix is not None:
            yield above + name, matrix


def _numpy(path: Path) -> dict[str, sparse.coo_array]:
    content = np.load(path, allow_pickle=False)
    if isinstance(content, np.ndarray):
        return {ALONE: _checked(content)}
    if {"format", "shape", "data"} <= set(content.files):
        return {ALONE: _checked(sparse.load_npz(path))}
    return dict(_of_arrays("", {name: content[name] for name in content.files}))


def _checked(value: object) -> sparse.coo_array:
    matrix = _real("the matrix", value)
    if matrix is None or matrix.ndim != 2:
        raise SeparatrixError(f"found an array of {np.shape(value)}, allowed a matrix of numbers")
    return matrix


def _op4(path: Path) -> dict[str, sparse.coo_array]:
    """Read a Nastran op4 file, binary or text."""
    op4 = library("pyyeti.nastran.op4", path, "formats")
    return dict(_of_arrays("", op4.read(str(path))))


def _real(name: str, value: object) -> sparse.coo_array | None:
    """Return a matrix of real numbers; None for texts and lists of others."""
    if np.dtype(value.dtype).kind not in "fiubc":
        return None
    if hasattr(value, "check_format"):
        # Indices outside the matrix would be read later.
        value.check_format(full_check=True)
    matrix = sparse.coo_array(value)
    if np.iscomplexobj(matrix.data):
        if matrix.data.imag.any():
            raise SeparatrixError(f"'{name}': found complex numbers, allowed real ones")
        matrix = matrix.real
    return matrix.astype(float)


_READERS = {".mat": _matlab, ".npz": _numpy, ".npy": _numpy, ".op4": _op4, ".dat": _op4}
CONTAINERS = tuple(_READERS)
