# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A map computed in this process by the library, in threads: the values of the program to the bit."""

import itertools
import math
from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait

import numpy as np
import xarray as xr

from separatrix.cases import Case
from separatrix.errors import BAD_DATA, CaseError, GivenUpError, Interrupted
from separatrix.given_up import all_given_up
from separatrix.progress import Progress, Report
from separatrix.simulate import LABEL_VARIABLES, Attractor, Catalogue, StopFlag, StoppedError, search_slices
from separatrix.variables import CATALOGUE, CYCLES, FORMAT_VERSION, KINDS, MAP, STARTS, attributes
from separatrix.version import __version__

# Starts of one call: enough for the lanes, few enough to be stopped soon.
_PIECE = 1024


def can_label(case: Case) -> bool:
    """Whether the library does it: one body on a line, no motor, all points, starts, nothing derived."""
    resolved = case.resolved
    starts = any(axis["name"] in STARTS for axis in resolved.get("axis", []))
    # a machine of several bodies has no restoring law
    line = resolved.get("restoring", {}).get("law", "pendulum") != "pendulum"
    more = any(name in resolved for name in ("refine", "derived", "motor"))
    return starts and line and not (more or "driven_mass" in resolved["body"])


class SecondLookError(Exception):
    """Points ended without an attractor: the program searches again from them."""


class Labelling:
    """A map under way: its axes, its catalogues, and the points that are done."""

    def __init__(self, case: Case, threads: int, asked: bool | Report | None) -> None:
        """Lay out the grid."""
        self.case, self.threads, self.asked = case, threads, asked
        self.axes = {str(axis["name"]): axis_values(axis) for axis in case.resolved.get("axis", [])}
        if len(self.axes) < 2:
            raise CaseError(f"{case.name}: found {len(self.axes)} axes, allowed two or more", BAD_DATA)
        self.parameters = [name for name in self.axes if name not in STARTS]
        self.shape = tuple(len(self.axes[name]) for name in self.parameters)
        self.starts = self._starts()
        self.looks_twice = case.resolved["attractors"].get("second_look", 0) > 0
        self.catalogues: list[Catalogue] = []
        count = math.prod(self.shape)
        self.values = {
            name: np.zeros((count, len(self.starts)), kind) for name, kind in LABEL_VARIABLES.items()
        }
        pieces = range(0, len(self.starts), _PIECE)
        self.left = [(number, first) for number in range(count) for first in pieces]
        self.done = 0

    def __call__(self) -> xr.Dataset:
        """Compute what is left; Interrupted can go on. GivenUpError where every motion was given up."""
        stop = StopFlag()
        with Progress(self.asked) as report:
            try:
                self._search(stop)
                self._label(stop, report)
            except (KeyboardInterrupt, StoppedError):
                stop.set()
                done = self.done / max(1, self._total())
                raise Interrupted(f"stopped at {100 * done:.0f} %; resume() goes on", done, self) from None
        result = self._dataset()
        if points := all_given_up(result):
            raise GivenUpError(
                f"the motions of all {points} points were given up: nothing is known of their ends", result
            )
        return result

    def _total(self) -> int:
        return len(self.starts) * math.prod(self.shape)

    def _starts(self) -> np.ndarray:
        """The starts of a slice, the last axis fastest: x [m], v [m/s], crank angle [rad]."""
        fixed = self.case.resolved["start"]
        names = [name for name in self.axes if name not in self.parameters]
        grid = np.meshgrid(*(self.axes[name] for name in names), indexing="ij")
        columns = dict(zip(names, (part.ravel() for part in grid), strict=True))
        number = max(1, math.prod(len(self.axes[name]) for name in names))
        kept = [
            columns.get(name, np.full(number, float(fixed[name]))) for name in ("x0", "v0", "crank_angle")
        ]
        return np.column_stack(kept)

    def _slices(self) -> list[Mapping[str, float]]:
        values = itertools.product(*(self.axes[name] for name in self.parameters))
        return [dict(zip(self.parameters, row, strict=True)) for row in values]

    def _search(self, stop: StopFlag) -> None:
        if self.catalogues:
            return
        slices = self._slices()
        with ThreadPoolExecutor(1) as helper:
            # A wait can be interrupted, a call of the library cannot.
            future = helper.submit(search_slices, self.case.model, slices, self.shape or (1,), stop)
            try:
                while not future.done():
                    wait([future], timeout=0.2)
            except KeyboardInterrupt:
                stop.set()
                raise
            self.catalogues = future.result()

    def _label(self, stop: StopFlag, report: Progress) -> None:
        pieces = list(self.left)
        with ThreadPoolExecutor(self.threads) as helpers:
            futures = {helpers.submit(self._piece, *piece, stop): piece for piece in pieces}
            try:
                waiting = set(futures)
                while waiting:
                    finished, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
                    for future in finished:
                        self.done += future.result()
                        self.left.remove(futures[future])
                    report("points", self.done, self._total())
            except BaseException:
                stop.set()
                helpers.shutdown(wait=True, cancel_futures=True)
                raise

    def _piece(self, number: int, first: int, stop: StopFlag) -> int:
        last = min(first + _PIECE, len(self.starts))
        found = self.catalogues[number].labels(self.starts[first:last], stop)
        for name, values in found.items():
            self.values[name][number, first:last] = values
        if self.looks_twice and not found["attractor"].all():
            raise SecondLookError
        return last - first

    def _dataset(self) -> xr.Dataset:
        dims = [name.replace(".", "_") for name in self.axes]
        # Parameters may stand between the starts: the slices are in their order, the starts in theirs.
        order = [*self.parameters, *(name for name in self.axes if name not in self.parameters)]
        shape = [len(self.axes[name]) for name in order]
        back = [order.index(name) for name in self.axes]
        data = {
            name: (dims, np.transpose(values.reshape(shape), back), attributes(MAP[name][1:]))
            for name, values in self.values.items()
        }
        coordinates = {
            dim: (dim, values, self._axis_attributes(name))
            for (name, values), dim in zip(self.axes.items(), dims, strict=True)
        }
        resolved = self.case.to_toml()
        about = {
            "format": "separatrix", "format_version": FORMAT_VERSION, "kind": "basin", "complete": 1,
            "title": self.case.title, "source": f"Separatrix {__version__}", "resolved_case": resolved,
        }  # fmt: skip
        return xr.Dataset({**data, **self._catalogue()}, coordinates, about)

    def _axis_attributes(self, name: str) -> dict[str, object]:
        if name in STARTS:
            return attributes(STARTS[name])
        unit = self.case.parameters[name].unit
        return {"units": unit or "1", "long_name": name.replace(".", " ").replace("_", " ")}

    def _catalogue(self) -> dict[str, tuple]:
        rows, found = [], []
        for number, catalogue in enumerate(self.catalogues):
            labels, counts = np.unique(self.values["attractor"][number], return_counts=True)
            captured = dict(zip(labels.tolist(), counts.tolist(), strict=True))
            for one in catalogue.attractors:
                count = captured.get(int(one.numbers["attractor"]), 0)
                rows.append({**one.numbers, "slice": number, "count": count})
                found.append(one)
        table = {
            f"catalogue_{name}": (
                "entry",
                np.array([row[name] for row in rows], kind),
                attributes(described),
            )
            for name, (kind, *described) in CATALOGUE.items()
        }
        return table | _cycles(found)


def _cycles(found: list[Attractor]) -> dict[str, tuple]:
    """All multipliers and all section points of the cycles, as a file has them."""
    if not found:
        return {}
    cycle = KINDS.index("cycle") + 1
    cycles = [(row, one) for row, one in enumerate(found) if one.numbers["kind"] == cycle]
    multipliers = np.full((len(found), max(one.multipliers.size for one in found)), np.nan, complex)
    multipliers.imag = np.nan
    for row, one in cycles:
        multipliers[row, : one.multipliers.size] = one.multipliers
    data = {"multiplier_real": multipliers.real, "multiplier_imaginary": multipliers.imag}
    if cycles:
        data["point_entry"] = np.concatenate([np.full(len(one.points), row) for row, one in cycles])
        data["point_entry"] = data["point_entry"].astype(np.int32)
        data["point"] = np.concatenate([one.points for _, one in cycles])
    return {
        f"catalogue_{name}": (
            CYCLES[name][0],
            values,
            {"units": CYCLES[name][1], "long_name": CYCLES[name][2]},
        )
        for name, values in data.items()
    }


def axis_values(axis: Mapping[str, object]) -> np.ndarray:
    """Return the values of an axis, with the bits of the program."""
    if "values" in axis:
        return np.array(axis["values"], float)
    first, last, count = float(axis["from"]), float(axis["to"]), int(axis["count"])
    if count == 1:
        return np.array([last])
    values = first + (last - first) * (np.arange(count) / (count - 1))
    values[-1] = last
    return values
