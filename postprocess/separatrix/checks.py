# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments of functions: numbers within bounds, pairs of numbers, whole numbers."""

import math
from numbers import Integral, Real

from separatrix.errors import USAGE, SeparatrixError

__all__ = ["count", "number", "numbers"]


def number(name: str, value: object, least: float = -math.inf, *, above: bool = False) -> float:
    """Return a finite number from `least` on, or above it; a SeparatrixError names what was found."""
    plain = isinstance(value, Real) and not isinstance(value, bool)
    found = float(value) if plain else math.nan
    if not math.isfinite(found) or found < least or (above and found == least):
        limits = "" if least == -math.inf else f" above {least:g}" if above else f" of {least:g} or more"
        raise SeparatrixError(f"{name}: found {value!r}, allowed a number{limits}", USAGE)
    return found


def count(name: str, value: object, least: int = 1) -> int:
    """Return a whole number from `least` on; a SeparatrixError names what was found."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise SeparatrixError(f"{name}: found {value!r}, allowed a whole number from {least} on", USAGE)
    return int(value)


def numbers(name: str, value: object, what: str) -> tuple[float, float]:
    """Return two numbers, which need not be finite; a SeparatrixError names what was found and `what`."""
    try:
        first, second = value
        pair = float(first), float(second)
    except (TypeError, ValueError):
        pair = (math.nan, math.nan)
    if any(math.isnan(one) for one in pair):
        raise SeparatrixError(f"{name}: found {value!r}, allowed {what}", USAGE)
    return pair
