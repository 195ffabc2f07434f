# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quadruple-precision reference: libseparatrix_reference.so through ctypes."""

import ctypes
import json
import multiprocessing
import os
import subprocess
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from machine import CASE, Outcomes, read_case

REFERENCE_TOLERANCE = 1e-20
DOMAIN = 1e6
EVENT_BUDGET = 1_000_000
TIME_OVER = 2
IMPACT_REGIMES = (2, 4, 5)
SHARE = 200
FAMILIES = ("body", "restoring", "friction", "contact", "drive")


class Reference:
    """Runs starts for the whole duration, without a catalogue."""

    def __init__(self, library: Path, program: Path, path: Path = CASE) -> None:
        self.entry = ctypes.CDLL(str(library)).separatrix_reference_run
        table = subprocess.run([program, "laws", "--json"], capture_output=True, text=True, check=True).stdout
        self.set_laws(json.loads(table), read_case(path))

    def set_laws(self, table: list[dict], case: dict) -> None:
        """The laws of the case as rows of the program's table, and their parameters one after the other."""
        chosen = [(family, case[family].get("law", "point_mass"), case[family]) for family in FAMILIES]
        chosen += [("effect", name, given) for name, given in case.get("effect", {}).items()]
        rows, lengths, values = [], [], []
        for family, name, given in chosen:
            law = next(law for law in table if (law["family"], law["law"]) == (family, name))
            rows.append(law["row"])
            for parameter in law["parameters"]:
                value = self.value_of(given, parameter)
                lengths.append(len(value))
                values += value
        self.rows = (ctypes.c_int * len(rows))(*rows)
        self.lengths = (ctypes.c_int * len(lengths))(*lengths)
        self.values = (ctypes.c_double * len(values))(*values)
        self.numbers = (ctypes.c_double * 6)(
            REFERENCE_TOLERANCE, DOMAIN, case["run"]["duration"], case["run"]["window"], 1.0, 0.0
        )

    @staticmethod
    def value_of(table: dict, parameter: dict) -> list[float]:
        """The value that the case gives, or its default."""
        name = parameter["name"]
        if name in table:
            return list(table[name]) if parameter["list"] else [table[name]]
        if name == "static_coefficient":
            return [table["kinetic_coefficient"]]
        if name == "lower":
            return [-np.finfo(float).max]
        # What may be left out altogether has no default: the largest number stands for it.
        return [np.finfo(float).max if parameter["default"] is None else parameter["default"]]

    def run(self, starts: np.ndarray) -> Outcomes:
        """Run every start (x0, v0) at crank angle 0."""
        given = np.ascontiguousarray(np.c_[starts, np.zeros(len(starts))])
        results = np.zeros((len(starts), 6))
        pointer = ctypes.POINTER(ctypes.c_double)
        failed = self.entry(
            ctypes.c_int(len(self.rows)),
            self.rows,
            # no law of these cases has a label or an expression: one end of a law for each
            ctypes.c_char_p(b"\x02" * len(self.rows)),
            self.lengths,
            self.values,
            ctypes.c_int(0),
            ctypes.c_int64(EVENT_BUDGET),
            self.numbers,
            ctypes.c_int(0),
            self.numbers,
            ctypes.c_int(len(starts)),
            given.ctypes.data_as(pointer),
            results.ctypes.data_as(pointer),
        )
        reason, _, regime, x, v, impacts = results.T
        if failed or np.any(reason != TIME_OVER):
            raise RuntimeError("the reference did not run to the end of the duration")
        return Outcomes(x, v, impacts.astype(int), np.isin(regime, IMPACT_REGIMES))


def run_share(share: tuple[Path, Path, Path, np.ndarray]) -> Outcomes:
    """Run some of the starts in a process of their own."""
    library, program, path, starts = share
    return Reference(library, program, path).run(starts)


def run_on_all_cores(
    library: Path, program: Path, starts: np.ndarray, path: Path = CASE, share: int | None = None
) -> Outcomes:
    """Run every start (x0, v0), on as many cores as this process may use."""
    share = share or SHARE
    shares = [(library, program, path, starts[i : i + share]) for i in range(0, len(starts), share)]
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=spawn) as pool:
        parts = list(pool.map(run_share, shares))
    names = ("x", "v", "impacts", "label")
    return Outcomes(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
