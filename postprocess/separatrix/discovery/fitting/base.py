# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The base machine fitted honestly: noise measured, phases found, several starts."""

import numpy as np

from separatrix.discovery.fitting.data import Data, fit_stages
from separatrix.discovery.fitting.fit import Fit, again, minimise
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.noise import noise_of
from separatrix.discovery.fitting.rig import cleaned
from separatrix.discovery.measured.signals import white_noise
from separatrix.discovery.policy import FIT


def fit_base(data: Data, model, mass: float) -> Fitted:
    """Fit all parameters that the records can determine; sets noise and memory of the records."""
    free = data.unknowns(model)
    find_phases(data, model, free)
    data.find_zeros(model, free)
    values = np.array([one.value for one in free])
    problem, fit = fit_stages(data, model, free, values, stages=[0, 1])
    measure_noise(data, problem, fit, mass)
    problem, fit = fit_stages(
        data, model, free, fit.values, stages=list(range(1, data.last + 1)), begin=(1, fit)
    )
    best = Fitted((), model, problem, fit, ())
    if not fit.converged or fit.reduced_chi2 > 2:
        # from the case as it stands, at the full length at once, and on from where the first try ended
        for begin, stages in (
            (np.array([one.value for one in free]), [data.last]),
            (fit.values, [1, data.last]),
        ):
            problem, fit = fit_stages(data, model, free, begin, stages=stages, most=40)
            same = _same_far_minimum(fit, best.fit)
            if _follows_better(fit, best.fit):
                best = Fitted((), model, problem, fit, ())
            if same:
                break
    if best.fit.converged:
        return best
    fit = minimise(best.problem, best.fit.values, best.fit.starts, patient=True)
    return best if fit.good.sum() < best.fit.good.sum() else Fitted((), model, best.problem, fit, ())


def _same_far_minimum(one: Fit, other: Fit) -> bool:
    """Whether two fits of a machine that lacks much follow the same segments as badly."""
    if one.good.sum() != other.good.sum() or one.reduced_chi2 < 2:
        return False
    alike = FIT.alike_behind if one.reduced_chi2 > FIT.near_base**2 else FIT.alike_near
    return abs(one.total - other.total) < alike * one.total


def _follows_better(fit: Fit, best: Fit) -> bool:
    """Whether a fit loses no segment of the best one and is closer, or the best one follows hardly any.

    A fit that follows no segment has no misfit.
    """
    kept, now = best.good.sum(), fit.good.sum()
    if kept < FIT.hardly_any * best.good.size:
        return bool(now > kept)
    return bool(now >= kept and fit.total < best.total)


def measure_noise(data: Data, problem: Likelihood, fit: Fit, mass: float) -> None:
    """Set what the records do not state.

    The fit must have been made without memory.
    """
    if data.measured_by_sensor(problem, fit):
        return
    found = noise_of(problem, fit, 0, mass)
    factors = found.factors
    before = np.median([data.prepared[i].sigma ** 2 for i in factors] or [1.0])
    for number, prepared in enumerate(data.prepared):
        measured = prepared.sigma * factors.get(number, 1.0)
        if not prepared.sigma_stated:
            prepared.sigma = max(measured, prepared.resolution / np.sqrt(12))
    if problem.channels > 1:
        # products of velocities in condensed blocks are not kept
        memory = found.memory if found.of_samples else None
        speeds = noise_of(problem, fit, 1, mass, memory).factors
        for number, prepared in enumerate(data.prepared):
            if prepared.record.v is not None and not prepared.velocity_sigma_stated:
                prepared.velocity_sigma *= speeds.get(number, 1.0)
    scatter = np.median([data.prepared[i].sigma ** 2 for i in factors] or [1.0])
    misfit = fit.reduced_chi2 * before / max(scatter, 1e-300)
    # with memory of the noise, values of blocks scatter by more than samples: that is no misfit
    known = found.of_samples or misfit < FIT.misfit_of_memory
    if not known and found.memory:
        # nor are small imperfections of a rig
        known = misfit * cleaned(problem, fit).reduced_chi2 / fit.reduced_chi2 < FIT.misfit_of_memory
    for prepared in data.prepared:
        prepared.memory = found.memory if known else 0.0
        prepared.memory_error = found.error


def renew_noise(data: Data, problem: Likelihood, fit: Fit, mass: float) -> bool:
    """Measure the noise anew by a better fit; whether it changed enough to matter (else it stays)."""
    before = [one.noise for one in data.prepared]
    for one in data.prepared:
        one.memory = 0.0
    measure_noise(data, problem, again(problem, fit), mass)
    changed = any(
        abs(one.noise[0] - memory) > FIT.memory_renewed
        or any(
            abs(np.log(now / was)) > FIT.noise_renewed for now, was in zip(one.noise[1:], sizes, strict=True)
        )
        for one, (memory, *sizes) in zip(data.prepared, before, strict=True)
    )
    if not changed:
        # what is compared must be scored with one noise
        for one, noise in zip(data.prepared, before, strict=True):
            one.noise = noise
    return changed


def find_phases(data: Data, model, free: list[Free]) -> None:
    """Search the crank angle of the records that do not state it, all else as in the case."""
    missing = [i for i, one in enumerate(data.prepared) if one.frequency is not None and not one.phase_stated]
    if not missing:
        return
    values = np.array([one.value for one in free])
    trials = []
    original = [one.phase for one in data.prepared]
    for turn in np.arange(FIT.phases) * 2 * np.pi / FIT.phases:
        for i in missing:
            data.prepared[i].phase = float(turn)
        problem, fit = fit_stages(data, model, free, values, stages=[0], most=4)
        record = problem.segments.record
        # a start that cannot be simulated is no fit
        lost = np.where(fit.evaluation.failed, 1e12, np.minimum(fit.chi2, 1e12))
        trials.append([float(np.sum(lost[record == i])) for i in missing])
    best = np.argmin(np.array(trials), axis=0)
    for one, phase in zip(data.prepared, original, strict=True):
        one.phase = phase
    for column, i in enumerate(missing):
        data.prepared[i].phase = float(best[column] * 2 * np.pi / FIT.phases)


def limit_noise(source: Data, target: Data) -> bool:
    """Limit the noise of far noisier records to that of the sensor of the fitted ones; whether any changed.

    A missing effect would hide in the noise of records that are too short to measure the noise again.
    """
    if any(one.sensor_noise for one in source.prepared):
        # nothing of theirs is measured on short records alone
        return False
    shares = [one.sigma / white for one in source.prepared if (white := white_noise(one.signal)) > 0]
    coloured = max([1.0, *shares])
    limited = False
    for one in target.prepared:
        sensor = max(coloured * white_noise(one.signal), one.resolution / np.sqrt(12))
        if not one.sigma_stated and one.sigma > FIT.same_sensor * sensor > 0:
            one.sigma, limited = sensor, True
    return limited


def copy_noise(source: Data, target: Data) -> None:
    """Give records that are not fitted the memory of the noise of those that are."""
    memory = float(np.mean([one.memory for one in source.prepared]))
    error = float(np.mean([one.memory_error for one in source.prepared]))
    for one in target.prepared:
        one.memory, one.memory_error = memory, error
