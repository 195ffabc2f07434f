# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and numbers of a verdict as the report prints them."""

import math


def words(name: str) -> str:
    """An effect's name as words."""
    return name.replace("_", " ")


def number(value: float | None, digits: int = 4) -> str:
    """A number of the verdict as text; large ones without a power of ten up to a million."""
    if value is None:
        return "unknown"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(value) < 1e6 else text


def digits_of(value: float, error: float | None) -> int:
    """Digits that show a value to two digits of its standard error, at least 4."""
    return 4 if not error or value == 0 else max(4, math.ceil(math.log10(abs(value) / error)) + 2)


def with_error(one: dict, digits: int) -> str:
    """A parameter of the verdict with its standard error, or why it has none."""
    unit = "" if one["unit"] == "1" else f" {one['unit']}"
    if one["standard_error"] is None:
        return f"{one['value']:.{digits}g}{unit}, {one['note']}"
    return f"{one['value']:.{digits}g} +- {one['standard_error']:.2g}{unit}"


def interval(one: dict, digits: int) -> str:
    """The 95 % interval of a parameter of the verdict, or why it has none."""
    if one["interval_95"] is None:
        return one["note"]
    return " to ".join(number(end, digits) for end in one["interval_95"])


def probability(value: float) -> str:
    """A p value; what is too small for a number is said to be."""
    return number(value, 2) if value > 0 else "below 1e-300"


def with_unit(value: float | None, unit: str, digits: int = 4) -> str:
    """A number of the verdict with its unit; none for pure numbers."""
    return number(value, digits) + ("" if unit == "1" or value is None else f" {unit}")
