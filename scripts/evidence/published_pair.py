#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs what two bodies and soft contacts must show and writes docs/published_pair.md with its figures.

The checks are in pair_checks.py and contact_checks.py, the prose of the page is in published_pair.md.in.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import contact_checks as contacts
import pair_checks as pair
from evidence_rows import SOURCE, Row, page, table, table_of, version_of
from pair_runs import Program
from separatrix import cli

SECTIONS = {
    "pair": (pair.free_bodies, pair.carried_off, pair.shaken, pair.free_pair, pair.algebraic),
    "impacts": (pair.bouncing, pair.hammer, pair.identified),
    "contacts": (contacts.hunt_crossley, contacts.formulas, contacts.kelvin_voigt),
    "books": (contacts.books,),
    "hard": (contacts.hard,),
}
# what no case file can show: a law over random machines, or a second method
TESTS = (
    ("energy never grows without a drive; the balance closes", "test_pair_motion", "the_book_closes"),
    ("the same with soft stops", "test_pair_contact", "the_book_closes"),
    ("the same, one body between soft barriers", "test_contact_flight", "energy_never_grows"),
    ("implicit steps with projection converge with order 1", "test_pair_motion", "time_stepping_converges"),
    ("random limiting cases complete; no stop is penetrated", "test_pair_ties", "hard_cases_at_random"),
    ("stops without clearance, with every kind of drive", "test_pair_ties", "stops_without_room"),
    ("no gap, e = 0, e = 1, a gap of 1e-9 m, e near 1", "test_pair_impact", "hard_cases"),
    ("simultaneous events", "test_pair_impact", "together_into_the_stop"),
    ("stiff contacts converge to the rigid law as K^(-2/5)", "test_pair_contact", "stiff_limit_is_newton"),
    ("sampled control converges to continuous control, order 1", "test_pair_impact", "sampled_controller"),
)  # fmt: skip
MOST_COMMANDS = 20
DRAWN = ("pair_free", "pair_platform", "hammer", "pair_backlash")
BESIDE = ("contact_hunt_crossley", "contact_kelvin_voigt")


def rows_of(items: list[Row]) -> str:
    """The table of a section."""
    columns = ("quantity", "ours", "theirs", "difference", "tolerance", "verdict")
    return table_of(items, columns, ("quantity", "computed", "expected", *columns[3:]))


def run_sections(program: Program) -> dict[str, tuple[list[Row], list[str]]]:
    """Return the checks of every section and the commands that they took."""
    done = {}
    for name, functions in SECTIONS.items():
        program.commands.clear()
        items = [item for function in functions for item in function(program)]
        done[name] = items, list(dict.fromkeys(program.commands))
        print(
            f"published: {name}: {sum(not item.differs for item in items)} of {len(items)} agree", flush=True
        )
    return done


def run_tests(build: Path) -> list[list[str]]:
    """Return what the named tests show, test, result."""
    outcomes = {}
    for suite in {suite for _, suite, _ in TESTS}:
        path = build / "bin" / "tests" / suite
        if not path.is_file():
            sys.exit(f"published: {path} has not been built")
        output = subprocess.run([path], capture_output=True, text=True, cwd=build).stdout
        for line in output.splitlines():
            word, _, name = line.partition(" ")
            outcomes[suite, name.strip()] = word
    return [
        [what, f"`{suite}`, `{name}`", "passed" if outcomes.get((suite, name)) == "ok" else "NOT passed"]
        for what, suite, name in TESTS
    ]


def commands_of(commands: list[str]) -> str:
    """Return the first commands of a section behind a fold; the others differ in numbers and laws."""
    lines = "\n".join(commands[:MOST_COMMANDS])
    more = len(commands) - MOST_COMMANDS
    tail = f"\n\nThe other {more} runs use the remaining laws and numbers of the table." if more > 0 else ""
    return f"<details><summary>{len(commands)} runs</summary>\n\n```sh\n{lines}\n```{tail}\n\n</details>"


def draw(program: Program, folder: Path) -> None:
    """Write the figures of the page into docs/figures/."""
    shown = SOURCE / "docs" / "figures"
    kinds = ["--formats", "png", "--dpi", "200", "-o", str(folder)]
    files = [program.command("trajectory", case) for case in DRAWN]
    files.append(program.command("sweep", "sweep_pair_kappa"))
    soft = [program.command("trajectory", case) for case in BESIDE]
    if cli.main([*map(str, files), *kinds]) or cli.main([*map(str, soft), "--beside", *kinds]):
        sys.exit("published: no figures")
    page = (SOURCE / "scripts/evidence/published_pair.md.in").read_text()
    for name in re.findall(r"\(figures/(.*?)\)", page):
        shutil.copy(folder / name, shown / name)


def main() -> int:
    """Run everything; return the exit code: 1 if a bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--build", type=Path, default=SOURCE / "build", help="build folder [build]")
    build = parser.parse_args().build.resolve()
    path = build / "bin" / "separatrix"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = Program(path, folder)
        sections = run_sections(program)
        tests = run_tests(build)
        draw(program, folder)
    fields = version_of(path)
    for name, (items, commands) in sections.items():
        fields[name] = rows_of(items)
        fields[f"{name}_runs"] = commands_of(commands)
    fields["tests"] = table(["property", "test", ""], tests)
    missed = [item.what for items, _ in sections.values() for item in items if item.differs]
    missed += [line[1] for line in tests if line[-1] != "passed"]
    fields["count"] = sum(len(items) for items, _ in sections.values())
    fields["missed"] = "\n".join(f"* {name}" for name in missed) or "None."
    (SOURCE / "docs" / "published_pair.md").write_text(page("published_pair", **fields))
    print("published: wrote docs/published_pair.md and its figures", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
