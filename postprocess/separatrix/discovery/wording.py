# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and numbers of a verdict as the report prints them."""

import math
import re
from collections.abc import Container
from dataclasses import dataclass


@dataclass(frozen=True)
class Units:
    """Units of x, of its speed and of what acts on it."""

    position: str = "m"
    velocity: str = "m/s"
    force: str = "N"


_ANGLES = Units("rad", "rad/s", "N m")
_OF_ANGLES = {"m": "rad", "N": "N m", "kg": "kg m^2"}
# in these units whatever x is
_AS_THEY_ARE = ("restoring.moment", "body.gravity")


def units_of(parameters: Container[str]) -> Units:
    """Units of the machine with these parameters: the x of a pendulum is an angle."""
    return _ANGLES if "restoring.moment" in parameters else Units()


def unit_of(path: str, unit: str, parameters: Container[str]) -> str:
    """Unit of a parameter whose `unit` is for x in metres, as x of this machine is."""
    if units_of(parameters) is not _ANGLES or path in _AS_THEY_ARE:
        return unit
    return re.sub(r"[A-Za-z]+", lambda found: _OF_ANGLES.get(found[0], found[0]), unit)


def words(name: str) -> str:
    """An effect's name as words."""
    return name.replace("_", " ")


def of_effects(verdict: dict) -> list[str]:
    """Paths of the parameters of the effects of a verdict, those that the base machine has too included."""
    several = verdict["locations"]
    return [
        path
        for path in verdict["parameters"]
        if path.startswith("effect.") or (several and path not in verdict["base_parameters"])
    ]


def searched(verdict: dict) -> str:
    """Where the effects of a verdict were looked for."""
    return "the catalogue" if verdict["asked_for"] is None else "the part of the catalogue that was asked for"


def number(value: float | None, digits: int = 4) -> str:
    """A number of the verdict as text; large ones without a power of ten up to a million."""
    if value is None:
        return "unknown"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(value) < 1e6 else text


def digits_of(value: float, error: float | None) -> int:
    """Digits that show a value to two digits of its standard error, at least 4."""
    if not error or value == 0:
        return 4
    return max(4, math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2)


def with_error(one: dict) -> str:
    """A parameter of the verdict with its standard error, or why it has none."""
    digits = digits_of(one["value"], one["standard_error"])
    unit = "" if one["unit"] == "1" else f" {one['unit']}"
    if one["standard_error"] is None:
        return f"{one['value']:.{digits}g}{unit}, {one['note']}"
    return f"{one['value']:.{digits}g} +- {one['standard_error']:.2g}{unit}"


def at_knot(one: dict) -> str:
    """Where a value of a table stands, with a space before it; nothing of other parameters."""
    return f" at {one['at']}" if one["at"] else ""


def interval(one: dict, digits: int) -> str:
    """The 95 % interval of a parameter of the verdict, or why it has none."""
    if one["interval_95"] is None:
        return one["note"]
    return " to ".join(number(end, digits) for end in one["interval_95"])


def probability(value: float) -> str:
    """A p value, or a bound where it underflows."""
    return number(value, 2) if value > 0 else "below 1e-300"


def with_unit(value: float | None, unit: str, digits: int = 4) -> str:
    """A number of the verdict with its unit; none for pure numbers."""
    return number(value, digits) + ("" if unit == "1" or value is None else f" {unit}")


def misfit(gap: dict, when: str) -> str:
    """What a machine misses beyond the noise, 'before' or 'after': size and share of the signal."""
    found = gap["misfit"]
    return f"{with_unit(found[when], found['unit'], 3)} ({100 * found['share'][when]:.2g} %)"
