# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Matrices that solvers write as lines of text, with names of the coordinates: Abaqus and CalculiX."""

from pathlib import Path

import numpy as np
from scipy import sparse

from separatrix.errors import SeparatrixError
from separatrix.structures.lines import (
    COMMAS,
    HOW,
    NUMBER,
    WHOLE,
    Rows,
    check_size,
    matrix_of,
    shown,
    text_of,
)

CALCULIX = {"mass": ".mas", "stiffness": ".sti"}


def read_abaqus(path: Path) -> tuple[sparse.csr_array, list[str]]:
    """Read Abaqus *MATRIX OUTPUT, FORMAT=MATRIX INPUT: lines of node, direction, node, direction, number.

    One triangle or both; internal nodes have negative numbers.
    """
    rule = (
        f"a Matrix Market header, or lines of node, direction, node, direction, number ({HOW}; "
        "Abaqus *MATRIX OUTPUT, FORMAT=MATRIX INPUT)"
    )
    rows = Rows(path, text_of(path), 1, (WHOLE, WHOLE, WHOLE, WHOLE, NUMBER), rule, COMMAS)
    if not len(rows.values):
        raise SeparatrixError(f"{path}: found no entry of a matrix, allowed {rule}")
    nodes = rows.values[:, :4].astype(np.int64).reshape(-1, 2)
    keys, indices = np.unique(nodes, axis=0, return_inverse=True)
    ones, others = indices.reshape(-1, 2).T
    shape = (len(keys), len(keys))
    values = rows.values[:, 4]
    matrix = matrix_of(shape, (ones, others, values), "general", rows.refuse)
    # What one triangle lacks is in the other.
    given = sparse.csr_array((np.ones(len(values)), (ones, others)), shape=shape)
    matrix = matrix + (matrix.T - matrix.T.multiply(given))
    return sparse.csr_array(matrix), [f"{node}:{direction}" for node, direction in keys]


def read_calculix(path: Path) -> tuple[sparse.csr_array, list[str]]:
    """Read a .sti or .mas file of CalculiX, *FREQUENCY, SOLVER=MATRIXSTORAGE, and the .dof file beside it.

    One triangle; a line of the .dof file is NODE.DIRECTION of a coordinate. Labels may come back: those of
    beams and of the inner motions of C3D8I.
    """
    rule = f"row, column and number ({HOW})"
    rows = Rows(path, text_of(path), 1, (WHOLE, WHOLE, NUMBER), rule)
    if not len(rows.values):
        raise SeparatrixError(f"{path}: found no entry of a matrix, allowed lines of {rule}")
    indices = rows.values[:, :2].astype(np.int64) - 1
    names = path.with_suffix(".dof")
    size = int(indices.max()) + 1
    labels = []
    if names.is_file():
        labels = _labels(names)
        if size > len(labels):
            raise SeparatrixError(
                f"{path}: found {size} coordinates, allowed {len(labels)} as {names} names (a model with "
                "cyclic symmetry has twice as many and is not read)"
            )
        size = len(labels)
    check_size(str(path), size, size)
    return matrix_of((size, size), (*indices.T, rows.values[:, 2]), "symmetric", rows.refuse), labels


def _labels(path: Path) -> list[str]:
    """Return "NODE:DIRECTION" of each line NODE.DIRECTION."""
    labels = []
    for number, line in enumerate(text_of(path).split(b"\n")[:-1], 1):
        node, point, direction = line.strip().decode(errors="replace").partition(".")
        if not point or not node.isdecimal() or direction not in tuple("0123456"):
            raise SeparatrixError(f"{path}:{number}: found {shown(line)}, allowed NODE.DIRECTION")
        labels.append(f"{node}:{direction}")
    return labels
