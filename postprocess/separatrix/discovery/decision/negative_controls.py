# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidates that are known to be wrong: each effect with the segments of its signature exchanged.

A negative control keeps size and shape of a signature and loses its relation to the motion. A control that
could be named would show that names follow from any misfit of the base and not from the effect.
"""

from dataclasses import replace

import numpy as np

from separatrix.discovery.decision.rounds import Round
from separatrix.discovery.decision.scoring import family_wise
from separatrix.discovery.fitting.screen import Signature, screen
from separatrix.discovery.options import Options


def negative_controls(found: Round, options: Options) -> dict:
    """The number of negative controls, the best with its gain and p value, and whether it could be named."""
    base = found.base
    made = [_exchanged(one, base.problem.segments.record) for one in found.signatures]
    made = [one for one in made if np.any(one.columns)]
    if not made:
        return {"tested": 0, "accepted": False}
    screened = screen(base.fit, made)
    scale = max(1.0, base.fit.reduced_chi2)
    gains = {one.name: screened.gain[one.name] - one.columns.shape[2] for one in made}
    best = max(made, key=lambda one: gains[one.name])
    p = family_wise(2 * screened.gain[best.name] / scale, best.columns.shape[2], screened.tests)
    real = max((one.training - one.parameters for one in found.scored), default=0.0)
    return {
        "tested": len(made),
        "best": best.name,
        "gain": gains[best.name],
        "p_value": p,
        "accepted": bool(
            p < options.detection_level and gains[best.name] > real + options.separation * scale
        ),
    }


def _exchanged(one: Signature, record: np.ndarray) -> Signature:
    """The signature with the segments of each record moved on by half of them."""
    columns = one.columns.copy()
    for number in np.unique(record):
        rows = np.flatnonzero(record == number)
        columns[rows] = one.columns[np.roll(rows, rows.size // 2)]
    return replace(one, columns=columns)
