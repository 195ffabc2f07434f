# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction that falls in proportion to the speed, which a spring force that lags behind reproduces.

A lag of tau turns the spring force -k x into -k x + k tau v to first order: damping that supplies energy.
"""

from dataclasses import replace

import numpy as np

from separatrix.discovery.decision.state import SearchState
from separatrix.discovery.fitting.curves import fit_member
from separatrix.discovery.fitting.fitted import Fitted, gain_over, values_of
from separatrix.discovery.fitting.members import MEMBERS
from separatrix.discovery.policy import SEARCH

_STIFFNESS = "restoring.stiffness"
_CURVE = next(one for one in MEMBERS if one.effect == "friction_curve")
_FALLING = {"friction_curve", "stribeck"}
DELAYED = "delayed_force"
"""Name of a force that lags, which is no effect of the catalogue."""


def may_lag(state: SearchState) -> bool:
    """Whether friction that falls with the speed is all that is named, of a machine with a spring."""
    accepted = state.decision.accepted
    if not accepted or len(names := accepted[0].fitted.names) != 1 or names[0] not in _FALLING:
        return False
    return _STIFFNESS in state.round.base.model.parameters


def lagging_force(state: SearchState) -> SearchState:
    """Doubt a friction that falls in proportion to the speed up to the largest one."""
    named, base = state.decision.accepted[0].fitted, state.round.base
    fastest = float(_CURVE.seen(named)[-1])
    line = fit_member(state.context.training, base, _CURVE, named, np.array([0.0, fastest]), alike=True)
    if line is None or not line.fit.converged:
        return state
    slope, error = _slope(line, fastest)
    gained = gain_over(named, base)[0]
    curved = gain_over(named, line)[0] > SEARCH.lag_curved * gained
    # of a large gap a line may close most and still leave far more than the name does
    most = state.context.options.missed_chi2 * max(1.0, named.fit.reduced_chi2)
    if curved or line.fit.reduced_chi2 > most or slope > -SEARCH.lag_sure * error:
        return state
    parameters = line.model.parameters
    free = [
        replace(one, value=parameters[one.path].value) for one in line.problem.free if one.path == _STIFFNESS
    ]
    stiffness = float(values_of(line, free)[0]) if free else parameters[_STIFFNESS].value
    lag = -slope / stiffness
    reason = (
        f"friction falls in proportion to the speed, by {-slope:.3g} N s/m up to {fastest:.3g} m/s, as "
        f"damping that supplies energy: a spring force that lags by {lag:.2g} s does the same. A record "
        "with another spring separates them: the damping of a lag grows with the stiffness"
    )
    decision = state.decision.because(reason)
    return state.decided(
        replace(decision, outcome="ambiguous", alternatives=[*decision.alternatives, [DELAYED]])
    )


def _slope(line: Fitted, fastest: float) -> tuple[float, float]:
    """Slope of friction over speed and its standard error [N s/m]."""
    first, last = line.added
    variance = line.covariance
    error = variance[first, first] + variance[last, last] - 2 * variance[first, last]
    values = line.fit.values
    return float(values[last] - values[first]) / fastest, float(np.sqrt(max(error, 0.0))) / fastest
