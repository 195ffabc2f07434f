# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the discovery decides: its stages, gates and thresholds, from the tables of the package."""

from pathlib import Path

from evidence.evidence_rows import table
from separatrix.discovery.decision.gates import DROP, GATES, GATES_OF_REST
from separatrix.discovery.decision.plan import PLAN
from separatrix.discovery.options import Options
from separatrix.discovery.policy import FIT, RECORDS, SEARCH
from separatrix.discovery.policy.row import SOURCES, rows_of

GUIDE = "discovery-guide.md"
BEGIN, END = "<!-- gates, made by scripts/docs -->\n", "<!-- end of gates -->\n"
PARTS = {
    "Gates of a name": (Options(), "`Options` has them, so that a script may choose others."),
    "Search": (SEARCH, "What is fitted, compared, named and reported."),
    "Fits": (FIT, "Fits, tables, functions, noise and instrument imperfections."),
    "Records": (RECORDS, "What is refused, reported, cut and condensed."),
}


def page() -> str:
    """The page of stages and thresholds."""
    lines = [
        "# Stages and thresholds of the discovery\n",
        "[Find the missing physics](../discovery-guide.md) explains the method.\n",
        "## Stages\n",
        "The search walks along this list (`decision/plan.py`). Two stages send it back to the first one.\n",
        table(["stage", "runs where"], [[one.name, one.reason] for one in PLAN]),
        "## Gates\n",
        gates(),
        "## Thresholds\n",
        "The source of a threshold is one of these:\n",
        table(["source", "meaning"], [[name, text] for name, text in SOURCES.items()]),
    ]
    for name, (policy, text) in PARTS.items():
        rows = [[f"`{one}`", number(value), *rest] for one, value, *rest in rows_of(policy)]
        lines += [f"### {name}\n", f"{text}\n", table(["name", "value", "unit", "meaning", "source"], rows)]
    return "\n\n".join(one.rstrip("\n") for one in lines) + "\n"


def number(value: object) -> str:
    """A value as text; those of a tuple one after the other."""
    return ", ".join(f"{one:g}" for one in (value if isinstance(value, tuple) else (value,)))


def gates() -> str:
    """The gates as a table."""
    rows = [*((one.name, one.sentence) for one in (*GATES, *GATES_OF_REST)), DROP]
    return table(["gate", "passed if"], [list(one) for one in rows])


def with_gates(text: str) -> str:
    """A document with its table of gates made anew."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{gates()}\n\n{END}{rest.split(END)[1]}"


def write(docs: Path, made: str) -> None:
    """Write the page into `docs/reference`, after the line `made`, and the gates into the guide."""
    (docs / "reference" / "discovery.md").write_text(made + page())
    guide = docs / GUIDE
    guide.write_text(with_gates(guide.read_text()))
