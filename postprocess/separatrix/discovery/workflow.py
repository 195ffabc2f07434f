# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""From records and a base case to a verdict."""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from separatrix.discovery.decision.plan import search
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.state import SearchState
from separatrix.discovery.decision.verdict import Findings, verdict_of
from separatrix.discovery.fitting.base import copy_noise, find_phases, fit_base, measure_noise
from separatrix.discovery.fitting.data import Data, fit_stages
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.machine import on_other_records, with_values
from separatrix.discovery.fitting.observations import Observation, observation_of
from separatrix.discovery.fitting.time_limit import OutOfTimeError, TimeLimit, kept
from separatrix.discovery.measured.records import Record, read_record, unique_names
from separatrix.discovery.options import Options
from separatrix.discovery.policy import RECORDS
from separatrix.errors import STOPPED, USAGE, SeparatrixError
from separatrix.library import Model
from separatrix.segments import flown_in_threads


def discover(
    base: object,
    records: Sequence[Path | Record],
    hold_out: Sequence[Path | Record] = (),
    options: Options | None = None,
    rest: Path | Record | None = None,
) -> dict:
    """Return the verdict (the content of verdict.json) on records of a machine that `base` models."""
    return investigate(base, records, hold_out, options, rest)[0]


def investigate(
    base: object,
    records: Sequence[Path | Record],
    hold_out: Sequence[Path | Record] = (),
    options: Options | None = None,
    rest: Path | Record | None = None,
) -> tuple[dict, "Findings"]:
    """As `discover`; also everything that the figures of the report need."""
    began = time.monotonic()
    options = options or Options()
    seen = _observation(base, options.compare)
    # what cannot be looked for is refused before any work
    seen.effects(options.candidates)
    read = [[_record(one) for one in group] for group in (records, hold_out)]
    still = None if rest is None else _record(rest, at_rest=True)
    training, held_out, chosen = _split(*read, seen, still)
    _all_different([*training, *held_out])
    unique_names([*training, *held_out])
    options.progress("reading and smoothing the records", 0.0)
    prepared = [[seen.prepare(one, still) for one in group] for group in (training, held_out)]
    if all(one.rests for one in prepared[0]):
        raise SeparatrixError(
            f"{training[0].file}: the body rests in all records to be fitted: nothing but noise"
        )
    data = seen.gather(prepared[0], options)
    predicted = seen.gather(prepared[1], options) if held_out else None
    limit = TimeLimit(began + (options.time_limit or np.inf))
    with kept(limit), flown_in_threads(options.workers):
        fitted = _fitted_base(data, predicted, seen, options)
        scales = seen.scales(data, fitted)
        found = search(SearchState(SearchContext(data, predicted, scales, options, limit=limit), fitted))
    # the noise of the base may have been measured again
    findings = Findings(found.context, found.round.base, found.decision, chosen, found.steps, found.stopped)
    verdict = verdict_of(findings)
    verdict["runtime_s"] = round(time.monotonic() - began, 3)
    return verdict, findings


def _fitted_base(data: Data, predicted: Data | None, seen: Observation, options: Options) -> Fitted:
    """The machine of the case, fitted to the records; what is predicted is made ready by it."""
    options.progress("fitting the base machine", 0.05)
    try:
        fitted = fit_base(data, seen.model, seen.mass)
        if not fitted.fit.good.any():
            raise SeparatrixError(
                "the base machine cannot follow any segment of these records: another machine?"
            )
        data.base_starts = fitted.fit.starts
        if predicted is not None:
            _prepare_held_out(predicted, data, seen.model, fitted, seen.scales(data, fitted).mass)
    except OutOfTimeError:
        raise SeparatrixError(
            f"the search ended at its time limit of {options.time_limit:g} s, while the machine of the case "
            "was fitted: no verdict, as no effect was tried yet",
            STOPPED,
        ) from None
    return fitted


def _prepare_held_out(held_out, training, model, fitted: Fitted, mass: float) -> None:
    """Noise and phases of the held-out records, measured on short segments with the machine as fitted."""
    free = with_values(fitted.problem.free, fitted.fit.values)
    whole = on_other_records(free, held_out.prepared)
    find_phases(held_out, model, whole)
    held_out.take_zeros(whole)
    problem, fit = fit_stages(held_out, model, whole, np.array([one.value for one in whole]), stages=[0, 1])
    measure_noise(held_out, problem, fit, mass)
    copy_noise(training, held_out)


def _observation(base: object, compare: str) -> Observation:
    named = isinstance(base, str | Path)
    model = Model.read(base) if named else base
    try:
        return observation_of(model, compare)
    except SeparatrixError as error:
        raise SeparatrixError(f"{base}: {error}" if named else str(error)) from None


def _record(one: Path | Record, at_rest: bool = False) -> Record:
    return one if isinstance(one, Record) else read_record(Path(one), at_rest)


def _split(
    records: list[Record],
    hold_out: list[Record],
    seen: Observation,
    rest: Record | None = None,
) -> tuple[list[Record], list[Record], str]:
    """Training and held-out records; by default the last record, or the end of the only one."""
    if hold_out:
        return records, hold_out, "as asked for"
    if len(records) > 1:
        return records[:-1], records[-1:], f"the last record, {records[-1].name}"
    if not records:
        raise SeparatrixError("no record to compare the base machine with", USAGE)
    whole = records[0]
    at = int((1 - RECORDS.held_out_end) * whole.t.size)
    period = seen.prepare(whole, rest).period_samples
    if period is not None:
        # the end needs some periods too
        latest = whole.t[-1] - RECORDS.held_out_periods * period * whole.interval
        at = min(at, max(whole.t.size // 2, int(np.searchsorted(whole.t, latest, "right")) - 1))
    share = f"{100 * (1 - at / whole.t.size):.0f} %"
    first, end = _cut(whole, 0, at, ""), _cut(whole, at, whole.t.size, "_end")
    first.part = f", all but the last {share}, which are held out"
    end.part = f", the last {share}, which are held out"
    # they name file and row
    end.notes = []
    return [first], [end], f"the last {share} of the only record"


def _all_different(records: list[Record]) -> None:
    """Refuse a record that is given twice: it would count twice, or predict itself."""
    for index, one in enumerate(records):
        for other in records[:index]:
            if _same(one, other):
                raise SeparatrixError(f"{one.file}: the same record as {other.file}", USAGE)


def _same(one: Record, other: Record) -> bool:
    """Whether all columns that two records share are the same; a commanded x(t) may be that of many runs."""
    pairs = [(getattr(one, name), getattr(other, name)) for name in ("t", "x", "v", "force")]
    pairs += [(one.sensors[name], other.sensors[name]) for name in one.sensors.keys() & other.sensors.keys()]
    return all(first is None or second is None or np.array_equal(first, second) for first, second in pairs)


def _cut(record: Record, first: int, last: int, suffix: str) -> Record:
    part = slice(first, last)
    pieces = [
        (max(a, first) - first, min(b, last) - first)
        for a, b in record.pieces
        if min(b, last) > max(a, first)
    ]
    channels = {
        name: None if getattr(record, name) is None else getattr(record, name)[part]
        for name in ("v", "force", "phi")
    }
    sensors = {name: column[part] for name, column in record.sensors.items()}
    header = dict(record.header)
    if first and "phase" in header and "phase_origin_s" not in header:
        # the header gives the crank angle at the first row of the whole record
        header["phase_origin_s"] = float(record.t[0])
    return Record(
        record.name + suffix,
        record.t[part],
        record.x[part],
        header=header,
        pieces=pieces,
        notes=list(record.notes),
        file=record.file,
        sensors=sensors,
        own_x=record.own_x,
        **channels,
    )
