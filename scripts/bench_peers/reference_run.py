# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quadruple-precision reference: libseparatrix_reference.so through ctypes."""

import ctypes
import json
import subprocess
from pathlib import Path

import numpy as np
from published_case import Outcomes, read_case

REFERENCE_TOLERANCE = 1e-20
DOMAIN = 1e6
EVENT_BUDGET = 1_000_000
TIME_OVER = 2
IMPACT_REGIMES = (2, 4, 5)
FAMILIES = ("body", "restoring", "friction", "contact", "drive")


class Reference:
    """Runs starts for the whole duration, without a catalogue."""

    def __init__(self, library: Path, program: Path) -> None:
        self.entry = ctypes.CDLL(str(library)).separatrix_reference_run
        table = subprocess.run([program, "laws", "--json"], capture_output=True, text=True, check=True).stdout
        self.set_laws(json.loads(table), read_case())

    def set_laws(self, table: list[dict], case: dict) -> None:
        """The laws of the case as rows of the program's table, and their parameters one after the other."""
        rows, lengths, values = [], [], []
        for family in FAMILIES:
            chosen = case[family].get("law", "point_mass")
            law = next(law for law in table if (law["family"], law["law"]) == (family, chosen))
            rows.append(law["row"])
            for parameter in law["parameters"]:
                value = self.value_of(case[family], parameter)
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
        return [parameter["default"]]

    def run(self, starts: np.ndarray) -> Outcomes:
        """Run every start (x0, v0) at crank angle 0."""
        given = np.ascontiguousarray(np.c_[starts, np.zeros(len(starts))])
        results = np.zeros((len(starts), 6))
        pointer = ctypes.POINTER(ctypes.c_double)
        failed = self.entry(
            ctypes.c_int(len(self.rows)),
            self.rows,
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
