# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of the header of a record: numbers with or without their units, units of the columns, the phase."""

import re
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from separatrix.discovery.measured.tables import (
    CHANNELS,
    KEYS,
    NUMBERS,
    SAME,
    Table,
    has_position,
    is_noise,
    is_sensor,
    kind_of,
)
from separatrix.errors import SeparatrixError

_TURN = 2 * np.pi
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": 0.0254, "ft": 0.3048}
_ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180, "turn": _TURN}
_FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216152605, "N m": 1.0}
_FREQUENCY = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6}
_RATE = {"rad/s": 1.0, "Hz": _TURN, "rpm": _TURN / 60}
_SPEED = {f"{unit}/s": size for unit, size in (_LENGTH | _ANGLE).items()}
_ACCELERATION = {f"{unit}/s^2": size for unit, size in (_LENGTH | _ANGLE).items()} | {"g": 9.80665}
_CURRENT = {"A": 1.0, "mA": 1e-3}
_VOLTAGE = {"V": 1.0, "mV": 1e-3, "kV": 1e3}
UNITS = {"t": _TIME, "x": _LENGTH | _ANGLE, "v": _SPEED, "force": _FORCE, "phi": _ANGLE, "a": _ACCELERATION}
UNITS |= {"current": _CURRENT, "voltage": _VOLTAGE, "pulse": _VOLTAGE | {"1": 1.0}}
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
    "motor_voltage_v": _VOLTAGE,
    "motor_speed_rad_s": _RATE,
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
    "N*m": "N m",
    "N.m": "N m",
    "hz": "Hz",
    "inch": "in",
    "newton": "N",
    "newtons": "N",
    "kilonewtons": "kN",
    "milliseconds": "ms",
    "microseconds": "us",
    "nanoseconds": "ns",
    "minutes": "min",
    "micrometres": "um",
    "micrometers": "um",
    "radian": "rad",
    "degree": "deg",
}
# entries of files without a unit
_UNSTATED = ("", "none", "n/a", "na", "-", "unknown", "not applicable")
_EXAMPLES = {"units": "units: s, mm", "phase": "phase: 0.35, or phase: 20 deg at t = 0 s"}
_AT = re.compile(r"\s*(?:at|@)\s*t\s*=\s*(.*)")
_NUMBER = re.compile(
    r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|infinity)\b)\s*(.*)", re.IGNORECASE
)
# longest symbol of a unit; longer ones are words
_SYMBOL = 3
# characters of a unit in a message
_LONGEST_UNIT = 60
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
    """Numbers of the header in the units of their keys; `phase_origin_s` is the time of the stated phase.

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
    unit = "" if found is None else _plain(found.group(2))
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


def is_stated(unit: str) -> bool:
    """Whether a file states a unit."""
    return unit.strip().lower() not in _UNSTATED


def same_unit(kind: str, one: str, other: str) -> bool:
    """Whether two units of a kind of column are the same."""
    sizes = [_size(kind, unit) for unit in (one, other)]
    return (
        None not in sizes
        and bool(np.isclose(*sizes, rtol=1e-6, atol=0))
        and _is_angle(one) == _is_angle(other)
    )


def to_si(path: Path, table: Table, notes: list[str]) -> tuple[dict[str, np.ndarray], str, float]:
    """The columns in SI, the unit of x, m or rad, and the unit of time [s]."""
    notes += table.notes
    units = _all_units(path, table, notes)
    if not units:
        notes.append("no 'units': read as s and m (rad of an angle)")
        return dict(table.columns), "m", 1.0
    silent = [name for name in table.columns if name not in units]
    if silent:
        notes.append(f"no unit of {', '.join(silent)}: read in SI units")
    columns = {}
    for name, column in table.columns.items():
        with np.errstate(invalid="ignore", over="ignore"):
            # values that are no numbers are refused with their row
            columns[name] = column * _size(kind_of(name), units[name]) if name in units else column
    # also for an angular speed without a position
    kind = "x" if has_position(table.columns) else "v"
    unit = next((units[name] for name in units if kind_of(name) == kind), "m")
    return columns, "rad" if _is_angle(unit) else "m", _size("t", units.get("t", "s"))


def _all_units(path: Path, table: Table, notes: list[str]) -> dict[str, str]:
    """Units of the columns by the header and by the file beside them, which must agree."""
    stated = {name: unit for name, unit in table.units.items() if name in table.columns and is_stated(unit)}
    given = _units(path, table) if "units" in table.header else {}
    by_header = {name: given.get(name, given.get(kind_of(name), "")) for name in table.columns}
    by_header = {name: unit for name, unit in by_header.items() if unit}
    for name, unit in stated.items():
        own = by_header.get(name)
        if own is not None and table.own_units:
            if not same_unit(kind_of(name), own, unit):
                notes.append(f"{name} is in '{own}' as the user states, not in '{unit}' as the file states")
        elif _size(kind_of(name), unit) is None:
            allowed = ", ".join(UNITS[kind_of(name)])
            raise SeparatrixError(
                f"{path}: '{name}' is in '{_shown(unit)}', expected one of {allowed}; where the file "
                f"is wrong, state it in {path.name}.keys, as in 'units: t s, x 2.5 mm'"
            )
        elif own is not None and not same_unit(kind_of(name), own, unit):
            raise SeparatrixError(f"{path}: 'units' gives '{own}' for '{name}', whose own unit is '{unit}'")
    return stated | by_header


def _shown(unit: str) -> str:
    """Printable text of a damaged file, for a message."""
    return "".join(one if one.isprintable() else "?" for one in unit[:_LONGEST_UNIT])


def _size(kind: str, unit: str) -> float | None:
    """Size of a unit, as `mm` or `2.5 mm`, over the SI unit; None if it is no unit of such a column."""
    found = _NUMBER.fullmatch(unit.strip())
    times = 1.0
    if found and found.group(2):
        times, unit = float(found.group(1)), found.group(2)
    size = UNITS.get(kind, {}).get(_plain(unit))
    return None if size is None or not np.isfinite(times) or times == 0 else times * size


def _is_angle(unit: str) -> bool:
    """Whether a unit is of an angle, or one over time."""
    found = _NUMBER.fullmatch(unit.strip())
    return _plain(found.group(2) if found else unit).partition("/")[0] in _ANGLE


def _plain(unit: str) -> str:
    """A unit in canonical form: `m s-2`, `m/s\u00b2` and `Meters/sec/sec` are `m/s^2`."""
    unit = re.sub(r"\s+since\s.*", "", unit.strip()).strip("[]()")
    unit = unit.replace("\u00b2", "^2").replace("**", "^").replace("\u00b7", " ")
    unit = re.sub(r"/s(ec)?/s(ec)?$", "/s^2", unit)
    unit = re.sub(r"[ *.]s\^?-1$", "/s", unit)
    unit = re.sub(r"[ *.]s\^?-2$", "/s^2", unit)
    unit = re.sub(r"/sec$", "/s", unit)
    unit = re.sub(r"/(s|sec)\^?2$", "/s^2", unit)
    above, over, below = unit.partition("/")
    above = above.strip()
    if above not in _SAME and len(above) > _SYMBOL:
        above = above.lower()
    return _SAME.get(above, above) + over + below.strip()


def _units(path: Path, table: Table) -> dict[str, str]:
    """Unit of each column: `s, mm`, in the order of the columns, or by name, as in `t s, x mm`."""
    text, columns = table.header["units"], table.columns
    entries = [entry.strip() for entry in re.split(r"[,;]", text) if entry.strip()]
    given = [_entry(entry, [one for one in columns if is_sensor(one)]) for entry in entries]
    _check_order(path, table, sum(not name for name, _ in given))
    found, order = {}, iter(table.names)
    for name, unit in given:
        if not name:
            name = next(order, "")
            if name not in columns:
                continue
        if _size(kind_of(name), unit) is None or name in found:
            _refuse(path, text)
        found[name] = unit
    known = {kind_of(name) for name in [*found, *table.units] if name in columns or name in UNITS}
    if "t" not in known or not known & ({"x"} if has_position(columns) else {"x", "v", "a"}):
        _refuse(path, text)
    return found


def _check_order(path: Path, table: Table, count: int) -> None:
    """Refuse units in order where their assignment depends on whether unused columns have some of them."""
    used = list(table.columns)
    among_all = [name for name in table.names[:count] if name in used]
    fewer = count < len(table.names) and among_all != used[:count]
    if fewer or (count > len(table.names) and table.unused):
        raise SeparatrixError(
            f"{path}: units '{table.header['units']}': {count} units in the order of "
            f"{len(used) + len(table.unused)} columns, of which {', '.join(table.unused)} "
            f"{'is' if len(table.unused) == 1 else 'are'} not used: state them by name, as in "
            "'units: t s, x mm'"
        )


def _entry(entry: str, sensors: list[str]) -> tuple[str, str]:
    """Name of a column ('' if there is none) and unit, from `mm`, `x mm`, `x: mm`, `x = mm`, `x [mm]`."""
    for name in (*sensors, "t", "x", "a", *CHANNELS, *SAME):
        match = re.fullmatch(rf"{re.escape(name)}\s*(?:[:=]\s*|\s+|(?=[\[(]))[\[(]?\s*(.*?)\s*[\])]?", entry)
        if match:
            return SAME.get(name, name), match.group(1)
    return "", entry.strip("[]() ")


def _refuse(path: Path, text: str) -> None:
    raise SeparatrixError(
        f"{path}: units '{text}', expected one of {', '.join(_TIME)} for t and one of "
        f"{', '.join(UNITS['x'])} for x, as in '{_EXAMPLES['units']}' or 'units: t s, x mm'"
    )
