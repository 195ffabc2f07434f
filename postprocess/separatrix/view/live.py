# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels of points between and beyond those of a map, computed now; a newer view ends work for an older."""

import threading
from collections.abc import Mapping

import numpy as np

from separatrix.errors import USAGE, SeparatrixError
from separatrix.simulate import LABEL_VARIABLES, StopFlag, StoppedError
from separatrix.view.files import ResultFile
from separatrix.view.machine import Machine

__all__ = ["Lattice", "Views", "compute", "possible"]


class Lattice:
    """Points `first + i step` (i = 0 ... count - 1) across and up, in index units of the axes of a plane."""

    def __init__(self, across: tuple[float, float, int], up: tuple[float, float, int], skip: bool) -> None:
        """Take both directions; `skip` leaves out the points that are even in both."""
        self.across, self.up, self.skip = across, up, skip

    def indices(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the index coordinates of all points, row by row."""
        (a, da, na), (b, db, nb) = self.across, self.up
        columns, rows = np.meshgrid(np.arange(na), np.arange(nb))
        columns, rows = columns.ravel(), rows.ravel()
        if self.skip:
            kept = (columns % 2 == 1) | (rows % 2 == 1)
            columns, rows = columns[kept], rows[kept]
        return a + da * columns, b + db * rows


class Views:
    """Which view a page looks at: pages have ids, views numbers that grow; a newer one stops the older."""

    def __init__(self) -> None:
        """No page yet."""
        self._lock = threading.Lock()
        self._latest: dict[int, int] = {}
        self._flags: dict[tuple[int, int], list[StopFlag]] = {}

    def enter(self, page: int, view: int) -> StopFlag:
        """Return the flag of work for a view. StoppedError if the page looks elsewhere by now."""
        flag = StopFlag()
        with self._lock:
            if view < self._latest.get(page, 0):
                raise StoppedError("stopped: the page looks elsewhere", 75)
            if view > self._latest.get(page, 0):
                self._stop_before(page, view)
                if len(self._latest) > 1000:
                    self._latest.clear()
                self._latest[page] = view
            self._flags.setdefault((page, view), []).append(flag)
        return flag

    def leave(self, page: int, view: int, flag: StopFlag) -> None:
        """The work is over."""
        with self._lock:
            flags = self._flags.get((page, view), [])
            if flag in flags:
                flags.remove(flag)
            if not flags:
                self._flags.pop((page, view), None)

    def stop(self, page: int, view: int) -> None:
        """End all work of a page for views up to this one."""
        with self._lock:
            self._stop_before(page, view + 1)
            self._latest[page] = max(view + 1, self._latest.get(page, 0))

    def stop_all(self) -> None:
        """End all work."""
        with self._lock:
            for flags in self._flags.values():
                for flag in flags:
                    flag.set()

    def _stop_before(self, page: int, view: int) -> None:
        for (other, older), flags in self._flags.items():
            if other == page and older < view:
                for flag in flags:
                    flag.set()


def possible(source: ResultFile, across: int, up: int) -> str:
    """Return why points of a plane cannot be computed now, empty if they can."""
    starts = [axis["start"] for axis in source.axes]
    if starts[across] and starts[up]:
        return ""
    if not any(starts):
        return ""
    return "points are computed live where both axes of the picture are starts, or no axis of the map is"


def coordinates(axis: dict, index: np.ndarray) -> np.ndarray:
    """Return values of an axis at index coordinates: those of the file where they are whole, lines beyond."""
    values = axis["array"]
    if len(values) < 2:
        return np.full(index.shape, values[0])
    if axis["uniform"]:
        found = values[0] + index * ((values[-1] - values[0]) / (len(values) - 1))
    else:
        below = np.clip(np.floor(index).astype(int), 0, len(values) - 2)
        found = values[below] + (index - below) * (values[below + 1] - values[below])
    whole = (index == np.rint(index)) & (index >= 0) & (index <= len(values) - 1)
    found[whole] = values[index[whole].astype(int)]
    return found


def compute(
    machine: Machine,
    across: int,
    up: int,
    at: tuple[int, ...],
    lattice: Lattice,
    other: Mapping[str, float],
    flag: StopFlag,
) -> dict[str, np.ndarray]:
    """Return the variables of a map at the points of a lattice in a plane, parameters `other` being set."""
    source = machine.source
    problem = possible(source, across, up)
    if problem:
        raise SeparatrixError(problem, USAGE)
    index = lattice.indices()
    values = {
        axis: coordinates(source.axes[axis], one) for axis, one in zip((across, up), index, strict=True)
    }
    fixed = {i: float(axis["array"][at[i]]) for i, axis in enumerate(source.axes) if i not in values}
    given = source.case.get("start", {})
    starts = np.zeros((len(index[0]), 3))
    for column, name in enumerate(("x0", "v0", "crank_angle")):
        starts[:, column] = given.get(name, 0.0)
        for i, axis in enumerate(source.axes):
            if axis["path"] == name:
                starts[:, column] = values.get(i, fixed.get(i))
    if not len(starts):
        return {name: np.empty(0, kind) for name, kind in LABEL_VARIABLES.items()}
    if source.axes[across]["start"]:
        parameters = source.parameters_at(at) | dict(other)
        catalogue, labels = machine.catalogue(parameters, None if other else source.slice_number(at), flag)
        found = catalogue.labels(starts, flag)
        found["attractor"] = labels[_positions(catalogue, found["attractor"])]
        return found
    paths = {i: source.axes[i]["path"] for i in range(len(source.axes))}
    fixed_values = {paths[i]: value for i, value in fixed.items()} | dict(other)
    points = [
        fixed_values | {paths[across]: a, paths[up]: b}
        for a, b in zip(values[across].tolist(), values[up].tolist(), strict=True)
    ]
    return machine.single_labels(tuple(starts[0]), points, flag)


def _positions(catalogue: object, found: np.ndarray) -> np.ndarray:
    """Return labels of the catalogue as positions in the list of labels of the file (0: none)."""
    numbers = np.array([0, *(one.numbers["attractor"] for one in catalogue.attractors)])
    positions = np.zeros(numbers.max() + 1, int)
    positions[numbers] = np.arange(len(numbers))
    return positions[found]
