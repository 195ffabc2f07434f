# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the rows of docs/validation.md are made of: numbers of ours, runs of the program, labels."""

import subprocess
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from separatrix import open_result, table
from separatrix.library import Model
from separatrix.open import decode_flags
from validation_numbers import THEIRS

SOURCE = Path(__file__).resolve().parents[2]
CASES = SOURCE / "examples" / "validation"


@dataclass(frozen=True)
class Row:
    """One number of ours, by its key in THEIRS, and how it was computed."""

    key: str
    ours: float
    how: str

    @property
    def difference(self) -> float:
        """Ours less theirs."""
        return self.ours - THEIRS[self.key][2]

    @property
    def verdict(self) -> str:
        """Whether the difference is within the bar."""
        return "agrees" if abs(self.difference) <= THEIRS[self.key][3] else "DIFFERS"


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


class Program:
    """Runs of the program on the cases of examples/validation/, and their models in the library."""

    def __init__(self, build: Path, folder: Path) -> None:
        self.path, self.folder = build / "bin" / "separatrix", folder
        folder.mkdir(parents=True, exist_ok=True)

    def run(self, command: str, case: str, *settings: str) -> Path:
        """Run a command on a case; return its file."""
        output = self.folder / f"{case}_{command}.h5"
        words = [self.path, command, CASES / f"{case}.toml", "-q", "--force", "-o", output]
        subprocess.run([*words, *(word for item in settings for word in ("--set", item))], check=True)
        return output

    def labels(self, case: str, parameter: str, ends: tuple[float, float], *settings: str) -> "Labels":
        """Follow the orbits of one drive period over a parameter; return the labels and where they stand."""
        output = self.folder / f"{case}_branches.h5"
        words = [self.path, "branches", CASES / f"{case}.toml", "-q", "--force", "-o", output]
        words += ["--parameter", parameter, "--from", repr(ends[0]), "--to", repr(ends[1]), "--searches", "4"]
        subprocess.run([*words, *(word for item in settings for word in ("--set", item))], check=True)
        with open_result(output) as result:
            chosen = result["period"].values == 1
            names = decode_flags(result["label"]).values[chosen]
            return Labels(names, result["parameter"].values[chosen], result["impacts"].values[chosen])

    def catalogue(self, case: str, *settings: str) -> dict[str, np.ndarray]:
        """Run a map; return its catalogue by column."""
        with open_result(self.run("basin", case, *settings)) as result:
            entries = table(result, "catalogue")
            return {str(name): entries[name].values for name in entries.data_vars}

    @cached_property
    def models(self) -> dict[str, Model]:
        """All cases as functions."""
        return {path.stem: Model.read(path) for path in sorted(CASES.glob("*.toml"))}
