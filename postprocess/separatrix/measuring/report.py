# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a measure: value, interval, definition, and what limits it."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Measure:
    """One number of one basin, or of a whole map.

    `value` is nan where it is not known; `lower` and `upper` enclose it as `interval` states (-inf or inf
    where one side is open). `limits` are the reasons why it is not better known, `details` what it was made
    from.
    """

    name: str
    definition: str
    unit: str = "1"
    of: int | None = None
    value: float = math.nan
    lower: float = math.nan
    upper: float = math.nan
    interval: str = ""
    parameters: Mapping[str, object] = field(default_factory=dict)
    limits: tuple[str, ...] = ()
    details: Mapping[str, object] = field(default_factory=dict)

    @property
    def known(self) -> bool:
        """Whether there is a value."""
        return math.isfinite(self.value)

    def as_dict(self) -> dict[str, object]:
        """Return it as JSON has it: lists, and None for what is not known or not bounded."""
        return {name: _plain(value) for name, value in asdict(self).items()}

    def __str__(self) -> str:
        """Return it in one line."""
        return f"{self.heading}: {self.number}"

    @property
    def heading(self) -> str:
        """Name, and the attractor that it is of."""
        return self.name.replace("_", " ") + ("" if self.of is None else f" of attractor {self.of}")

    @property
    def number(self) -> str:
        """Value, interval and unit as text."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        if not self.known:
            text = "not known"
            if math.isfinite(self.lower):
                text = f"not known, at least {self.lower:.6g}{unit}"
            return text
        ends = ""
        if not (math.isnan(self.lower) or math.isnan(self.upper)):
            digits = _digits(self.value, self.upper - self.lower)
            ends = f" [{_end(self.lower, digits)}, {_end(self.upper, digits)}]"
        return f"{self.value:.6g}{ends}{unit}"


class Measures:
    """The measures of one map: a sequence, a table as text, and a DataFrame."""

    def __init__(self, found: list[Measure], about: Mapping[str, object] | None = None) -> None:
        """Keep them in their order, and what they all are of."""
        self._found = list(found)
        self.about = dict(about or {})

    def __iter__(self) -> Iterator[Measure]:
        """Go through them."""
        return iter(self._found)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._found)

    def __getitem__(self, key: int | str | tuple[str, int]) -> Measure:
        """Return one by its index, its name, or its name and attractor."""
        if isinstance(key, int):
            return self._found[key]
        name, of = key if isinstance(key, tuple) else (key, None)
        for one in self._found:
            if one.name == name and of in (None, one.of):
                return one
        raise KeyError(key)

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return one row for each: name, attractor, value, ends of the interval, unit, limits."""
        import pandas

        columns = ("name", "of", "value", "lower", "upper", "unit", "interval")
        frame = pandas.DataFrame([{key: getattr(one, key) for key in columns} for one in self._found])
        frame["limits"] = ["; ".join(one.limits) for one in self._found]
        return frame

    def as_dict(self) -> dict[str, object]:
        """Return all of it as JSON has it."""
        return {"about": _plain(self.about), "measures": [one.as_dict() for one in self._found]}

    def __str__(self) -> str:
        """Return the report of the command: a table, and under it the definitions, once each."""
        lines = [f"{key}: {value}" for key, value in self.about.items()]
        width = max((len(one.heading) for one in self._found), default=0)
        lines += [f"{one.heading:{width}}  {one.number}" for one in self._found]
        defined: dict[str, Measure] = {}
        for one in self._found:
            defined.setdefault(one.name, one)
        for one in defined.values():
            given = ", ".join(
                f"{key.replace('_', ' ')} {_short(value)}" for key, value in one.parameters.items()
            )
            lines += ["", f"{one.name.replace('_', ' ')}: {one.definition}"]
            lines += [f"  interval: {one.interval}"] * bool(one.interval)
            lines += [f"  {given}"] * bool(given)
            limits = {
                limit: None for other in self._found if other.name == one.name for limit in other.limits
            }
            lines += [f"  limited: {limit}" for limit in limits]
        return "\n".join(lines)


def _digits(value: float, width: float) -> int:
    """Digits that show the width of an interval."""
    if not (math.isfinite(width) and width > 0 and value != 0):
        return 6
    return min(max(6, math.ceil(-math.log10(width / abs(value))) + 1), 10)


def _end(end: float, digits: int) -> str:
    return f"{end:.{digits}g}" if math.isfinite(end) else "open"


def _short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple | np.ndarray):
        return "(" + ", ".join(_short(item) for item in value) + ")"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_short(item)}" for key, item in value.items())
    return str(value)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
