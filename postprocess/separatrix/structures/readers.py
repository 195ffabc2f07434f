# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Matrices out of the files that engineers' tools write, by the ends of their names."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
from scipy import sparse

from separatrix.errors import BAD_DATA, DAMAGE, NO_INPUT, SeparatrixError, why_absent
from separatrix.structures.containers import ALONE, CONTAINERS, find_matrix, read_containers
from separatrix.structures.content import Matrices
from separatrix.structures.harwell_boeing import read_harwell_boeing
from separatrix.structures.matrix_market import is_matrix_market, read_matrix_market
from separatrix.structures.solvers import CALCULIX, read_abaqus, read_calculix

Reader = Callable[[Path], Mapping[str, sparse.coo_array]]

ROLES = ("mass", "stiffness", "damping")
_MATRIX_MARKET = (".mtx", ".mm")
_HARWELL_BOEING = (".hb", ".rb", ".rsa", ".rua", ".matrix")
_CALCULIX = (*CALCULIX.values(), ".dof")
WHAT_IS_READ = (
    "Matrix Market or Abaqus .mtx .mm, Harwell-Boeing .hb .rb .rsa .rua .matrix, CalculiX .sti .mas, "
    "MATLAB .mat, NumPy and SciPy .npy .npz, Nastran .op4, universal files of modes .uff .unv .u55"
)
# What Abaqus adds to the stiffness of a coordinate that is held.
_HELD = 1e30


def read_matrices(
    files: Mapping[str, str | Path], names: Mapping[str, str] | None = None, both: str | Path | None = None
) -> Matrices:
    """Read `files` = {"mass": ..., "stiffness": ..., "damping": ...}, or all of them out of one file `both`.

    `names` are the names of the matrices in a file with several.
    """
    found, labels = {}, []
    read = cache(read_containers)
    if both is not None and _holds_one(Path(both), read):
        raise SeparatrixError(f"{both}: holds one matrix, allowed with --mass, --stiffness or --damping")
    for role in ROLES:
        path = files.get(role) or _file_of(role, both)
        if path is None:
            continue
        name, required = (names or {}).get(role), role != "damping" or role in files
        matrix, own = _matrix(Path(path), read, role, name, required)
        if matrix is None:
            continue
        if labels and own and own != labels:
            every = _all_labels(Path(path), labels, own)
            found = {key: _placed(value, labels, every) for key, value in found.items()}
            matrix, labels = _placed(matrix, own, every), every
        found[role], labels = matrix, labels or own
    for role in ("mass", "stiffness"):
        if role not in found:
            raise SeparatrixError(f"no {role} matrix is given; see separatrix-structure --help")
    structure = Matrices(**found, labels=labels)
    # Abaqus holds by a very large stiffness.
    return structure.without(np.flatnonzero(structure.stiffness.diagonal() >= _HELD))


def _holds_one(path: Path, read: Reader) -> bool:
    """Whether a file cannot hold several matrices, or does not."""
    suffix = path.suffix.lower()
    if suffix in CONTAINERS and path.is_file():
        return ALONE in read(path)
    return suffix in (*_MATRIX_MARKET, *_HARWELL_BOEING)


def _file_of(role: str, both: str | Path | None) -> Path | None:
    """Return where a role is out of one file for all; CalculiX writes several of one name."""
    if both is None or Path(both).suffix.lower() not in _CALCULIX:
        return None if both is None else Path(both)
    return Path(both).with_suffix(CALCULIX[role]) if role in CALCULIX else None


def _all_labels(path: Path, one: list[str], other: list[str]) -> list[str]:
    """Return the labels of both, by node and direction."""
    if len(set(one)) < len(one) or len(set(other)) < len(other):
        raise SeparatrixError(
            f"{path}: found other labels of coordinates, some of them twice, allowed the same"
        )
    return sorted({*one, *other}, key=lambda label: tuple(int(part) for part in label.split(":")))


def _placed(matrix: sparse.csr_array, labels: list[str], wanted: list[str]) -> sparse.csr_array:
    """Put a matrix among more coordinates."""
    where = {label: row for row, label in enumerate(wanted)}
    rows = np.array([where[label] for label in labels])
    entries = sparse.coo_array(matrix)
    return sparse.csr_array(
        (entries.data, (rows[entries.row], rows[entries.col])), shape=(len(wanted), len(wanted))
    )


def _matrix(
    path: Path, read: Reader, role: str, name: str | None, required: bool
) -> tuple[sparse.csr_array | None, list[str]]:
    """Return a matrix and the labels of its coordinates, none where the file has no names."""
    if not path.is_file():
        raise SeparatrixError(f"{path}: {why_absent(path)}", NO_INPUT)
    suffix = path.suffix.lower()
    try:
        if suffix in _MATRIX_MARKET:
            return (read_matrix_market(path), []) if is_matrix_market(path) else read_abaqus(path)
        if suffix in _HARWELL_BOEING:
            return read_harwell_boeing(path), []
        if suffix in CALCULIX.values():
            return read_calculix(path)
        if suffix in CONTAINERS:
            return find_matrix(read(path), path, role, name, required), []
    except SeparatrixError:
        raise
    except DAMAGE as error:
        raise SeparatrixError(f"{path}: cannot be read as {suffix}: {error}", BAD_DATA) from None
    raise SeparatrixError(f"{path}: found the ending '{suffix}', allowed {WHAT_IS_READ}", BAD_DATA)
