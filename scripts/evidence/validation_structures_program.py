# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the program on the cases of several bodies, and numbers of others beside ours."""

import subprocess
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

SOURCE = Path(__file__).resolve().parents[2]
CASES = SOURCE / "examples" / "validation" / "structures"


@dataclass(frozen=True)
class Number:
    """A number of theirs beside ours; `bar` is half a unit of their last digit, or 1e-9."""

    source: str
    what: str
    theirs: float
    ours: float
    bar: float

    @property
    def verdict(self) -> str:
        """Whether the difference is within the bar."""
        return "agrees" if abs(self.ours - self.theirs) <= self.bar else "DIFFERS"


def text(value: str | bytes) -> str:
    """An attribute as text."""
    return value.decode() if isinstance(value, bytes) else value


class Program:
    """Runs of the program; files go to a folder."""

    def __init__(self, build: Path, folder: Path) -> None:
        self.path, self.folder = build / "bin" / "separatrix", folder
        folder.mkdir(parents=True, exist_ok=True)

    def run(self, command: str, case: Path | str, **settings: str | float) -> Path:
        """Run a command on a case; return its file. Settings have `__` for dots."""
        case = case if isinstance(case, Path) else CASES / f"{case}.toml"
        output = self.folder / f"{case.stem}_{command}.h5"
        changes = [
            word for key, value in settings.items() for word in ("--set", f"{key.replace('__', '.')}={value}")
        ]
        subprocess.run([self.path, command, case, "-q", "--force", "-o", output, *changes], check=True)
        return output

    def events(self, case: Path | str, kind: str, joint: str, **settings: str | float) -> np.ndarray:
        """Time, coordinate, rate before and after of the events of a kind at a joint, a row each."""
        with h5py.File(self.run("trajectory", case, **settings)) as file:
            kinds = text(file["event_kind"].attrs["flag_meanings"]).split()
            joints = text(file["event_joint"].attrs["flag_meanings"]).split()
            wanted = (file["event_kind"][:] == file["event_kind"].attrs["flag_values"][kinds.index(kind)]) & (
                file["event_joint"][:] == joints.index(joint) + 1
            )
            names = ("event_time", "event_joint_x", "event_joint_v_before", "event_joint_v_after")
            return np.column_stack([file[name][:][wanted] for name in names])

    def labels(self, case: str, name: str, low: float, high: float) -> dict[str, float]:
        """Values of a parameter at the labels of the branches over it, the last of each name."""
        output = self.folder / f"{case}_branches.h5"
        words = ["--parameter", name, "--from", str(low), "--to", str(high), "-q", "--force", "-o", output]
        subprocess.run([self.path, "branches", CASES / f"{case}.toml", *words], check=True)
        with h5py.File(output) as file:
            names = text(file["label"].attrs["flag_meanings"]).split()
            return dict(zip((names[k] for k in file["label"][:]), file["parameter"][:], strict=True))

    def branch_points(self, case: str, name: str, low: float, high: float, **settings: float) -> list[tuple]:
        """Label, parameter, period and impacts of every point of the branches over a parameter."""
        output = self.folder / f"{case}_branches.h5"
        words = ["--parameter", name, "--from", str(low), "--to", str(high), "-q", "--force", "-o", output]
        words += [
            word for key, value in settings.items() for word in ("--set", f"{key.replace('__', '.')}={value}")
        ]
        subprocess.run([self.path, "branches", CASES / f"{case}.toml", *words], check=True)
        with h5py.File(output) as file:
            names = text(file["label"].attrs["flag_meanings"]).split()
            columns = (file[name][:] for name in ("parameter", "period", "impacts"))
            return list(zip((names[k] for k in file["label"][:]), *columns, strict=True))

    def multipliers(self, case: str, **settings: str | float) -> np.ndarray:
        """Multipliers of the impacting cycle in the catalogue of a map, the largest first."""
        with h5py.File(self.run("basin", case, **settings)) as file:
            entry = int(np.argmax(file["catalogue/impacts_per_period"][:]))
            found = (
                file["catalogue/multiplier_real"][entry] + 1j * file["catalogue/multiplier_imaginary"][entry]
            )
        return np.sort_complex(found[np.isfinite(found)])
