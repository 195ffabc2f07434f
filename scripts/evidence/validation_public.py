#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Public problems with their sources: theirs, ours, difference.

The cases are in examples/validation/public/. Run by itself it prints the table or, with --write, puts it into
docs/validation.md in place of the one there; the exit code is 1 where a number differs.
"""

import os
import sys

from evidence_rows import COLUMNS, Row, arguments, show, table_of, version_of
from validation_public_closed import COMPUTED as IN_CLOSED_FORM
from validation_public_forms import COMPUTED as OTHER_FORMS
from validation_public_machines import COMPUTED as MACHINES
from validation_public_printed import COMPUTED as PRINTED
from validation_public_program import Program
from validation_public_steps import COMPUTED as BY_STEPS
from validation_sections import write_section

COMPUTED = (*PRINTED, *IN_CLOSED_FORM, *OTHER_FORMS, *BY_STEPS, *MACHINES)
#: The heading of the section in the page.
HEADING = "Public problems"


def numbers(program: Program) -> list[Row]:
    """All of them."""
    return [number for compute in COMPUTED for number in compute(program)]


def main() -> int:
    """Print the rows or write them."""
    parser = arguments(__doc__, "validation")
    parser.add_argument("--json", action="store_true", help="a line of JSON for each row")
    parser.add_argument("--write", action="store_true", help="into docs/validation.md")
    options = parser.parse_args()
    program = Program(options.build.resolve(), options.out.resolve() / "public")
    os.environ["SEPARATRIX_PROGRAM"] = str(program.path)
    found = numbers(program)
    if options.write:
        commit = version_of(program.path)["commit"]
        write_section(
            HEADING, public=table_of(found, ("source", *COLUMNS)), public_count=len(found), commit=commit
        )
    return show(found, options.json)


if __name__ == "__main__":
    sys.exit(main())
