# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records that a machine misses, and stated noise that cannot be right, by the chi^2 of each record."""

import numpy as np
from scipy.stats import chi2

from separatrix.discovery.decision.table_range import scored_segments
from separatrix.discovery.fitting.data import Data
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.heldout import Prediction, explained
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.noise import noise_of, white_share
from separatrix.discovery.fitting.rescue import suspicious
from separatrix.discovery.measured.preflight import Prepared
from separatrix.discovery.measured.signals import white_noise
from separatrix.discovery.options import Options
from separatrix.discovery.policy import SEARCH
from separatrix.discovery.wording import units_of


def record_chi2(data: Data, fit: Fit) -> dict[int, tuple[float, int]]:
    """Reduced chi^2 of each record and its degrees of freedom; the machine counts as known."""
    record = data.stages[data.last].record
    found = {}
    for number in range(len(data.prepared)):
        rows = (record == number) & fit.good
        squares, more = fit.condensed(rows)
        freedom = int(fit.counts[rows].sum() - fit.unknowns * rows.sum() + more)
        if freedom > 0:
            found[number] = (float((fit.chi2[rows].sum() + squares) / freedom), freedom)
    return found


def missed(data: Data, fit: Fit, options: Options) -> list[str]:
    """Return, in words, the records whose reduced chi^2 is neither that of an adequate model nor chance.

    Also those along which the machine cannot be simulated.
    """
    record = data.stages[data.last].record
    found = record_chi2(data, fit)
    lost = [number for number in np.unique(record) if fit.evaluation.failed[record == number].all()]
    return [f"{data.prepared[number].record.name} (no segment of it can be flown)" for number in lost] + [
        f"{data.prepared[number].record.name} (reduced chi^2 {size:.4g})"
        for number, (size, freedom) in found.items()
        if size > _limit(data.prepared[number], options)
        and chi2.sf(size * freedom, freedom) < options.detection_level / len(found)
    ]


def unused(data: Data, fit: Fit, contacts: bool) -> list[str]:
    """Return in words how many segments of each record a machine, with contacts or none, is not scored by."""
    record, evaluation = data.stages[data.last].record, fit.evaluation
    notes = []
    for number, one in enumerate(data.prepared):
        here = record == number
        lost = here & ~fit.good
        failed = lost & evaluation.failed
        empty = lost & ~failed & (fit.counts == 0)
        others = int((lost & ~failed & ~empty).sum())
        why = [f"{failed.sum()} cannot be flown"] if failed.any() else []
        why += [f"{empty.sum()} have no sample that counts"] if empty.any() else []
        if others and contacts:
            why.append(f"the impacts of {others} are not steady")
        elif others:
            why.append(f"{others} have no derivatives at some samples")
        if why:
            reasons = " and ".join(why)
            notes.append(f"{one.record.name}: {lost.sum()} of {here.sum()} segments are not used: {reasons}")
    return notes


def misses(prediction: Prediction, fitted: Fit, options: Options) -> bool:
    """Whether held-out records are missed, by more than chance and not in a few segments alone."""
    kept, freedom = _followed(prediction)
    # noise that was overestimated in training is overestimated here too
    size = prediction.fit.chi2[kept].sum() / freedom / min(1.0, fitted.reduced_chi2)
    return bool(size > max(options.adequate_chi2, 1 + SEARCH.chi2_chance * np.sqrt(2 / freedom)))


def refuted(prediction: Prediction, fitted: Fit, options: Options) -> bool:
    """Whether held-out records are missed by more than errors of noise or parameters explain."""
    _, freedom = _followed(prediction)
    return predicted_chi2(prediction, fitted) > max(
        options.missed_chi2, 1 + SEARCH.chi2_chance * np.sqrt(2 / freedom)
    )


def predicted_chi2(prediction: Prediction, fitted: Fit) -> float:
    """Reduced chi^2 of held-out records over that in training, where it is above 1.

    The part that likely errors of the parameters explain is subtracted, and the few segments that may be in
    a wrong minimum are left out.
    """
    kept, freedom = _followed(prediction)
    left = prediction.fit.chi2[kept].sum() - explained(prediction, kept)
    return float(left / freedom / max(1.0, fitted.reduced_chi2))


def _followed(prediction: Prediction) -> tuple[np.ndarray, float]:
    """Held-out segments that can be scored, and their degrees of freedom.

    The few that may be in a wrong minimum are left out, and those beyond what a fitted table covers.
    """
    fit, kept = prediction.fit, prediction.good & scored_segments(prediction)
    in_local_minimum = suspicious(fit)
    if in_local_minimum.size <= SEARCH.most_in_local_minimum:
        kept[in_local_minimum] = False
    return kept, max(1.0, float((fit.counts - fit.unknowns)[kept].sum()))


def _limit(one: Prepared, options: Options) -> float:
    """Reduced chi^2 above which a record is missed.

    Unstated noise and its memory are estimates themselves, and rounding follows the motion instead of chance.
    """
    rounding = one.resolution**2 / 12 > SEARCH.rounding_share * one.sigma**2
    return one.doubt * (options.adequate_chi2 if one.sigma_stated and not rounding else options.missed_chi2)


def doubted_noise(data: Data, problem: Likelihood, fit: Fit, mass: float) -> list[str]:
    """Return in words what noise cannot be as stated or measured, by the best machine that was found.

    More scatter counts only if the fourth differences of the samples show it too: a machine that lacks
    something leaves more than noise.
    """
    notes = []
    units = units_of(problem.model.parameters)
    unit = problem.unit(units)
    factors = noise_of(problem, fit, 0, mass).factors
    found = record_chi2(data, fit)
    for number, one in enumerate(data.prepared):
        if number not in found:
            continue
        if not one.sigma_stated:
            notes += _more_than_white(one, unit)
            continue
        scatter = min(one.sigma * factors.get(number, 1.0), white_noise(one.signal))
        if scatter > SEARCH.noise_disagreement * one.sigma:
            notes.append(f"{_stated(one, unit)} scatter by {scatter:.3g} {unit}")
        size, freedom = found[number]
        if size < SEARCH.too_quiet and freedom > SEARCH.freedom_of_doubt:
            notes.append(
                f"{_stated(one, unit)} scatter by only {one.sigma * np.sqrt(size):.3g} {unit}: "
                "what is smaller than the stated noise is overlooked"
            )
    return notes


def _more_than_white(one: Prepared, unit: str) -> list[str]:
    """Noise that was measured as far larger than the samples scatter: coloured, or what the machine lacks."""
    white = white_noise(one.signal)
    key = one.noise_key
    if (
        one.sigma < SEARCH.noise_larger * white / np.sqrt(white_share(one.memory))
        or one.resolution**2 > 3 * one.sigma**2
    ):
        return []
    return [
        f"{one.record.name}: noise of {one.sigma:.3g} {unit} is taken, neighbouring samples scatter by "
        f"{white:.3g} {unit}: either the noise is coloured, or it hides a gap; {key} states it"
    ]


def _stated(one: Prepared, unit: str) -> str:
    return f"{one.record.name}: noise is stated as {one.sigma:.3g} {unit}, the samples"


def too_quiet(data: Data, fit: Fit) -> bool:
    """Whether records scatter by far less than their stated noise."""
    found = record_chi2(data, fit)
    return any(
        data.prepared[number].sigma_stated and size < SEARCH.too_quiet and freedom > SEARCH.freedom_of_doubt
        for number, (size, freedom) in found.items()
    )
