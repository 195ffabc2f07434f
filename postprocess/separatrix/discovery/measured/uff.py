# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in universal files: functions over time (data set 58) and the units of the file (164)."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from separatrix.discovery.measured.arrays import Found, column_of, common_times
from separatrix.discovery.measured.header import is_stated, same_unit
from separatrix.discovery.measured.tables import is_column, kind_of
from separatrix.errors import SeparatrixError
from separatrix.extras import library
from separatrix.universal_files import FileUnits, check_whole, units_of

# specific data types of UFF 58 (displacement, velocity, force) and the columns that they are
_OF_TYPE = {8: "x", 11: "v", 9: "force", 13: "force"}
# types of function and abscissa of a time record: time response over time or unspecified; unspecified over
# time
_OVER_TIME = {(1, 17), (1, 0), (0, 17)}
_ROTATIONS = (4, 5, 6)
# digits of the times of an uneven function in text; of a step, what one more digit would show
_DIGITS, _COARSE = 6, 0.1


def read_uff(path: Path, names: Mapping[str, str]) -> Found:
    """Functions over time; displacement is x, velocity v, force force, or the column in `id1`."""
    check_whole(path)
    sets = library("pyuff", path, "formats").UFF(str(path)).read_sets()
    sets = [sets] if isinstance(sets, dict) else sets
    found, times, others = Found(), {}, 0
    units = _units(path, sets)
    for one in (one for one in sets if one.get("type") == 58):
        if (one.get("func_type"), one.get("abscissa_spec_data_type")) not in _OVER_TIME:
            others += 1
            continue
        for line in (str(one.get(f"id{k}", "")) for k in range(1, 6)):
            key, colon, value = (word.strip() for word in line.partition(":"))
            if colon:
                found.key(key, value)
        own = str(one.get("id1", "")).strip()
        name = column_of(own, names)
        if not is_column(name) and not names:
            name = _OF_TYPE.get(one.get("ordinate_spec_data_type"), "")
        if not is_column(name):
            found.unused.append(own or "NONE")
            continue
        if name in found.values:
            raise SeparatrixError(
                f"{path}: two functions are '{name}': state which in their first line (id1)"
            )
        found.values[name] = _values(path, name, one)
        times[name] = np.asarray(one["x"], float)
        unit = _unit(name, one, units)
        found.units |= {name: unit} if unit else {}
        unit = str(one.get("abscissa_axis_units_lab", ""))
        found.units |= {"t": unit} if is_stated(unit) else {}
        _check_times(path, name, one, times[name], found.notes)
    if others:
        found.notes.append(f"{others} functions that are not over time (spectra, FRF) are left out")
    found.notes = list(dict.fromkeys(found.notes))
    if times and "t" not in found.values:
        found.values["t"] = common_times(path, times)
        if "units" not in found.values:
            # by the standard, but it is not stated
            found.units.setdefault("t", "s")
    return found


def _values(path: Path, name: str, one: dict) -> np.ndarray:
    """The values of a function, as many as its header states."""
    values, stated = np.asarray(one["data"]), int(one["num_pts"])
    if values.size != stated:
        raise SeparatrixError(
            f"{path}: '{name}' has {values.size} values, expected {stated} as its header states: damaged or "
            "cut off"
        )
    return values


def _units(path: Path, sets: list[dict]) -> FileUnits | None:
    """The units that the file states."""
    try:
        return units_of([one for one in sets if one.get("type") == 164])
    except SeparatrixError as error:
        raise SeparatrixError(f"{path}: {error}") from None


def _unit(name: str, one: dict, units: FileUnits | None) -> str:
    """The unit of a function, by its label and by data set 164; '' where the file states none."""
    label = str(one.get("ordinate_axis_units_lab", "")).strip()
    label = label if is_stated(label) else ""
    kind = kind_of(name)
    if units is None or kind == "phi":
        return label
    if units.problem:
        # no unit: refused, or stated by the user
        return "unknown: code and factors of data set 164 disagree"
    length, force = units.length, units.force
    turns = abs(one.get("rsp_dir") or 0) in _ROTATIONS
    if kind == "force":
        unit = f"{1 / (force * length)!r} N m" if turns else f"{1 / force!r} N"
    else:
        over = {"x": "", "v": "/s", "a": "/s^2"}[kind]
        unit = f"rad{over}" if turns else f"{1 / length!r} m{over}"
    if label and not same_unit(kind, label, unit):
        # no unit: refused, or stated by the user
        return f"{label} by its label, {unit} by data set 164"
    return label or unit


def _check_times(path: Path, name: str, one: dict, t: np.ndarray, notes: list[str]) -> None:
    """Report the rate of even times, and refuse uneven ones whose digits hide the steps."""
    if one.get("abscissa_spacing"):
        step = float(one.get("abscissa_inc") or 0.0)
        if step > 0:
            notes.append(f"t has even steps of {step:.9g} s as the file states, {1 / step:.9g} Hz")
        return
    if t.size < 2:
        return
    last = float(np.max(np.abs(t)))
    steps = np.diff(t)
    usual = float(np.ptp(t)) / steps.size
    finest = 10.0 ** (np.floor(np.log10(last)) - _DIGITS + 1) if last > 0 else 0.0
    if not finest > _COARSE * usual or np.ptp(steps) < 1e-3 * usual:
        return
    rounded = np.array([float(f"{value:.{_DIGITS - 1}e}") for value in t])
    if np.allclose(rounded, t, rtol=1e-9, atol=0):
        raise SeparatrixError(
            f"{path}: the times of '{name}' have six digits ({t[-2]:.6g} and {t[-1]:.6g} s at the end), too "
            f"few for steps of {usual:.3g} s: write even times (abscissa_spacing 1), or begin at 0"
        )
