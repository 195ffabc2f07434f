# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of cases of examples/, and rows of what they found beside what is expected."""

import os
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr
from evidence_rows import SOURCE, Row
from separatrix import decode_flags, open_result, table


def check(
    name: str,
    found: float | Sequence[float],
    expected: float | Sequence[float],
    bar: float,
    relative: bool = False,
    digits: int = 10,
) -> Row:
    """Return a row for one number, or for as many as expected; the difference is the largest one."""
    return Row("", name, np.atleast_1d(expected), np.atleast_1d(found), bar, relative, digits)


@dataclass
class Run:
    """A trajectory: attributes, history, and events by column."""

    data: xr.Dataset
    kinds: np.ndarray
    events: dict[str, np.ndarray] = field(default_factory=dict)

    def number(self, name: str) -> float:
        """An attribute."""
        return float(self.data.attrs[name])

    def of(self, column: str, *kinds: str) -> np.ndarray:
        """A column of the events of some kinds."""
        return self.events[column][np.isin(self.kinds, kinds)]

    def closing(self) -> float:
        """What is missing in the book of energy, relative to what was turned over."""
        names = ("energy_start", "energy_lost_to_friction", "energy_lost_to_damping", "energy_put_in")
        turned = sum(abs(self.number(name)) for name in (*names, "energy_lost_to_contacts"))
        return abs(self.number("energy_closing_error")) / turned


class Program:
    """Runs cases of examples/ and remembers the commands."""

    def __init__(self, program: Path, folder: Path) -> None:
        self.program, self.folder = program, folder
        self.commands: list[str] = []
        # a process of its own needs no network, and looking for one takes longer than these runs
        alone = {"ess_singleton_isolated": "1", "pml": "ob1", "btl": "self"}
        self.environment = os.environ | {f"OMPI_MCA_{name}": value for name, value in alone.items()}

    def command(self, command: str, case: str, *settings: str, extra: Sequence[object] = ()) -> Path:
        """Run a command of the program; return its result file."""
        path = self.folder / f"{case}.h5"
        words = [word for text in settings for word in ("--set", text)]
        case_file = f"examples/{case}.toml"
        # any other folder would do: the case is named by its path in the repository
        subprocess.run(
            [self.program, command, SOURCE / case_file, "-q", "--force", "-o", path, *words, *extra],
            check=True,
            env=self.environment,
        )
        shown = " ".join(f"--set '{text}'" for text in settings)
        self.commands.append(f"separatrix {command} {case_file} {shown}".rstrip())
        return path

    def refused(self, command: str, case: str, *settings: str) -> int:
        """Return the exit code of a case that must be refused, 0 if its message does not give the reason."""
        words = [word for text in settings for word in ("--set", text)]
        path = SOURCE / "examples" / f"{case}.toml"
        outcome = subprocess.run(
            [self.program, command, path, "--validate", *words],
            capture_output=True,
            text=True,
            env=self.environment,
        )
        key = settings[0].split("=")[0]
        return outcome.returncode if f"'{key}'" in outcome.stderr else 0

    def trajectory(self, case: str, *settings: str) -> Run:
        """Run one motion."""
        with open_result(self.command("trajectory", case, *settings)) as result:
            data = result.load()
        events = {str(name): data[name].values for name in data if str(name).startswith("event_")}
        return Run(data, decode_flags(data["event_kind"]).values.astype(str), events)

    def limits(self, case: str, *settings: str) -> dict[str, float]:
        """Run a sweep; return the middles of the brackets that it saw in steps."""
        with open_result(self.command("sweep", case, *settings)) as result:
            limits = table(result, "limits")
            middles = (limits["observed_lower"].values + limits["observed_upper"].values) / 2
            return {str(name): float(at) for name, at in zip(limits["name"].values, middles, strict=True)}

    def record(self, case: str, *settings: str) -> np.ndarray:
        """Run one motion with a sensor; return its record, a column each."""
        with tempfile.NamedTemporaryFile(suffix=".csv", dir=self.folder) as file:
            self.command("trajectory", case, *settings, extra=("--record", file.name))
            lines = [line for line in Path(file.name).read_text().splitlines() if not line.startswith("#")]
            return np.genfromtxt(lines, delimiter=",", names=True)


def restitution_of(run: Run) -> float:
    """Speed after a contact over that before."""
    return -run.of("event_v_after", "separation")[0] / run.of("event_v_before", "touch_upper")[0]
