# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where no closed form closes a gap: the member of a family that is a function, on as many knots as pay."""

from separatrix.discovery.decision.judge import Judged, lead, margin
from separatrix.discovery.decision.rounds import Bench, Round
from separatrix.discovery.fitting.curves import (
    KNOTS,
    RESTITUTION,
    change_of,
    impact_speeds,
    restitution_curve,
    speeds_at,
)
from separatrix.discovery.fitting.refit import Fitted
from separatrix.library import effects


def flexible_member(bench: Bench, found: Round) -> tuple[Judged, list[Judged]] | None:
    """The restitution as a function of the impact speed, and its rivals of other families; or None."""
    wanted = bench.options.candidates
    family = effects()[RESTITUTION].family
    allowed = wanted is None or any(
        name == RESTITUTION or effects()[name].family == family for name in wanted
    )
    if not allowed or "contact.restitution" not in found.base.model.parameters:
        return None
    known = _begun(found, family)
    best = None
    speeds = impact_speeds(bench.training)
    for count in KNOTS:
        knots = speeds_at(speeds, count)
        fitted = None if knots is None else restitution_curve(bench.training, known, change_of(known), knots)
        if fitted is None:
            break
        bench.options.progress(f"fitting {RESTITUTION} on {count} speeds", 0.8)
        known = fitted
        if not fitted.fit.converged:
            # more knots than these impacts can tell apart
            continue
        one = found.judge(fitted, bench.foretell(fitted, found.foretold))
        if best is not None and one.evidence < best.evidence + margin(best, one, bench.options):
            break
        best = one
    if best is None:
        return None
    others = [one for one in found.judged if effects()[one.name].family != family]
    return best, [one for one in others if lead(best, one) < margin(best, one, bench.options)]


def _begun(found: Round, family: str) -> Fitted:
    """The closed form of the family where there is one, else the base."""
    members = [one for one in found.judged if effects()[one.name].family == family]
    return members[0].fitted if members else found.base
