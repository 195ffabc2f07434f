# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The short-segment likelihood: residuals of all segments and their derivatives, from the simulator."""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.machine import Free, drive_amplitudes
from separatrix.discovery.preflight import Prepared
from separatrix.discovery.segments import Segments, padded
from separatrix.errors import SeparatrixError

_SCALE_STEP = 1e-5
_CLOCK_STEP = 1e-6


@dataclass
class Evaluation:
    """Residuals over their noise (segments, channels*length), derivatives by start (…, 2) and parameters (…,
    p).

    `used` is 0 where a segment was given up by the simulator or has no sample; `steady` is false where the
    sequence of impacts would change under a small step, so that the derivatives mean nothing.
    """

    residual: np.ndarray
    used: np.ndarray
    failed: np.ndarray
    steady: np.ndarray
    x: np.ndarray
    v: np.ndarray
    # per record rows of segment (of that record), time, speed before, speed after, side
    impacts: list[np.ndarray | None]
    # number of impacts of each segment
    hits: np.ndarray
    by_start: np.ndarray | None = None
    by_parameter: np.ndarray | None = None
    # derivatives of x and v by the start, without noise: what a force does later follows from them
    transition: np.ndarray | None = None


class Problem:
    """Records cut into segments, a model, and what is free."""

    def __init__(self, model, prepared: list[Prepared], segments: Segments, free: list[Free]) -> None:
        """Collect what every evaluation needs."""
        self.model = model
        self.prepared = prepared
        self.segments = segments
        self.free = free
        self.amplitudes = drive_amplitudes(model)
        self._parts = [self._part(number) for number in range(len(prepared))]

    def with_free(self, free: list[Free]) -> "Problem":
        """The same segments with other free parameters."""
        other = object.__new__(Problem)
        other.__dict__.update(self.__dict__)
        other.free = free
        return other

    def of_segments(self, rows: np.ndarray) -> "Problem":
        """The same problem with these segments only; a segment may come several times."""
        old = self.segments
        chosen = padded(old.record[rows], old.first[rows], old.last[rows])
        return Problem(self.model, self.prepared, chosen, self.free)

    @property
    def values(self) -> np.ndarray:
        """Values that the free parameters start from."""
        return np.array([one.value for one in self.free])

    def _part(self, number: int) -> dict:
        """The segments of one record as lists for the simulator."""
        record = self.prepared[number].record
        rows = np.flatnonzero(self.segments.record == number)
        first, last = self.segments.first[rows], self.segments.last[rows]
        offsets = np.concatenate([[0], np.cumsum(last - first)])
        samples = np.concatenate(
            [np.arange(a, b) for a, b in zip(first, last, strict=True)] or [np.zeros(0, int)]
        )
        starts = record.t[first]
        times = record.t[samples] - np.repeat(starts, last - first)
        return {
            "rows": rows,
            "offsets": offsets,
            "times": times,
            "starts": starts,
            "inside": self.segments.inside[rows],
            "x": record.x[samples],
            "v": None if record.v is None else record.v[samples],
            "force": _force_argument(record, starts),
        }

    def evaluate(self, values: np.ndarray, starts: np.ndarray, derivatives: bool = True) -> Evaluation:
        """Simulate all segments from `starts` (segments, 2) of x and v."""
        shape = self.segments.inside.shape
        channels = 2 if any(part["v"] is not None for part in self._parts) else 1
        count, length = shape
        width = channels * length
        out = Evaluation(
            residual=np.zeros((count, width)),
            used=np.zeros((count, width)),
            failed=np.zeros(count, bool),
            steady=np.ones(count, bool),
            x=np.zeros(shape),
            v=np.zeros(shape),
            impacts=[None] * len(self._parts),
            hits=np.zeros(count, int),
        )
        if derivatives:
            out.by_start = np.zeros((count, width, 2))
            out.by_parameter = np.zeros((count, width, len(self.free)))
            out.transition = np.zeros((count, length, 2, 2))
        for number, part in enumerate(self._parts):
            if part["rows"].size:
                try:
                    self._evaluate_record(number, part, values, starts, derivatives, out)
                except SeparatrixError:
                    # values that together make no machine
                    out.failed[part["rows"]] = True
        # what was not flown to its end says nothing
        for table in (out.residual, out.by_start, out.by_parameter):
            if table is not None:
                table[out.failed] = 0
        out.residual = self.whitened(out.residual)
        if derivatives:
            out.by_start = self.whitened(out.by_start)
            out.by_parameter = self.whitened(out.by_parameter)
        return out

    def whitened(self, table: np.ndarray) -> np.ndarray:
        """Rows (segments, channels*length, ...) over their noise, freed of the memory of the noise."""
        length = self.segments.inside.shape[1]
        for number, prepared in enumerate(self.prepared):
            memory = prepared.memory
            if memory == 0:
                continue
            rows = np.flatnonzero(self.segments.record == number)
            for first in range(0, table.shape[1], length):
                part = table[rows, first : first + length]
                part[:, 1:] = (part[:, 1:] - memory * part[:, :-1]) / np.sqrt(1 - memory**2)
                table[rows, first : first + length] = part
        used = np.tile(self.segments.inside, (1, table.shape[1] // length))
        table[~used] = 0
        return table

    def _evaluate_record(
        self,
        number: int,
        part: dict,
        values: np.ndarray,
        starts: np.ndarray,
        derivatives: bool,
        out: Evaluation,
    ) -> None:
        prepared = self.prepared[number]
        active, given, chain = self._active(number, values, derivatives)
        start = np.column_stack([starts[part["rows"]], self._crank(number, part, values)])
        result = self._simulate(part, active, given, start, derivatives)
        rows, inside = part["rows"], part["inside"]
        length = inside.shape[1]
        failed = np.asarray(result.reason) != 0
        finite = _padded(np.isfinite(result.x) & np.isfinite(result.v), inside)
        failed |= np.any(inside & (finite == 0), axis=1)
        out.failed[rows] = failed
        out.x[rows] = _padded(result.x, inside)
        out.v[rows] = _padded(result.v, inside)
        out.hits[rows] = result.impacts
        hits = result.impact
        out.impacts[number] = np.column_stack(
            [hits.segment, hits.time, hits.speed_before, hits.speed_after, hits.side]
        )
        jacobians = (None, None)
        if derivatives:
            out.steady[rows] = np.asarray(result.steady, bool)
            jacobians, steady = self._derivatives(number, part, active, given, chain, start, values, result)
            out.steady[rows] &= steady
            n = len(active)
            out.transition[rows, :, 0, :] = _padded(result.jacobian[:, n : n + 2], inside)
            out.transition[rows, :, 1, :] = _padded(result.velocity_jacobian[:, n : n + 2], inside)
        for channel, (measured, computed, sigma) in enumerate(
            ((part["x"], result.x, prepared.sigma), (part["v"], result.v, prepared.velocity_sigma))
        ):
            if measured is None:
                continue
            columns = slice(channel * length, (channel + 1) * length)
            out.residual[rows, columns] = np.nan_to_num(_padded((measured - computed) / sigma, inside))
            out.used[rows, columns] = inside
            if derivatives:
                by_start, by_parameter = jacobians[channel]
                out.by_start[rows, columns] = np.nan_to_num(_padded(by_start / sigma, inside))
                out.by_parameter[rows, columns] = np.nan_to_num(_padded(by_parameter / sigma, inside))

    def _simulate(
        self, part: dict, active: list[str], given: np.ndarray, start: np.ndarray, derivatives: bool
    ):
        more = {} if part["force"] is None else {"force": part["force"]}
        return self.model.segments(
            active, given, start, part["offsets"], part["times"], derivatives=derivatives, **more
        )

    def machine_values(self, number: int, values: np.ndarray) -> dict[str, float]:
        """Values of the machine as it was during record `number`."""
        chosen = {
            one.path: one.physical(value)
            for one, value in zip(self.free, values, strict=True)
            if not one.is_nuisance
        }
        prepared = self.prepared[number]
        scale = prepared.drive_scale * self._nuisance("nuisance:drive_scale", number, values, 1.0)
        if scale != 1.0 or prepared.drive_scale != 1.0:
            for path, value in self.amplitudes.items():
                chosen[path] = scale * value
        if prepared.frequency is not None:
            frequency = prepared.frequency * (1 + self._nuisance("nuisance:clock", number, values, 0.0))
            ratio = self.model.parameters["drive.ratio"].value
            chosen["drive.ratio"] = ratio
            chosen["drive.ratio"] = ratio * frequency / self.model.drive_frequency(chosen)
        return chosen

    def _nuisance(self, path: str, number: int, values: np.ndarray, absent: float) -> float:
        for one, value in zip(self.free, values, strict=True):
            if one.path == path and one.record in (None, number):
                return float(value)
        return absent

    def crank_angle(self, number: int, values: np.ndarray, t: float) -> float:
        """Angle of the crank at time `t` of a record [rad]."""
        return float(self._crank(number, {"starts": np.array([t])}, values)[0])

    def _crank(self, number: int, part: dict, values: np.ndarray) -> np.ndarray:
        prepared = self.prepared[number]
        if prepared.frequency is None:
            return np.zeros(part["starts"].size)
        clock = self._nuisance("nuisance:clock", number, values, 0.0)
        phase = prepared.phase + self._nuisance("nuisance:phase", number, values, 0.0)
        return phase + prepared.frequency * (1 + clock) * (part["starts"] - prepared.origin)

    def _active(self, number: int, values: np.ndarray, derivatives: bool) -> tuple:
        """Paths, their values and d(values)/d(free parameters); the scale of the drive is differenced."""
        chosen = self.machine_values(number, values)
        active = list(chosen)
        given = np.array([chosen[path] for path in active])
        if not derivatives:
            return active, given, None
        chain = np.zeros((len(active), len(self.free)))
        for j, one in enumerate(self.free):
            if one.is_nuisance:
                continue
            chain[active.index(one.path), j] = one.slope(values[j])
        if "drive.ratio" in chosen and self.prepared[number].frequency is not None:
            row = active.index("drive.ratio")
            for j, one in enumerate(self.free):
                chain[row, j] = self._ratio_slope(one, number, chosen) * one.slope(values[j])
        return active, given, chain

    def _ratio_slope(self, one: Free, number: int, chosen: dict[str, float]) -> float:
        """How drive.ratio follows a parameter, so that the frequency stays that of the record."""
        ratio = chosen["drive.ratio"]
        if one.path == "nuisance:clock" and one.record == number:
            return ratio
        if one.path not in ("restoring.stiffness", "restoring.moment", "body.mass"):
            return 0.0
        step = 1e-5 * abs(chosen[one.path])
        ends = [
            self.model.drive_frequency({**chosen, one.path: chosen[one.path] + sign * step})
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / (2 * step)
        return -ratio * slope / (0.5 * (ends[0] + ends[1]))

    def _derivatives(self, number, part, active, given, chain, start, values, result) -> tuple:
        n = len(active)
        prepared = self.prepared[number]
        lengths = np.diff(part["offsets"])
        crank = np.zeros((part["starts"].size, len(self.free)))
        scale_column = None
        for j, one in enumerate(self.free):
            if one.path == "nuisance:phase" and one.record == number:
                crank[:, j] = 1
            elif one.path == "nuisance:clock" and one.record == number:
                crank[:, j] = prepared.frequency * (part["starts"] - prepared.origin)
            elif one.path == "nuisance:drive_scale":
                scale_column = j
        crank = np.repeat(crank, lengths, axis=0)
        jacobians, steady = [], np.ones(part["rows"].size, bool)
        for whole in (result.jacobian, result.velocity_jacobian):
            by_parameter = whole[:, :n] @ chain + whole[:, n + 2 : n + 3] * crank
            jacobians.append((whole[:, n : n + 2], by_parameter))
        if scale_column is not None:
            slopes, steady = self._scale_slopes(part, active, given, start, values[scale_column])
            for (_, by_parameter), slope in zip(jacobians, slopes, strict=True):
                by_parameter[:, scale_column] = slope
        return jacobians, steady

    def _scale_slopes(self, part, active, given, start, scale: float) -> tuple:
        amplitude = np.array([path in self.amplitudes for path in active])
        base = np.where(amplitude, given / scale, 0.0)
        if not amplitude.any():
            active = [*active, *self.amplitudes]
            base = np.concatenate([np.zeros(given.size), list(self.amplitudes.values())])
            given = np.concatenate([given, list(self.amplitudes.values())])
        ends = [
            self._simulate(part, active, given + sign * _SCALE_STEP * base, start, False) for sign in (1, -1)
        ]
        steady = np.asarray(ends[0].impacts) == np.asarray(ends[1].impacts)
        return [
            (getattr(ends[0], name) - getattr(ends[1], name)) / (2 * _SCALE_STEP) for name in ("x", "v")
        ], steady


def _padded(flat: np.ndarray, inside: np.ndarray) -> np.ndarray:
    table = np.zeros(inside.shape + flat.shape[1:])
    table[inside] = flat
    return table


def _force_argument(record, starts: np.ndarray):
    if record.force is None:
        return None
    # the mean, so that the series ends where the record does
    interval = (record.t[-1] - record.t[0]) / (record.t.size - 1)
    return starts - record.t[0], interval, record.force
