# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the rows of docs/validation.md are made of: numbers of ours, runs of the program, labels."""

from dataclasses import dataclass
from functools import cached_property

import evidence_program
import numpy as np
from evidence_rows import SOURCE, Row
from separatrix import open_result, table
from separatrix.library import Model
from validation_numbers import THEIRS

CASES = SOURCE / "examples" / "validation"


def row(key: str, ours: float, how: str) -> Row:
    """A number of ours by its key in THEIRS, and how it was computed."""
    source, what, theirs, bar = THEIRS[key]
    return Row(source, what, theirs, float(ours), bar, how=how)


@dataclass(frozen=True)
class Labels:
    """Labels of the points of branches, with their parameter and the impacts of their orbits."""

    names: np.ndarray
    values: np.ndarray
    impacts: np.ndarray

    def at(self, *names: str, impacts: int | None = None) -> np.ndarray:
        """Where one of some labels stands, ascending; on orbits with so many impacts."""
        chosen = np.isin(self.names, names)
        if impacts is not None:
            chosen &= self.impacts == impacts
        return np.unique(self.values[chosen])


class Program(evidence_program.Program):
    """Runs of the program on the cases of examples/validation/, and their models in the library."""

    cases = CASES

    def labels(self, case: str, name: str, ends: tuple[float, float], *settings: str) -> Labels:
        """Follow the orbits of one drive period over a parameter; return the labels and where they stand."""
        found = self.branches(case, name, ends, *settings, searches=4)
        chosen = found["period"] == 1
        return Labels(*(found[key][chosen] for key in ("label", "parameter", "impacts")))

    def catalogue(self, case: str, *settings: str) -> dict[str, np.ndarray]:
        """Run a map; return its catalogue by column."""
        with open_result(self.run("basin", case, *settings)) as result:
            entries = table(result, "catalogue")
            return {str(name): entries[name].values for name in entries.data_vars}

    @cached_property
    def models(self) -> dict[str, Model]:
        """All cases as functions."""
        return {path.stem: Model.read(path) for path in sorted(CASES.glob("*.toml"))}
