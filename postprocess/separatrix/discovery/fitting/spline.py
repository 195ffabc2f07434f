# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A smoothing spline: a Gaussian prior on the second derivative of a function that is known by its values.

The posterior is averaged over the size of that prior, weighed by its evidence, with a uniform prior for the
size (A. Gelman, Bayesian Analysis 1 (2006) 515), so that the band includes the uncertainty of the shape. Such
a band contains a function on its nominal share of the support (G. Wahba, J. R. Stat. Soc. B 45 (1983) 133).
"""

import numpy as np

# precisions of the prior over the information on the values, from rough to straight, in decades
_DECADES = np.linspace(-6, 6, 49)


def roughness(at: np.ndarray) -> np.ndarray:
    """Matrix of the integral of the squared second derivative of the natural cubic spline through values.

    P. J. Green and B. W. Silverman, Nonparametric Regression (1994), section 2.1.
    """
    h = np.diff(at)
    inner = at.size - 2
    slopes = np.zeros((at.size, inner))
    bends = np.zeros((inner, inner))
    for i in range(inner):
        slopes[i : i + 3, i] = 1 / h[i], -1 / h[i] - 1 / h[i + 1], 1 / h[i + 1]
        bends[i, i] = (h[i] + h[i + 1]) / 3
        if i + 1 < inner:
            bends[i, i + 1] = bends[i + 1, i] = h[i + 1] / 6
    return slopes @ np.linalg.solve(bends, slopes.T)


def smoothed(
    information: np.ndarray, gradient: np.ndarray, centre: np.ndarray, penalty: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Mean and covariance of values whose misfit is d^T information d - 2 d^T gradient about a centre.

    None where neither the records nor the smoothness determine some value.
    """
    unit = np.trace(information) / np.trace(penalty)
    if not unit > 0:
        return None
    rank = np.linalg.matrix_rank(penalty)
    found = []
    for precision in unit * 10**_DECADES:
        matrix = information + precision * penalty
        size = np.sqrt(np.diag(matrix))
        scaled = matrix / np.outer(size, size)
        values, vectors = np.linalg.eigh(scaled)
        if not values[0] > 1e-14 * values[-1]:
            continue
        inverse = (vectors / values) @ vectors.T / np.outer(size, size)
        slope = gradient - precision * (penalty @ centre)
        step = inverse @ slope
        evidence = 0.5 * (slope @ step - precision * centre @ penalty @ centre + rank * np.log(precision))
        evidence -= 0.5 * np.sum(np.log(values)) + np.sum(np.log(size))
        # the prior is uniform in the size of the bend, not in the logarithm of the precision
        evidence -= 0.5 * np.log(precision)
        found.append((evidence, centre + step, inverse))
    if not found:
        return None
    evidences = np.array([one[0] for one in found])
    weights = np.exp(evidences - evidences.max())
    weights /= weights.sum()
    mean = sum(w * one[1] for w, one in zip(weights, found, strict=True))
    covariance = sum(
        w * (one[2] + np.outer(one[1] - mean, one[1] - mean)) for w, one in zip(weights, found, strict=True)
    )
    return mean, covariance
