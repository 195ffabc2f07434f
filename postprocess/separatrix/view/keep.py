# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A view that was computed live as a file of its own, in the layout of a map."""

import datetime
import os
import re
import zlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np

from separatrix.cores import cores
from separatrix.errors import SeparatrixError
from separatrix.simulate import LABEL_VARIABLES, StopFlag
from separatrix.variables import CATALOGUE, FORMAT_VERSION, MAP, attributes
from separatrix.version import __version__
from separatrix.view import live
from separatrix.view.files import ResultFile
from separatrix.view.machine import Machine

__all__ = ["keep_file"]

_CANNOT_CREATE = 73
_ROWS = 16  # computed at a time


def keep_file(
    machine: Machine,
    folder: Path,
    across: int,
    up: int,
    at: tuple[int, ...],
    lattice: live.Lattice,
    changed: Mapping[str, float],
    flag: StopFlag,
) -> Path:
    """Compute a lattice of points and write it; return the path, of a file that was not there before.

    StoppedError if the flag is set, SeparatrixError if the file cannot be written.
    """
    values = _compute(machine, across, up, at, lattice, changed, flag)
    source = machine.source
    axes = [
        (source.axes[axis], live.coordinates(source.axes[axis], first + step * np.arange(count)))
        for axis, (first, step, count) in ((across, lattice.across), (up, lattice.up))
    ]
    try:
        descriptor, path = _new_file(folder, source.path.name.removesuffix(".h5"))
        with os.fdopen(descriptor, "r+b") as handle, h5py.File(handle, "w") as file:
            _write(file, machine, axes, values, at, changed)
    except OSError as error:
        raise SeparatrixError(f"{folder}: cannot be written ({error})", _CANNOT_CREATE) from error
    return path


def _compute(
    machine: Machine,
    across: int,
    up: int,
    at: tuple[int, ...],
    lattice: live.Lattice,
    changed: Mapping[str, float],
    flag: StopFlag,
) -> dict[str, np.ndarray]:
    """Return the variables, the axis across first."""
    (b, db, rows), columns = lattice.up, lattice.across[2]

    def band(first: int) -> dict[str, np.ndarray]:
        part = live.Lattice(lattice.across, (b + db * first, db, min(_ROWS, rows - first)), False)
        return live.compute(machine, across, up, at, part, changed, flag)

    with ThreadPoolExecutor(cores()) as pool:
        bands = list(pool.map(band, range(0, rows, _ROWS)))
    return {
        name: np.ascontiguousarray(np.concatenate([one[name] for one in bands]).reshape(rows, columns).T)
        for name in LABEL_VARIABLES
    }


def _new_file(folder: Path, stem: str) -> tuple[int, Path]:
    for number in range(1, 10000):
        path = folder / f"{stem}_view_{number}.h5"
        try:
            return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666), path
        except FileExistsError:
            continue
    raise SeparatrixError(f"{folder}: has 9999 views of {stem} already", _CANNOT_CREATE)


def _write(
    file: h5py.File,
    machine: Machine,
    axes: list[tuple[dict, np.ndarray]],
    values: dict[str, np.ndarray],
    at: tuple[int, ...],
    changed: Mapping[str, float],
) -> None:
    source = machine.source
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    title = f"View of {source.attributes.get('title', source.path.name)}"
    file.attrs.update(
        Conventions="CF-1.10", title=title, source=f"Separatrix {__version__}", references="",
        history=f"{now} separatrix-view: points computed live beside {source.path.name}",
        format="separatrix", kind="basin", date_created=now,
    )  # fmt: skip
    file.attrs.update(format_version=np.int32(FORMAT_VERSION), complete=np.int32(1))
    angle = _is_angle(source)
    for axis, points in axes:
        _put(file, axis["key"], points, axis["unit"], axis["label"]).make_scale(axis["key"])
    for name, array in values.items():
        like = source.file.get(name)
        about = attributes(MAP[name][1:], angle) if like is None else like.attrs
        item = _put(file, name, array, str(about.get("units", "1")), str(about.get("long_name", name)))
        for i, (axis, _) in enumerate(axes):
            item.dims[i].attach_scale(file[axis["key"]])
        for key in ("flag_values", "flag_meanings"):
            if key in about:
                item.attrs[key] = about[key]
    parameters = source.parameters_at(at) | dict(changed)
    for axis, _ in axes:
        parameters.pop(axis["path"], None)
    if axes[0][0]["start"]:
        _write_catalogue(file, machine, parameters, None if changed else source.slice_number(at), values)
    provenance = file.create_group("provenance")
    text = _case_of_view(machine, axes, parameters, source, at)
    provenance.attrs.update(case_text=text, resolved_case=text)
    provenance.attrs.update(version=__version__, computed_by="separatrix-view", started=now, finished=now)


def _is_angle(source: ResultFile) -> bool:
    """Whether the positions of the map beside which this one is kept are angles."""
    file = source.file
    return file["amplitude" if "amplitude" in file else "catalogue/x"].attrs["units"] in ("rad", b"rad")


def _write_catalogue(
    file: h5py.File,
    machine: Machine,
    parameters: Mapping[str, float],
    slice_number: int | None,
    values: dict[str, np.ndarray],
) -> None:
    """Write the attractors with the labels that the points have."""
    catalogue, labels = machine.catalogue(parameters, slice_number)
    rows = [
        one.numbers
        | {"slice": 0, "attractor": int(label), "count": int((values["attractor"] == label).sum())}
        for one, label in zip(catalogue.attractors, labels[1:], strict=True)
    ]
    group = file.create_group("catalogue")
    group["entry"] = np.arange(len(rows), dtype=np.int32)
    group["entry"].make_scale("entry")
    angle = _is_angle(machine.source)
    for name, (kind, *described) in CATALOGUE.items():
        about = attributes(described, angle)
        item = _put(
            group, name, np.array([row[name] for row in rows], kind), about["units"], about["long_name"]
        )
        item.attrs.update(about)
        item.dims[0].attach_scale(group["entry"])


def _put(group: h5py.Group, name: str, array: np.ndarray, unit: str, label: str) -> h5py.Dataset:
    packed = {"compression": "gzip", "compression_opts": 1, "chunks": True} if array.ndim > 1 else {}
    item = group.create_dataset(name, data=array, **packed)
    item.attrs.update(units=unit, long_name=label)
    item.attrs["checksum"] = np.uint32(zlib.crc32(np.ascontiguousarray(array).tobytes()))
    return item


def _case_of_view(
    machine: Machine,
    axes: list[tuple[dict, np.ndarray]],
    parameters: Mapping[str, float],
    source: object,
    at: tuple,
) -> str:
    """Return the resolved case with the axes of the view instead of its own."""
    fixed = {
        axis["path"]: float(axis["array"][i])
        for axis, i in zip(source.axes, at, strict=True)
        if axis["start"] and axis["path"] not in {one["path"] for one, _ in axes}
    }
    start = {key: machine.source.case["start"][key] for key in ("x0", "v0", "crank_angle")} | fixed
    text = machine.case_text(tuple(start.values()), parameters)
    text = re.sub(r"(?ms)^\[\[axis\]\]$.*?(?=^\[|\Z)", "", text)
    text = re.sub(r"(?ms)^\[(grid|refine)\]$.*?(?=^\[|\Z)", "", text)
    for axis, points in axes:
        listed = ", ".join(repr(value) for value in points.tolist())
        text += f'\n[[axis]]\nname = "{axis["path"]}"\nvalues = [{listed}]\n'
    return text
