# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts of a request as checked numbers; what is not understood is refused with what is allowed."""

import math
from collections.abc import Mapping

from separatrix.errors import USAGE, SeparatrixError

_LARGEST = 1e300


class RefusedError(SeparatrixError):
    """A request that is not understood or out of range."""

    def __init__(self, message: str) -> None:
        """Keep what is wrong."""
        super().__init__(message, USAGE)


class Parameters:
    """Texts of a request as checked numbers."""

    def __init__(self, texts: Mapping[str, str]) -> None:
        """Keep the texts."""
        self.texts = texts

    def whole(self, name: str, low: int, high: int, default: int | None = None) -> int:
        """Return a whole number from low to high."""
        text = self.texts.get(name)
        if text is None and default is not None:
            return default
        digits = (text or "").removeprefix("-")
        if not (digits.isascii() and digits.isdigit() and len(digits) <= 12 and low <= int(text) <= high):
            raise RefusedError(f"{name}: found {shown(text)}, allowed a whole number from {low} to {high}")
        return int(text)

    def real(self, name: str, default: float | None = None) -> float:
        """Return a finite number."""
        text = self.texts.get(name)
        if text is None and default is not None:
            return default
        try:
            value = float(text or "") if len(text or "") <= 40 else math.nan
        except ValueError:
            value = math.nan
        if not abs(value) <= _LARGEST:
            raise RefusedError(f"{name}: found {shown(text)}, allowed a finite number")
        return value

    def changes(self) -> dict[str, float]:
        """Return `with=path:value;...`, other values of parameters."""
        text = self.texts.get("with", "")
        found = {}
        for part in text.split(";") if text else []:
            path, _, value = part.partition(":")
            found[path] = Parameters({path: value}).real(path)
        if len(found) > 16 or len(text) > 2000:
            raise RefusedError("with: allowed are at most 16 parameters")
        return found


def shown(text: str | None) -> str:
    """Return a text as a message repeats it."""
    return "nothing" if text is None else f"'{text[:40]}'"
