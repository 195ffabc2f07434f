# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One round of the search: every candidate screened, refitted, and predicting the held-out records."""

from dataclasses import dataclass, field, replace

import numpy as np

from separatrix.discovery.decision.scoring import ScoredCandidate, scored
from separatrix.discovery.fitting.catalogue import ON_REQUEST, Candidate, Scales
from separatrix.discovery.fitting.data import Data
from separatrix.discovery.fitting.fitted import Fitted, beaten, gain_over, leaves_noise
from separatrix.discovery.fitting.halves import halves
from separatrix.discovery.fitting.heldout import Known, Prediction, predict
from separatrix.discovery.fitting.joint_effects import candidate_of, effect_of
from separatrix.discovery.fitting.locations import SensedScales
from separatrix.discovery.fitting.machine import with_values
from separatrix.discovery.fitting.normal_equations import solve_scaled
from separatrix.discovery.fitting.refit import carried_on, crossed, imitating, refit, rough_total
from separatrix.discovery.fitting.rig import cleaned, with_imperfections
from separatrix.discovery.fitting.screen import Screened, Signature, project, screen, signature
from separatrix.discovery.fitting.time_limit import TimeLimit
from separatrix.discovery.options import Options
from separatrix.discovery.policy import FIT, SEARCH


@dataclass
class SearchContext:
    """Data, scales and options of a search."""

    training: Data
    held_out: Data | None
    scales: Scales | SensedScales
    options: Options
    # the part of all work that the present stage is
    span: tuple[float, float] = (0.0, 1.0)
    limit: TimeLimit = field(default_factory=TimeLimit)
    # whether something is known that may be reported at the time limit
    has_result: bool = False

    @property
    def late(self) -> bool:
        """Whether the time limit is over."""
        return self.limit.over

    def report(self, text: str, part: float = 0.0) -> None:
        """Report what begins, a part of the present stage being over; out of time, the stage may end here."""
        self.limit.ends_fits()
        first, last = self.span
        self.options.progress(text, first + (last - first) * part)

    def predict(self, fitted: Fitted, other: Prediction | None = None) -> Prediction | None:
        """Score the held-out records, also from the end of an `other` prediction of them."""
        if self.held_out is None:
            return None
        free, fit = fitted.problem.free, fitted.fit
        misfit = max(1.0, fit.reduced_chi2)
        known = Known(fit.values, fitted.covariance, fitted.unseen)
        return predict(self.held_out, fitted.model, free, known, misfit, other)

    def predict_with_imperfections(self, fitted: Fitted, other: Prediction) -> Prediction:
        """The same by parameters that were fitted beside imperfections of a rig in the training records."""
        free, fit = fitted.problem.free, fitted.fit
        beside = with_imperfections(fitted.problem, fit)
        lower, upper = (np.array([getattr(one, side) for one in free]) for side in ("lower", "upper"))
        known = Known(np.clip(fit.values + beside.shift, lower, upper), beside.covariance, fitted.unseen)
        misfit = max(1.0, cleaned(fitted.problem, fit).reduced_chi2)
        return replace(
            predict(self.held_out, fitted.model, free, known, misfit, other), with_imperfections=True
        )


@dataclass
class Round:
    """Candidates of a round, best first, and the screen that chose them."""

    base: Fitted
    predicted: Prediction | None
    candidates: dict[str, Candidate]
    signatures: list[Signature]
    screened: Screened
    # why some effects make no sense for this machine
    absent: dict[str, str]
    scored: list[ScoredCandidate] = field(default_factory=list)
    # families as functions that were fitted on this base: effect, machine begun from, whether strictly
    tables: list[tuple[str, Fitted, bool, ScoredCandidate | None]] = field(default_factory=list)

    def score(self, fitted: Fitted, prediction: Prediction | None) -> ScoredCandidate:
        """Evidence over the base of this round."""
        return scored(self.base, self.predicted, fitted, prediction)

    def rank(self) -> None:
        """Put those of most evidence first."""
        self.scored.sort(key=lambda one: -one.evidence)


def run_round(
    context: SearchContext,
    base: Fitted,
    predicted: Prediction | None,
    earlier: Round | None = None,
    everything: bool = False,
    without: frozenset[str] = frozenset(),
) -> Round:
    """Screen all candidates on top of `base` and refit those that matter, or `everything` that is seen.

    Those of `without` are not fitted.

    The fits of an `earlier` round are used again if its base was this fit, and are continued if the base was
    refitted.
    """
    options = context.options
    stands = earlier is not None and earlier.base is base
    if stands:
        # earlier candidates are compared with new ones without imperfections
        known_alone = [replace(one, imperfections=None) for one in earlier.scored]
        found = replace(earlier, predicted=predicted, scored=known_alone)
    else:
        found = _screened(context, base, predicted)
    known = {one.name: one.fitted for one in earlier.scored} if earlier else {}
    ends = [one for one in found.scored if one.fitted.fit.converged]
    rival = max(ends, key=lambda one: one.training).fitted if ends else None
    if rival is None and base.fit.like_noise(2):
        rival = base
    chosen = [name for name in choose(base, found.screened, options, everything) if name not in without]
    if stands:
        chosen = [name for name in chosen if name not in known]
    # earlier leaders come first: the others may then be far behind at once
    ranked = list(known)
    chosen.sort(key=lambda name: ranked.index(name) if name in ranked else len(ranked))
    if rival is None and not ranked and base.fit.reduced_chi2 > FIT.near_base:
        chosen = _promising_first(context, found, chosen)
    for number, name in enumerate(chosen):
        if found.scored and not context.has_result:
            context.limit.work_counts = True
        if context.late and found.scored:
            break
        context.report(f"fitting {name}", number / len(chosen))
        fitted = refit(
            context.training,
            base,
            found.candidates[name],
            found.screened,
            rival,
            options.quick,
            known.get(name),
        )
        # a candidate far behind a machine that leaves only noise and predicts needs no prediction
        prediction = None if _far_behind(fitted, found, rival) else context.predict(fitted, _leading(found))
        found.scored.append(_simplest(context, found, found.score(fitted, prediction)))
        fitted = found.scored[-1].fitted
        if fitted.fit.converged and (rival is None or gain_over(fitted, rival)[0] > 0):
            rival = fitted
    found.rank()
    if context.late:
        return found
    _carry_on(context, found)
    _cross(context, found)
    _same_motion(context, found)
    _fair(context, found)
    return found


def _promising_first(context: SearchContext, found: Round, names: list[str]) -> list[str]:
    """The order of a few steps of each: far from the base the screen is none.

    A machine that closes the gap spares the others most of their starts.
    """
    totals = {}
    for number, name in enumerate(names):
        context.report(f"trying {name}", number / len(names) / 2)
        totals[name] = rough_total(context.training, found.base, found.candidates[name], found.screened)
    return sorted(names, key=totals.get)


def _screened(context: SearchContext, base: Fitted, predicted: Prediction | None) -> Round:
    """All candidates on top of a machine and what they would do, none of them fitted yet."""
    options = context.options
    free = with_values(base.problem.free, base.fit.values)
    candidates: dict[str, Candidate] = {}
    absent: dict[str, str] = {}
    every = base.problem.effects(options.candidates)
    for name in every:
        if name in base.names:
            continue
        if any(path.startswith(f"effect.{name}.") for path in base.model.parameters):
            continue
        if name in ON_REQUEST and not options.candidates:
            absent[name] = ON_REQUEST[name]
            continue
        why = base.problem.cannot_show(effect_of(name))
        if why:
            absent[name] = why
            continue
        made = candidate_of(base.model, free, base.names, name, context.scales)
        if isinstance(made, str):
            absent[name] = made
        else:
            candidates[name] = made
    context.report(f"screening {len(candidates)} effects")
    shown = {name: signature(base.problem, base.fit, one) for name, one in candidates.items()}
    signatures = [one for one in shown.values() if one is not None]
    absent |= {name: "it changes nothing in these records" for name, one in shown.items() if one is None}
    absent = {name: absent[name] for name in every if name in absent}
    return Round(base, predicted, candidates, signatures, screen(base.fit, signatures), absent)


def _simplest(
    context: SearchContext, found: Round, whole: ScoredCandidate, doubtful: bool = True
) -> ScoredCandidate:
    """The effect, or one of its laws alone that has more evidence; if `doubtful`, where one may be zero."""
    best = whole
    if whole.prediction is None and context.held_out is not None:
        return best
    candidate = found.candidates[whole.name]
    for part, fitted in halves(context.training, found.base, candidate, whole.fitted, doubtful):
        one = found.score(fitted, context.predict(fitted, whole.prediction))
        if one.evidence > best.evidence:
            best, found.candidates[whole.name] = one, part
    return best


def _leading(found: Round) -> Prediction | None:
    """The best prediction of the held-out records so far, whose starts are the nearest."""
    able = [one for one in found.scored if one.prediction is not None and one.held_out > 0]
    return max(able, key=lambda one: one.held_out).prediction if able else found.predicted


def _far_behind(fitted: Fitted, found: Round, rival: Fitted | None) -> bool:
    if rival is None or not (leaves_noise(rival, found.base) and beaten(fitted, rival)):
        return False
    return rival is found.base or any(one.fitted is rival and one.held_out >= 0 for one in found.scored)


def _beaten_by_noise(fitted: Fitted, base: Fitted) -> bool:
    """Whether a candidate is far behind a base that already leaves only noise."""
    return base.fit.like_noise(2) and beaten(fitted, base)


def _fair(context: SearchContext, found: Round) -> None:
    """Let the base predict from the starts of the best candidate too, and compare all with that."""
    if found.predicted is None or not found.scored or found.scored[0].held_out < SEARCH.worth_a_refit:
        return
    fairer = context.predict(found.base, found.scored[0].prediction)
    if fairer.score[fairer.good].sum() <= found.predicted.score[found.predicted.good].sum():
        return
    found.predicted = fairer
    found.scored = [found.score(one.fitted, one.prediction) for one in found.scored]
    found.rank()


def _carry_on(context: SearchContext, found: Round) -> None:
    """Fit the candidates near the best to convergence and let them predict, whatever the screen promised."""
    order = found.scored
    for index, one in enumerate(order):
        near = order[0].evidence - one.evidence < SEARCH.near * context.options.separation
        done = one.fitted.fit.converged
        if near and not (done and (one.prediction is not None or context.held_out is None)):
            fitted = one.fitted
            # over a base that leaves only noise the remainder cannot be named
            if not done and not _beaten_by_noise(fitted, found.base):
                fitted = carried_on(context.training, found.candidates[one.name], fitted, patient=True)
            order[index] = found.score(fitted, context.predict(fitted, one.prediction))
    found.rank()


def _cross(context: SearchContext, found: Round) -> None:
    """Try the leaders again from the machine of the best: it may have left a minimum of theirs."""
    order = found.scored
    if len(order) < 2 or context.options.quick or order[0].training < SEARCH.worth_crossing:
        return
    best = order[0].fitted
    for index in range(1, min(SEARCH.crossed, len(order))):
        one = order[index]
        behind = order[0].evidence - one.evidence
        if behind < context.options.separation or one.evidence < SEARCH.crossed_share * order[0].evidence:
            continue
        better = crossed(context.training, one.fitted, best, found.candidates[one.name])
        if better is not one.fitted:
            order[index] = found.score(better, context.predict(better, order[0].prediction))
    found.rank()


def _same_motion(context: SearchContext, found: Round) -> None:
    """Start names of one motion from the best of them: they share its motion, unless sticking differs.

    A name whose fit ended in another minimum would be missed in a verdict.
    """
    order = found.scored
    best = next((one for one in order if effect_of(one.name).confused), None)
    if best is None or context.options.quick or best.training < SEARCH.worth_crossing:
        return
    if best.evidence < SEARCH.crossed_share * order[0].evidence:
        return
    for index, one in enumerate(order):
        behind = best.evidence - one.evidence
        if one.name not in effect_of(best.name).confused or behind < context.options.separation:
            continue
        better = imitating(context.training, one.fitted, best.fitted, found.candidates[one.name])
        if better is not one.fitted:
            one = found.score(better, context.predict(better, best.prediction))
        order[index] = _simplest(context, found, one, doubtful=False)
    found.rank()


def choose(base: Fitted, screened: Screened, options: Options, everything: bool = False) -> list[str]:
    """Names to refit, best first; all of them where the base is too bad for the linear screen."""
    order = sorted(filter(screened.seen, screened.names), key=lambda name: -screened.gain[name])
    bad = base.fit.reduced_chi2 > SEARCH.bad_base and not options.quick
    if everything or (bad and cleaned(base.problem, base.fit).reduced_chi2 > SEARCH.bad_base):
        return order
    return [
        name
        for index, name in enumerate(order)
        if (
            index < SEARCH.certain_refits
            and (screened.gain[name] > SEARCH.worth_a_refit or index < SEARCH.fewest_refits)
        )
        or (
            screened.gain[name] > SEARCH.worth_a_refit
            and not options.quick
            and (
                any(screened.cosine(name, other) > SEARCH.related for other in order[:3])
                or (
                    not screened.live[name].any()
                    and screened.gain[name] > SEARCH.curved_share * screened.gain[order[0]]
                )
            )
        )
    ]


def pair_gains(screen_round: Round) -> list[tuple[float, str, str]]:
    """Linearised gain of every pair of effects, best first."""
    fit = screen_round.base.fit
    evaluation = fit.evaluation
    signatures = screen_round.signatures
    columns = [evaluation.by_parameter, *[one.columns for one in signatures]]
    matrix, gradient = fit.normal_equations(*columns).total()
    left, score = project(matrix, gradient, evaluation.by_parameter.shape[2], ~fit.at_bound)
    edges = np.cumsum([0, *[one.columns.shape[2] for one in signatures]])
    found = []
    for i in range(len(signatures)):
        for j in range(i):
            part = np.r_[edges[i] : edges[i + 1], edges[j] : edges[j + 1]]
            step = solve_scaled(left[np.ix_(part, part)], score[part], np.ones(part.size, bool))
            found.append((0.5 * float(score[part] @ step), signatures[i].name, signatures[j].name))
    return sorted(found, reverse=True)
