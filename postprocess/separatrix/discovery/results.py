# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is written: the verdict, the case with the effect added, the numbers behind the figures."""

import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py
import numpy as np

from separatrix.discovery.decision.verdict import Findings
from separatrix.discovery.fitting.catalogue import within_barriers
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.machine import SENSOR_BIAS
from separatrix.discovery.wording import units_of, with_error
from separatrix.errors import CANNOT_CREATE, SeparatrixError

FILES = ("details.h5", "extended.toml", "report.html", "report.pdf", "verdict.json")
"""All that a run may leave in its folder."""
_DRAFT = ".writing-"


@contextmanager
def replacing(folder: Path) -> Iterator[Path]:
    """Give a draft folder, whose files finally replace those in `folder`; files that it lacks are removed.

    After an error nothing has changed.
    """
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(folder)
        with tempfile.TemporaryDirectory(dir=folder, prefix=_DRAFT) as name, _locked(Path(name)):
            draft = Path(name)
            yield draft
            for file in FILES:
                if (draft / file).exists():
                    (draft / file).replace(folder / file)
                else:
                    # that of an earlier run would look like one of this
                    (folder / file).unlink(missing_ok=True)
    except BaseException as error:
        with suppress(OSError):
            for one in made:
                one.rmdir()
        if isinstance(error, OSError):
            reason = "a file, expected a folder" if folder.is_file() else error.strerror or error
            raise SeparatrixError(f"{folder}: {reason}", CANNOT_CREATE) from None
        raise


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold a lock that ends with this process, however it ends."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        # not every file system has locks
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


def _remove_abandoned(folder: Path) -> None:
    """Remove the drafts of runs that were killed: nobody holds their lock."""
    for draft in folder.glob(f"{_DRAFT}*"):
        with suppress(OSError):
            handle = os.open(draft, os.O_RDONLY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(draft)
            finally:
                os.close(handle)


def require_writable(folder: Path) -> None:
    """Refuse a folder that no results could be written to, before any work; nothing is left behind."""
    with suppress(_UndoneError), replacing(folder):
        raise _UndoneError


class _UndoneError(Exception):
    """A draft that is not wanted."""


def write_results(folder: Path, verdict: dict, findings: Findings) -> None:
    """Write verdict.json, details.h5 and, where a law was found, extended.toml."""
    text = json.dumps(plain(verdict), indent=2, allow_nan=False) + "\n"
    (folder / "verdict.json").write_text(text, encoding="utf-8")
    write_details(folder / "details.h5", findings)
    if findings.decision.corrected is not None:
        (folder / "extended.toml").write_text(extended_case(verdict, findings), encoding="utf-8")


def plain(value: object) -> object:
    """Numbers that JSON knows; what is not finite becomes null."""
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def extended_case(verdict: dict, findings: Findings) -> str:
    """The base case with the effect and all fitted values: an ordinary case file."""
    fitted = findings.decision.corrected.fitted
    records = ", ".join(f"{one['name']} ({one['use']})" for one in verdict["records"])
    lines = [
        f"# Written by separatrix-discover {verdict['version']}: {', '.join(fitted.names)} added.",
        f"# Outcome: {verdict['outcome']}; records: {records}.",
    ]
    if verdict["alternatives"]:
        lines.append(f"# Not distinguished from: {', '.join(verdict['alternatives'])}.")
    for path in fitted.model.parameters:
        found = verdict["parameters"].get(path)
        if found:
            lines.append(f"# {path} = {with_error(found)}")
    return "\n".join([*lines, machine_text(fitted)])


def machine_text(fitted: Fitted) -> str:
    """The resolved case of the fitted machine; starts and axes end at its barriers."""
    values = machine_values(fitted)
    try:
        return fitted.model.to_text(values)
    except SeparatrixError:
        ends = [values.get("contact.lower", -np.inf), values.get("contact.upper", np.inf)]
        return within_barriers(fitted.model, *ends).to_text(values)


def machine_values(fitted: Fitted) -> dict[str, float]:
    """Values of the machine as fitted, with the drive at the ratio of the case."""
    values = {
        path: number
        for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True)
        if not one.is_nuisance
        for path, number in one.numbers(value).items()
    }
    for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True):
        if one.path == "nuisance:drive_scale":
            values |= {path: float(value) * size for path, size in fitted.problem.amplitudes.items()}
    if fitted.problem.prepared[0].frequency is not None and "drive.ratio" in fitted.model.parameters:
        # a ratio to the natural frequency: that of the drive stays what it is in the base case
        model = fitted.model
        ratio = model.parameters["drive.ratio"].value
        values["drive.ratio"] = (
            ratio * model.drive_frequency({}) / model.drive_frequency({**values, "drive.ratio": ratio})
        )
    return values


def write_details(path: Path, findings: Findings) -> None:
    """Numbers behind the figures: see docs/discovery-guide.md for the layout."""
    decision, context = findings.decision, findings.context
    final = decision.corrected
    with h5py.File(path, "w") as file:
        units = units_of(findings.base.model.parameters)
        file.attrs["position_unit"], file.attrs["velocity_unit"] = units.position, units.velocity
        file.attrs["force_unit"], file.attrs["compared"] = units.force, context.options.compare
        for one in findings.maps:
            group = file.create_group(f"where/{one.name}")
            group.attrs["unit"], group.attrs["force_unit"] = one.unit, one.force_unit
            group["edges"] = one.edges
            if one.other_edges is not None:
                group["velocity_edges"] = one.other_edges
            for name in ("force", "error", "flagged"):
                group[name] = getattr(one, name)
        screened = decision.rounds[0].screened
        file["confusability/names"] = np.array(screened.names, dtype=h5py.string_dtype())
        file["confusability/matrix"] = screened.cosines
        _write_fits(file, "training", findings.base, final.fitted if final else None)
        if decision.predicted is not None:
            before = decision.predicted
            after = final.prediction if final else None
            _write_fits(file, "held_out", before, after)
        for data in (context.training, context.held_out):
            for number, prepared in enumerate(data.prepared if data else ()):
                group = file.create_group(f"records/{prepared.record.name}")
                group.attrs["sigma"] = prepared.sigma
                group.attrs["held_out"] = data is context.held_out
                group["t"], group["x"] = prepared.record.t, prepared.record.x
                for name, (values, attributes) in data.details(number).items():
                    group[name] = values
                    group[name].attrs.update(attributes)


def _write_fits(file: h5py.File, use: str, before: object, after: object | None) -> None:
    """Residuals and motion of each record as fitted, by the base and by the extended machine."""
    for name, fitted in (("before", before), ("after", after)):
        if fitted is None:
            continue
        problem, fit = fitted.problem, fitted.fit
        times = problem.sample_times()
        for number, prepared in enumerate(problem.prepared):
            rows = np.flatnonzero(problem.segments.record == number)
            inside = problem.segments.inside[rows]
            first = prepared.samples.t[problem.segments.first[rows]]
            group = file.create_group(f"{use}/{prepared.record.name}/{name}")
            group["t"] = (times[rows] + first[:, None])[inside]
            group["segment"] = np.broadcast_to(np.arange(rows.size)[:, None], inside.shape)[inside]
            group["x"], group["v"] = fit.evaluation.x[rows][inside], fit.evaluation.v[rows][inside]
            if fit.evaluation.force is not None:
                group["force"] = fit.evaluation.force[rows][inside]
            length = inside.shape[1]
            group["residual"] = fit.evaluation.residual[rows, :length][inside]
            group["good"] = fit.good[rows]
            group.attrs["crank_angle"] = float(problem.crank_angle(number, fit.values, prepared.record.t[0]))
            machine = problem.machine_values(number, fit.values)
            group.attrs["sensor_bias"] = machine.get(SENSOR_BIAS, 0.0)
            impacts = fit.evaluation.impacts[number]
            group["impacts"] = np.zeros((0, 5)) if impacts is None else impacts
            group["impacts"].attrs["columns"] = "segment time speed_before speed_after side"
