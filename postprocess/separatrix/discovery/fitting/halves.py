# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""An effect of several laws, as dry and viscous asymmetry, fitted with one of them alone.

A law that the records do not determine predicts other records badly, and the whole effect would lose to
another effect with the other law alone.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from separatrix.discovery.fitting.catalogue import Candidate
from separatrix.discovery.fitting.data import Data, polished
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.fitted import Fitted, gain_over
from separatrix.discovery.policy import FIT
from separatrix.library import effects


def halves(
    data: Data, base: Fitted, candidate: Candidate, whole: Fitted, doubtful: bool = True
) -> Iterator[tuple[Candidate, Fitted]]:
    """The effect with each of its laws alone; if `doubtful`, only where not all of them are sure."""
    name = candidate.names[-1]
    if name not in effects():
        # of several bodies each is one law
        return
    effect = effects()[name]
    paths = [candidate.free[i].path for i in candidate.added]
    units = {effect.parameters[key].unit for key in effect.amplitudes}
    if len(units) < 2 or len(units) != len(paths) or not whole.fit.converged:
        return
    if gain_over(whole, base)[0] < FIT.worth_halving or (doubtful and not _doubtful(whole)):
        return
    for path in paths:
        # the value fitted may be none for the case as it is written, whose friction was fitted too
        value = candidate.model.parameters[path].value
        model = base.model.with_effect(name, {path.rpartition(".")[2]: value})
        kept = [one for one in candidate.free if one.path == path or one.path not in paths]
        at = [i for i, one in enumerate(kept) if one.path == path]
        part = replace(candidate, model=model, free=kept, added=tuple(at), linear=np.ones(1, bool))
        known = {(one.path, one.record): v for one, v in zip(candidate.free, whole.fit.values, strict=True)}
        values = np.array([known[one.path, one.record] for one in kept])
        problem = data.problem(model, data.last, kept)
        fit = minimise(problem, values, whole.fit.starts)
        fit = polished(data, problem, fit, data.last, 8, rival=whole.fit)
        if fit.converged:
            yield part, Fitted(candidate.names, model, problem, fit, part.added, whole.tries)


def _doubtful(whole: Fitted) -> bool:
    """Whether the interval of one of the added parameters has zero."""
    error = np.sqrt(np.diag(whole.covariance))
    return any(abs(whole.fit.values[i]) < FIT.doubtful_law * error[i] for i in whole.added)
