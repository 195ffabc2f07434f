# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The machine of a file in the library: motions, attractors and labels that are not in the file."""

import csv
import io
import re
import threading
from collections import OrderedDict
from collections.abc import Mapping

import numpy as np

from separatrix.errors import SeparatrixError
from separatrix.library import Model
from separatrix.simulate import Catalogue, Motion, StopFlag, trajectory
from separatrix.variables import KINDS
from separatrix.view.files import ResultFile

__all__ = ["Machine"]

EVENTS = (
    "impact_upper", "impact_lower", "stick", "release", "turning_point", "chatter_upper", "chatter_lower",
    "barrier_release", "touch_upper", "touch_lower", "separation", "impulse",
)  # fmt: skip
REGIMES = ("unresolved", "non_impact", "impact", "sticking", "mixed", "chattering", "at_rest", "stuck")
REASONS = (
    "not_run", "settled", "time_over", "left_domain", "not_finite", "event_budget", "step_failed",
    "step_budget", "mode_cycle",
)  # fmt: skip
_FAMILY = 1 + KINDS.index("family")
_KEPT = 64  # catalogues
_SAME = 1e-6  # relative distance of section points up to which two attractors are one


class Machine:
    """The case of a file, with other values of its parameters where asked."""

    def __init__(self, source: ResultFile) -> None:
        """Read the case of a file. CaseError if the library cannot."""
        self.source = source
        self.model = Model.from_text(source.case_text, source.path.resolve().parent)
        self._catalogues: OrderedDict[tuple, tuple[Catalogue, np.ndarray]] = OrderedDict()
        self._lock = threading.Lock()
        self._searches: dict[tuple, threading.Lock] = {}

    def check(self, values: Mapping[str, float]) -> None:
        """Refuse parameters that the case does not have. CaseError."""
        for path in values:
            if path not in self.model.parameters:
                self.model.index_of(path)

    def motion(
        self, start: tuple[float, float, float], values: Mapping[str, float], duration: float, samples: int
    ) -> Motion:
        """Fly one motion; `duration` [s] and `samples` a drive period are those of the case if 0."""
        return trajectory(self.model, start, values, duration, samples, partial=True)

    def period(self, values: Mapping[str, float]) -> float:
        """Return the drive period [s]."""
        return 2 * np.pi / self.model.drive_frequency(values)

    def catalogue(
        self, values: Mapping[str, float], slice_number: int | None, stop: StopFlag | None = None
    ) -> tuple[Catalogue, np.ndarray]:
        """Return the attractors of the machine with other values, and the label of each.

        They are searched as `basin` does; `slice_number` is that of the slice of the file where it is one,
        whose attractors, and those of its neighbours, are starts of the search too. One that is in the file
        has its label there; labels of others are above all of the file.
        """
        key = tuple(sorted(values.items()))
        with self._lock:
            search = self._searches.setdefault(key, threading.Lock())
        with search:
            with self._lock:
                if key in self._catalogues:
                    self._catalogues.move_to_end(key)
                    return self._catalogues[key]
            catalogue = Catalogue(self.model, values).search(stop=stop)
            known = self.source.tables.get("catalogue", {})
            slices = np.array(known.get("slice", []), int)
            if slice_number is not None and slices.size:
                near = np.abs(slices - slice_number) <= 1
                starts = np.column_stack([known["x"], known["v"], np.zeros(len(slices))])[near]
                catalogue.search(starts, stop)
            found = (catalogue, self._labels(catalogue, slice_number))
            with self._lock:
                self._catalogues[key] = found
                while len(self._catalogues) > _KEPT:
                    old, _ = self._catalogues.popitem(last=False)
                    self._searches.pop(old, None)
            return found

    def _labels(self, catalogue: Catalogue, slice_number: int | None) -> np.ndarray:
        """Return the label of each attractor: that of the same one in the file, or one of its own."""
        known = self.source.tables.get("catalogue", {})
        labels = [0]
        highest = max(known.get("attractor", [0]), default=0)
        taken: set[int] = set()
        for one in catalogue.attractors:
            label = 0
            for i in range(len(known.get("attractor", []))):
                same = known["slice"][i] == slice_number and known["attractor"][i] not in taken
                same = same and all(known[key][i] == one.numbers[key] for key in ("regime", "period"))
                if "kind" in known:
                    same = same and (known["kind"][i] == _FAMILY) == (one.numbers["kind"] == _FAMILY)
                if same and (
                    one.numbers["period"] == 0 or one.numbers["rests"] or _near(known, i, one.numbers)
                ):
                    label = int(known["attractor"][i])
                    break
            if not label:
                highest += 1
                label = highest
            taken.add(label)
            labels.append(label)
        return np.array(labels, np.int32)

    def single_labels(
        self, start: tuple[float, float, float], values: list[Mapping[str, float]], stop: StopFlag
    ) -> dict[str, np.ndarray]:
        """Return variables of points of a map over parameters: each finds its own attractor, unlabelled."""
        rows = []
        for one in values:
            catalogue = Catalogue(self.model, one).search(np.array([start]), stop)
            rows.append(catalogue.labels(np.array([start]), stop))
        found = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
        found["attractor"][:] = 0
        return found

    def case_text(self, start: tuple[float, float, float], values: Mapping[str, float]) -> str:
        """Return a case file of the machine with a start; `separatrix trajectory` flies it."""
        text = self.model.to_text(dict(values))
        for key, value in zip(("x0", "v0", "crank_angle"), start, strict=True):
            pattern = rf"(?ms)(^\[start\]$.*?^{key} = )[^\n]*"
            text, count = re.subn(
                pattern, lambda found, value=value: f"{found[1]}{float(value)!r}", text, count=1
            )
            if not count:
                raise SeparatrixError(f"the case has no start.{key}")
        return text


def samples_csv(motion: Motion) -> str:
    """Return the samples as a table whose numbers read back to the same bits."""
    columns = {name: column for name, column in motion.samples.items() if not np.isnan(column).all()}
    return _csv(list(columns), zip(*(column.tolist() for column in columns.values()), strict=True))


def events_csv(motion: Motion) -> str:
    """Return the events as a table, as `separatrix trajectory --csv` does."""
    columns = {name: column.tolist() for name, column in motion.events.items()}
    columns["kind"] = [EVENTS[int(kind) - 1] for kind in columns["kind"]]
    if not motion.summary["two_bodies"]:
        del columns["driver_x"], columns["driver_v"]
    return _csv(list(columns), zip(*columns.values(), strict=True))


def _csv(names: list[str], rows: object) -> str:
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return table.getvalue()


def _near(known: dict[str, list], i: int, numbers: dict[str, float]) -> bool:
    scale = max(abs(numbers["amplitude"]), 1e-300), max(abs(numbers["v_max"]), 1e-300)
    parts = zip(("x", "v"), scale, strict=True)
    return all(abs(known[key][i] - numbers[key]) <= _SAME * size for key, size in parts)
