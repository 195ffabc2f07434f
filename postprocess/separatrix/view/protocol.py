# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a page may ask, one table for all transports (docs/viewer.md): requests, parameters, answers.

Parameters are texts of an address; each is checked before anything is done. None names files.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from separatrix.errors import SeparatrixError
from separatrix.library import CaseError
from separatrix.palette import for_page
from separatrix.view import live
from separatrix.view.files import ResultFile
from separatrix.view.keep import keep_file
from separatrix.view.machine import EVENTS, REASONS, REGIMES, Machine, events_csv, samples_csv
from separatrix.view.packing import pack
from separatrix.view.parameters import Parameters, RefusedError, shown
from separatrix.view.pyramid import Plane

__all__ = ["PROTOCOL_VERSION", "REQUESTS", "Desk", "RefusedError"]

PROTOCOL_VERSION = 1
_PLANES = 24  # kept in memory
_MOST_SAMPLES = 400_000
_MOST_LIVE = 65_536  # points of one request
_MOST_KEPT = 16_000_000


@dataclass(frozen=True)
class Request:
    """A request: what answers it, the parameters it must and may have, and whether it changes something."""

    answer: Callable[["Desk", "Parameters"], bytes]
    needs: tuple[str, ...]
    may_have: tuple[str, ...] = ()
    acts: bool = False


class Desk:
    """The files of a viewer and what is kept of them between requests."""

    def __init__(self, paths: list[Path], folder: Path | None = None) -> None:
        """Open all files; kept views are written into `folder`, nowhere if it is None."""
        self.files = [ResultFile(path, i) for i, path in enumerate(paths)]
        self._open_maps()
        self.views = live.Views()
        self.folder = folder
        self._planes: OrderedDict[tuple, Plane] = OrderedDict()
        self._machines: dict[int, Machine] = {}
        self._lock = threading.Lock()
        self._machine_lock = threading.Lock()

    def answer(self, name: str, texts: Mapping[str, str], acting: bool = False) -> bytes:
        """Return the answer to a request. RefusedError if it is not understood, or what it fails with."""
        request = REQUESTS.get(name)
        if request is None:
            raise RefusedError(f"{shown(name)}: no such request")
        unknown = set(texts) - set(request.needs) - set(request.may_have)
        missing = set(request.needs) - set(texts)
        if unknown or missing:
            raise RefusedError(f"{name}: unknown {_list(unknown)}; missing {_list(missing)}")
        if request.acts and not acting:
            raise RefusedError(f"{name}: has to be sent as an act (POST)")
        try:
            return request.answer(self, Parameters(texts))
        except SeparatrixError:
            raise
        except (ArithmeticError, LookupError, OSError, RuntimeError, TypeError, ValueError) as error:
            raise SeparatrixError(
                f"the file cannot be read here ({str(error).splitlines()[0][:200]})"
            ) from error

    def close(self) -> None:
        """End all work."""
        self.views.stop_all()
        for plane in list(self._planes.values()):
            plane.close()

    def _open_maps(self) -> None:
        """Open the maps of boundaries where they lie beside them."""
        for source in [one for one in self.files if one.kind == "boundary"]:
            beside = source.path.parent / Path(str(source.attributes["map"])).name
            known = any(one.identity == source.attributes["map_identity"] for one in self.files if one.axes)
            if not known and beside.is_file():
                self.files.append(ResultFile(beside, len(self.files)))

    def file(self, parameters: Parameters, kind: str = "") -> ResultFile:
        """Return the file that a request is about."""
        found = self.files[parameters.whole("file", 0, len(self.files) - 1, 0)]
        if kind and found.kind != kind:
            raise RefusedError(f"file: holds {found.kind}, allowed {kind}")
        return found

    def slice_of(self, source: ResultFile, parameters: Parameters) -> tuple[int, int, tuple[int, ...]]:
        """Return the axes of a plane and the index on every axis (0 along the plane)."""
        across = parameters.whole("across", 0, len(source.axes) - 1)
        up = parameters.whole("up", 0, len(source.axes) - 1)
        if across == up:
            raise RefusedError("across, up: allowed are two different axes")
        at = list(self.index(source, parameters))
        at[across] = at[up] = 0
        return across, up, tuple(at)

    def index(self, source: ResultFile, parameters: Parameters) -> tuple[int, ...]:
        """Return the index on every axis of a map."""
        parts = parameters.texts.get("at", "").split(",")
        if len(parts) != len(source.axes):
            raise RefusedError(f"at: found {len(parts)} numbers, allowed are {len(source.axes)}")
        return tuple(
            Parameters({"at": part}).whole("at", 0, n - 1)
            for part, n in zip(parts, source.shape, strict=True)
        )

    def plane(self, parameters: Parameters) -> Plane:
        """Return a plane, kept or new."""
        source = self.file(parameters, "basin")
        variable = parameters.whole("variable", 0, len(source.variables) - 1)
        across, up, at = self.slice_of(source, parameters)
        key = (source.number, variable, across, up, at)
        with self._lock:
            if key not in self._planes:
                self._planes[key] = Plane(source, variable, across, up, at)
            self._planes.move_to_end(key)
            old = [self._planes.popitem(last=False)[1] for _ in range(len(self._planes) - _PLANES)]
            found = self._planes[key]
        for plane in old:
            plane.close()
        return found

    def tiles(self, texts: Mapping[str, str], level: int) -> tuple[int, int]:
        """Return rows and columns of tiles of a plane."""
        return self.plane(Parameters(texts)).tiles(level)

    def finish(self, texts: Mapping[str, str]) -> None:
        """Wait until all levels of a plane are complete."""
        self.plane(Parameters(texts)).finish()

    def machine(self, source: ResultFile) -> Machine:
        """Return the machine of a file. CaseError if there is no library or it refuses the case."""
        with self._machine_lock:
            if source.number not in self._machines:
                self._machines[source.number] = Machine(source)
            return self._machines[source.number]

    def setting(self, parameters: Parameters) -> tuple[Machine, tuple[float, float, float], dict[str, float]]:
        """Return machine, start and parameters of a motion."""
        source = self.file(parameters)
        machine = self.machine(source)
        values = source.parameters_at(self.index(source, parameters)) if source.axes else {}
        values |= parameters.changes()
        machine.check(values)
        start = tuple(parameters.real(name) for name in ("x", "v", "angle"))
        return machine, start, values


def describe(desk: Desk, _: Parameters) -> bytes:
    """All files, what the codes mean, and the colours."""
    described = []
    for source in desk.files:
        one = source.describe()
        try:
            parameters = desk.machine(source).model.parameters
            one["parameters"] = {path: [p.value, p.lower, p.upper, p.unit] for path, p in parameters.items()}
        except CaseError as error:
            one["no_motions"] = str(error)
        described.append(one)
    codes = {"events": EVENTS, "regimes": REGIMES, "reasons": REASONS}
    about = {"version": PROTOCOL_VERSION, "keeps": desk.folder is not None, "palette": for_page()}
    return pack({**about, "files": described, **codes})


def tile(desk: Desk, parameters: Parameters) -> bytes:
    """Cells of a tile."""
    plane = desk.plane(parameters)
    level = parameters.whole("level", 0, plane.top)
    rows, columns = plane.tiles(level)
    row, column = parameters.whole("row", 0, rows - 1), parameters.whole("column", 0, columns - 1)
    cells = plane.tile(level, row, column)
    complete = plane.complete or level < plane.first
    return pack({"complete": complete, "classes": len(plane.words or ())}, cells)


def classes(desk: Desk, parameters: Parameters) -> bytes:
    """Names of the classes of a plane, and its coarsest level."""
    plane = desk.plane(parameters)
    return pack({"names": plane.class_names(), "top": plane.top})


def values(desk: Desk, parameters: Parameters) -> bytes:
    """All variables at one point."""
    source = desk.file(parameters, "basin")
    index = desk.index(source, parameters)
    coordinates = [float(axis["array"][i]) for axis, i in zip(source.axes, index, strict=True)]
    return pack({"coordinates": coordinates, "values": source.values_at(index)})


def series(desk: Desk, parameters: Parameters) -> bytes:
    """Arrays of a file that is not a map."""
    source = desk.file(parameters)
    if source.kind == "basin":
        raise RefusedError("file: is a map; ask for tiles")
    return pack(*source.series())


def motion(desk: Desk, parameters: Parameters) -> bytes:
    """One motion from a start, computed now."""
    machine, start, changed = desk.setting(parameters)
    found = _fly(machine, start, changed, parameters)
    samples, period = found.samples, found.summary["drive_period"]
    columns = {"x": samples["x"], "v": samples["v"], "driver": samples["driver_x"], "mode": samples["mode"]}
    arrays = {name: column.astype(np.float32) for name, column in columns.items()}
    if found.summary["two_bodies"]:
        arrays["driver_v"] = samples["driver_v"].astype(np.float32)
    elif "motor" in machine.source.case:
        arrays["crank"] = samples["driver_v"].astype(np.float32)
    arrays["time"] = samples["time"]
    arrays["energy"] = samples["energy"].astype(np.float32)
    arrays |= {f"event_{name}": column for name, column in found.events.items() if not np.isnan(column).all()}
    arrays["section"] = _on_section(arrays, samples["time"], start[2], period)
    return pack({"summary": found.summary, "start": start, "parameters": changed}, arrays)


def _on_section(arrays: dict, time: np.ndarray, angle: float, period: float) -> np.ndarray:
    """Indices of the samples on the section; of a crank with a motor those next to its passages."""
    if "crank" in arrays:
        whole = np.diff(np.floor(arrays["crank"] / (2 * np.pi)), prepend=0.0) > 0
        return np.flatnonzero(whole).astype(np.int32)
    turns = (time * (2 * np.pi / period) + angle) / (2 * np.pi)
    return np.flatnonzero(np.abs(turns - np.rint(turns)) < 1e-6).astype(np.int32)


def _fly(machine: Machine, start: tuple, changed: dict[str, float], parameters: Parameters) -> object:
    periods, samples = parameters.whole("periods", 0, 100_000, 0), parameters.whole("samples", 0, 2000, 0)
    period = machine.period(changed)
    duration = periods * period
    rate = samples or machine.source.case["trajectory"]["samples_per_period"]
    length = (duration or machine.source.case["run"]["duration"]) / period
    if length * rate > _MOST_SAMPLES:
        raise RefusedError(
            f"periods, samples: found {length * rate:.6g} samples, allowed are {_MOST_SAMPLES}"
        )
    return machine.motion(start, changed, duration, samples)


def download(desk: Desk, parameters: Parameters) -> bytes:
    """A motion as a table of its samples or events, or its case, as text."""
    machine, start, changed = desk.setting(parameters)
    what = parameters.texts["what"]
    if what == "case":
        text = machine.case_text(start, changed)
    elif what in ("samples", "events"):
        found = _fly(machine, start, changed, parameters)
        text = samples_csv(found) if what == "samples" else events_csv(found)
    else:
        raise RefusedError(f"what: found {shown(what)}, allowed are case, samples, events")
    return pack({"text": text})


def attractors(desk: Desk, parameters: Parameters) -> bytes:
    """The attractors of a slice, searched now, with all their points on the section."""
    source = desk.file(parameters, "basin")
    if not any(axis["start"] for axis in source.axes):
        return pack({"attractors": []})
    at, changed = desk.index(source, parameters), parameters.changes()
    machine = desk.machine(source)
    machine.check(changed)
    page, view = _view(parameters)
    flag = desk.views.enter(page, view)
    try:
        number = None if changed else source.slice_number(at)
        catalogue, labels = machine.catalogue(source.parameters_at(at) | changed, number, flag)
    finally:
        desk.views.leave(page, view, flag)
    # Points with more coordinates are not in the plane of x and v.
    flat = [one.points.shape[1] == 2 and not one.numbers["two_bodies"] for one in catalogue.attractors]
    found = [
        one.numbers | {"attractor": int(label), "points": one.points.tolist() if drawn else []}
        for one, label, drawn in zip(catalogue.attractors, labels[1:], flat, strict=True)
    ]
    return pack({"attractors": found})


def points(desk: Desk, parameters: Parameters) -> bytes:
    """Labels of the points of a lattice, computed now."""
    source, across, up, at, lattice, changed, (page, view) = _lattice(desk, parameters, _MOST_LIVE)
    flag = desk.views.enter(page, view)
    try:
        found = live.compute(desk.machine(source), across, up, at, lattice, changed, flag)
    finally:
        desk.views.leave(page, view, flag)
    return pack({"points": len(found["attractor"])}, found)


def keep(desk: Desk, parameters: Parameters) -> bytes:
    """Computes a lattice and writes it to a file of its own."""
    if desk.folder is None:
        raise RefusedError("keep: this viewer was started without --keep FOLDER")
    source, across, up, at, lattice, changed, (page, view) = _lattice(desk, parameters, _MOST_KEPT)
    if lattice.skip:
        raise RefusedError("skip: allowed is 0")
    flag = desk.views.enter(page, view)
    try:
        path = keep_file(desk.machine(source), desk.folder, across, up, at, lattice, changed, flag)
    finally:
        desk.views.leave(page, view, flag)
    return pack({"written": path.name})


def stop(desk: Desk, parameters: Parameters) -> bytes:
    """Ends the work for a page's views up to this one."""
    desk.views.stop(*_view(parameters))
    return pack({})


def _view(parameters: Parameters) -> tuple[int, int]:
    return parameters.whole("page", 0, 10**9), parameters.whole("view", 0, 10**9)


def _lattice(desk: Desk, parameters: Parameters, most: int) -> tuple:
    source = desk.file(parameters, "basin")
    across, up, at = desk.slice_of(source, parameters)
    counts = [parameters.whole(name, 1, 8192) for name in ("columns", "rows")]
    if counts[0] * counts[1] > most:
        raise RefusedError(f"columns, rows: found {counts[0] * counts[1]} points, allowed are {most}")
    lines = [(parameters.real(first), parameters.real(step)) for first, step in (("a", "da"), ("b", "db"))]
    skip = bool(parameters.whole("skip", 0, 1, 0))
    lattice = live.Lattice((*lines[0], counts[0]), (*lines[1], counts[1]), skip)
    changed = parameters.changes()
    desk.machine(source).check(changed)
    return source, across, up, at, lattice, changed, _view(parameters)


def _list(names: set[str]) -> str:
    return ", ".join(sorted(name[:40] for name in names)[:10]) or "nothing"


_PLANE = ("file", "across", "up", "at")
_START = ("file", "x", "v", "angle")
_LATTICE = (*_PLANE, "a", "da", "columns", "b", "db", "rows", "page", "view")
REQUESTS = {
    "describe": Request(describe, ()),
    "tile": Request(tile, (*_PLANE, "variable", "level", "row", "column")),
    "classes": Request(classes, (*_PLANE, "variable")),
    "values": Request(values, ("file", "at")),
    "series": Request(series, ("file",)),
    "motion": Request(motion, _START, ("at", "with", "periods", "samples")),
    "download": Request(download, (*_START, "what"), ("at", "with", "periods", "samples")),
    "attractors": Request(attractors, ("file", "at", "page", "view"), ("with",)),
    "points": Request(points, _LATTICE, ("skip", "with")),
    "keep": Request(keep, _LATTICE, ("skip", "with"), acts=True),
    "stop": Request(stop, ("page", "view"), acts=True),
}
