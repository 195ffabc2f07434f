# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Evidence of the candidates and the gates that a name has to pass."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import binom, chi2

from separatrix.discovery.decision.table_range import within_tables
from separatrix.discovery.fitting.ceiling import Ceiling
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.fitted import Fitted, gain_over
from separatrix.discovery.fitting.heldout import Prediction, ahead, gained_together
from separatrix.discovery.fitting.joint_effects import effect_of
from separatrix.discovery.fitting.locations import usual_speed
from separatrix.discovery.fitting.rig import share_with_imperfections
from separatrix.discovery.options import Options
from separatrix.discovery.policy import SEARCH

# what imperfections add where they were not weighed
_NO_IMPERFECTIONS = (0.0, 0.0)


@dataclass
class ScoredCandidate:
    """A candidate with what it gained: log-likelihood in training, log score on held-out records."""

    fitted: Fitted
    prediction: Prediction | None
    training: float
    held_out: float
    held_out_parts: np.ndarray
    parameters: int
    p: float = 1.0
    gates: dict[str, bool] = field(default_factory=dict)
    ceiling: Ceiling | None = None
    # share of the gain that small imperfections of a rig do not explain
    own: float = 1.0
    # the same for the gain on held-out records, and the prediction of the base there
    own_predicted: float = 1.0
    predicted: Prediction | None = None
    # what it leaves, if it is adequate
    leaves: str = ""
    # log-likelihood that imperfections of a rig beside it add, where it was fitted and where it predicted;
    # None where they were not weighed
    imperfections: tuple[float, float] | None = None

    @property
    def name(self) -> str:
        """The effect that was added last."""
        return self.fitted.names[-1]

    @property
    def settled(self) -> bool:
        """Whether the fit is at its end: converged, or at a kink from where little of the gain is missing."""
        fit = self.fitted.fit
        kink = (
            fit.exhausted
            and not fit.in_local_minimum
            and fit.decrement < SEARCH.kink_share * 2 * self.training
        )
        return bool(fit.converged or kink)

    @property
    def evidence(self) -> float:
        """Log-likelihood gained, less one per parameter (Akaike), plus the score on what was not fitted.

        Where they were weighed, with imperfections of a rig beside it.
        """
        return self.fitted_evidence + self.predicted_evidence

    @property
    def own_evidence(self) -> float:
        """The same without imperfections."""
        return self.training - self.parameters + self.held_out

    @property
    def fitted_evidence(self) -> float:
        """Of the records that were fitted."""
        return self.training - self.parameters + (self.imperfections or _NO_IMPERFECTIONS)[0]

    @property
    def predicted_evidence(self) -> float:
        """Of the records that were predicted."""
        return self.held_out + (self.imperfections or _NO_IMPERFECTIONS)[1]


def scored(
    base: Fitted, predicted: Prediction | None, fitted: Fitted, prediction: Prediction | None
) -> ScoredCandidate:
    """Evidence of a candidate over the base."""
    training, _ = gain_over(fitted, base)
    parts = np.zeros(0)
    if prediction is not None and predicted is not None:
        parts = gained_together(prediction, predicted)
    live = max(1, int((~fitted.fit.at_bound[list(fitted.added)]).sum()))
    return ScoredCandidate(fitted, prediction, training, float(parts.sum()), parts, live, predicted=predicted)


def lead(one: ScoredCandidate, other: ScoredCandidate) -> float:
    """Evidence of one candidate over another of the same base, compared directly."""
    if one.prediction is None or other.prediction is None:
        return one.evidence - other.evidence
    fitted = one.fitted_evidence - other.fitted_evidence
    mine, theirs = ((each.imperfections or _NO_IMPERFECTIONS)[1] for each in (one, other))
    return fitted + ahead(one.prediction, other.prediction) + (mine - theirs)


def detection(one: ScoredCandidate, tested: float, inflation: float) -> float:
    """Family-wise p value of what a candidate gained, for candidates worth so many independent tests.

    What small imperfections of the rig may explain of it is no gain.
    """
    gained = one.own * one.training + one.own_predicted * one.held_out
    return family_wise(2 * gained / inflation, one.parameters, tested)


def family_wise(gain: float, parameters: int, tested: float) -> float:
    """Probability that the best of `tested` independent candidates lowers chi^2 by as much by chance."""
    single = chi2.sf(max(0.0, gain), parameters)
    return float(-np.expm1(tested * np.log1p(-min(single, 1 - 1e-16))))


def held_out_bounds(one: ScoredCandidate, options: Options) -> dict[int, tuple[float, float]]:
    """Lower and upper 5 % bound of the gain in each held-out record, over the misfit, by block bootstrap.

    Segments that one of the machines cannot follow are not drawn, nor those in which the effect does not act,
    such as those without an impact for one of restitution. Where few are left, the bounds are the odds of a
    name away from what they gained.
    """
    bounds = {}
    random = np.random.default_rng([options.seed, 11])
    informative = _informative(one)
    for number in np.unique(one.prediction.record):
        here = one.prediction.record == number
        parts = one.held_out_parts[here & informative] / one.prediction.misfit
        if parts.size < SEARCH.few_segments:
            whole = float(one.held_out_parts[here].sum()) / one.prediction.misfit
            bounds[int(number)] = (whole - options.separation, whole + options.separation)
            continue
        sums = _block_sums(parts, random, options.bootstraps)
        bounds[int(number)] = (float(np.quantile(sums, 0.05)), float(np.quantile(sums, 0.95)))
    return bounds


def predicts(one: ScoredCandidate, options: Options) -> bool:
    """Whether one held-out record alone supports an effect by the odds of a name, and in several segments.

    The prediction of a right base is beaten by more than log(1/p) with a probability of at most p (Ville),
    for any mixture of segments. It must also be beaten without the best segment, or in a significant number
    of segments (sign test).
    """
    records = np.unique(one.prediction.record)
    # any of several records may be the one
    least = options.separation + np.log(records.size)
    for number in records:
        parts = one.held_out_parts[one.prediction.record == number] / one.prediction.misfit
        parts = parts[parts != 0]
        if parts.sum() <= least:
            continue
        better = int(np.sum(parts > 0))
        if parts.sum() > parts.max() or binom.sf(better - 1, parts.size, 0.5) < SEARCH.better_segments_p:
            return True
    return False


def beyond_doubt(one: ScoredCandidate, base: Fitted, options: Options) -> bool:
    """Whether fitted records prove an effect on which held-out ones have no information.

    Held-out records are predicted alike, or no worse than by chance where the expected gain, half of the
    information on the effect, is small. Over a base that is not at its minimum they do count.
    """
    parts, misfit = one.held_out_parts, one.prediction.misfit
    compared = np.count_nonzero(parts) > parts.size / 2
    alike = float(np.abs(parts).sum()) < options.separation * misfit
    expected = float(_held_out_information(one).sum()) / 2
    silent = expected < options.separation and float(parts.sum()) > options.harm * misfit
    doubtless = one.training - one.parameters > SEARCH.doubtless * misfit
    return bool(compared and (alike or silent) and base.fit.converged and doubtless)


def _held_out_information(one: ScoredCandidate) -> np.ndarray:
    """Information of each held-out segment on the added parameters, over their sizes."""
    fitted, prediction = one.fitted, one.prediction
    shared = [i for i, free in enumerate(fitted.problem.free) if free.record is None]
    added = [i for i in fitted.added if i in shared]
    columns = [shared.index(i) for i in added]
    return _information(fitted, prediction.fit.reduced.matrix, added, columns)


def _informative(one: ScoredCandidate) -> np.ndarray:
    """Whether both machines follow a held-out segment and it has information on what was added."""
    prediction, information = one.prediction, _held_out_information(one)
    informative = np.zeros(information.size, bool)
    for number in np.unique(prediction.record):
        here = prediction.record == number
        informative[here] = information[here] > SEARCH.silent_segment * information[here].mean()
    return informative & (one.held_out_parts != 0)


def _information(
    fitted: Fitted, matrix: np.ndarray, added: Sequence[int], columns: Sequence[int] | None = None
) -> np.ndarray:
    """Information of each segment on the added parameters, over their sizes; `columns`: in the matrix."""
    sizes = np.array([_size(fitted, i) for i in added])
    columns = added if columns is None else columns
    return (matrix[:, columns, columns] * sizes**2).max(axis=1, initial=0.0)


def _block_sums(parts: np.ndarray, random: np.random.Generator, count: int) -> np.ndarray:
    """Totals of resampled series of the same length, drawn in blocks of neighbours (circular)."""
    n = parts.size
    blocks = -(-n // SEARCH.bootstrap_block)
    first = random.integers(0, n, (count, blocks))
    index = (first[:, :, None] + np.arange(SEARCH.bootstrap_block)) % n
    return parts[index].sum(axis=(1, 2))


def stable(one: ScoredCandidate, base: Fitted, options: Options) -> float:
    """Share of block bootstraps of the segments in which the effect pays for its parameters.

    Only segments that have information on the effect are drawn; where they are few, it has to pay without the
    best of them. Held-out segments are drawn too where the training records alone support the effect. All
    gains are over the misfit.
    """
    fit = one.fitted.fit
    added = np.array(one.fitted.added)
    added = added[~fit.at_bound[added]]
    misfit = max(1.0, fit.reduced_chi2)
    gain, parts = gain_over(one.fitted, base)
    gain, parts = gain / misfit, parts / misfit
    if not added.size:
        return 0.0
    information = _information(one.fitted, fit.reduced.matrix, added)
    informative = information > SEARCH.silent_segment * information.mean()
    rest = min(0.0, float(parts[~informative].sum()))
    proven = one.held_out_parts.size and gain - one.parameters > options.separation
    if informative.sum() < SEARCH.few_segments:
        predicted = one.held_out_parts.sum() / one.prediction.misfit if proven else 0.0
        others = parts[informative].sum() - parts[informative].max(initial=0.0)
        return float(others + rest + predicted > one.parameters)
    random = np.random.default_rng([options.seed, 12])
    sums = rest + _block_sums(parts[informative], random, options.bootstraps)
    if proven:
        sums = sums + _block_sums(one.held_out_parts / one.prediction.misfit, random, options.bootstraps)
    return float(np.mean(sums > one.parameters))


def differs_from_nothing(fitted: Fitted, i: int) -> bool:
    """Whether the 95 % interval of a parameter is without zero, or the number behind a logarithm is known."""
    error = float(np.sqrt(fitted.covariance[i, i]))
    return _size(fitted, i) > 1.96 * error > 0


def _size(fitted: Fitted, i: int) -> float:
    """Distance of a parameter from no effect; 1 of the logarithm where it is one."""
    return 1.0 if fitted.problem.free[i].positive else abs(fitted.fit.values[i])


def sliding_speed(fitted: Fitted) -> float:
    """Usual speed of the body while it moves: at rest no speed of friction is seen."""
    fit = fitted.fit
    v = fit.evaluation.v[fitted.problem.segments.inside & fit.good[:, None]]
    v = v[v != 0]
    return float(np.sqrt(np.mean(v**2))) if v.size else 0.0


def _together_clear(fitted: Fitted, columns: list[int]) -> bool:
    """Whether the 95 % region of several parameters is without zero, though the interval of each may have it.

    The values of a table share a constant that another parameter of the machine can absorb.
    """
    variance = np.diag(fitted.covariance)
    columns = [i for i in columns if not fitted.problem.free[i].positive and variance[i] > 0]
    if len(columns) < 2:
        return False
    size = np.sqrt(variance[columns])
    information = np.linalg.pinv(
        fitted.covariance[np.ix_(columns, columns)] / np.outer(size, size), hermitian=True
    )
    values = fitted.fit.values[columns] / size
    return bool(values @ information @ values > chi2.ppf(0.95, len(columns)))


def clear_of(best: ScoredCandidate, other: ScoredCandidate, options: Options) -> bool:
    """Whether a candidate clearly beats another one, even if that has small imperfections of the rig.

    Records that were fitted and records that were not must not clearly contradict each other.
    """
    least = margin(best, other, options)
    over = lead(best, other)
    fitted = best.fitted_evidence - other.fitted_evidence
    if any(best.imperfections or _NO_IMPERFECTIONS) and any(other.imperfections or _NO_IMPERFECTIONS):
        # both have them already, as far as they are linear
        unsure = SEARCH.not_linear * max(sum(best.imperfections), sum(other.imperfections))
        return over >= least and min(fitted, over - fitted) > -max(least, unsure)
    if over < least or min(fitted, over - fitted) <= -least:
        return False
    return over * share_with_imperfections(best.fitted, other.fitted) >= least


def margin(best: ScoredCandidate, other: ScoredCandidate, options: Options) -> float:
    """Evidence by which a candidate must beat another one: more where the two are names of one motion."""
    scale = options.separation * max(1.0, best.fitted.fit.reduced_chi2)
    return scale * (options.equivalent if equivalent(best, other) else 1.0)


def equivalent(one: ScoredCandidate, other: ScoredCandidate) -> bool:
    """Whether two fits differ only by two names of the same motion."""
    mine, theirs = set(one.fitted.names), set(other.fitted.names)
    left, right = mine - theirs, theirs - mine
    return len(left) == len(right) == 1 and right.pop() in effect_of(left.pop()).confused


def admissible(one: ScoredCandidate, base: Fitted, options: Options) -> tuple[bool, str]:
    """Signs and bounds: the effect is inside of its own, is not nothing, and leaves the drive sensible."""
    fit, free = one.fitted.fit, one.fitted.problem.free
    base_good = int(base.fit.good.sum())
    inside = [i for i in one.fitted.added if not fit.at_bound[i]]
    clear = [differs_from_nothing(one.fitted, i) for i in inside]
    if fit.good.sum() < options.followed * max(1, base_good):
        return False, "the machine with it cannot follow some segments that the base can"
    if not clear:
        return False, "its parameters are at their bounds: the wrong sign"
    if not any(clear) and not _together_clear(one.fitted, inside):
        return False, "its 95 % intervals contain zero"
    usual = sliding_speed(one.fitted)
    lowest, highest = options.drive_scales
    for i, value in enumerate(fit.values):
        if free[i].path == "effect.stribeck.velocity" and free[i].physical(value) > usual:
            return False, "its velocity is above the usual speed, where it is Coulomb friction"
        if free[i].path.endswith(".stribeck_velocity") and i in inside:
            joint = free[i].path.rpartition(".")[0]
            if free[i].physical(value) > usual_speed(one.fitted.problem, fit, joint):
                return False, "its velocity is above the usual speed there, where it is Coulomb friction"
        if free[i].path == "nuisance:drive_scale" and not lowest < value < highest:
            return False, f"it would need a drive {value:.3g} times the stated one"
    return True, ""


NOISE, LITTLE, LARGER_NOISE = "noise", "little of the gap", "larger noise"


def adequate(one: ScoredCandidate, options: Options) -> str:
    """What an adequate machine leaves; '' if it is not adequate.

    `noise`: the fit is like noise and a flexible force explains nothing more, or less than the effect does
    and nothing that is sizeable. `little of the gap`: no more than a share of it, however significant.
    `larger noise`: somewhat more than noise, of which no force explains anything. Small imperfections of a
    rig count as noise.
    """
    fit = one.ceiling.fit
    gained = max(0.0, 2 * one.training)
    share = gained / max(gained + one.ceiling.closable, 1e-300)
    trifle = share > 0.5 and not sizeable(one.ceiling.closable, fit, options)
    clean = one.ceiling.p > options.detection_level or trifle
    closed = share >= options.adequate_share and one.ceiling.p > options.adequate_p
    doubt = max((record.doubt for record in one.fitted.problem.prepared), default=1.0)
    if fit.sample_chi2 <= doubt * options.adequate_chi2 and (clean or closed):
        return NOISE
    if _all_closed(one, options):
        return LITTLE
    # no force explains more: the noise is larger than stated or measured
    noisier = one.ceiling.p > options.detection_level and share >= options.adequate_share
    return LARGER_NOISE if noisier and fit.sample_chi2 <= options.missed_chi2 else ""


def sizeable(gain: float, fit: Fit, options: Options, least: float | None = None) -> bool:
    """Whether a gain of chi^2 is that of a motion of some size beside the noise of a sample."""
    least = options.least_gap if least is None else least
    return gain > least**2 * fit.samples


def extrapolates(one: ScoredCandidate, options: Options) -> bool:
    """Whether a table is hardly known along held-out records, and yet leaves little of their gap."""
    if one.prediction is None or within_tables(one.prediction).sum() >= SEARCH.few_segments:
        return False
    return _held_out_closed(one, options)


def _all_closed(one: ScoredCandidate, options: Options) -> bool:
    """Whether the gap is closed but for a small share of another cause, where it was fitted and predicted."""
    left = max(one.ceiling.closable, one.ceiling.fit.excess, 0.0)
    if left > options.remaining * (2 * one.training + left):
        return False
    return one.prediction is None or _held_out_closed(one, options)


def _held_out_closed(one: ScoredCandidate, options: Options) -> bool:
    left = max(one.prediction.excess, 0.0)
    return left <= options.remaining * (2 * one.held_out + left)
