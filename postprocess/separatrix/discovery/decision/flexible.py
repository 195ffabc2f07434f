# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Families as tabulated functions, for gaps that no closed form closes; the evidence chooses the knots."""

from collections.abc import Iterator

from separatrix.discovery.decision.gates import weigh_imperfections
from separatrix.discovery.decision.rounds import Round, SearchContext
from separatrix.discovery.decision.scoring import ScoredCandidate, admissible, clear_of, margin
from separatrix.discovery.decision.table_range import within_tables
from separatrix.discovery.fitting.ceiling import Ceiling
from separatrix.discovery.fitting.curves import fit_member, fits_machine, knots_at
from separatrix.discovery.fitting.fitted import Fitted, gain_over
from separatrix.discovery.fitting.joint_effects import effect_of
from separatrix.discovery.fitting.members import MEMBERS, Member
from separatrix.discovery.policy import FIT, SEARCH


def flexible_member(
    context: SearchContext, found: Round, ceiling: Ceiling, earlier: Round | None = None
) -> tuple[ScoredCandidate, list[ScoredCandidate]] | None:
    """The best family as a function, and its rivals of other families; or None.

    Tables that left most of the gap in an `earlier` round of the same records are not fitted again.
    """
    far = _far_tables(earlier) if earlier is not None else set()
    members = [one for one in _promising(context, found, ceiling) if one.effect not in far]
    fitted = [one for member in members for one in best_table(context, found, member)]
    if not fitted:
        return None
    if any(one.imperfections is not None for one in found.scored):
        # the candidates that they are compared with have them
        for one in fitted:
            weigh_imperfections(context, one)
    able = [one for one in fitted if admissible(one, found.base, context.options)[0]]
    best = max(able or fitted, key=lambda one: one.evidence)
    family = effect_of(best.name).family
    others = [one for one in [*found.scored, *fitted] if effect_of(one.name).family != family]
    return best, [one for one in others if not clear_of(best, one, context.options)]


def _promising(context: SearchContext, found: Round, ceiling: Ceiling) -> list[Member]:
    """Members of the families that explain much of the gap, in closed form or as a free force."""
    wanted = context.options.candidates
    free = {one.name: max(0.0, one.gain - one.rank) for one in ceiling.families if one.name != "pieces"}
    most = max([1e-300, *free.values()])
    highest = max([1e-300, *(one.evidence for one in found.scored)])
    shares = {}
    for member in MEMBERS:
        if not (found.base.problem.has_tables and fits_machine(member, found.base.model)):
            continue
        allowed = wanted is None or any(
            name == member.effect or effect_of(name).family == member.family for name in wanted
        )
        if not allowed:
            continue
        closed = [one.evidence for one in found.scored if effect_of(one.name).family == member.family]
        share = max([free.get(member.explains, 0.0) / most, *(one / highest for one in closed)])
        if share > SEARCH.family_promise:
            shares[member] = share
    return sorted(shares, key=lambda member: -shares[member])


def _far_tables(found: Round) -> set[str]:
    """Tables of a round that leave most of the gap on as many knots as they got."""
    gap = max(0.0, found.base.fit.excess)
    closing: dict[str, bool] = {}
    for effect, _, _, one in found.tables:
        if one is not None:
            best = min(fit.fit.excess for fit in (one.fitted, one.fitted.finer) if fit is not None)
            closing[effect] = closing.get(effect, False) or best < SEARCH.table_leaves * gap
    return {effect for effect, closes in closing.items() if not closes}


def best_table(
    context: SearchContext, found: Round, member: Member, strict: bool = True
) -> Iterator[ScoredCandidate]:
    """The table of a family on as many knots as the evidence pays for; nothing where none converges.

    Without `strict` an unnamed table need not converge; its predictions decide. A table that was fitted on
    this base is used again.
    """
    known = _begun(found, member.family)
    same = [
        one
        for effect, begun, how, one in found.tables
        if (effect, how) == (member.effect, strict) and begun is known
    ]
    best = same[0] if same else _fit_table(context, found, member, known, strict)
    if not same:
        found.tables.append((member.effect, known, strict, best))
    if best is not None:
        yield found.score(best.fitted, best.prediction)


def _fit_table(
    context: SearchContext, found: Round, member: Member, known: Fitted, strict: bool
) -> ScoredCandidate | None:
    """The table of a family, from a `known` machine."""
    best = None
    seen = member.seen(known)
    # also tables of other families: one that closes the gap makes the others short
    done = [*found.scored, *(one for *_, one in found.tables if one is not None)]
    ahead = max((one.fitted for one in done if one.fitted.fit.converged), default=None, key=_closeness)
    for alike in (True, False) if len(member.values) > 1 and member.knots else (False,):
        for count in FIT.knots:
            knots = knots_at(member, seen, count)
            made = None
            if knots is not None:
                made = fit_member(context.training, found.base, member, known, knots, alike, ahead)
            if made is None:
                break
            context.report(f"fitting {member.effect} on {count} knots")
            if made.fit.good.sum() < context.options.followed * found.base.fit.good.sum():
                # lost segments would appear as a gain
                continue
            if not made.fit.converged:
                # too many knots for these records, no function, or one still far from its shape
                if best is not None and made.fit.total < best.fitted.fit.total + FIT.worse:
                    best.fitted.finer = made
                if count > FIT.knots[0] and _pointless(known, made, ahead):
                    break
                known = min(known, made, key=lambda one: one.fit.excess)
                if strict:
                    continue
            else:
                known = made
            one = found.score(made, context.predict(made, found.predicted))
            if best is not None and _lead(one, best) < margin(best, one, context.options):
                best.fitted.finer = made
                if _pointless(best.fitted, made, ahead):
                    break
                # still far from its shape: it follows the fitted records and predicts no others
                continue
            slow = best is not None and _pointless(best.fitted, made, ahead)
            best = one
            if slow:
                break
        if best is not None:
            known = best.fitted
    return best


def _lead(one: ScoredCandidate, other: ScoredCandidate) -> float:
    """Evidence of a table over one of other knots, without what both only extrapolate."""
    if one.prediction is None or other.prediction is None:
        return one.evidence - other.evidence
    within = within_tables(one.prediction) & within_tables(other.prediction)
    parts = (one.held_out_parts - other.held_out_parts)[~within]
    return one.evidence - other.evidence - float(parts.sum())


def _closeness(one: Fitted) -> float:
    return -one.fit.excess


def _pointless(one: Fitted, more: Fitted, ahead: Fitted | None) -> bool:
    """Whether more knots leave nearly as much of a gap, or there is none left.

    Where a closed form is far ahead, most of it is nearly as much.
    """
    before, after = (max(0.0, fitted.fit.excess) for fitted in (one, more))
    far = ahead is not None and gain_over(more, ahead)[0] < -SEARCH.table_far_behind
    return after >= (SEARCH.knots_pointless_behind if far else SEARCH.knots_pointless) * before


def _begun(found: Round, family: str) -> Fitted:
    """The closed form of the family where there is one, else the base."""
    members = [one for one in found.scored if effect_of(one.name).family == family]
    return members[0].fitted if members else found.base
