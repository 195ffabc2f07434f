#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the cases of examples/validation/ and the referee of tests/referee/ and writes docs/validation.md.

The numbers of others are in validation_numbers.py, ours come from validation_rows.py, the prose is in
validation.md.in. The referee's reports stay in the output folder until the program or the referee is newer.
"""

import os
import sys
import textwrap

import validation_curves
import validation_measures
import validation_motors
import validation_public
import validation_rows as rows
import validation_structures
from evidence_rows import COLUMNS, SOURCE, Row, arguments, page, sections, table, table_of, version_of
from validation_numbers import NOT_YET, THEIRS
from validation_program import Program

sys.path.insert(0, str(SOURCE / "tests" / "referee"))
import compare  # noqa: E402


def with_methods(found: list[Row]) -> str:
    """The rows of one source, and the methods by which ours were computed."""
    ways = list(dict.fromkeys(row.how for row in found))
    lines = [[*(row.cells()[name] for name in COLUMNS), str(ways.index(row.how) + 1)] for row in found]
    methods = "\n".join(
        textwrap.fill(
            f"{number}. {how}", 120, subsequent_indent="   ", break_long_words=False, break_on_hyphens=False
        )
        for number, how in enumerate(ways, 1)
    )
    return f"{table([*COLUMNS, 'method'], lines)}\n\nMethods:\n\n{methods}"


def text_of(found: list[Row], others: dict[str, list[Row]], report: dict, version: dict[str, str]) -> str:
    """The text of docs/validation.md."""
    order = [theirs[:2] for theirs in THEIRS.values()]
    found = sorted(found, key=lambda row: order.index((row.source, row.what)))
    missed = [row for row in found if row.differs]
    every = ("source", *COLUMNS)
    return page(
        "validation",
        **version,
        differs=table_of(missed, every) if missed else "None.",
        count=len(found),
        tables=sections(found, with_methods),
        structures=table_of(others["structures"], every),
        public=table_of(others["public"], every),
        public_count=len(others["public"]),
        **validation_motors.fields(others["motors"]),
        measures=sections(others["measures"]),
        not_yet=table(["source", "quantity", "reason"], [list(item) for item in NOT_YET]),
        referee=compare.summary_table(report),
        disagreements=compare.disagreements(report),
    )


def main() -> int:
    """Run everything; the exit code is 1 where a number differs or the referee finds something wrong."""
    options = arguments(__doc__, "validation").parse_args()
    build, folder = options.build.resolve(), options.out.resolve()
    version = version_of(build / "bin" / "separatrix")
    os.environ["SEPARATRIX_LIBRARY"] = str(build / "lib" / "libseparatrix.so")
    program = Program(build, folder)
    found = []
    for compute in (*rows.COMPUTED, *validation_curves.COMPUTED):
        print(f"validation: {compute.__name__}", flush=True)
        found += compute(program)
    print("validation: structures", flush=True)
    others = {}
    others["structures"] = validation_structures.numbers(
        validation_structures.Program(build, folder / "structures")
    )
    os.environ["SEPARATRIX_PROGRAM"] = str(build / "bin" / "separatrix")
    print("validation: public problems", flush=True)
    others["public"] = validation_public.numbers(validation_public.Program(build, folder / "public"))
    print("validation: machines with a motor", flush=True)
    others["motors"] = validation_motors.numbers(validation_motors.Program(build, folder / "motors"))
    print("validation: measures", flush=True)
    others["measures"] = validation_measures.rows()
    report = compare.kept_report(build, folder / "referee")
    (SOURCE / "docs" / "validation.md").write_text(text_of(found, others, report, version))
    print("validation: wrote docs/validation.md", flush=True)
    bad = any(row.differs for rows_of in (found, *others.values()) for row in rows_of)
    return 1 if bad or compare.wrong_in(report) else 0


if __name__ == "__main__":
    sys.exit(main())
