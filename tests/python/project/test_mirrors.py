# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures that Fortran and C++ share have the same members, in the same order and of the same shapes."""

import ast
import re
from math import prod
from pathlib import Path

import pytest

LANES = Path(__file__).parents[3] / "src" / "lanes"
HEADERS = ("lane_types.hpp", "structure_types.hpp", "tape_types.hpp")
#: Fortran dimensions run the other way round.
Member = tuple[str, tuple[int, ...], str]


def number(text: str, names: dict[str, int]) -> int:
    """Value of an integer expression of constants."""
    known = re.sub(r"[a-z_]\w*", lambda name: str(names[name[0]]), text.strip())
    assert re.fullmatch(r"[\d\s+*/()-]+", known), text
    return int(eval(compile(ast.parse(known, mode="eval"), "", "eval")))


def cpp_constants() -> dict[str, int]:
    names: dict[str, int] = {}
    for file in HEADERS:
        text = re.sub(r"//.*", "", (LANES / file).read_text())
        for body in re.findall(r"enum \{(.*?)\}", text, re.S):
            for name, value in re.findall(r"(\w+)\s*=\s*([^,}]+)", body):
                names[name] = number(value, names)
    return names


def fortran_constants(file: Path) -> dict[str, int]:
    """Those that a module has or uses; private names of others may be the same."""
    names: dict[str, int] = {}
    curves = (LANES.parent / "laws" / "curve_law.f90").read_text()
    modules = dict.fromkeys((LANES / "lane_types.f90", file))
    for text in (curves, *(module.read_text() for module in modules)):
        joined = re.sub(r"&\s*\n\s*", " ", text)
        for row in re.findall(r"integer, parameter(?:, public)? :: (.*)", joined):
            for name, value in re.findall(r"(\w+)\s*=\s*([^,]+?)(?=,\s*\w+\s*=|$)", row):
                names[name] = number(value, names)
    return names


def cpp_members(name: str) -> list[Member]:
    """Members of a structure of C++; a field over lanes has that many."""
    texts = [re.sub(r"//.*", "", (LANES / f).read_text()) for f in HEADERS]
    names = cpp_constants()
    body = next(
        found[1] for text in texts if (found := re.search(rf"struct {name} \{{(.*?)\n\}};", text, re.S))
    )
    members: list[Member] = []
    for row in re.sub(r"enum \{.*?\};", "", body, flags=re.S).split(";"):
        kind, _, rest = " ".join(row.split()).partition(" ")
        if not rest:
            continue
        if over_lanes := re.fullmatch(r"(\w+)<double\[(\w+)\]>", kind):
            lanes = names[over_lanes[2]]
            members += [(one, (*shape, lanes), "double") for one, shape, _ in cpp_members(over_lanes[1])]
            continue
        for one in rest.split(","):
            member, *shape = re.split(r"[\[\]]+", one.strip())
            members.append((member, tuple(number(n, names) for n in shape if n), kind))
    return members


def length(bounds: str, names: dict[str, int]) -> int:
    lower, _, upper = bounds.rpartition(":")
    return number(upper, names) - (number(lower, names) if lower else 1) + 1


def fortran_members(body: str, file: Path, mirrored: dict[str, str]) -> list[Member]:
    names = fortran_constants(file)
    kinds = {"real(c_double)": "double", "integer(c_int)": "int"}
    members: list[Member] = []
    for row in re.sub(r"&\s*\n\s*", " ", body).splitlines():
        if "::" not in row:
            continue
        left, right = (side.strip() for side in row.split("::"))
        base = left.split(",")[0].strip()
        kind = kinds.get(base) or mirrored[base.removeprefix("type(").removesuffix(")")]
        common = re.search(r"dimension\((.*)\)", left)
        for one in re.findall(
            r"(\w+)(?:\(((?:[^()]|\([^()]*\))*)\))?\s*(?:=\s*(?:\w+\([^)]*\)|[^,]+))?(?:,|$)", right
        ):
            shape = one[1] or (common[1] if common else "")
            bounds = [length(part, names) for part in shape.split(",")] if shape else []
            members.append((one[0], tuple(reversed(bounds)), kind))
    return members


def mirrors() -> dict[str, tuple[str, str, Path]]:
    """Name in C++ by the name in Fortran, with the body and the file there."""
    comment = r"Mirrors `(\w+)` of \w+\.hpp[^\n]*\n(?:  !>[^\n]*\n)*"
    pattern = comment + r"  type, bind\(c\)(?:, public)? :: (\w+)\n(.*?)\n  end type"
    found = {}
    for file in sorted(LANES.glob("*.f90")):
        for cpp, fortran, body in re.findall(pattern, file.read_text(), re.S):
            found[fortran] = (cpp, body, file)
    return found


@pytest.mark.parametrize("fortran", sorted(mirrors()))
def test_members_are_the_same(fortran: str) -> None:
    every = mirrors()
    cpp, body, file = every[fortran]
    ours = fortran_members(body, file, {name: other for name, (other, _, _) in every.items()})
    theirs = cpp_members(cpp)
    assert len(theirs) >= 2
    assert ours == theirs
    assert all(prod(shape) > 0 for _, shape, _ in ours)


def test_every_shared_type_is_compared() -> None:
    shared = {
        name
        for file in LANES.glob("*.f90")
        for name in re.findall(r"^  type, bind\(c\)(?:, public)? :: (\w+)", file.read_text(), re.M)
    }
    assert shared == set(mirrors())
