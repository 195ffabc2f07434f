# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of evidence, a number of ours beside one of others: tables in Markdown and lines of JSON."""

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).resolve().parents[2]
#: the columns of most tables
COLUMNS = ("quantity", "theirs", "ours", "difference", "tolerance", "verdict")
_SETTLED = 1e-9


@dataclass(frozen=True)
class Row:
    """A quantity of a source, theirs and ours: numbers, or as many of each.

    `bar`: the largest difference allowed, relative to theirs if `relative`, of the worst of several numbers.
    `closed`: a closed form that decides where theirs and ours differ. `digits` are shown. `how`: the method.
    """

    source: str
    what: str
    theirs: float | Sequence[float]
    ours: float | Sequence[float]
    bar: float
    relative: bool = False
    digits: int = 12
    how: str = ""
    closed: float | None = None

    @property
    def difference(self) -> float:
        """Ours less theirs; of several numbers, and of relative ones, the largest size."""
        theirs = np.asarray(self.theirs, float)
        apart = np.asarray(self.ours, float) - theirs
        if apart.ndim == 0 and not self.relative:
            return float(apart)
        return float(np.abs(apart / theirs if self.relative else apart).max())

    @property
    def verdict(self) -> str:
        """'agrees', 'DIFFERS', or that theirs is not the closed form."""
        if abs(self.difference) <= self.bar:
            return "agrees"
        if self.closed is not None and abs(self.ours - self.closed) <= _SETTLED:
            return f"theirs is off, closed form {self.closed:.9g}"
        return "DIFFERS"

    @property
    def differs(self) -> bool:
        """Whether ours is neither theirs nor settled by a closed form."""
        return self.verdict == "DIFFERS"

    def cells(self) -> dict[str, str]:
        """The row as text, by column."""
        theirs, ours = (
            ", ".join(f"{float(one):.{self.digits}g}" for one in np.atleast_1d(values))
            for values in (self.theirs, self.ours)
        )
        return {
            "source": self.source,
            "quantity": self.what,
            "theirs": theirs,
            "ours": ours,
            "difference": f"{self.difference:.1e}" if self.difference else "0",
            "tolerance": f"{self.bar:.2g}{' (relative)' if self.relative else ''}",
            "verdict": self.verdict if self.verdict == "agrees" else f"**{self.verdict}**",
        }

    def to_json(self) -> str:
        """The row as a line of JSON."""
        values = {name: np.asarray(getattr(self, name), float).tolist() for name in ("theirs", "ours")}
        about = {"source": self.source, "quantity": self.what, **values, "difference": self.difference}
        return json.dumps(
            {**about, "tolerance": self.bar, "relative": self.relative, "verdict": self.verdict}
        )


def table(header: Iterable[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of cells."""
    header = list(header)
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def table_of(
    rows: Iterable[Row], columns: Sequence[str] = COLUMNS, heads: Sequence[str] | None = None
) -> str:
    """A table of rows, the columns under other names where `heads` are given."""
    return table(heads or columns, [[row.cells()[name] for name in columns] for row in rows])


def sections(rows: Sequence[Row], write: Callable[[list[Row]], str] = table_of) -> str:
    """A table for each source under its name, in the order of the rows."""
    names = dict.fromkeys(row.source for row in rows)
    return "\n\n".join(
        f"### {name}\n\n{write([row for row in rows if row.source == name])}" for name in names
    )


def page(name: str, **fields: object) -> str:
    """The text of a page of docs/, from its template in this folder."""
    return (SOURCE / f"scripts/evidence/{name}.md.in").read_text().format(**fields)


def version_of(program: Path) -> dict[str, str]:
    """What the program prints as its version, by name; ends where it has not been built."""
    if not program.is_file():
        sys.exit(f"{Path(sys.argv[0]).stem}: {program} has not been built")
    lines = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    return dict(line.split(" ", 1) for line in lines.splitlines())


def processor() -> dict[str, str]:
    """What the system reports of the first processor: its model name, flags, ..."""
    lines = Path("/proc/cpuinfo").read_text().split("\n\n")[0].splitlines()
    found = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}
    return {"model name": "unknown processor", **found}


def arguments(description: str, out: str) -> argparse.ArgumentParser:
    """The options that the scripts share: --build, --out."""
    parser = argparse.ArgumentParser(description=description.split("\n")[0])
    parser.add_argument("--build", type=Path, default=SOURCE / "build", help="build folder [build]")
    parser.add_argument("--out", type=Path, default=SOURCE / "out" / out, help=f"files [out/{out}]")
    return parser


def show(rows: Sequence[Row], as_json: bool, columns: Sequence[str] = ("source", *COLUMNS)) -> int:
    """Print the rows, as a table or a line of JSON each; the exit code: 1 where one differs."""
    print("\n".join(row.to_json() for row in rows) if as_json else table_of(rows, columns))
    return 1 if any(row.differs for row in rows) else 0
