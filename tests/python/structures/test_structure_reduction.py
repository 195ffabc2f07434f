# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Masses of elements of reduced integration: of too low a rank, without a zero on the diagonal."""

import numpy as np
import pytest
from scipy import linalg, sparse
from separatrix.errors import SeparatrixError
from separatrix.structures import Matrices, craig_bampton, modal, reduction
from separatrix.structures.cli import main


def _membrane(side, held=True):
    """A membrane of square elements, whose masses have one point of integration."""
    count = side + 1
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    stiffness, mass = np.zeros((2, count**2, count**2))
    element = np.array([[4, -1, -2, -1], [-1, 4, -1, -2], [-2, -1, 4, -1], [-1, -2, -1, 4]]) / 6
    for i in range(side):
        for j in range(side):
            nodes = np.ravel_multi_index((corners + [i, j]).T, (count, count))
            stiffness[np.ix_(nodes, nodes)] += element
            mass[np.ix_(nodes, nodes)] += np.full((4, 4), 1 / 16 / side**2)
    free = np.arange(count if held else 0, count**2)
    points = {"tip": np.eye(len(free))[-1], "mid": np.eye(len(free))[len(free) // 2]}
    return Matrices(mass[np.ix_(free, free)], stiffness[np.ix_(free, free)], points=points)


def _finite(structure):
    """Squared frequencies of the motions that have mass, ascending, by M u = u K u / w^2."""
    inverse = linalg.eigh(structure.mass.toarray(), structure.stiffness.toarray(), eigvals_only=True)
    return np.sort(1 / inverse[inverse > 1e-10 * inverse[-1]])


@pytest.mark.parametrize("dense", [1500, 20])
def test_modes_of_masses_of_low_rank(dense, monkeypatch):
    """Dense and by shift and invert; a floating one has its rigid motion, and none is invented."""
    monkeypatch.setattr(reduction, "_DENSE", dense)
    structure = _membrane(9)
    shares = np.linalg.eigvalsh(structure.mass.toarray())
    assert np.all(structure.mass.diagonal() > 0)
    assert np.sum(shares > 1e-12 * shares[-1]) < structure.size
    wanted = np.sqrt(_finite(structure)) / (2 * np.pi)
    found = modal(structure, 6)
    assert found.frequency == pytest.approx(wanted[:6], rel=1e-8)
    every = modal(structure, structure.size)
    assert every.frequency == pytest.approx(wanted, rel=1e-6)
    free = modal(_membrane(9, held=False), 3)
    assert free.frequency[0] == 0
    assert free.frequency[1] == pytest.approx(0.5, rel=0.02)


def test_craig_bampton_of_masses_of_low_rank():
    """The lowest frequencies come from above; the flexibility of the points is exact."""
    structure = _membrane(6)
    reduced = craig_bampton(structure, 8)
    wanted = _finite(structure)
    assert np.sort(_finite(reduced))[:3] == pytest.approx(wanted[:3], rel=1e-3)
    before, after = reduction.flexibility(structure), reduction.flexibility(reduced)
    assert after == pytest.approx(before, rel=1e-9)


def test_masses_that_are_none(tmp_path, capsys):
    """An indefinite mass is refused, and a singular one without reduction; rounded to 14 digits too."""
    structure = _membrane(2)
    mass = np.array([[float(f"{value:.13e}") for value in row] for row in structure.mass.toarray()])
    rounded = Matrices(mass, structure.stiffness, points=structure.points)
    assert modal(rounded, 3).frequency == pytest.approx(modal(structure, 3).frequency, rel=1e-9)
    np.savez(tmp_path / "s.npz", M=mass, K=structure.stiffness.toarray())
    words = [str(tmp_path / "s.npz"), "--point", "tip=6", "-o", str(tmp_path / "s.h5")]
    assert main(words) == 65
    assert "--reduce modal leaves out what has no mass" in capsys.readouterr().err
    assert main([*words, "--reduce", "modal", "--modes", "4"]) == 0
    for wrong, message in (
        (np.array([[1.0, 2.0], [2.0, 1.0]]), "indefinite"),
        (np.array([[1.0, 0.0], [0.0, -1.0]]), "indefinite"),
    ):
        with pytest.raises(SeparatrixError, match=message):
            modal(Matrices(wrong, sparse.eye_array(2)), 1)
    with pytest.raises(SeparatrixError, match="neither mass nor stiffness"):
        modal(Matrices(np.ones((2, 2)), np.ones((2, 2))), 1)
