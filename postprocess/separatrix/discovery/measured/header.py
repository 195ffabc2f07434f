# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the header of a record says: numbers with or without their units, units of the columns, the phase."""

import re
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from separatrix.discovery.measured.tables import CHANNELS, KEYS, NUMBERS, SAME, Table, is_noise, is_sensor
from separatrix.errors import SeparatrixError

_TURN = 2 * np.pi
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
_ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180, "turn": _TURN}
_FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "N m": 1.0}
_FREQUENCY = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6}
_RATE = {"rad/s": 1.0, "Hz": _TURN, "rpm": _TURN / 60}
_SPEED = {f"{unit}/s": size for unit, size in (_LENGTH | _ANGLE).items()}
_ACCELERATION = {f"{unit}/s^2": size for unit, size in (_LENGTH | _ANGLE).items()} | {"g": 9.80665}
UNITS = {"t": _TIME, "x": _LENGTH | _ANGLE, "v": _SPEED, "force": _FORCE, "phi": _ANGLE, "a": _ACCELERATION}
"""Units of the columns, over the SI unit."""
_OF_KEYS = {
    "sampling_rate_hz": _FREQUENCY,
    "sensor_noise_sigma_m": _LENGTH | _ANGLE,
    "sensor_resolution_m": _LENGTH | _ANGLE,
    "sensor_noise_sigma_m_s": _SPEED,
    "phi_noise_sigma_rad": _ANGLE,
    "force_noise_sigma_n": _FORCE,
    "drive_frequency_rad_s": _RATE,
    "phase": _ANGLE,
    "sensor_delay_s": _TIME,
}
# other ways to write a unit
_SAME = {"°": "deg", "degrees": "deg", "µm": "um", "μm": "um", "micrometre": "um", "µs": "us", "μs": "us"}
_SAME |= {"sec": "s", "seconds": "s", "second": "s", "metre": "m", "metres": "m", "meter": "m", "meters": "m"}
_SAME |= {
    "millimetres": "mm",
    "millimeters": "mm",
    "radians": "rad",
    "turns": "turn",
    "Nm": "N m",
    "hz": "Hz",
}
_EXAMPLES = {"units": "units: s, mm", "phase": "phase: 0.35, or phase: 20 deg at t = 0 s"}
_AT = re.compile(r"\s*(?:at|@)\s*t\s*=\s*(.*)")
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)\w*)\s*(.*)", re.IGNORECASE)
# likeness of a header key to a known one that makes it a misspelling
_NEAR = 0.7
_POSITIVE = ("sampling_rate_hz", "drive_ratio", "drive_frequency_rad_s", "drive_scale")
_NO_LESS_THAN_0 = (
    "sensor_noise_sigma_m",
    "sensor_noise_sigma_m_s",
    "sensor_resolution_m",
    "phi_noise_sigma_rad",
    "force_noise_sigma_n",
)


def numbers_of(path: Path, header: dict[str, str], of_time: float, notes: list[str]) -> dict[str, float]:
    """Numbers of the header in the units of their keys; `phase_origin_s` is when the phase was what is said.

    `of_time`: unit of the column t [s].
    """
    numbers = {}
    for key in sorted(NUMBERS & header.keys()):
        text = header[key]
        at = _AT.search(text) if key == "phase" else None
        if at:
            text = text[: at.start()]
            numbers["phase_origin_s"] = _quantity(path, key, header[key], at.group(1), _TIME, of_time)
        numbers[key] = _quantity(path, key, header[key], text, _OF_KEYS.get(key, {}))
        if not np.isfinite(numbers[key]):
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}")
    for key in filter(is_noise, header):
        numbers[key] = _quantity(path, key, header[key], header[key], {})
        if not numbers[key] > 0:
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}, expected more than 0")
    for key in _POSITIVE:
        if key in numbers and numbers[key] <= 0:
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}, expected more than 0")
    for key in _NO_LESS_THAN_0:
        if key in numbers and numbers[key] < 0:
            raise SeparatrixError(f"{path}: '{key}' is {header[key]}, expected at least 0")
        if numbers.get(key) == 0 and key.startswith("sensor_noise"):
            notes.append(f"{key} is 0: measured instead")
    _doubt(header, numbers, notes)
    return numbers


def _quantity(
    path: Path, key: str, whole: str, text: str, units: dict[str, float], usual: float = 1.0
) -> float:
    """A number with a unit, or in the `usual` one, in the unit of the key."""
    found = _NUMBER.fullmatch(text.strip())
    unit = "" if found is None else _SAME.get(found.group(2).strip(), found.group(2).strip())
    if found is None or (unit and unit not in units):
        example = _EXAMPLES.get(
            key, f"{key}: {'0.5' if not units else f'0.5, or {key}: 0.5 {list(units)[-1]}'}"
        )
        raise SeparatrixError(f"{path}: '{key}' is '{whole}', expected a number, as in '{example}'")
    return float(found.group(1)) * (units[unit] if unit else usual)


def _doubt(header: dict[str, str], numbers: dict[str, float], notes: list[str]) -> None:
    """Warn of keys that look like misspelt ones, and of an angle that looks like degrees."""
    for key in header:
        near = [] if key in KEYS else get_close_matches(key, sorted(KEYS), 1, _NEAR)
        if near:
            notes.append(f"header key '{key}' is not used: '{near[0]}'?")
    if abs(numbers.get("phase", 0.0)) > _TURN:
        notes.append(f"phase is {numbers['phase']:g} rad, more than a turn: degrees?")


def to_si(path: Path, table: Table, notes: list[str]) -> tuple[dict[str, np.ndarray], str, float]:
    """The columns in SI, the unit of x, m or rad, and the unit of time [s]."""
    if "units" not in table.header:
        notes.append("no 'units': read as s and m (rad of an angle)")
        return dict(table.columns), "m", 1.0
    units, columns = _units(path, table), {}
    for name, column in table.columns.items():
        unit = units.get(name, units.get(_kind(name)))
        columns[name] = column if unit is None else column * UNITS[_kind(name)][unit]
    place = next(units[name] for name in units if _kind(name) == "x")
    return columns, "rad" if place in _ANGLE else "m", _TIME[units["t"]]


def _kind(name: str) -> str:
    """What a column is: `x` of `x.BODY`, `force` of `F.JOINT`."""
    kind = name.partition(".")[0] if is_sensor(name) else name
    return SAME.get(kind, kind)


def _units(path: Path, table: Table) -> dict[str, str]:
    """Unit of each column: `s, mm`, in the order of the columns, or by name, as in `t s, x mm`."""
    text, columns = table.header["units"], table.columns
    entries = [entry.strip() for entry in re.split(r"[,;]", text) if entry.strip()]
    told = [_entry(entry, [one for one in columns if is_sensor(one)]) for entry in entries]
    _check_order(path, table, sum(not name for name, _ in told))
    found, order = {}, iter(table.names)
    for name, unit in told:
        if not name:
            name = next(order, "")
            if name not in columns:
                continue
        unit = _SAME.get(unit, unit)
        if unit not in UNITS.get(_kind(name), ()) or name in found:
            _refuse(path, text)
        found[name] = unit
    if not {"t", "x"} <= {_kind(name) for name in found if name in columns or name in UNITS}:
        _refuse(path, text)
    return found


def _check_order(path: Path, table: Table, count: int) -> None:
    """Refuse so many units in order where it matters whether columns that are not used have some of them."""
    used = list(table.columns)
    among_all = [name for name in table.names[:count] if name in used]
    fewer = count < len(table.names) and among_all != used[:count]
    if fewer or (count > len(table.names) and table.unused):
        raise SeparatrixError(
            f"{path}: units '{table.header['units']}': {count} units in the order of "
            f"{len(used) + len(table.unused)} columns, of which {', '.join(table.unused)} "
            f"{'is' if len(table.unused) == 1 else 'are'} not used: say them by name, as in "
            "'units: t s, x mm'"
        )


def _entry(entry: str, sensors: list[str]) -> tuple[str, str]:
    """Name of a column ('' if there is none) and unit, from `mm`, `x mm`, `x: mm`, `x = mm`, `x [mm]`."""
    for name in (*sensors, "t", "x", "a", *CHANNELS, *SAME):
        said = re.fullmatch(rf"{re.escape(name)}\s*(?:[:=]\s*|\s+|(?=[\[(]))[\[(]?\s*(.*?)\s*[\])]?", entry)
        if said:
            return SAME.get(name, name), said.group(1)
    return "", entry.strip("[]() ")


def _refuse(path: Path, text: str) -> None:
    raise SeparatrixError(
        f"{path}: units '{text}', expected one of {', '.join(_TIME)} for t and one of "
        f"{', '.join(UNITS['x'])} for x, as in '{_EXAMPLES['units']}' or 'units: t s, x mm'"
    )
