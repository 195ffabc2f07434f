#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Public problems with their sources: theirs, ours, difference.

The cases are in examples/validation/public/. Run by itself it prints the table or, with --write, puts it into
docs/validation.md in place of the one there; the exit code is 1 where a number differs.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

from markdown import table
from validation_public_closed import COMPUTED as IN_CLOSED_FORM
from validation_public_printed import COMPUTED as PRINTED
from validation_public_steps import COMPUTED as BY_STEPS
from validation_structures_program import SOURCE, Number, Program

COMPUTED = (*PRINTED, *IN_CLOSED_FORM, *BY_STEPS)
#: The heading of the section in the page and the one after it.
HEADING, NEXT = "## Public problems\n", "## Measures of basins\n"


def numbers(program: Program) -> list[Number]:
    """All of them."""
    return [number for compute in COMPUTED for number in compute(program)]


def differs(number: Number) -> bool:
    """Whether a number is neither theirs nor settled against theirs."""
    return number.verdict == "DIFFERS"


def section(found: list[Number]) -> str:
    """The numbers as a table."""
    head = ["source", "quantity", "theirs", "ours", "difference", "tolerance", "verdict"]
    lines = []
    for one in found:
        verdict = one.verdict if one.verdict == "agrees" else f"**{one.verdict}**"
        ours = [f"{one.theirs:.12g}", f"{one.ours:.12g}", f"{one.ours - one.theirs:.1e}", f"{one.bar:.2g}"]
        lines.append([one.source, one.what, *ours, verdict])
    return table(head, lines)


def between(page: str) -> str:
    """The part of a page from the heading of the section to the next."""
    return HEADING + page.split(HEADING)[1].split(NEXT)[0]


def write(found: list[Number], commit: str) -> None:
    """The section of docs/validation.md anew, by its part of the template."""
    path = SOURCE / "docs" / "validation.md"
    page = path.read_text()
    template = (SOURCE / "scripts/evidence/validation.md.in").read_text()
    new = between(template).format(public=section(found), public_count=len(found), commit=commit)
    path.write_text(page.replace(between(page), new))


def main() -> int:
    """Print the table or write it."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--build", type=Path, default=SOURCE / "build", help="build folder [build]")
    parser.add_argument(
        "--out", type=Path, default=SOURCE / "out" / "validation", help="files [out/validation]"
    )
    parser.add_argument("--write", action="store_true", help="into docs/validation.md")
    options = parser.parse_args()
    program = Program(options.build.resolve(), options.out.resolve() / "public")
    os.environ["SEPARATRIX_PROGRAM"] = str(program.path)
    found = numbers(program)
    if options.write:
        lines = subprocess.run([program.path, "--version"], capture_output=True, text=True, check=True).stdout
        write(found, dict(line.split(" ", 1) for line in lines.splitlines())["commit"])
    else:
        print(section(found))
    return 1 if any(map(differs, found)) else 0


if __name__ == "__main__":
    sys.exit(main())
