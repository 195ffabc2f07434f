# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fewer coordinates: coordinates without mass condensed, modes, Craig and Bampton's substructures."""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse import linalg as sparse_linalg

from separatrix.errors import SeparatrixError
from separatrix.structures.content import Matrices, Modes

# Above it only the wanted modes are computed, by shift and invert.
_DENSE = 1500
# A mass of a coordinate below this share of the largest is none.
_NONE = 1e-12
# A squared frequency below this share of the largest of those asked for is that of a rigid motion.
_RIGID = 1e-9
# A mass of a motion below this share of the largest is none; the rounding of 14 digits stays below it.
NO_MASS = 1e-12


@dataclass
class Check:
    """Static flexibility of a point [m/N] after and before a reduction; NaN where the structure floats."""

    name: str
    kept: float
    full: float


def hold(structure: Matrices, coordinates: list[str]) -> Matrices:
    """Hold coordinates at zero."""
    held = set()
    for coordinate in coordinates:
        held |= set(np.flatnonzero(structure.row_of(coordinate)))
    if len(held) == structure.size:
        raise SeparatrixError("--hold: nothing is left that moves")
    return structure.without(np.array(sorted(held), dtype=int))


def condense(structure: Matrices) -> Matrices:
    """Take out coordinates without mass: they follow the others at rest (exact but for their dampers)."""
    largest = abs(structure.mass).max()
    light = np.array(abs(structure.mass).sum(axis=1)).ravel() <= _NONE * largest
    if not light.any():
        return structure
    if light.all():
        raise SeparatrixError("mass: found no coordinate with mass")
    masters, slaves = np.flatnonzero(~light), np.flatnonzero(light)
    try:
        block = structure.stiffness[slaves][:, slaves].toarray()
        with warnings.catch_warnings():
            warnings.simplefilter("error", linalg.LinAlgWarning)
            follow = -linalg.solve(block, structure.stiffness[slaves][:, masters].toarray(), assume_a="sym")
    except (linalg.LinAlgError, linalg.LinAlgWarning):
        names = ", ".join(structure.labels[number] for number in slaves[:6])
        raise SeparatrixError(
            f"mass: found coordinates with neither mass nor stiffness of their own: {names}"
        ) from None
    change = np.zeros((structure.size, len(masters)))
    change[masters, np.arange(len(masters))] = 1
    change[slaves] = follow
    return _changed(structure, change, [structure.labels[number] for number in masters])


def _changed(structure: Matrices, change: np.ndarray, labels: list[str]) -> Matrices:
    """Return the structure in other coordinates, q = change y."""

    def turned(matrix: sparse.csr_array) -> np.ndarray:
        result = change.T @ (matrix @ change)
        return (result + result.T) / 2

    return Matrices(
        sparse.csr_array(turned(structure.mass)),
        sparse.csr_array(turned(structure.stiffness)),
        None if structure.damping is None else sparse.csr_array(change.T @ (structure.damping @ change)),
        labels,
        {name: row @ change for name, row in structure.points.items()},
    )


def undamped_modes(structure: Matrices, count: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the squared angular frequencies, ascending, and mass-normalised shapes (columns)."""
    size = structure.size
    count = size if count is None else min(count, size)
    try:
        if np.any(structure.mass.diagonal() <= 0):
            raise SeparatrixError("mass: found an indefinite matrix, allowed a positive semidefinite one")
        if size <= _DENSE or count > size // 2:
            squares, shapes = _dense_modes(structure.stiffness.toarray(), structure.mass.toarray(), count)
        else:
            # a small negative shift: a structure that floats has a singular stiffness
            shift = -1e-6 * abs(structure.stiffness.diagonal()).max() / abs(structure.mass.diagonal()).max()
            squares, shapes = sparse_linalg.eigsh(
                sparse.csc_array(structure.stiffness), count, sparse.csc_array(structure.mass), sigma=shift
            )
            order = np.argsort(squares)
            squares, shapes = squares[order], shapes[:, order]
    except (linalg.LinAlgError, RuntimeError) as error:
        raise SeparatrixError(f"mass: found a singular or indefinite matrix: {error}") from None
    squares = np.where(np.abs(squares) <= _RIGID * np.abs(squares).max(), 0.0, squares)
    if squares[0] < 0:
        raise SeparatrixError("stiffness: found an indefinite matrix, allowed a positive semidefinite one")
    # the sign of a shape is free: largest entry positive, so that two runs give one file
    signs = np.sign(shapes[np.abs(shapes).argmax(axis=0), np.arange(shapes.shape[1])])
    return squares, shapes * np.where(signs == 0, 1, signs)


def smallest_share(mass: np.ndarray) -> float:
    """Return the smallest eigenvalue of a mass matrix, with ones on its diagonal, over the largest."""
    diagonal = np.diagonal(mass)
    if np.any(diagonal <= 0):
        return 0.0
    shares = linalg.eigvalsh(mass / np.sqrt(np.outer(diagonal, diagonal)))
    return float(shares[0] / shares[-1])


def _dense_modes(stiffness: np.ndarray, mass: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest modes, no more than there are motions with mass.

    Elements of reduced integration leave motions without mass that are no coordinates. With them
    M u = m (K + s M) u is solved for K u = w^2 M u; w^2 = 1/m - s is most accurate about the shift s.
    """
    if smallest_share(mass) > NO_MASS:
        return linalg.eigh(stiffness, mass, subset_by_index=(0, count - 1))
    scale = 1 / np.sqrt(np.diagonal(mass))
    shares = linalg.eigvalsh(mass * np.outer(scale, scale))
    if shares[0] < -NO_MASS * shares[-1]:
        raise SeparatrixError(
            f"mass: found an indefinite matrix (smallest share {shares[0] / shares[-1]:.2g}), "
            "allowed a positive semidefinite one"
        )
    size = len(mass)
    count = min(count, int(np.sum(shares > NO_MASS * shares[-1])))
    shift = 1e-6 * np.diagonal(stiffness).max() / np.diagonal(mass).max()
    if smallest_share(stiffness + shift * mass) <= np.finfo(float).eps:
        raise SeparatrixError("mass: found motions with neither mass nor stiffness, or a stiffness below 0")
    for _ in range(2):
        wanted = (size - count, size - 1)
        inverse, shapes = linalg.eigh(mass, stiffness + shift * mass, subset_by_index=wanted)
        squares, shapes = 1 / inverse[::-1] - shift, (shapes / np.sqrt(inverse))[:, ::-1]
        # again about the lowest that is not rigid
        elastic = squares[squares > _RIGID * squares[-1]]
        shift = elastic[0] if len(elastic) else shift
    return squares, shapes


def modal(structure: Matrices, count: int) -> Modes:
    """Keep the `count` lowest modes."""
    structure = condense(structure)
    squares, shapes = undamped_modes(structure, count)
    damping = None if structure.damping is None else shapes.T @ (structure.damping @ shapes)
    return Modes(
        np.sqrt(squares) / (2 * np.pi),
        None,
        damping,
        {},
        {name: row @ shapes for name, row in structure.points.items()},
    )


def craig_bampton(structure: Matrices, count: int) -> Matrices:
    """Keep the coordinates of the points and the `count` lowest modes of the rest with those held.

    Craig, Bampton, Coupling of substructures for dynamic analyses, AIAA J. 6 (1968). Its static flexibility
    at the points is exact, which modes alone lack.
    """
    structure = condense(structure)
    boundary = sorted({int(number) for row in structure.points.values() for number in np.flatnonzero(row)})
    if not boundary:
        raise SeparatrixError("--reduce craig-bampton: give the points of joints: --point NAME=COORDINATE")
    inner = np.array([number for number in range(structure.size) if number not in set(boundary)], dtype=int)
    change = np.zeros((structure.size, len(boundary)))
    change[boundary, np.arange(len(boundary))] = 1
    if len(inner):
        try:
            factor = sparse_linalg.splu(sparse.csc_array(structure.stiffness[inner][:, inner]))
            follow = -factor.solve(structure.stiffness[inner][:, boundary].toarray())
        except RuntimeError:
            raise SeparatrixError(
                "--reduce craig-bampton: the structure moves freely with its points held; give more points"
            ) from None
        change[inner] = follow
        rest = Matrices(structure.mass, structure.stiffness, None, structure.labels).without(boundary)
        shapes = undamped_modes(rest, count)[1] if count else np.zeros((len(inner), 0))
        change = np.hstack([change, np.zeros((structure.size, shapes.shape[1]))])
        change[inner, len(boundary) :] = shapes
    labels = [structure.labels[number] for number in boundary]
    labels += [f"mode{number + 1}" for number in range(change.shape[1] - len(boundary))]
    return _changed(structure, change, labels)


def flexibility(structure: Matrices | Modes) -> dict[str, float]:
    """Static displacement of each point for one newton there [m/N]; NaN of a structure that floats."""
    if isinstance(structure, Modes):
        squares = (2 * np.pi * structure.frequency) ** 2
        if np.any(squares <= 0):
            return dict.fromkeys(structure.points, np.nan)
        return {name: float(np.sum(row**2 / squares)) for name, row in structure.points.items()}
    try:
        factor = sparse_linalg.splu(sparse.csc_array(structure.stiffness))
        return {name: float(row @ factor.solve(row)) for name, row in structure.points.items()}
    except RuntimeError:
        return dict.fromkeys(structure.points, np.nan)


def checks(full: Matrices, reduced: Matrices | Modes) -> list[Check]:
    """Compare the static flexibility of the points."""
    before, after = flexibility(full), flexibility(reduced)
    return [Check(name, after[name], before[name]) for name in reduced.points]
