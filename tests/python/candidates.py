# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidates of a search that nothing was flown for: their fits and scores."""

from types import SimpleNamespace

import numpy as np
from separatrix.discovery.decision.scoring import (
    ScoredCandidate,
)
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.options import Options

COUNT = 20
OPTIONS = Options()


def fit(chi2: np.ndarray, decrement: float = 0.0) -> Fit:
    """One parameter, inside its bounds."""
    ones = np.ones(chi2.size)
    flown = SimpleNamespace(steady=ones > 0, failed=ones < 0)
    starts, open_ = np.zeros((chi2.size, 2)), np.zeros(1, bool)
    reduced = SimpleNamespace(matrix=ones[:, None, None])
    return Fit(np.ones(1), starts, flown, reduced, chi2, 50 * ones, decrement, 1, open_, ~open_)


def fitted(name: str, chi2: np.ndarray) -> Fitted:
    problem = SimpleNamespace(free=[Free(f"effect.{name}.force", 1.0)], locates=False)
    return Fitted((name,) if name else (), None, problem, fit(chi2), (0,))


def scored(gains: np.ndarray, held_out: np.ndarray) -> ScoredCandidate:
    """A candidate that gains so much log-likelihood by segment over a base with chi^2 of 100 in each."""
    one = fitted("coulomb", 100 - 2 * gains)
    prediction = SimpleNamespace(misfit=1.0)
    return ScoredCandidate(one, prediction, float(gains.sum()), float(held_out.sum()), held_out, 1)


def contender(name: str, evidence: float) -> ScoredCandidate:
    one = fitted(name, np.full(COUNT, 47.0))
    return ScoredCandidate(one, None, evidence + 1, 0.0, np.zeros(0), 1)
