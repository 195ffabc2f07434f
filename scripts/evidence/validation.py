#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the cases of examples/validation/ and the referee of tests/referee/ and writes docs/validation.md.

The numbers of others are in validation_numbers.py, ours come from validation_rows.py, the prose is in
validation.md.in. The referee's reports stay in the output folder until the program or the referee is newer.
"""

import argparse
import os
import subprocess
import sys
import textwrap
from itertools import groupby
from pathlib import Path

import validation_curves
import validation_measures
import validation_public
import validation_rows as rows
import validation_structures
from markdown import table
from validation_numbers import NOT_YET, THEIRS
from validation_program import SOURCE, Program, Row

sys.path.insert(0, str(SOURCE / "tests" / "referee"))
import compare  # noqa: E402


def line(row: Row) -> list[str]:
    """A row as cells: quantity, theirs, ours, difference, tolerance, verdict."""
    _, what, theirs, bar = THEIRS[row.key]
    apart = f"{row.difference:.1e}" if row.difference else "0"
    verdict = row.verdict if row.verdict == "agrees" else f"**{row.verdict}**"
    return [what, f"{theirs:.12g}", f"{row.ours:.12g}", apart, f"{bar:g}", verdict]


def section(source: str, found: list[Row]) -> str:
    """The rows of one source under its name, and the methods by which ours were computed."""
    head = ["quantity", "theirs", "ours", "difference", "tolerance", "verdict", "method"]
    ways = list(dict.fromkeys(row.how for row in found))
    lines = [[*line(row), str(ways.index(row.how) + 1)] for row in found]
    methods = "\n".join(
        textwrap.fill(
            f"{number}. {how}", 120, subsequent_indent="   ", break_long_words=False, break_on_hyphens=False
        )
        for number, how in enumerate(ways, 1)
    )
    return f"### {source}\n\n{table(head, lines)}\n\nMethods:\n\n{methods}"


def page(
    found: list[Row], structures: list, public: list, measures: list, report: dict, version: dict[str, str]
) -> str:
    """The text of docs/validation.md."""
    order = list(THEIRS)
    found = sorted(found, key=lambda row: order.index(row.key))
    parts = [section(name, list(group)) for name, group in groupby(found, key=lambda row: THEIRS[row.key][0])]
    missed = [[THEIRS[row.key][0], *line(row)] for row in found if row.verdict != "agrees"]
    head = ["source", "quantity", "theirs", "ours", "difference", "tolerance", "verdict"]
    return (
        (SOURCE / "scripts/evidence/validation.md.in")
        .read_text()
        .format(
            **version,
            differs=table(head, missed) if missed else "None.",
            count=len(found),
            tables="\n\n".join(parts),
            structures=validation_structures.section(structures),
            public=validation_public.section(public),
            public_count=len(public),
            measures=validation_measures.section(measures),
            not_yet=table(["source", "quantity", "reason"], [list(item) for item in NOT_YET]),
            referee=compare.summary_table(report),
            disagreements=compare.disagreements(report),
        )
    )


def version_of(program: Path) -> dict[str, str]:
    """Name, commit and compiler of a program."""
    if not program.is_file():
        sys.exit(f"validation: {program} has not been built")
    lines = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    return dict(item.split(" ", 1) for item in lines.splitlines())


def main() -> int:
    """Run everything; the exit code is 1 where a number differs or the referee finds something wrong."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--build", type=Path, default=SOURCE / "build", help="build folder [build]")
    parser.add_argument(
        "--out", type=Path, default=SOURCE / "out" / "validation", help="files [out/validation]"
    )
    options = parser.parse_args()
    build, folder = options.build.resolve(), options.out.resolve()
    version = version_of(build / "bin" / "separatrix")
    os.environ["SEPARATRIX_LIBRARY"] = str(build / "lib" / "libseparatrix.so")
    program = Program(build, folder)
    found = []
    for compute in (*rows.COMPUTED, *validation_curves.COMPUTED):
        print(f"validation: {compute.__name__}", flush=True)
        found += compute(program)
    print("validation: structures", flush=True)
    structures = validation_structures.numbers(validation_structures.Program(build, folder / "structures"))
    os.environ["SEPARATRIX_PROGRAM"] = str(build / "bin" / "separatrix")
    print("validation: public problems", flush=True)
    public = validation_public.numbers(validation_structures.Program(build, folder / "public"))
    print("validation: measures", flush=True)
    measures = validation_measures.rows()
    report = compare.kept_report(build, folder / "referee")
    (SOURCE / "docs" / "validation.md").write_text(page(found, structures, public, measures, report, version))
    print("validation: wrote docs/validation.md", flush=True)
    bad = [row for row in [*found, *structures, *measures] if row.verdict != "agrees"]
    bad += filter(validation_public.differs, public)
    return 1 if bad or compare.wrong_in(report) else 0


if __name__ == "__main__":
    sys.exit(main())
