# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A candidate fitted with everything else free, from several starts."""

from dataclasses import replace

import numpy as np

from separatrix.discovery.fitting.catalogue import Candidate
from separatrix.discovery.fitting.data import Data, fit_stages, polished
from separatrix.discovery.fitting.fit import Fit, blocking, minimise
from separatrix.discovery.fitting.fitted import (
    Fitted,
    beaten,
    gain_over,
    hopeless,
    leaves_noise,
    shared_values,
    values_of,
)
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.screen import Screened
from separatrix.discovery.policy import FIT


def refit(
    data: Data,
    base: Fitted,
    candidate: Candidate,
    screened: Screened | None,
    rival: Fitted | None = None,
    quick: bool = False,
    known: Fitted | None = None,
) -> Fitted:
    """The best of several starts: the linearised estimate, then usual sizes from short segments on.

    If a `rival` (perhaps the base itself) already leaves only noise, a candidate that is clearly worse after
    its first start is not tried further. A fit `known` from another noise is continued, and is tried from the
    present base if it is neither good nor far behind.
    """
    best, best_kind = None, "known"
    if known is not None:
        best = carried_on(data, candidate, known)
        out = best.fit.far_off(hopeless(base)) or (rival is not None and beaten(best, rival))
        if out or _delivers(best, base, candidate, screened):
            return best
    values = _base_values(base, candidate)
    settled = rival is not None and rival.fit.converged and leaves_noise(rival, base)
    for tries, (kind, start) in enumerate(_starts(candidate, screened), start=1):
        tried = values.copy()
        tried[list(candidate.added)] = start
        if best is None and settled:
            kind = "linear"
            problem, fit = _try(data, base, candidate, kind, tried, 8, rival.fit.total)
            rough = Fitted(candidate.names, candidate.model, problem, fit, candidate.added)
            if beaten(rough, rival):
                return rough
        elif best is not None and kind != "linear" and _closes_nothing(data, base, candidate, kind, tried):
            if _as_far(best.fit, base):
                break
            continue
        else:
            if best is None and base.fit.reduced_chi2 > FIT.near_base:
                # through short segments it would cost more than the start from afar
                kind = "linear"
            problem, fit = _try(data, base, candidate, kind, tried, 8 if settled else 20)
        if kind == "linear" and not fit.far_off(hopeless(base)) and not _as_far(fit, base):
            # of other kinds it was done with the last stage
            fit = polished(data, problem, fit, data.last, 8, rival=base.fit)
            if not settled and not fit.converged and fit.excess < (1 - FIT.most_closed) * base.fit.excess:
                # it was ended on its way; a start from afar costs more
                fit = minimise(problem, fit.values, fit.starts, most=FIT.fit_on)
        found = Fitted(candidate.names, candidate.model, problem, fit, candidate.added)
        agreed = best is not None and _agree({kind, best_kind}, found, best, base, rival)
        if best is None or _better(found, best):
            best, best_kind = found, kind
        best.tries = tries
        if agreed:
            break
        promised = base.fit.reduced_chi2 < FIT.bad_screen and kind == "linear"
        if (promised or best.fit.like_noise(1)) and _delivers(best, base, candidate, screened):
            break
        if settled and gain_over(best, rival)[0] < -FIT.beaten:
            break
        if _enough(best, base, candidate, rival):
            break
        if known is not None or ((quick or base.added) and tries >= 2):
            # the other starts of a known fit were tried before
            break
    return _above_base(data, best, base, candidate)


def _as_far(fit: Fit, base: Fitted) -> bool:
    """Whether a fit leaves nearly all that a base far from the records leaves: in the same segments."""
    far = base.fit.reduced_chi2 > FIT.near_base and fit.converged
    return far and fit.excess > (1 - FIT.hardly_closed) * base.fit.excess


def _closes_nothing(data: Data, base: Fitted, candidate: Candidate, kind: str, values: np.ndarray) -> bool:
    """Whether a start leaves nearly all that a base far from the records leaves in short segments.

    There every machine is nearly linear, so that the right one closes its part of the gap.
    """
    if base.fit.reduced_chi2 <= FIT.near_base or data.last == 0:
        return False
    stage = 0 if kind == "far" else 1
    if stage not in base.short:
        problem = data.problem(base.model, stage, base.problem.free)
        starts = data.carried_starts(stage, data.last, base.fit)
        base.short[stage] = _squares(
            minimise(problem, base.fit.values, starts, robust=True, most=12, rough=True)
        )
    values = _nominal(values, candidate) if kind == "far" else values
    problem = data.problem(candidate.model, stage, candidate.free)
    fit = minimise(problem, values, data.smoothed_starts(stage), robust=True, most=12, rough=True)
    own, known = _squares(fit), base.short[stage]
    both = np.isfinite(own) & np.isfinite(known)
    excess = known[both].sum() - fit.counts[both].sum()
    return excess > 0 and (known - own)[both].sum() < FIT.hardly_closed * excess


def _squares(fit: Fit) -> np.ndarray:
    """Sums of squares of segments, NaN of those that are not followed."""
    return np.where(fit.good, fit.chi2, np.nan)


def _nominal(values: np.ndarray, candidate: Candidate) -> np.ndarray:
    """The machine of the case with the effect as it is."""
    nominal = np.array([one.value for one in candidate.free])
    return np.where(np.isin(np.arange(values.size), candidate.added), values, nominal)


def rough_total(data: Data, base: Fitted, candidate: Candidate, screened: Screened) -> float:
    """Sum of squares after a few steps from the base, without the effect or, if it has no linear estimate,
    with its usual size.

    The linear estimate itself may be far out. Segments that the base follows and the candidate does not
    count as the base leaves them.
    """
    starts = _starts(candidate, screened)
    if not starts:
        return np.inf
    kind, start = starts[0]
    values = _base_values(base, candidate)
    values[list(candidate.added)] = start
    problem = data.problem(candidate.model, data.last, candidate.free)
    begun = _absent(values, candidate) if kind == "linear" else values
    fit = minimise(problem, begun, base.fit.starts, most=FIT.fit_fewest, rough=True)
    lost = base.fit.good & ~fit.good
    return fit.total + float(base.fit.chi2[lost].sum())


def _enough(found: Fitted, base: Fitted, candidate: Candidate, rival: Fitted | None) -> bool:
    """Whether a fit that began at the base needs no start from afar.

    An effect with amplitudes alone has one minimum near the base. Others have more; but these are not worth
    their cost where the first is worse than no effect, or far behind a rival that closes most of the gap, or
    on top of an effect.
    """
    if base.fit.reduced_chi2 > FIT.near_base:
        return False
    converged, worse = found.fit.converged, gain_over(found, base)[0] < -FIT.worse
    if candidate.linear.all():
        return converged and not worse
    if (worse and converged) or (base.added and (worse or converged)):
        return True
    if worse or not converged:
        return False
    if rival is None or not rival.fit.converged:
        return False
    closed = rival.fit.excess < (1 - FIT.most_closed) * base.fit.excess
    return closed and gain_over(found, rival)[0] < -2 * FIT.beaten


def _above_base(data: Data, best: Fitted, base: Fitted, candidate: Candidate) -> Fitted:
    """The fit, or a better one from the base: a machine that contains the base cannot be worse.

    A fit that stays worse has not found its minimum.
    """
    if not candidate.linear.any() or gain_over(best, base)[0] > -FIT.worse:
        return best
    values = _absent(_base_values(base, candidate), candidate)
    problem = data.problem(candidate.model, data.last, candidate.free)
    fit = minimise(problem, values, base.fit.starts)
    found = Fitted(candidate.names, candidate.model, problem, fit, candidate.added, best.tries + 1)
    best = found if _better(found, best) else best
    if gain_over(best, base)[0] > -FIT.worse:
        return best
    return replace(best, fit=replace(best.fit, in_local_minimum=True))


def _absent(values: np.ndarray, candidate: Candidate) -> np.ndarray:
    """The values with the effect of size zero."""
    values = values.copy()
    values[np.array(candidate.added)[candidate.linear]] = 0.0
    return values


def carried_on(data: Data, candidate: Candidate, known: Fitted, patient: bool = False) -> Fitted:
    """An earlier fit, continued with the present noise."""
    problem = data.problem(candidate.model, data.last, candidate.free)
    values = values_of(known, [replace(one, value=0.0) if one.path in _amplitudes(candidate) else one
                               for one in candidate.free])  # fmt: skip
    fit = minimise(problem, values, known.fit.starts, patient=patient)
    return Fitted(candidate.names, candidate.model, problem, fit, candidate.added, known.tries)


def _amplitudes(candidate: Candidate) -> set[str]:
    """Paths of the added parameters without which there is no effect."""
    return {candidate.free[i].path for i, size in zip(candidate.added, candidate.linear, strict=True) if size}


def _delivers(found: Fitted, base: Fitted, candidate: Candidate, screened: Screened | None) -> bool:
    """Whether a fit gained what the screen promised, as far as the base is good enough for a promise."""
    if not found.fit.converged:
        return False
    believed = screened is not None and base.fit.reduced_chi2 < FIT.bad_screen
    promised = screened.gain.get(candidate.names[-1], 0.0) if believed else 0.0
    return gain_over(found, base)[0] >= FIT.delivered * promised


def _same_minimum(one: Fitted, other: Fitted) -> bool:
    """Whether two fits follow the same segments as closely."""
    both = one.fit.good.sum() == other.fit.good.sum()
    return bool(both and abs(gain_over(one, other)[0]) < max(FIT.worse, FIT.same_minimum * one.fit.total))


def _agree(kinds: set[str], one: Fitted, other: Fitted, base: Fitted, rival: Fitted | None) -> bool:
    """Whether two starts of one candidate make another one needless.

    They led to the same minimum, one from afar; or both are hopeless, or alike and far behind the
    base or a converged rival.
    """
    if "far" in kinds and _same_minimum(one, other):
        return True
    if one.fit.far_off(hopeless(base)) and other.fit.far_off(hopeless(base)):
        return True
    alike = abs(one.fit.total - other.fit.total) < FIT.alike_behind * one.fit.total
    known = [base] if rival is None or not rival.fit.converged else [base, rival]
    return alike and any(
        all(gain_over(fitted, ahead)[0] < -2 * FIT.beaten for fitted in (one, other)) for ahead in known
    )


def _better(one: Fitted, other: Fitted) -> bool:
    """Whether a fit follows clearly more segments, or as many and those more closely."""
    counts = [fitted.fit.good.sum() for fitted in (one, other)]
    if abs(counts[0] - counts[1]) > FIT.followed_more * max(counts):
        return bool(counts[0] > counts[1])
    return gain_over(one, other)[0] > 0


def _try(
    data: Data,
    base: Fitted,
    candidate: Candidate,
    kind: str,
    values: np.ndarray,
    most: int,
    beat: float | None = None,
) -> tuple[Likelihood, Fit]:
    """One start: at full length from the fitted base, or through the stages; far: from the case."""
    if kind == "linear":
        problem = data.problem(candidate.model, data.last, candidate.free)
        fit = minimise(problem, values, base.fit.starts, most=most, beat=beat)
        absent = _absent(values, candidate)
        if fit.total > base.fit.total + 2 * FIT.worse and not np.array_equal(absent, values):
            # the linearised size threw it out of the minimum of the base, which it contains
            other = minimise(problem, absent, base.fit.starts, most=most, beat=beat)
            if not other.converged:
                barred = blocking(problem, absent, base.fit.starts)
                other = polished(data, problem, other, data.last, most, suspects=barred)
            if other.good.sum() >= fit.good.sum() and other.total < fit.total:
                fit = other
        return problem, fit
    stages = [1, data.last]
    if kind == "far":
        stages = list(range(data.last + 1))
        values = _nominal(values, candidate)
    more = {"most": min(most, 12), "hopeless": hopeless(base), "rival": base.fit}
    return fit_stages(data, candidate.model, candidate.free, values, stages=stages, **more)


def crossed(data: Data, one: Fitted, other: Fitted, candidate: Candidate) -> Fitted:
    """A fit tried again from the machine and starts of another effect; the better of both."""
    values = _base_values(other, candidate)
    added = list(candidate.added)
    values[added] = one.fit.values[list(one.added)]
    return _from(data, one, values, other)


def imitating(data: Data, one: Fitted, other: Fitted, candidate: Candidate) -> Fitted:
    """A fit tried again from another name of its motion; the better of both.

    It begins at the machine of that name, without a size and with the size that its own parameters reach
    there. If both end far from it, it begins at its own machine with the same motion.
    """
    own = _base_values(other, candidate)
    found = _from(data, one, _absent(own, candidate), other)
    own[list(candidate.added)] = one.fit.values[list(one.added)]
    others = ~np.isin(np.arange(own.size), candidate.added)
    sized = minimise(one.problem, own, other.fit.starts, most=8, fixed=others, rough=True)
    found = _from(data, found, sized.values, other)
    if gain_over(other, found)[0] < FIT.imitated_behind:
        return found
    return _imitated(data, found, other, candidate)


def _imitated(data: Data, one: Fitted, other: Fitted, candidate: Candidate) -> Fitted:
    """A fit from its own machine with the motion of another name; the better of both.

    Without a size both machines are the same. The change of its parameters that follows the first share of
    that size is extrapolated in proportion, as names of one motion are proportional.
    """
    known = _absent(_base_values(other, candidate), candidate)
    theirs = other.fit.values.copy()
    theirs[list(other.added)] *= FIT.imitated_share
    motion = other.problem.evaluate(theirs, other.fit.starts, derivatives=False)
    # this motion excludes imperfections of the rig
    imperfections = np.array([free.is_imperfection for free in one.problem.free])
    begun = np.where(imperfections, 0.0, known)
    imitating = one.problem.imitating(motion)
    if imitating is None:
        return one
    fit = minimise(imitating, begun, other.fit.starts, most=8, fixed=imperfections)
    starts = other.fit.starts + (fit.starts - other.fit.starts) / FIT.imitated_share
    values = known + (fit.values - begun) / FIT.imitated_share
    lower, upper = (
        np.array([getattr(free, side) for free in one.problem.free]) for side in ("lower", "upper")
    )
    begun_from = replace(other, fit=replace(other.fit, starts=starts))
    return _from(data, one, np.clip(values, lower, upper), begun_from)


def warm_started_by(data: Data, one: Fitted, other: Fitted) -> Fitted:
    """A fit tried again from the end of a machine that contains it; the better of both."""
    return _from(data, one, shared_values(one, other), other)


def _from(data: Data, one: Fitted, values: np.ndarray, other: Fitted) -> Fitted:
    """The better of a fit and another from given values and the starts of another machine."""
    fit = minimise(one.problem, values, other.fit.starts, most=15)
    fit = polished(data, one.problem, fit, data.last, 8, rival=one.fit)
    found = Fitted(one.names, one.model, one.problem, fit, one.added, one.tries + 1)
    return found if _better(found, one) else one


def _base_values(base: Fitted, candidate: Candidate) -> np.ndarray:
    return values_of(base, candidate.free)


def _starts(candidate: Candidate, screened: Screened | None) -> list[tuple[str, np.ndarray]]:
    name = candidate.names[-1]
    lower = np.array([candidate.free[i].lower for i in candidate.added])
    upper = np.array([candidate.free[i].upper for i in candidate.added])
    starts = []
    if screened is not None and name in screened.step:
        guess = screened.origin[name].copy()
        live = screened.live[name]
        if live.any():
            sizes = np.array([candidate.free[i].size for i in candidate.added])
            if live.any():
                guess[live] += screened.step[name] * sizes[live]
            far = FIT.farthest * np.where(candidate.linear, sizes, np.inf)
            guess = np.clip(np.clip(guess, -far, far), lower, upper)
            # away from zero, where its other parameters could not move
            guess = np.where((guess == 0) & candidate.linear, 0.01 * sizes, guess)
            starts.append(("linear", guess))
        else:
            starts.append(("near", guess))
    far = [("far", start) for start in candidate.starts[:2]]
    if starts and not candidate.linear.all():
        # of the shape least like the first one before all: if both agree, that is the minimum
        far.sort(key=lambda one: -np.linalg.norm((one[1] - starts[0][1])[~candidate.linear]))
    starts += far[:1]
    starts += [("near", start) for start in candidate.starts[1:2] if not candidate.linear.all()]
    starts += far[1:]
    return [(kind, np.clip(start, lower, upper)) for kind, start in starts]
