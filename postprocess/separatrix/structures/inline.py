# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Structure files for the library, which reads no HDF5: their content replaces them in the case."""

import json
import tomllib
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path

import h5py
import numpy as np

from separatrix.errors import BAD_DATA, DAMAGE, NO_INPUT, CaseError, SeparatrixError, why_absent
from separatrix.trial import read_apart

# numbers of a structure: in the case or in its file
_NUMBERS = ("mass", "stiffness", "damping", "frequency", "damping_ratios")


def inlined(text: str, name: str | Path, settings: Iterable[str] = ()) -> list[str]:
    """Return the settings for a case whose [structure.NAME] may name HDF5 files, with their numbers in front.

    `name` stands for the case in messages; files are looked for in its folder. What is not understood is
    returned as it is: the library reports what is wrong with it.
    """
    settings = list(settings)
    if "structure" not in text and not any("structure" in setting for setting in settings):
        return settings
    try:
        tables = tomllib.loads(text).get("structure", {})
        paths = [_path(setting) for setting in settings]
        for setting, path in zip(settings, paths, strict=True):
            if path[0] == "structure" and not _of_element(path):
                tables = _changed(tables, path[1:], tomllib.loads(f"v = {setting.partition('=')[2]}")["v"])
    except (tomllib.TOMLDecodeError, TypeError):
        return settings
    if not isinstance(tables, Mapping):
        return settings
    folder = Path(name).parent
    full = {
        key: f"structure.{key}={_toml(_without_file(table, folder / table['file'], name, key))}"
        for key, table in tables.items()
        if isinstance(table, Mapping) and isinstance(table.get("file"), str)
    }
    before, after = [], []
    for setting, path in zip(settings, paths, strict=True):
        if path[0] != "structure" or (_of_element(path) and path[1] in full):
            after.append(setting)
        elif len(path) == 1 or path[1] not in full:
            before.append(setting)
    return [*before, *full.values(), *after]


def _path(setting: str) -> list[str]:
    return setting.partition("=")[0].strip().split(".")


def _of_element(path: list[str]) -> bool:
    """Whether a setting is of an element of a list, which no file has."""
    return len(path) > 1 and "[" in "".join(path[1:])


def _changed(tables: object, path: list[str], value: object) -> object:
    """Return the tables with a value at its path, as the program does it; TypeError in a list."""
    if not path:
        return value
    if isinstance(tables, list):
        raise TypeError
    tables = tables if isinstance(tables, Mapping) else {}
    return {**tables, path[0]: _changed(tables.get(path[0], {}), path[1:], value)}


def _without_file(table: Mapping, path: Path, name: str | Path, key: str) -> dict:
    """Return a table with the numbers of its file; a point may have the name that it has in the file."""
    at = f"{name}: key 'structure.{key}"
    content, points = _read(path, f"{at}.file'")
    for number in _NUMBERS:
        if number in table:
            raise CaseError(f"{at}.{number}': found beside a file, allowed one or the other", BAD_DATA)
    named = table.get("point", {})
    if not isinstance(named, Mapping):
        raise CaseError(f"{at}.point': found {named!r}, allowed a table of points", BAD_DATA)
    rows = dict(points)
    for point, row in named.items():
        if point in points:
            raise CaseError(
                f"{at}.point.{point}': found a point of the file again, allowed another name", BAD_DATA
            )
        if isinstance(row, str) and row not in points:
            raise CaseError(
                f'{at}.point.{point}\': found "{row}", allowed a point of the file: {", ".join(points)}',
                BAD_DATA,
            )
        rows[point] = points[row] if isinstance(row, str) else row
    kept = {entry: value for entry, value in table.items() if entry not in ("file", "point")}
    return {**kept, **content, "point": rows}


def _read(path: Path, at: str) -> tuple[dict, dict]:
    """Return matrices or modes of a file, and the rows of its points."""
    if not path.is_file():
        raise CaseError(f"{at}: {path}: {why_absent(path)}", NO_INPUT)
    try:
        state = path.stat()
        return _content(path, state.st_mtime_ns, state.st_size)
    except SeparatrixError as error:
        raise CaseError(f"{at}: {error}", error.code) from None


@lru_cache(maxsize=8)
def _content(path: Path, _time: int, _size: int) -> tuple[dict, dict]:
    """Read a file as it is at a time; HDF5 may crash in a damaged one."""
    return read_apart(path, "structure", lambda: _of_file(path))


def _of_file(path: Path) -> tuple[dict, dict]:
    try:
        with h5py.File(path) as file:
            if "structure" not in file:
                raise SeparatrixError(
                    f"{path}: found no group /structure, allowed a file of separatrix-structure"
                )
            group = file["structure"]
            if "frequency" in group:
                units = group["frequency"].attrs.get("units", "Hz")
                units = units.decode() if isinstance(units, bytes) else units
                if units not in ("Hz", "rad/s"):
                    raise SeparatrixError(
                        f"{path}: /structure/frequency: found the units '{units}', allowed Hz, rad/s"
                    )
                content = {"frequency": group["frequency"][:] * (2 * np.pi if units == "Hz" else 1)}
                if "damping_ratio" in group:
                    content["damping_ratios"] = group["damping_ratio"][:]
            else:
                missing = [matrix for matrix in ("mass", "stiffness") if matrix not in group]
                if missing:
                    raise SeparatrixError(f"{path}: /structure/{missing[0]}: missing")
                content = {matrix: group[matrix][:] for matrix in ("mass", "stiffness")}
            if "damping" in group:
                content["damping"] = group["damping"][:]
            points = {point: row[:] for point, row in group.get("point", {}).items()}
    except DAMAGE as error:
        raise SeparatrixError(f"{path}: cannot be read as a structure file ({error})") from None
    return content, points


def _toml(value: object) -> str:
    """Return a value as TOML on one line; numbers have all their digits."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, np.ndarray):
        return _toml(value.tolist())
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)
