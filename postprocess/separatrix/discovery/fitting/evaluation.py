# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Result of an evaluation of all segments."""

from dataclasses import dataclass

import numpy as np


@dataclass
class Evaluation:
    """Residuals over their noise (segments, channels*length, then nuisances that were measured), derivatives
    by start (…, 2) and parameters (…, p).

    `used` is 0 where a segment has no sample; `failed` is true where the simulator gave one up (its rows are
    0); `steady` is false where the sequence of impacts would change under a small step, so that the
    derivatives mean nothing.
    """

    residual: np.ndarray
    used: np.ndarray
    failed: np.ndarray
    steady: np.ndarray
    x: np.ndarray
    v: np.ndarray
    # per record rows of segment (of that record), time, speed before, speed after, side
    impacts: list[np.ndarray | None]
    # number of impacts of each segment
    hits: np.ndarray
    by_start: np.ndarray | None = None
    by_parameter: np.ndarray | None = None
    # derivatives of x and v by the start, without noise: what a force does later follows from them
    transition: np.ndarray | None = None
    # unknowns of each segment: those of its start, none where the motion is known
    unknowns: int = 2
    # that the motion takes [N], where it is compared
    force: np.ndarray | None = None
    # of several bodies: positions, then velocities of all coordinates (segments, length, 2 n)
    motion: np.ndarray | None = None
