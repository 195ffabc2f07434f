# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A result file as the viewer sees it: what is in it, and its values; nothing is written."""

import tomllib
from pathlib import Path

import h5py
import numpy as np

from separatrix.errors import BAD_DATA, DAMAGE, NO_INPUT, SeparatrixError, why_absent
from separatrix.locks import lock_options
from separatrix.palette import of_attractors
from separatrix.stored import check_named, first_line, why_unreadable
from separatrix.trial import CASE_GIVEN, try_first
from separatrix.variables import FORMAT_VERSION, RENAMED
from separatrix.view.packing import clean
from separatrix.words import decode_word

__all__ = ["ResultFile"]

STARTS = ("x0", "v0", "crank_angle")
KINDS = ("basin", "sweep", "trajectory", "points", "branches", "boundary")
_TABLES = ("catalogue", "limits")
# of an axis whose values are sent one by one
_SHORT = 4096


class ResultFile:
    """One file: axes and variables of a map, or the arrays of another result."""

    def __init__(self, path: str | Path, number: int = 0) -> None:
        """Open a file. SeparatrixError if it is missing, foreign, incomplete, too new or damaged."""
        self.path, self.number = Path(path), number
        if not self.path.is_file():
            raise SeparatrixError(f"{path}: {why_absent(self.path)}", NO_INPUT)
        options = lock_options(path)
        try_first(path, lambda: self._try(h5py.File(path, **options)))
        try:
            self.file = h5py.File(path, **options)
            self._read_header(self.file)
        except SeparatrixError:
            raise
        except DAMAGE as error:
            if self.path.suffix == ".toml" and not h5py.is_hdf5(self.path):
                raise SeparatrixError(f"{path}: cannot be read as HDF5 ({CASE_GIVEN})", BAD_DATA) from error
            reason = f"is damaged ({first_line(error)})"
            if isinstance(error, OSError):
                reason = why_unreadable(self.path, error)
            raise SeparatrixError(f"{path}: {reason}") from error

    def _try(self, file: h5py.File) -> None:
        """Read a little of everything."""
        self._read_header(file)
        for item in file.values():
            if isinstance(item, h5py.Dataset) and item.size:
                for corner in (0, -1):
                    _ = item[(corner,) * item.ndim]

    def _read_header(self, file: h5py.File) -> None:
        attributes = {key: _plain(value) for key, value in file.attrs.items()}
        check_named(self.path, file, attributes)
        if attributes.get("format") != "separatrix":
            raise SeparatrixError(f"{self.path}: is not a file of Separatrix")
        if int(attributes["format_version"]) > FORMAT_VERSION:
            raise SeparatrixError(
                f"{self.path}: has format {attributes['format_version']}; "
                f"this viewer reads 1 to {FORMAT_VERSION}"
            )
        if not int(attributes["complete"]):
            raise SeparatrixError(f"{self.path}: is not complete; finish it with --resume")
        self.kind = str(attributes["kind"])
        if self.kind not in KINDS:
            raise SeparatrixError(f"{self.path}: holds '{self.kind}', allowed are {', '.join(KINDS)}")
        self.attributes = attributes
        provenance = file["provenance"]
        # in files of version 1 it is a dataset
        old = "resolved_case" in provenance
        self.case_text = _plain(provenance["resolved_case"][()] if old else provenance.attrs["resolved_case"])
        self.case = tomllib.loads(self.case_text)
        self.axes = self._read_axes(file) if self.kind == "basin" else []
        self.shape = tuple(axis["count"] for axis in self.axes)
        self.variables = [
            self._describe(name, item)
            for name, item in file.items()
            if self.kind == "basin" and isinstance(item, h5py.Dataset) and item.shape == self.shape
            and name not in {axis["key"] for axis in self.axes}
        ]  # fmt: skip
        if self.kind == "basin" and not (len(self.axes) >= 2 and self.variables):
            raise SeparatrixError(f"{self.path}: is damaged (no map over two axes)")
        self.variables.sort(key=lambda one: _order(one["name"]))
        self.identity = str(_plain(file["provenance"].attrs.get("case_identity", "")))
        self.tables = {name: _table(file[name]) for name in _TABLES if name in file}

    def _read_axes(self, file: h5py.File) -> list[dict]:
        axes = []
        for given in self.case["axis"]:
            key = given["name"].replace(".", "_")
            values = np.asarray(file[key][()], float)
            if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
                raise SeparatrixError(f"{self.path}: is damaged (axis {key})")
            steps = np.diff(values)
            uniform = len(values) < 3 or bool(np.ptp(steps) <= 1e-9 * abs(steps).max())
            path = RENAMED[key].replace("_", ".", 1) if key in RENAMED else given["name"]
            axis = {"key": key, "path": path, "label": _text(file[key], "long_name", key)}
            axis |= {"unit": _unit(file[key]), "start": given["name"] in STARTS, "count": len(values)}
            axis |= {"from": values[0], "to": values[-1], "uniform": uniform}
            axis["values"] = None if uniform and len(values) > _SHORT else values.tolist()
            axis["array"] = values
            axes.append(axis)
        return axes

    def _describe(self, name: str, item: h5py.Dataset) -> dict:
        codes = {}
        if "flag_values" in item.attrs:
            names = str(_plain(item.attrs["flag_meanings"])).split()
            codes = dict(zip(np.atleast_1d(item.attrs["flag_values"]).tolist(), names, strict=True))
        return {
            "name": name,
            "label": _text(item, "long_name", name),
            "unit": _unit(item),
            "classes": item.dtype.kind in "iu" or name == "event_word",
            "codes": codes,
            "dtype": item.dtype.str,
        }

    def describe(self) -> dict:
        """Return all that a page has to know before it asks for values."""
        axes = [{key: value for key, value in axis.items() if key != "array"} for axis in self.axes]
        entries = self.tables.get("catalogue", {})
        catalogue = [
            dict(zip(entries, row, strict=True))
            for row in zip(*(entries[key] for key in entries), strict=True)
        ]
        for one in catalogue:
            one["word"] = decode_word(one.get("event_word") or 0)
        description = {
            "kind": self.kind,
            "name": self.path.name,
            "title": self.attributes.get("title", ""),
            "identity": self.identity,
            "axes": axes,
            "variables": self.variables,
            "catalogue": catalogue,
            "colours": self._colours(entries),
            "points": int(np.prod(self.shape, dtype=np.int64)) if self.shape else 0,
            "machine": self.machine(),
            "attributes": {
                key: self.attributes[key] for key in self.attributes if key not in ("references",)
            },
        }
        return clean(description)

    def _colours(self, catalogue: dict[str, list]) -> dict[int, str]:
        """Return the colours of the attractors by number, which are those of figures of the whole map."""
        points: dict[int, int] = {}
        numbers = catalogue.get("attractor", [])
        for number, count in zip(numbers, catalogue.get("count", [0] * len(numbers)), strict=True):
            points[number] = points.get(number, 0) + count
        return of_attractors(points, max(points, default=0))

    def machine(self) -> dict:
        """Return the tables of the case that the drawing needs."""
        tables = ("body", "restoring", "friction", "contact", "drive", "effect", "start", "run", "trajectory")
        return {key: self.case[key] for key in tables if key in self.case}

    def dataset(self, variable: int) -> h5py.Dataset:
        """Return the dataset of a variable by its number."""
        return self.file[self.variables[variable]["name"]]

    def values_at(self, index: tuple[int, ...]) -> dict[str, object]:
        """Return all variables at one point of a map."""
        found = {}
        for one in self.variables:
            value = self.file[one["name"]][index]
            text = one["codes"].get(int(value)) if one["classes"] else None
            if one["name"] == "event_word":
                text = decode_word(value)
            found[one["name"]] = text if text is not None else value
        return found

    def parameters_at(self, index: tuple[int, ...]) -> dict[str, float]:
        """Return the parameters of the machine at a point of a map, by path."""
        pairs = zip(self.axes, index, strict=True)
        return {axis["path"]: float(axis["array"][i]) for axis, i in pairs if not axis["start"]}

    def slice_number(self, index: tuple[int, ...]) -> int:
        """Return the number of the slice of a point, as in the catalogue."""
        number = 0
        for axis, i in zip(self.axes, index, strict=True):
            if not axis["start"]:
                number = number * axis["count"] + i
        return number

    def series(self) -> tuple[dict, dict[str, np.ndarray]]:
        """Return names, units and arrays of a file that is not a map, and its table of limits."""
        header, arrays = {}, {}
        found = dict(self.file.items())
        if "saddles" in found:
            found |= {f"saddles_{name}": item for name, item in self.file["saddles"].items()}
        for written, item in found.items():
            name = RENAMED.get(written, written)
            if not isinstance(item, h5py.Dataset) or item.dtype.kind not in "fiu" or not item.ndim:
                continue
            header[name] = {"label": _text(item, "long_name", name), "unit": _unit(item)}
            if "flag_meanings" in item.attrs:
                header[name]["codes"] = self._describe(name, item)["codes"]
            values = item[()]
            arrays[name] = values.astype(np.float64) if values.dtype == np.int64 else values
        return {"variables": header, "limits": self.tables.get("limits", {})}, arrays


def _order(name: str) -> tuple[int, str]:
    first = ("attractor", "regime", "settle_time", "grazing_margin", "period", "event_word")
    return (first.index(name) if name in first else len(first), name)


def _table(group: h5py.Group) -> dict[str, list]:
    """Return the columns of a table that have a value for each row; others are lists of their own."""
    columns = {
        name: item[()] for name, item in group.items() if isinstance(item, h5py.Dataset) and item.ndim == 1
    }
    rows = next((len(columns[name]) for name in ("attractor", "lower") if name in columns), 0)
    columns = {name: values for name, values in columns.items() if len(values) == rows}
    return {
        name: _plain_column(group, name, values)
        for name, values in columns.items()
        if name not in ("entry", "limit")
    }


def _plain_column(group: h5py.Group, name: str, values: np.ndarray) -> list:
    """Return a column; the codes of limits as texts, as files of version 1 have them."""
    attributes = group[name].attrs
    if group.name == "/limits" and "flag_meanings" in attributes:
        names = str(_plain(attributes["flag_meanings"])).split()
        texts = dict(zip(np.atleast_1d(attributes["flag_values"]).tolist(), names, strict=True))
        return [texts[value] for value in values.tolist()]
    return [_plain(value) for value in values]


def _text(item: h5py.Dataset, key: str, otherwise: str) -> str:
    return str(_plain(item.attrs.get(key, otherwise)))


def _unit(item: h5py.Dataset) -> str:
    unit = _text(item, "units", "")
    return "" if unit == "1" else unit


def _plain(value: object) -> object:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    if isinstance(value, np.generic):
        return value.item()
    return value
