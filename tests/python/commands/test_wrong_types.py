# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every key of the examples with a value of another type: refused with a message, or taken; never a crash."""

import tomllib
from collections.abc import Iterator

import separatrix as sx
from separatrix.cases import Case
from separatrix.trial import read_apart

VALUES = ("8", "[[1.0]]")
# Keys of a structure that no example has.
STRUCTURE = ("mass", "stiffness", "damping", "damping_ratio", "modes", "x0", "v0", "point", "file")


def _keys(value: object, at: str = "", law: str = "") -> Iterator[tuple[str, str]]:
    """Every key and table below a value, with the law of its table."""
    if isinstance(value, dict):
        law = str(value.get("law", law))
        for key, below in value.items():
            yield from _keys(below, f"{at}.{key}" if at else key, law)
    if at:
        yield at, law


def _problems(text: str, name: str, keys: list[str]) -> list[str]:
    """What is neither accepted nor a CaseError of code 65 or 66 with a message."""
    problems = []
    for key in keys:
        for value in VALUES:
            try:
                Case(text, name, [f"{key}={value}"])
            except sx.CaseError as error:
                if error.code not in (65, 66) or not str(error).strip():
                    problems.append(f"{key} = {value}: {error.code} {error}")
    return problems


def test_every_key_with_a_value_of_another_type(source_dir):
    """A number in place of the list of frequencies ended the program by a signal."""
    seen = set()
    for path in sorted((source_dir / "examples").glob("*.toml")):
        text = path.read_text()
        case = tomllib.loads(text)
        keys = [one for one in dict.fromkeys(_keys(case)) if one not in seen]
        seen.update(keys)
        further = [f"structure.{name}.{key}" for name in case.get("structure", {}) for key in STRUCTURE]
        names = [key for key, _ in keys] + further
        assert read_apart(path, "case", lambda: _problems(text, str(path), names)) == []  # noqa: B023
    assert len(seen) > 200
