# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The peers with drivers in C: built as shared libraries, called through ctypes."""

import ctypes
import subprocess
from pathlib import Path

import numpy as np

from machine import Machine, Outcomes

FOLDER = Path(__file__).resolve().parent
COMPILER = "cc"
FLAGS = ("-O3", "-march=native", "-std=c11", "-D_GNU_SOURCE", "-fPIC", "-shared")
LIBRARIES = {
    "cvode": ("-lsundials_cvode", "-lsundials_nvecserial", "-lsundials_sunnonlinsolfixedpoint"),
    "gsl": ("-lgsl", "-lgslcblas"),
}
COLUMNS = 6


def build(peer: str, folder: Path) -> Path:
    """Compile the driver of a peer and return the library; the compiler's messages go to stderr."""
    folder.mkdir(parents=True, exist_ok=True)
    library = folder / f"libbench_{peer}.so"
    sources = [FOLDER / f"{peer}_driver.c", FOLDER / "machine.c"]
    subprocess.run([COMPILER, *FLAGS, "-o", library, *sources, *LIBRARIES[peer], "-lm"], check=True)
    return library


class Compiled:
    """A driver in C."""

    def __init__(self, library: Path, machine: Machine, tolerance: float) -> None:
        self.machine, self.tolerance = machine, tolerance
        self.entry = ctypes.CDLL(str(library)).run_trajectories
        self.entry.restype = ctypes.c_long
        self.entry.argtypes = [
            ctypes.POINTER(Machine),
            ctypes.c_double,
            ctypes.c_long,
            np.ctypeslib.ndpointer(np.float64, ndim=2, flags="C"),
            np.ctypeslib.ndpointer(np.float64, ndim=2, flags="C"),
        ]

    def run(self, starts: np.ndarray) -> Outcomes:
        """Run every start."""
        results = np.zeros((len(starts), COLUMNS))
        failed = self.entry(ctypes.byref(self.machine), self.tolerance, len(starts), starts, results)
        if failed:
            raise RuntimeError(f"trajectory {failed} failed")
        x, v, impacts, window_impacts, sticks, repaired = results.T
        return Outcomes(x, v, impacts.astype(int), window_impacts > 0, int(sticks.sum()), int(repaired.sum()))
