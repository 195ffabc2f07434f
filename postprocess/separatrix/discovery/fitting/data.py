# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records ready to be fitted: smoothed, and cut into short, middle and long segments."""

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from separatrix.discovery.fitting.catalogue import Scales
from separatrix.discovery.fitting.fit import Fit, minimise
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.machine import Free, base_parameters, drive_nuisances, sensor_zeros
from separatrix.discovery.fitting.one_body import BodyInForce, BodyInMotion
from separatrix.discovery.fitting.rescue import rescued, suspicious
from separatrix.discovery.measured.condense import condense, stride
from separatrix.discovery.measured.preflight import Prepared
from separatrix.discovery.measured.segments import Segments, cut
from separatrix.discovery.measured.signals import jumps, usual_size, white_noise
from separatrix.discovery.measured.smoother import (
    Smoothed,
    impact_table,
    in_intervals,
    reversals,
    smooth,
    stick_intervals,
)
from separatrix.discovery.policy import FIT
from separatrix.errors import SeparatrixError


@dataclass
class Data:
    """Prepared and smoothed records and their segments by stage."""

    prepared: list[Prepared]
    smoothed: list[Smoothed]
    stages: list[Segments]
    # starts of the longest segments by the base machine, tried where another machine is in a local minimum
    base_starts: np.ndarray | None = None
    # what imperfections of the rig add to the longest segments where they are fitted, as in a `Likelihood`
    imperfections: dict[tuple[str, int | None], np.ndarray] | None = None

    @property
    def last(self) -> int:
        """Number of the stage with the longest segments."""
        return len(self.stages) - 1

    def problem(self, model, stage: int, free: list[Free]) -> Likelihood:
        """The fit of a model to the segments of a stage."""
        imperfections = self.imperfections if stage == self.last else None
        kind = BodyInMotion if self.prepared[0].driven is None else BodyInForce
        return kind(model, self.prepared, self.stages[stage], free, imperfections)

    def unknowns(self, model) -> list[Free]:
        """What is free in the base machine."""
        force = any(one.record.force is not None for one in self.prepared)
        free = base_parameters(model, force, self.prepared[0].near_mass) + drive_nuisances(
            model, self.prepared
        )
        return free + sensor_zeros(free, len(self.prepared))

    def find_zeros(self, model, free: list[Free]) -> None:
        """Search the zeros of sensors that no record states; changes the values of `free`."""

    def take_zeros(self, free: list[Free]) -> None:
        """Take the zeros of sensors from a fit to other records."""

    def measured_by_sensor(self, problem: Likelihood, fit: Fit) -> bool:
        """Whether the noise of each sensor was measured by itself."""
        return False

    def details(self, number: int) -> dict[str, tuple[np.ndarray, dict]]:
        """What was measured of a record, for the file of details, with attributes."""
        prepared, smoothed = self.prepared[number], self.smoothed[number]
        columns = "t x v_before v_after v_before_error v_after_error"
        return prepared.details() | {
            "smoothed": (smoothed.state, {}),
            "smoothed_error": (np.sqrt(np.einsum("kii->ki", smoothed.covariance)), {}),
            "impacts": (impact_table(smoothed), {"columns": columns}),
            "reversals": (reversals(smoothed), {}),
            "stick": (np.array(stick_intervals(smoothed)).reshape(-1, 2), {}),
        }

    def with_imperfections(self, imperfections: dict[tuple[str, int | None], np.ndarray]) -> "Data":
        """The same records with imperfections of the rig, whose noise may be measured anew."""
        return replace(self, prepared=[copy(one) for one in self.prepared], imperfections=imperfections)

    def smoothed_starts(self, stage: int) -> np.ndarray:
        """Starts (segments, 2) of a stage from the smoother."""
        segments = self.stages[stage]
        starts = np.zeros((segments.count, 2))
        for r, (one, smoothed) in enumerate(zip(self.prepared, self.smoothed, strict=True)):
            rows = np.flatnonzero(segments.record == r)
            t = one.samples.t[segments.first[rows]]
            starts[rows] = smoothed.at(t)
            # of a body that sticks the smoother shows noise, from which a fit of its start would not return
            starts[rows[in_intervals(t, stick_intervals(smoothed))], 1] = 0.0
        return starts

    def smoothed_errors(self, stage: int) -> np.ndarray:
        """Standard errors of those starts."""
        segments = self.stages[stage]
        errors = np.zeros((segments.count, 2))
        for r, (one, smoothed) in enumerate(zip(self.prepared, self.smoothed, strict=True)):
            rows = np.flatnonzero(segments.record == r)
            near = smoothed.nearest(one.samples.t[segments.first[rows]])
            errors[rows] = np.sqrt(np.einsum("kii->ki", smoothed.covariance[near])[:, :2])
        return errors

    def carried_starts(self, stage: int, known: int, fit: Fit) -> np.ndarray:
        """Starts of a stage from the motion fitted at stage `known`; from the smoother where it failed."""
        starts = self.smoothed_starts(stage)
        old, new = self.stages[known], self.stages[stage]
        for r, record in enumerate(self.prepared):
            x = np.full(record.samples.t.size, np.nan)
            v = x.copy()
            for i in np.flatnonzero((old.record == r) & ~fit.evaluation.failed):
                inside = old.inside[i]
                x[old.index[i, inside]] = fit.evaluation.x[i, inside]
                v[old.index[i, inside]] = fit.evaluation.v[i, inside]
            rows = np.flatnonzero(new.record == r)
            carried = np.column_stack([x[new.first[rows]], v[new.first[rows]]])
            known_rows = np.all(np.isfinite(carried), axis=1)
            starts[rows[known_rows]] = carried[known_rows]
        return starts


def gather(prepared: list[Prepared], periods: float, seconds: float | None) -> Data:
    """Smooth and cut records; the longest segments have `periods` drive periods, or `seconds`."""
    smoothed, lengths = [], []
    for one in prepared:
        record = one.record
        # noise does not oscillate
        resting = one.period_samples if one.rests else None
        oscillation = resting or oscillation_samples(record.x)
        smoothed.append(_smoothed(one, oscillation))
        if seconds is not None:
            length = seconds / record.interval
        elif one.period_samples is not None:
            length = periods * min(one.period_samples, FIT.most_natural_periods * _natural_samples(one))
        else:
            length = periods * oscillation
        lengths.append(int(np.clip(length, FIT.fewest_segments, record.t.size / 3)))
    stages = [
        cut(
            [one.samples for one in prepared],
            smoothed,
            [max(FIT.fewest_segments, int(share * n)) for n in lengths],
        )
        for share in FIT.stage_lengths
    ]
    for number, one in enumerate(prepared):
        if not np.any(stages[-1].record == number):
            raise SeparatrixError(f"{one.record.file}{one.record.part}: gaps leave no interval to be fitted")
    return Data(prepared, smoothed, stages)


def _natural_samples(one: Prepared) -> float:
    """Samples per natural period, infinite where there is none."""
    return 2 * np.pi / one.natural / one.record.interval if one.natural else np.inf


def _smoothed(one: Prepared, oscillation: float) -> Smoothed:
    """Smooth a record; one that is sampled far faster than it moves is thinned, and condensed."""
    record = one.record
    known = one.known_motion(oscillation)
    if known is not None:
        return known
    period = min(one.period_samples or np.inf, _natural_samples(one), oscillation)
    every = stride(period, record.t.size)
    if every == 1:
        seen = smooth(record.t, record.x, one.sigma, one.period_samples)
        one.samples.blind = _blind(one, seen)
        return seen
    at = np.concatenate([np.arange(first, last, every) for first, last in record.pieces])
    seen = smooth(record.t[at], record.x[at], one.sigma, period / every)
    one.samples = condense(record, period, one.sigma, _events(record.t.size, at, seen))
    factor = one.samples.factor
    within, equal = "", " of equal information"
    if factor > 1:
        within, equal = f" within {factor:.0f} times the noise", ""
    one.notes.append(
        f"{record.t.size} samples, {period:.0f} per period of the motion: intervals in which it is "
        f"smooth{within} are condensed to {one.samples.t.size} values{equal}"
    )
    one.samples.blind = _blind(one, seen)
    return seen


def _blind(one: Prepared, seen: Smoothed) -> np.ndarray | None:
    """Rows whose velocity is left out, because an impact lies nearer than its time is known.

    A sample on the wrong side of a jump misses by hundreds of its noise, and no derivative shows in which
    direction the impact should move. The error of the time of an impact is that of position over speed.
    """
    samples, v = one.samples, one.samples.v
    if v is None:
        return None
    blind = np.zeros(v.size, bool)
    single = samples.size == 1
    rows = jumps(v, max(one.velocity_sigma, white_noise(one.record.v)))
    longest = FIT.beside_impact * (samples.t[-1] - samples.t[0]) / max(1, rows.size)
    for row in rows:
        if not (single[row] and single[row + 1]):
            continue
        near = seen.nearest(samples.t[row : row + 1])[0]
        late = (
            FIT.impact_time_errors * np.sqrt(seen.covariance[near, 0, 0]) / np.max(np.abs(v[row : row + 2]))
        )
        late = min(late, longest)
        first, last = np.searchsorted(samples.t, [samples.t[row + 1] - late, samples.t[row] + late])
        blind[min(first, row) : max(last, row + 2)] = True
    return blind & single


def _events(count: int, at: np.ndarray, seen: Smoothed) -> tuple[np.ndarray, np.ndarray, float]:
    """Samples around impacts; those where the body may turn or stick; the usual acceleration."""
    hit, slow = np.zeros(at.size, bool), np.zeros(at.size, bool)
    hit[seen.impacts] = True
    hit[np.minimum(seen.impacts + 1, at.size - 1)] = True
    slow |= np.abs(seen.v) < FIT.at_rest_errors * np.sqrt(seen.covariance[:, 1, 1])
    slow[:-1] |= seen.v[:-1] * seen.v[1:] <= 0
    for shift in (-1, 1):
        slow |= np.roll(slow, shift)
    slow &= ~_within_rests(seen)
    nearest = np.clip(np.searchsorted(at, np.arange(count)), 1, at.size - 1)
    nearest -= np.arange(count) - at[nearest - 1] < at[nearest] - np.arange(count)
    return hit[nearest], slow[nearest], float(np.median(np.abs(seen.state[:, 2])) / 0.6745)


def _within_rests(seen: Smoothed) -> np.ndarray:
    """Samples within a rest and away from its ends, where no friction jumps."""
    margin = FIT.rest_margin * float(np.median(np.diff(seen.t)))
    rests = [
        (begin + margin, end - margin) for begin, end in stick_intervals(seen) if end - begin > 2 * margin
    ]
    return in_intervals(seen.t, rests)


def oscillation_samples(x: np.ndarray) -> int:
    """Samples of one oscillation of a record."""
    return 4 * _correlation_samples(x)


def _correlation_samples(x: np.ndarray) -> int:
    """Samples until the autocorrelation of a record first crosses zero: a quarter of an oscillation."""
    centred = x - x.mean()
    spectrum = np.abs(rfft(centred, next_fast_len(2 * x.size, real=True))) ** 2
    correlation = irfft(spectrum)[: x.size]
    below = np.flatnonzero(correlation < 0)
    return int(below[0]) if below.size else x.size // 8


def fit_stages(
    data: Data,
    model,
    free: list[Free],
    values: np.ndarray,
    *,
    stages: list[int],
    robust: bool = True,
    most: int = 20,
    hopeless: float | None = None,
    begin: tuple[int, Fit] | None = None,
    fixed: np.ndarray | None = None,
    rival: Fit | None = None,
) -> tuple[Likelihood, Fit]:
    """Fit at each stage in turn, from short segments to long ones: Huber's loss, then squares at the last.

    The starts of a `rival` at the last stage are tried for suspicious segments, unless it is far ahead.
    """
    known = begin
    problem, fit = None, None
    for stage in stages:
        last = stage == stages[-1]
        problem = data.problem(model, stage, free)
        starts = data.smoothed_starts(stage) if known is None else data.carried_starts(stage, *known)
        begun = None
        if robust:
            # it only starts the fit by squares, or longer segments
            more = {"hopeless": hopeless, "fixed": fixed, "rough": True}
            fit = minimise(problem, values, starts, robust=True, most=most, **more)
            values, starts, begun = fit.values, fit.starts, fit.evaluation
        if not robust or last:
            fit = minimise(problem, values, starts, most=most, hopeless=hopeless, fixed=fixed, begun=begun)
            values = fit.values
        known = (stage, fit)
    if hopeless is not None and fit.far_off(hopeless):
        return problem, fit
    return problem, polished(data, problem, fit, stages[-1], most, fixed, rival=rival)


def polished(
    data: Data,
    problem: Likelihood,
    fit: Fit,
    stage: int,
    most: int,
    fixed: np.ndarray | None = None,
    rival: Fit | None = None,
    suspects: np.ndarray | None = None,
) -> Fit:
    """The fit after its suspicious segments, or those given, were tried by the machine of the others.

    The starts of a `rival`, a fit of the same segments, are tried too. Where the machine of the others is far
    behind it on these, the suspects are not what the fit lacks.
    """
    tried = [data.smoothed_starts(stage), *([] if rival is None else [rival.starts])]
    if stage == data.last and data.base_starts is not None and tried[-1] is not data.base_starts:
        tried.append(data.base_starts)
    errors = data.smoothed_errors(stage)
    if suspects is None:
        suspects = suspicious(fit)
    if not suspects.size:
        return fit
    versions = [fit]
    if suspects.size <= FIT.few_wrong * fit.counts.size:
        versions.append(_without(problem, fit, suspects, most, fixed))
        if rival is not None and _behind(versions[-1], rival, suspects):
            return fit
    best = fit
    for version in versions:
        starts, improved = rescued(problem, version, suspects, tried, errors)
        if improved.any():
            found = minimise(problem, version.values, starts, most=most, fixed=fixed)
            if found.good.sum() >= best.good.sum() and found.total < best.total:
                best = found
    return best


def _behind(fit: Fit, rival: Fit, suspects: np.ndarray) -> bool:
    """Whether a fit is far behind another one on all but the suspects."""
    both = fit.good & rival.good
    both[suspects] = False
    return bool((fit.chi2 - rival.chi2)[both].sum() > FIT.squares_behind + fit.decrement)


def _without(problem: Likelihood, fit: Fit, suspects: np.ndarray, most: int, fixed: np.ndarray | None) -> Fit:
    """The machine fitted to the other segments, evaluated on all."""
    kept = np.setdiff1d(np.arange(problem.segments.count), suspects)
    part = problem.of_segments(kept)
    found = minimise(part, fit.values, fit.starts[kept], most=most, fixed=fixed, rough=True)
    starts = fit.starts.copy()
    starts[kept] = found.starts
    return minimise(problem, found.values, starts, most=0)


def scales_of(data: Data, model) -> Scales:
    """Typical sizes in the records."""
    parameters = model.parameters
    mass = parameters["body.mass"].value if "body.mass" in parameters else 1.0
    x = np.concatenate([one.record.x for one in data.prepared])
    v = np.concatenate([one.v for one in data.smoothed])
    acceleration = np.concatenate([one.state[:, 2] for one in data.smoothed])
    length, speed = float(np.std(x)), float(np.sqrt(np.mean(v**2)))
    force = mass * usual_size(acceleration)
    speeds = np.concatenate([np.abs(one.v[one.impacts]) for one in data.smoothed])
    friction = 0.05 * force
    if "friction.kinetic_coefficient" in parameters:
        gravity = parameters["body.gravity"].value
        friction = max(friction, parameters["friction.kinetic_coefficient"].value * mass * gravity)
    # a body that mostly rests has hardly any usual acceleration
    force = max(force, friction)
    return Scales(
        mass,
        length,
        speed,
        force,
        float(np.median(speeds)) if speeds.size else speed,
        friction,
        float(np.min(x)),
        float(np.max(x)),
        float(np.median([one.record.interval for one in data.prepared])),
    )
