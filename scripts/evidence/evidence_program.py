# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the program on cases of examples/validation/, and what their files contain."""

import subprocess
from pathlib import Path

import h5py
import numpy as np
from evidence_rows import SOURCE
from separatrix import open_result
from separatrix.open import decode_flags


class Program:
    """Runs of the program; files go to a folder. Settings are 'key=value', or names with `__` for dots."""

    cases = SOURCE / "examples" / "validation" / "structures"

    def __init__(self, build: Path, folder: Path) -> None:
        self.path, self.folder = build / "bin" / "separatrix", folder
        folder.mkdir(parents=True, exist_ok=True)

    def run(
        self, command: str, case: Path | str, *settings: str, options: tuple = (), **changes: str | float
    ) -> Path:
        """Run a command on a case; return its file."""
        case = case if isinstance(case, Path) else self.cases / f"{case}.toml"
        output = self.folder / f"{case.stem}_{command}.h5"
        settings += tuple(f"{key.replace('__', '.')}={value}" for key, value in changes.items())
        words = [*map(str, options), *(word for item in settings for word in ("--set", item))]
        subprocess.run([self.path, command, case, "-q", "--force", "-o", output, *words], check=True)
        return output

    def branches(
        self,
        case: str,
        name: str,
        ends: tuple[float, float],
        *settings: str,
        searches: int = 0,
        **changes: float,
    ) -> dict[str, np.ndarray]:
        """Label, parameter, period and impacts of every point of the branches over a parameter."""
        options = ("--parameter", name, "--from", repr(ends[0]), "--to", repr(ends[1]))
        options += ("--searches", searches) if searches else ()
        with open_result(self.run("branches", case, *settings, options=options, **changes)) as result:
            columns = {key: result[key].values for key in ("parameter", "period", "impacts")}
            return {"label": decode_flags(result["label"]).values, **columns}

    def labels(self, case: str, name: str, low: float, high: float) -> dict[str, float]:
        """Values of a parameter at the labels of the branches over it, the last of each name."""
        found = self.branches(case, name, (low, high))
        return dict(zip(found["label"], found["parameter"], strict=True))

    def events(self, case: Path | str, kind: str, joint: str, **changes: str | float) -> np.ndarray:
        """Time, coordinate, rate before and after of the events of a kind at a joint, a row each."""
        with open_result(self.run("trajectory", case, **changes)) as result:
            wanted = decode_flags(result["event_kind"]).values == kind
            wanted &= decode_flags(result["event_joint"]).values == joint
            names = ("event_time", "event_joint_x", "event_joint_v_before", "event_joint_v_after")
            return np.column_stack([result[name].values[wanted] for name in names])

    def multipliers(self, case: str, **changes: str | float) -> np.ndarray:
        """Multipliers of the impacting cycle in the catalogue of a map, the largest first."""
        with h5py.File(self.run("basin", case, **changes)) as file:
            catalogue = file["catalogue"]
            entry = int(np.argmax(catalogue["impacts_per_period"][:]))
            found = catalogue["multiplier_real"][entry] + 1j * catalogue["multiplier_imaginary"][entry]
        return np.sort_complex(found[np.isfinite(found)])
