# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of a function: its values at knots, and what the records alone know of them."""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.members import Member
from separatrix.discovery.policy import FIT


@dataclass
class Part:
    """A function by its values at knots, with their covariance, and the information of the records alone.

    `information` and `gradient` are of a quadratic misfit about `centre`: d^T information d - 2 d^T gradient.
    """

    name: str
    at: np.ndarray
    value: np.ndarray
    covariance: np.ndarray
    information: np.ndarray
    gradient: np.ndarray
    centre: np.ndarray

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the values."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0))


def misfit_rows(part: Part) -> tuple[np.ndarray, np.ndarray]:
    """Rows of residuals whose squares are the misfit of a function to the records, and their zero.

    Directions that the records do not determine are left out.
    """
    size = np.sqrt(np.maximum(np.diag(part.information), 1e-300))
    values, vectors = np.linalg.eigh(part.information / np.outer(size, size))
    kept = values > FIT.function_unknown * values[-1]
    rows = (np.sqrt(values[kept])[:, None] * vectors[:, kept].T) * size
    offset = (vectors[:, kept].T @ (part.gradient / size)) / np.sqrt(values[kept])
    return rows, rows @ part.centre + offset


def series_part(fitted: Fitted, member: Member) -> Part:
    """A series of harmonics by its values over a turn."""
    at = np.linspace(0, 2 * np.pi, FIT.series_points)
    paths = [one.path for one in fitted.problem.free]
    columns, indices = [], []
    for key, wave in zip(member.values, (np.cos, np.sin), strict=True):
        for index, path in enumerate(paths):
            if path.startswith(f"effect.{member.effect}.{key}["):
                indices.append(index)
                columns.append(wave(int(path.split("[")[1][:-1]) * at))
    basis = np.column_stack(columns)
    covariance = basis @ fitted.covariance[np.ix_(indices, indices)] @ basis.T
    none = np.zeros((at.size, at.size))
    return Part("", at, basis @ fitted.fit.values[indices], covariance, none, none[0], 0 * at)
