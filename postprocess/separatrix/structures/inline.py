# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Structure files for the library, which reads no HDF5: what they hold takes their place in the case."""

import json
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path

import h5py
import numpy as np

from separatrix.errors import BAD_DATA, NO_INPUT, CaseError


def inlined(text: str, name: str | Path, settings: Iterable[str] = ()) -> list[str]:
    """Return the settings for a case whose [structure.NAME] may name HDF5 files, with their numbers in front.

    `name` stands for the case in messages; files are looked for in its folder. Texts that are no TOML come
    back as they are: the library says what is wrong with them.
    """
    settings = list(settings)
    if "structure" not in text and not any("structure" in setting for setting in settings):
        return settings
    try:
        tables = tomllib.loads(text).get("structure", {})
    except tomllib.TOMLDecodeError:
        return settings
    files = {key: table["file"] for key, table in tables.items() if _has_file(table)}
    tables = dict(tables)
    rest = []
    for setting in settings:
        path, _, value = setting.partition("=")
        parts = [part.strip() for part in path.split(".")]
        if parts[0] != "structure" or len(parts) not in (2, 3) or (len(parts) == 3 and parts[2] != "file"):
            rest.append(setting)
            continue
        given = _value(value)
        if len(parts) == 3 and isinstance(given, str):
            files[parts[1]] = given
        elif len(parts) == 2 and _has_file(given):
            files[parts[1]], tables[parts[1]] = given["file"], given
        else:
            if len(parts) == 2:
                files.pop(parts[1], None)
            rest.append(setting)
    folder = Path(name).parent
    return [
        *(
            f"structure.{key}={_toml(_without_file(tables.get(key, {}), folder / file, name, key))}"
            for key, file in files.items()
        ),
        *rest,
    ]


def _has_file(table: object) -> bool:
    return isinstance(table, Mapping) and isinstance(table.get("file"), str)


def _value(text: str) -> object:
    """Return the value of a setting, None where it is not TOML."""
    try:
        return tomllib.loads(f"value={text}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip()


def _without_file(table: Mapping, path: Path, name: str | Path, key: str) -> dict:
    """Return a table with the numbers of its file; a point may have the name that it has in the file."""
    content, points = _read(path, f"{name}: key 'structure.{key}.file'")
    for number in content:
        if number in table:
            raise CaseError(
                f"{name}: key 'structure.{key}.{number}': found beside a file, allowed one or the other",
                BAD_DATA,
            )
    named = {
        point: points.get(place, place) if isinstance(place, str) else place
        for point, place in dict(table.get("point", {})).items()
    }
    kept = {entry: value for entry, value in table.items() if entry not in ("file", "point")}
    return {**kept, **content, "point": {**points, **named}}


def _read(path: Path, at: str) -> tuple[dict, dict]:
    """Return matrices or modes of a file, and the rows of its points."""
    if not path.is_file():
        raise CaseError(f"{at}: {path}: no such file", NO_INPUT)
    try:
        with h5py.File(path) as file:
            if "structure" not in file:
                raise CaseError(
                    f"{at}: {path}: found no group /structure, allowed a file of separatrix-structure",
                    BAD_DATA,
                )
            group = file["structure"]
            if "frequency" in group:
                units = group["frequency"].attrs.get("units", "Hz")
                units = units.decode() if isinstance(units, bytes) else units
                if units not in ("Hz", "rad/s"):
                    raise CaseError(
                        f"{at}: {path}: /structure/frequency: found the units '{units}', allowed Hz, rad/s",
                        BAD_DATA,
                    )
                content = {"frequency": group["frequency"][:] * (2 * np.pi if units == "Hz" else 1)}
                if "damping_ratio" in group:
                    content["damping_ratios"] = group["damping_ratio"][:]
            else:
                missing = [matrix for matrix in ("mass", "stiffness") if matrix not in group]
                if missing:
                    raise CaseError(f"{at}: {path}: /structure/{missing[0]}: missing", BAD_DATA)
                content = {matrix: group[matrix][:] for matrix in ("mass", "stiffness")}
            if "damping" in group:
                content["damping"] = group["damping"][:]
            points = {point: row[:] for point, row in group.get("point", {}).items()}
    except (OSError, TypeError, ValueError) as error:
        raise CaseError(f"{at}: {path}: found what is no structure file ({error})", BAD_DATA) from None
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
