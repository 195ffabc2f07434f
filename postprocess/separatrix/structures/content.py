# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A structure as matrices or as modes, with the names of its coordinates and of its points."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from separatrix.errors import SeparatrixError
from separatrix.structures.lines import number

# Directions of a node as tools number them.
_DIRECTIONS = {"x": "1", "y": "2", "z": "3", "rx": "4", "ry": "5", "rz": "6"}
_NAME = re.compile(r"[A-Za-z0-9_-]*[A-Za-z_-][A-Za-z0-9_-]*")

# Largest number of a matrix: what is computed with it stays finite.
_LARGEST = 1e100

Row = np.ndarray


@dataclass
class Matrices:
    """M q'' + C q' + K q; `labels` name the coordinates as the tool does, "NODE:DIRECTION" or numbers."""

    mass: sparse.csr_array
    stiffness: sparse.csr_array
    damping: sparse.csr_array | None = None
    labels: list[str] = field(default_factory=list)
    points: dict[str, Row] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Sparse, square, of one size, symmetric."""
        size = np.shape(self.mass)[0]
        for name in ("mass", "stiffness", "damping"):
            if getattr(self, name) is None:
                continue
            matrix = sparse.csr_array(getattr(self, name))
            if np.iscomplexobj(matrix.data) and matrix.data.imag.any():
                raise SeparatrixError(f"{name}: found complex numbers, allowed real ones")
            matrix = matrix.real.astype(float)
            setattr(self, name, matrix)
            if size == 0:
                raise SeparatrixError(f"{name}: found no coordinate, allowed a matrix of at least one")
            if matrix.shape != (size, size):
                raise SeparatrixError(
                    f"{name}: found a matrix of {matrix.shape[0]} x {matrix.shape[1]}, "
                    f"allowed {size} x {size} like the mass matrix"
                )
            if not np.isfinite(matrix.data).all():
                raise SeparatrixError(f"{name}: found a number that is not finite")
            largest = abs(matrix).max() if matrix.nnz else 0.0
            if largest > _LARGEST:
                raise SeparatrixError(f"{name}: found {largest:g}, allowed at most {_LARGEST:g}")
            if name != "damping" and abs(matrix - matrix.T).max() > 1e-10 * largest:
                raise SeparatrixError(f"{name}: found a matrix that is not symmetric")
        if not self.labels:
            self.labels = [str(number + 1) for number in range(size)]

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.mass.shape[0]

    def without(self, held: np.ndarray) -> "Matrices":
        """Return the structure with coordinates (their numbers) held at zero."""
        free = np.setdiff1d(np.arange(self.size), held)
        damping = None if self.damping is None else self.damping[free][:, free]
        return Matrices(
            self.mass[free][:, free],
            self.stiffness[free][:, free],
            damping,
            [self.labels[number] for number in free],
            {name: row[free] for name, row in self.points.items()},
        )

    def row_of(self, point: str) -> Row:
        """Return the row of a point: a coordinate, or a weighted sum "0.5*12:y+0.5*13:y"."""
        return _row(point, self.labels, lambda number: _unit(number, self.size), self.size)


@dataclass
class Modes:
    """Mass-normalised modes: frequencies [Hz], damping ratios, displacements of points in each mode."""

    frequency: np.ndarray
    damping_ratio: np.ndarray | None = None
    damping: np.ndarray | None = None
    shapes: dict[str, Row] = field(default_factory=dict)
    points: dict[str, Row] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of modes."""
        return len(self.frequency)

    def row_of(self, point: str) -> Row:
        """Return the displacement of a point in each mode."""
        names = list(self.shapes)
        return _row(point, names, lambda number: self.shapes[names[number]], self.size)


def add_points(structure: Matrices | Modes, points: Mapping[str, str]) -> None:
    """Name points: `{"tip": "12:y"}`."""
    for name, point in points.items():
        if not _NAME.fullmatch(name):
            raise SeparatrixError(
                f"--point {name}={point}: found the name '{name}', allowed letters, digits, _ and -,"
                " with a letter"
            )
        structure.points[name] = structure.row_of(point)


def _unit(number: int, size: int) -> Row:
    row = np.zeros(size)
    row[number] = 1
    return row


def _row(point: str, labels: Sequence[str], row_of: Callable[[int], Row], size: int) -> Row:
    """Sum the terms of a point."""
    total = np.zeros(size)
    words = point.replace(" ", "")
    terms = re.findall(r"[+-]?[^+-]+(?:[eE][+-]\d+[^+-]*)?", words)
    if "".join(terms) != words:
        raise SeparatrixError(f"'{point}': found a sign without a term, allowed a sum like 0.5*12:y-0.5*13:y")
    for term in terms:
        factor, star, label = term.rpartition("*")
        sign = -1.0 if not star and label.startswith("-") else 1.0
        label = _in_numbers(label.lstrip("+-"))
        weight = number(factor) if star else sign
        if weight is None:
            raise SeparatrixError(
                f"'{point}': found '{factor}', allowed a finite number with a decimal point"
            )
        times = labels.count(label)
        if times == 0:
            near = ", ".join(labels[:6]) + (", ..." if len(labels) > 6 else "")
            raise SeparatrixError(f"'{point}': there is no coordinate '{label}', allowed {near}")
        if times > 1:
            raise SeparatrixError(
                f"'{point}': found {times} coordinates with the label '{label}', allowed a label of one: the "
                "inner motions of an element, or a beam as a solid"
            )
        total += weight * row_of(labels.index(label))
    if not np.any(total):
        raise SeparatrixError(f"'{point}': found a point that no coordinate moves, allowed one that moves")
    return total


def _in_numbers(label: str) -> str:
    """Return "12:2" for "12:y"."""
    node, colon, direction = label.partition(":")
    return node + colon + _DIRECTIONS.get(direction.lower(), direction)
