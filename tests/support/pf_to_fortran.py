#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Translates a .pf file into one Fortran file: its module and a program that runs its tests.

Refuses what pFUnit's own translator does not take: it goes by lines, not by statements.

pf_to_fortran.py SUITE.pf OUTPUT.F90 [--name PATH]   PATH is what failed assertions print
pf_to_fortran.py SUITE.pf --ranks                    prints how many ranks the suite asks for
"""

import argparse
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

ASSERTIONS = (
    "assertEqual",
    "assertRelativelyEqual",
    "assertTrue",
    "assertFalse",
    "assertLessThan",
    "assertLessThanOrEqual",
    "assertGreaterThan",
    "assertGreaterThanOrEqual",
    "assertIsNaN",
    "assertIsFinite",
)
MARKS = ("test", "before", "after")
ANNOTATION = re.compile(r"^\s*@(\w+)\s*(.*)$")
SUBROUTINE = re.compile(r"^\s*subroutine\s+(\w+)\s*(?:\(\s*(\w*)\s*\))?\s*$", re.IGNORECASE)
MODULE = re.compile(r"^\s*module\s+(\w+)\s*$", re.IGNORECASE)
USES_MPI = re.compile(r"^\s*use\s+pfunit\b", re.IGNORECASE)
NPES = re.compile(r"^\(\s*npes\s*=\s*\[(\s*\d+\s*(?:,\s*\d+\s*)*)\]\s*\)$", re.IGNORECASE)


class PfError(Exception):
    """Something in the .pf file that cannot be translated."""


@dataclass
class Procedure:
    """A subroutine with an annotation."""

    name: str
    with_context: bool
    npes: list[int]


@dataclass
class Suite:
    """What the translation of one file collects."""

    name: str
    module: str = ""
    mpi: bool = False
    tests: list[Procedure] = field(default_factory=list)
    before: Procedure | None = None
    after: Procedure | None = None
    body: list[str] = field(default_factory=list)

    @property
    def ranks(self) -> int:
        return max((n for test in self.tests for n in test.npes), default=1)


def code_of(line: str) -> str:
    """The line without its comment and without trailing blanks."""
    quote = ""
    for position, character in enumerate(line):
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        elif character == "!":
            return line[:position].rstrip()
    return line.rstrip()


def assertion(known: str, text: str, name: str, line: int) -> list[str]:
    """The call of an assertion; the line markers keep compiler messages on the .pf's lines."""
    if code_of(text) != text.rstrip():
        raise PfError(f"{line}: a comment behind @{known}; allowed on a line of its own")
    text = text.strip()
    if text.endswith("&"):
        raise PfError(f"{line}: @{known} goes on in the next line; allowed on one line")
    if not text.startswith("("):
        raise PfError(f"{line}: @{known} has no arguments")
    if not text.endswith(")"):
        raise PfError(f"{line}: @{known} has no closing parenthesis")
    return [
        f'# {line} "{name}"',
        f"call {known}{text[:-1].rstrip()}, &",
        f"  location=SourceLocation('{name}', {line}))",
        "if (anyExceptions()) return",
        f'# {line + 1} "{name}"',
    ]


def mark(suite: Suite, known: str, rest: str, following: list[str], line: int) -> None:
    """Notes the subroutine that follows @test, @before or @after."""
    npes = []
    if rest not in ("", "()"):
        match = NPES.match(rest)
        if known != "test" or not match:
            raise PfError(f"{line}: @{known}{rest} is not understood; known: @test(npes=[1,2])")
        npes = [int(n) for n in match.group(1).split(",")]
        if min(npes) < 1:
            raise PfError(f"{line}: npes must be 1 or more")
    code = next((c for c in map(code_of, following) if c.strip()), "")
    match = SUBROUTINE.match(code)
    if not match:
        raise PfError(f"{line}: no subroutine with at most one argument follows @{known}")
    with_context = bool(match.group(2))
    if npes and not with_context:
        raise PfError(f"{line}: a test with npes needs the argument class(MpiTestMethod)")
    if known == "test" and with_context and not npes:
        raise PfError(f"{line}: a test with an argument needs npes: @test(npes=[1,2])")
    procedure = Procedure(match.group(1), with_context, npes or [1])
    if known == "test":
        suite.tests.append(procedure)
    elif getattr(suite, known):
        raise PfError(f"{line}: a second @{known}")
    else:
        setattr(suite, known, procedure)


def read_suite(text: str, stem: str, name: str) -> Suite:
    """Translates the module; collects the tests."""
    suite = Suite(name=stem)
    suite.body.append(f'# 1 "{name}"')
    lines = text.splitlines()
    spelling = {known.lower(): known for known in (*ASSERTIONS, *MARKS)}
    index = 0
    while index < len(lines):
        line = lines[index]
        if match := MODULE.match(line):
            suite.module = match.group(1)
        suite.mpi = suite.mpi or bool(USES_MPI.match(line))
        match = ANNOTATION.match(line)
        if not match:
            suite.body.append(line)
            index += 1
            continue
        known = spelling.get(match.group(1).lower())
        if known is None:
            raise PfError(
                f"{index + 1}: unknown annotation @{match.group(1)}; known: @"
                + ", @".join((*MARKS, *ASSERTIONS))
            )
        if known in MARKS:
            mark(suite, known, match.group(2).strip(), lines[index + 1 :], index + 1)
            suite.body.append("!" + line)
        else:
            suite.body.extend(assertion(known, match.group(2), name, index + 1))
        index += 1
    check(suite)
    return suite


def check(suite: Suite) -> None:
    """Refuses what would silently test less than it states."""
    if not suite.tests:
        raise PfError("1: no @test in this file")
    if suite.module.lower() != suite.name.lower():
        raise PfError(f"1: the module must be named {suite.name}, found '{suite.module}'")
    names = [test.name.lower() for test in suite.tests]
    for name in names:
        if names.count(name) > 1:
            raise PfError(f"1: two tests are named {name}")
    marked = [p for p in (*suite.tests, suite.before, suite.after) if p]
    if not suite.mpi and any(p.with_context for p in marked):
        raise PfError("1: a test with an argument needs `use pfunit`")
    if suite.before or suite.after:
        if len({procedure.with_context for procedure in marked}) > 1:
            raise PfError("1: @before and @after have the argument of the tests, or none")
        if suite.tests[0].with_context and not (suite.before and suite.after):
            raise PfError("1: tests with npes need both @before and @after, or neither")


def surroundings(suite: Suite) -> list[str]:
    """What pFUnit writes around a suite refers to these names: a suite that exports others is refused."""
    return [
        f"subroutine {suite.name}_suite()",
        "  use funit",
        f"  use {suite.module}",
        "  implicit none",
        f"  {'class(MpiTestMethod), pointer' if suite.mpi else 'integer'} :: t",
        "  integer :: suite",
        "  suite = test + testmethod + testsuite",
        f"end subroutine {suite.name}_suite",
    ]


def program(suite: Suite) -> list[str]:
    """The program: one internal procedure per test, with @before and @after around it."""
    runner = "mpi_test_runner" if suite.mpi else "test_runner"
    marked = [p for p in (*suite.tests, suite.before, suite.after) if p]
    local = {p.name: f"procedure_{i}" for i, p in enumerate(marked, start=1)}
    renames = ", &\n    ".join(f"{local[p.name]} => {p.name}" for p in marked)
    context = "(this)" if suite.mpi else ""
    out = [
        f"program run_{suite.name}",
        f"  use {runner}, only: begin_suite, run_test, end_suite",
        "  use test_outcome, only: anyExceptions",
        *(["  use pfunit, only: MpiTestMethod"] if suite.mpi else []),
        f"  use {suite.module}, only: &\n    {renames}",
        "  implicit none",
        f"  call begin_suite('{suite.name}')",
    ]
    for number, test in enumerate(suite.tests, start=1):
        npes = ", [" + ", ".join(map(str, test.npes)) + "]" if suite.mpi else ""
        out.append(f"  call run_test('{test.name}', run_{number}{npes})")
    out += ["  call end_suite()", "contains"]
    for number, test in enumerate(suite.tests, start=1):
        out.append(f"  subroutine run_{number}{context}")
        if suite.mpi:
            out.append("    class(MpiTestMethod), intent(inout) :: this")
        for procedure in (suite.before, test, suite.after):
            if procedure is None:
                continue
            guard = "if (.not. anyExceptions()) " if procedure is test else ""
            argument = "(this)" if procedure.with_context else "()"
            out.append(f"    {guard}call {local[procedure.name]}{argument}")
        out.append(f"  end subroutine run_{number}")
    out.append(f"end program run_{suite.name}")
    return out


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("suite", type=Path)
    parser.add_argument("output", type=Path, nargs="?")
    parser.add_argument("--name", help="path to print instead of SUITE")
    parser.add_argument("--ranks", action="store_true", help="print the number of ranks asked for")
    arguments = parser.parse_args()
    name = arguments.name or str(arguments.suite)
    if not arguments.ranks and arguments.output is None:
        parser.error("OUTPUT is missing")
    try:
        suite = read_suite(arguments.suite.read_text(encoding="utf-8"), arguments.suite.stem, name)
    except PfError as error:
        print(f"{name}:{error}", file=sys.stderr)
        return 1
    if arguments.ranks:
        print(suite.ranks)
    else:
        text = "\n".join([*suite.body, *surroundings(suite), *program(suite)]) + "\n"
        arguments.output.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
