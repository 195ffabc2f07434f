# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a flexible machine could still explain: forces that are smooth in speed, position, phase and time.

A family of forces (and of kicks at impacts) is fitted to the residual of a fit, linearised. Under a right
model its gain is a chi^2 of its rank. The family of pieces gives each segment forces of its own and so
detects what no function of the state describes.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.rig import cleaned
from separatrix.discovery.fitting.screen import project
from separatrix.discovery.policy import FIT


@dataclass
class Family:
    """Gain of chi^2 by a family of forces, its rank and its p value."""

    name: str
    gain: float
    rank: int
    p: float


@dataclass
class Ceiling:
    """All families; `p` is corrected for their number."""

    families: list[Family]
    # the fit that they were tried on: without what imperfections of a rig may explain
    fit: Fit

    @property
    def p(self) -> float:
        """Probability that a right model leaves as much to any of the families."""
        return float(min(1.0, len(self.families) * min(one.p for one in self.families)))

    @property
    def closable(self) -> float:
        """Chi^2 that a flexible machine would explain beyond chance."""
        return max(0.0, *(one.gain - one.rank for one in self.families))

    @property
    def mostly(self) -> str:
        """The dependence of a force that explains most of what any force does; '' if none does."""
        free = max(one.gain for one in self.families)
        of_one = [one for one in self.families if one.name != "pieces" and one.gain > FIT.mostly * free]
        return max(of_one, key=lambda one: one.gain).name if of_one else ""


def ceiling(problem: Likelihood, fit: Fit, mass: float) -> Ceiling:
    """Try every family on what imperfections of a rig leave of the residuals of a fit."""
    fit = cleaned(problem, fit)
    families = []
    for name, columns in problem.families(fit, mass).items():
        gain, rank = _gain(fit, columns)
        families.append(Family(name, gain, rank, float(chi2.sf(gain, rank)) if rank else 1.0))
    gain, rank = _piecewise_gain(problem, fit, mass)
    families.append(Family("pieces", gain, rank, float(chi2.sf(gain, rank)) if rank else 1.0))
    return Ceiling(families, fit)


def _gain(fit: Fit, columns: np.ndarray) -> tuple[float, int]:
    p = fit.evaluation.by_parameter.shape[2]
    matrix, gradient = fit.normal_equations(fit.evaluation.by_parameter, columns).total()
    left, score = project(matrix, gradient, p, ~fit.at_bound)
    # relative to what the columns were before anything was projected out
    size = np.sqrt(np.maximum(np.diag(matrix)[p:], 1e-300))
    values, vectors = np.linalg.eigh(left / np.outer(size, size))
    usable = values > FIT.usable
    parts = vectors[:, usable].T @ (score / size)
    return float(np.sum(parts**2 / values[usable])), int(usable.sum())


def _piecewise_gain(problem: Likelihood, fit: Fit, mass: float) -> tuple[float, int]:
    """Forces of each segment by itself, constant over fifths of it; common parameters stay."""
    inside = problem.segments.inside
    lengths = inside.sum(axis=1)
    piece = np.minimum(np.arange(inside.shape[1])[None, :] * FIT.pieces // lengths[:, None], FIT.pieces - 1)
    forces = (piece[:, :, None] == np.arange(FIT.pieces)) * inside[:, :, None].astype(float)
    columns = problem.force_columns(fit, forces, mass)
    reduced = fit.normal_equations(columns)
    size = np.sqrt(np.maximum(np.einsum("kii->ki", reduced.matrix), 1e-300))
    scaled = reduced.matrix / (size[:, :, None] * size[:, None, :])
    values, vectors = np.linalg.eigh(scaled)
    usable = (values > 1e-4) & fit.good[:, None]
    parts = (vectors.transpose(0, 2, 1) @ (reduced.gradient / size)[:, :, None])[:, :, 0]
    gain = float(np.sum(np.where(usable, parts**2 / np.where(usable, values, 1), 0)))
    return gain, max(0, int(usable.sum()) - int((~fit.at_bound).sum()))
