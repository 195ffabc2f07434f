# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands share in reading their arguments."""

import argparse
from collections.abc import Callable, Collection

from separatrix.errors import USAGE, SeparatrixError


class Parser(argparse.ArgumentParser):
    """Usage errors leave with 64, as those of `separatrix` do."""

    def error(self, message: str) -> None:
        """Raise what the command reports."""
        raise SeparatrixError(f"{message}; see {self.prog} --help", USAGE)


def list_of(allowed: Collection[str]) -> Callable[[str], list[str]]:
    """Return the reader of a list of names, parted by commas, out of the allowed ones."""

    def read(text: str) -> list[str]:
        names = [name.strip().lower() for name in text.split(",") if name.strip()]
        unknown = [name for name in names if name not in allowed]
        if unknown or not names:
            found = ", ".join(unknown) or text
            raise argparse.ArgumentTypeError(f"found '{found}', allowed a list out of {', '.join(allowed)}")
        return names

    return read


def whole_number(lowest: int, highest: int | None = None) -> Callable[[str], int]:
    """Return the reader of a whole number within bounds."""
    bounds = f"from {lowest} on" if highest is None else f"from {lowest} to {highest}"

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = lowest - 1
        if value < lowest or (highest is not None and value > highest):
            raise argparse.ArgumentTypeError(f"'{text}' is not a whole number {bounds}")
        return value

    return read


def positive(text: str) -> float:
    """Read a number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number above 0")
    return value


def names(text: str) -> list[str]:
    """Read a list parted by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def two_names(text: str) -> tuple[str, str]:
    """Read two names parted by a comma."""
    found = names(text)
    if len(found) != 2:
        raise argparse.ArgumentTypeError(f"'{text}' is not two names parted by a comma")
    return found[0], found[1]


def interval(text: str) -> tuple[float, float]:
    """Read A:B with A below B."""
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        low, high = 1.0, 0.0
    if not low < high:
        raise argparse.ArgumentTypeError(f"'{text}' is not A:B with numbers, A below B")
    return low, high


def pairs(ranges: bool) -> Callable[[str], dict]:
    """Return the reader of NAME=VALUE,... or, with ranges, of NAME=A:B,..."""

    def read(text: str) -> dict:
        found = {}
        for part in names(text):
            name, _, value = part.partition("=")
            try:
                found[name.strip()] = interval(value) if ranges else float(value)
            except ValueError:
                form = "NAME=A:B" if ranges else "NAME=VALUE"
                raise argparse.ArgumentTypeError(f"'{part}' is not {form}") from None
        return found

    return read


def size(text: str) -> tuple[float, float]:
    """Read WxH in mm."""
    try:
        width, height = (float(part) for part in text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not WxH in mm") from None
    return width, height
