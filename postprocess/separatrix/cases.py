# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A case: one machine and what to compute with it. Cases are not changed; `with_` makes others."""

import json
import tomllib
from collections.abc import Iterable, Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Self

import numpy as np

from separatrix.errors import NO_INPUT, USAGE, CaseError
from separatrix.library import Model, Parameter

__all__ = ["Case", "linspace", "load", "number", "quantity"]

# The program cuts an override that is longer.
_LONGEST_SETTING = 4000
# A setting that is longer is not repeated in messages.
_SHORT = 60


class linspace:  # noqa: N801
    """`count` values from `first` to `last`, both exact: an axis in two numbers and a count.

    The ends are numbers in SI units or texts with a unit.

    Examples
    --------
    >>> sx.linspace("-3 mm", "3 mm", 5)
    linspace('-3 mm', '3 mm', 5)
    """

    def __init__(self, first: float | str, last: float | str, count: int) -> None:
        """Keep both ends and the count."""
        self.first, self.last = quantity("linspace", first), quantity("linspace", last)
        self.count = int(number("linspace", count))

    def __repr__(self) -> str:
        """Show it as it was written."""
        ends = (repr(end) if isinstance(end, str) else f"{end:g}" for end in (self.first, self.last))
        return f"linspace({', '.join(ends)}, {self.count})"


class Case:
    """A case that has been read and found right; use `load`, `Case.from_text` or `Case.from_dict`.

    Two cases are equal if they describe the same machine and the same work, however they were written.

    Examples
    --------
    >>> case = sx.load("examples/basin_coulomb.toml")
    >>> case.with_({"drive.ratio": 1.3}).parameters["drive.ratio"].value
    1.3
    """

    def __init__(
        self, text: str, name: str | Path, settings: Iterable[str] = (), directory: Path | None = None
    ) -> None:
        """Check a text with settings "key.path=value" on top; CaseError lists all that is wrong.

        `name` stands for the file in messages. Files that the case names are looked for in `directory`, or
        in that of `name`, wherever the process goes afterwards.
        """
        self._text = text
        self._name = str(name)
        self._settings = tuple(settings)
        self._directory = (directory or Path(name).parent).absolute()
        path = self._directory / Path(name).name
        try:
            self._model = Model.from_settings(text, path, self._settings)
        except CaseError as error:
            message = str(error).replace(str(path), self._name)
            raise CaseError(_in_python(message, self._settings), error.code) from None

    @classmethod
    def from_text(cls, text: str, directory: str | Path = ".") -> Self:
        """Return the case of a TOML text; files that it names are looked for in `directory`."""
        return cls(text, Path(directory) / "case.toml")

    @classmethod
    def from_dict(cls, tables: Mapping[str, object], directory: str | Path = ".") -> Self:
        """Return the case of nested mappings: `{"body": {"mass": "1 kg"}, "friction": {"law": ...}}`."""
        # a key of a table of its own has to be a mapping; all others are values of a table
        settings = [f"{key}={toml(value)}" for key, value in _flat(tables)]
        return cls("", Path(directory) / "case.toml", settings)

    def with_(self, changes: Mapping[str, object] | None = None, /, **more: object) -> Self:
        """Return this case with other values: `case.with_(drive__ratio=1.3)`, or `{"drive.ratio": 1.3}`.

        Keys are those of a case file; two underscores stand for a dot, and `axis[1].count` is written as a
        key of a mapping. Values are numbers in SI units, texts with a unit ("12 mm"), lists, or mappings
        that replace a whole table: `case.with_(friction={"law": "viscous", "damping": 0.2})`. What is
        unknown or out of bounds is a CaseError.
        """
        new = {**(changes or {}), **{key.replace("__", "."): value for key, value in more.items()}}
        settings = [f"{key}={toml(value)}" for key, value in new.items()]
        return type(self)(self._text, self._name, self._settings + tuple(settings), self._directory)

    def in_si(self, path: str, value: float | str) -> float:
        """Return a value of the key `path` in its SI unit.

        A number is returned as it is, a text ("-3 mm") is read as in a case file; CaseError names what is
        wrong.
        """
        if not isinstance(value, str):
            return number(path, value)
        # The axes of the case may not suit the value.
        case = self.with_({"axis": [], path: value})
        found: object = case.resolved
        for key in path.split("."):
            if key not in found:
                # an older name of a parameter
                return case.parameters[list(case.parameters)[case.model.index_of(path)]].value
            found = found[key]
        return float(found)

    def start(self, **given: float | str | None) -> dict[str, float]:
        """Return x0 [m], v0 [m/s] and crank_angle [rad] of a start; what is None is that of the case."""
        fixed = self.resolved["start"]
        return {
            name: float(fixed[name]) if value is None else self.in_si(f"start.{name}", value)
            for name, value in given.items()
        }

    @property
    def name(self) -> str:
        """The file, or what stands for it in messages."""
        return self._name

    @property
    def directory(self) -> Path:
        """Where files that the case names are looked for."""
        return self._directory

    @property
    def title(self) -> str:
        """The title, empty if there is none."""
        return str(self.resolved.get("title", ""))

    @property
    def settings(self) -> tuple[str, ...]:
        """What was put on top of the text, as `--set` takes it."""
        return self._settings

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Every number of the laws and effects by path, with unit and bounds."""
        return dict(self._model.parameters)

    @property
    def model(self) -> Model:
        """The machine as a function (docs/library.md)."""
        return self._model

    @cached_property
    def resolved(self) -> dict:
        """Every value of the case in SI units, defaults filled in, as nested dictionaries."""
        return tomllib.loads(self.to_toml())

    def to_toml(self) -> str:
        """Return the resolved case as a TOML text: SI units, defaults filled in."""
        return self._model.to_text({})

    def save(self, path: str | Path) -> Path:
        """Write the case as a file: as it was read, or resolved if values were put on top.

        The resolved case is written, too, if the text names files that are in another folder.
        """
        path = Path(path)
        path.write_text(self._text if not self._settings and self._reads_at(path) else self.to_toml())
        return path

    def _reads_at(self, path: Path) -> bool:
        """Whether the text is the same case at another path."""
        try:
            return type(self)(self._text, path) == self
        except CaseError:
            return False

    def on_command_line(self, folder: Path) -> list[str]:
        """Return how to name this case to the program; what has to be a file is written into `folder`."""
        source = Path(self._name)
        if source.parent.absolute() != self._directory:
            source = self._directory / source.name
        short = all(len(setting.encode()) < _LONGEST_SETTING for setting in self._settings)
        if short and len(self._settings) < 100 and _holds(source, self._text):
            return [str(source), *(part for setting in self._settings for part in ("--set", setting))]
        # The resolved case holds what its files held.
        path = folder / (source.name or "case.toml")
        path.write_text(self.to_toml())
        return [str(path)]

    def __eq__(self, other: object) -> bool:
        """Compare the resolved cases."""
        return isinstance(other, Case) and self.to_toml() == other.to_toml()

    def __hash__(self) -> int:
        """Hash the resolved case."""
        return hash(self.to_toml())

    def __repr__(self) -> str:
        """Name the case and what was put on top."""
        changes = "".join(f", {setting}" for setting in self._settings)
        return f"<Case {self._name}{changes}>"


def load(path: str | Path) -> Case:
    """Read a case file. CaseError names file, line, key, what was found and what is allowed.

    Examples
    --------
    >>> sx.load("examples/basin_coulomb.toml").title
    'Basins at frequency ratio 1.2, Coulomb friction'
    """
    if not isinstance(path, str | PathLike):
        raise CaseError(f"load: found {path!r}, allowed the name of a file", USAGE)
    path = Path(path).expanduser()
    try:
        text = path.read_text()
    except OSError as error:
        raise CaseError(f"{path}: cannot be read ({error.strerror})", NO_INPUT) from error
    except UnicodeDecodeError as error:
        raise CaseError(f"{path}: is no text in UTF-8") from error
    return Case(text, path)


def as_case(case: "Case | str | Path") -> Case:
    """Return a case, which may be given by its file."""
    return case if isinstance(case, Case) else load(case)


def number(name: str, value: object) -> float:
    """Return a number; CaseError for what is none."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise CaseError(f"{name}: found {value!r}, allowed a number", USAGE) from None


def quantity(name: str, value: object) -> float | str:
    """Return a number, or a text that the case will read with its unit; CaseError for anything else."""
    return value if isinstance(value, str) else number(name, value)


def toml(value: object) -> str:
    """Return a value as TOML on one line."""
    if isinstance(value, linspace):
        return toml({"from": value.first, "to": value.last, "count": value.count})
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return repr(float(value))
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return toml(value.item())
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)}={toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Iterable):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    raise CaseError(f"found {value!r}, allowed a number, a text, a list or a mapping", USAGE)


def _in_python(message: str, settings: Iterable[str]) -> str:
    """A message without the spelling of the command line, and without what would fill a screen."""
    message = message.replace("--set ", "")
    for setting in settings:
        if len(setting) > _SHORT:
            message = message.replace(f"{setting}: ", f"{setting.partition('=')[0]}: ")
    return message


def _flat(tables: Mapping[str, object]) -> list[tuple[str, object]]:
    """The entries of the tables; effects are tables in a table."""
    found = []
    for key, value in tables.items():
        if key == "effect" and isinstance(value, Mapping):
            found += [(f"effect.{name}", table) for name, table in value.items()]
        else:
            found.append((key, value))
    return found


def _key(key: object) -> str:
    text = str(key)
    return text if text.replace("_", "").replace("-", "").isalnum() else json.dumps(text)


def _holds(path: Path, text: str) -> bool:
    """Whether a file still is what was read from it."""
    try:
        return path.is_file() and path.read_text() == text
    except (OSError, UnicodeDecodeError):
        return False
