# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The machine of a map as a labelling function: new starts in threads, with the numbers of the map."""

import functools
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from separatrix.cases import Case
from separatrix.cores import cores
from separatrix.errors import BAD_DATA, SeparatrixError
from separatrix.measuring.sampling import NO_START
from separatrix.simulate import Attractor, Catalogue, section_points
from separatrix.variables import KINDS

# Starts of one call, as in a map.
_PIECE = 1024
_FAMILY = 1 + KINDS.index("family")
_COLUMNS = {"x0": 0, "v0": 1, "crank_angle": 2}


@functools.cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads)


class Machine:
    """One slice of a map: its attractors by the numbers of the map, and labels of any starts."""

    def __init__(
        self,
        case: Case,
        values: Mapping[str, float],
        names: tuple[str, ...],
        scale: np.ndarray,
        threads: int | None = None,
    ) -> None:
        """Search the attractors; points have the coordinates `names`, each divided by its `scale`."""
        self.case, self.values, self.names, self.scale = case, dict(values), names, scale
        self.threads = threads or cores()
        fixed = case.resolved["start"]
        self.start = np.array([float(fixed[name]) for name in _COLUMNS])
        self.catalogue = Catalogue(case.model, self.values).search()
        self.numbers: dict[int, int] = {}
        self.counted = 0
        self._take_own_numbers()

    def _take_own_numbers(self) -> None:
        self.numbers = {
            int(one.numbers["attractor"]): int(one.numbers["attractor"]) for one in self.catalogue.attractors
        }

    def take_numbers(self, entries: list[dict[str, float]]) -> None:
        """Number the attractors as the `entries` of a map's catalogue; missing ones are searched there."""
        missing = [entry for entry in entries if self._like(entry) is None]
        starts = [(entry["x"], entry["v"], 0.0) for entry in missing]
        if starts:
            self.catalogue.search(np.array(starts))
        self.numbers = {}
        for entry in entries:
            found = self._like(entry)
            if found is None:
                raise SeparatrixError(
                    f"attractor {entry['attractor']} of the map is not found again", BAD_DATA
                )
            self.numbers[int(found.numbers["attractor"])] = int(entry["attractor"])

    def _like(self, entry: dict[str, float]) -> Attractor | None:
        """The attractor that is an entry of a map: the same motion, at the same point of the section."""
        for one in self.catalogue.attractors:
            mine = one.numbers
            if any(mine[name] != entry[name] for name in ("period", "regime", "event_word")):
                continue
            if mine["period"] == 0:
                # a family of cycles differs from other motions without a period; older files have no kinds
                if "kind" in entry and (mine["kind"] == _FAMILY) != (entry["kind"] == _FAMILY):
                    continue
                return one
            size = max(abs(entry["amplitude"]), 1e-9)
            if np.abs(one.points[:, 0] - entry["x"]).min(initial=np.inf) < 1e-6 * size:
                return one
        return None

    def columns(self, points: np.ndarray, angle: float | None = None) -> np.ndarray:
        """Return starts x, v, crank angle of scaled points; `angle` instead of that of the case."""
        starts = np.tile(self.start, (len(points), 1))
        for axis, name in enumerate(self.names):
            starts[:, _COLUMNS[name]] = points[:, axis] * self.scale[axis]
        if angle is not None:
            starts[:, 2] = angle
        return starts

    def found(self, points: np.ndarray, angle: float | None = None) -> dict[str, np.ndarray]:
        """Return all that a map has of scaled points; `attractor` by the numbers of the map, -1: no start."""
        return self._labelled(self.columns(points, angle))

    def _labelled(self, starts: np.ndarray) -> dict[str, np.ndarray]:
        pieces = [starts[i : i + _PIECE] for i in range(0, len(starts), _PIECE)]
        parts = (
            list(_pool(self.threads).map(self.catalogue.labels, pieces))
            if len(pieces) > 1
            else [self.catalogue.labels(piece) for piece in pieces]
        )
        self.counted += len(starts)
        found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        own = found["attractor"]
        numbered = np.zeros_like(own)
        for mine, theirs in self.numbers.items():
            numbered[own == mine] = theirs
        # the reason of the library is 0 where it has not flown
        found["attractor"] = np.where(found["reason"] == 0, NO_START, numbered)
        return found

    def labels(self, points: np.ndarray, angle: float | None = None) -> np.ndarray:
        """Return the labels of scaled points."""
        return self.found(points, angle)["attractor"] if len(points) else np.empty(0, np.int32)

    def labels_of(self, states: np.ndarray) -> np.ndarray:
        """Return the labels of states x [m], v [m/s], crank angle [rad]."""
        return self._labelled(states)["attractor"]

    def attractor(self, number: int) -> Attractor:
        """Return the attractor with a number of the map."""
        mine = {theirs: own for own, theirs in self.numbers.items()}[number]
        return next(one for one in self.catalogue.attractors if int(one.numbers["attractor"]) == mine)

    def section(self, number: int, angle: float | None = None) -> np.ndarray | None:
        """Return the section points of a cycle or a rest, scaled, at a crank angle; None if it has none.

        Only of a map over x0 and v0.
        """
        one = self.attractor(number)
        if self.names != ("x0", "v0") or one.numbers["any_position"] or one.numbers["two_bodies"]:
            return None
        if one.points.shape[1] < 2:
            # the section of a machine without a drive is where it turns round
            return None
        turn = float(self.start[2]) if angle is None else angle
        if one.numbers["rests"]:
            points = one.points[:1]
        elif one.numbers["period"] > 0:
            period = int(one.numbers["period"])
            points = section_points(self.case.model, tuple(one.points[0, :2]), period, turn, self.values)
        else:
            return None
        return points[:, :2] / self.scale
