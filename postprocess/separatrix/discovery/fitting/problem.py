# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the likelihoods of all observations share: segments, noise, free parameters, imperfections."""

from functools import cached_property

import numpy as np

from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.machine import SENSOR_BIAS, SENSOR_ZERO, Free, drive_amplitudes
from separatrix.discovery.fitting.time_limit import present_limit
from separatrix.discovery.measured.preflight import Prepared
from separatrix.discovery.measured.segments import Segments, padded, seeing
from separatrix.errors import SeparatrixError


class Problem:
    """Records cut into segments, a model, and what is free; a part of each `Likelihood`."""

    # numbers of a start, and those of them that are fitted
    starts = 2

    @property
    def unknowns(self) -> int:
        """Unknowns of each segment."""
        return self.starts

    def __init__(
        self,
        model,
        prepared: list[Prepared],
        segments: Segments,
        free: list[Free],
        imperfections: dict[tuple[str, int | None], np.ndarray] | None = None,
    ) -> None:
        """Collect what every evaluation needs.

        `imperfections`: what each imperfection of the rig of size 1, by path and record, adds to x and v
        (segments, channels, length) [m, m/s].
        """
        self.model = model
        self.imperfections = imperfections or {}
        self.prepared = prepared
        self.segments = segments
        self.free = free
        self.amplitudes = drive_amplitudes(model)
        self._parts = [self._part(number) for number in range(len(prepared))]

    def of_segments(self, rows: np.ndarray) -> "Problem":
        """The same problem with these segments only; a segment may come several times."""
        old = self.segments
        found = self.like(self.model, self.free, padded(old.record[rows], old.first[rows], old.last[rows]))
        # short segments are a narrower table
        length = found.segments.inside.shape[1]
        found.imperfections = {key: table[rows][:, :, :length] for key, table in self.imperfections.items()}
        return found

    def like(self, model, free: list[Free], segments: Segments | None = None) -> "Problem":
        """The same records with another model, or other segments without imperfections of the rig."""
        found = type(self)(model, self.prepared, self.segments if segments is None else segments, free)
        found.imperfections = self.imperfections if segments is None else {}
        return found

    def left_over(self) -> tuple[np.ndarray, np.ndarray]:
        """Residual squares of the condensed blocks of each segment, and their degrees of freedom.

        They are independent of the machine and measure the noise relative to the assumed one.
        """
        squares, freedom = np.zeros(self.segments.count), np.zeros(self.segments.count)
        for number, prepared in enumerate(self.prepared):
            samples = prepared.samples
            if not samples.condensed:
                continue
            rows = np.flatnonzero(self.segments.record == number)
            first, last = self.segments.first[rows], self.segments.last[rows]
            count = samples.freedom
            weights = samples.weights(prepared.memory)
            white = samples.left * weights / prepared.sigma**2
            if samples.v is not None:
                white = white + samples.left_v * weights / prepared.velocity_sigma**2
                count = 2 * count
            for table, per_row in ((squares, white), (freedom, count)):
                total = np.concatenate([[0.0], np.cumsum(per_row)])
                table[rows] = total[last] - total[first]
        return squares, freedom

    @cached_property
    def compared(self) -> np.ndarray:
        """Samples of x and, in further columns, of v that are compared (segments, channels*length)."""
        samples = [one.samples for one in self.prepared]
        inside = self.segments.inside
        return inside if self.channels == 1 else np.hstack([inside, seeing(self.segments, samples)])

    def _known_nuisances(self) -> list[tuple[int, float, np.ndarray]]:
        """Indices and errors of nuisances of known size, and the segments that share their residual.

        Each is one more residual of its record, of which every segment has a share, so that sums and
        resampled sums over the segments contain it.
        """
        return [
            (index, one.error, rows)
            for index, one in enumerate(self.free)
            if one.error is not None and (rows := self._rows_of(one.record)).size
        ]

    def _rows_of(self, record: int | None) -> np.ndarray:
        """Segments of a record, or of all."""
        return np.flatnonzero((self.segments.record == record) | (record is None))

    @property
    def values(self) -> np.ndarray:
        """Values that the free parameters start from."""
        return np.array([one.value for one in self.free])

    def _part(self, number: int) -> dict:
        """The segments of one record as lists for the simulator."""
        fitted = self.prepared[number].samples
        rows = np.flatnonzero(self.segments.record == number)
        first, last = self.segments.first[rows], self.segments.last[rows]
        offsets = np.concatenate([[0], np.cumsum(last - first)])
        samples = np.concatenate(
            [np.arange(a, b) for a, b in zip(first, last, strict=True)] or [np.zeros(0, int)]
        )
        starts = fitted.t[first]
        times = fitted.t[samples] - np.repeat(starts, last - first)
        return {
            "rows": rows,
            "offsets": offsets,
            "times": times,
            "starts": starts,
            "inside": self.segments.inside[rows],
            "samples": samples,
        }

    def evaluate(
        self, values: np.ndarray, starts: np.ndarray, derivatives: bool = True, by_start_alone: bool = False
    ) -> Evaluation:
        """Simulate all segments from `starts` (segments, 2) of x and v, or of positions and velocities.

        With `by_start_alone` derivatives by the parameters of the machine are 0, which is much quicker.
        """
        present_limit().ends_fits()
        shape = self.segments.inside.shape
        count, length = shape
        measured = self._known_nuisances()
        width = self.channels * length + len(measured)
        out = Evaluation(
            residual=np.zeros((count, width)),
            used=np.zeros((count, width)),
            failed=np.zeros(count, bool),
            steady=np.ones(count, bool),
            x=np.zeros(shape),
            v=np.zeros(shape),
            impacts=[None] * len(self._parts),
            hits=np.zeros(count, int),
            unknowns=self.unknowns,
        )
        if derivatives:
            out.by_start = np.zeros((count, width, self.starts))
            out.by_parameter = np.zeros((count, width, len(self.free)))
            out.transition = np.zeros((count, length, self.starts, self.starts))
        for number, part in enumerate(self._parts):
            if part["rows"].size:
                try:
                    self._evaluate_record(number, part, values, starts, (derivatives, by_start_alone), out)
                except SeparatrixError:
                    # values that together make no machine
                    out.failed[part["rows"]] = True
        for column, (index, error, rows) in enumerate(measured, start=self.channels * length):
            out.residual[rows, column] = -values[index] / error
            out.used[rows, column] = 1 / rows.size
            if derivatives:
                out.by_parameter[rows, column, index] = 1 / error
        self._add_imperfections(values, out)
        # segments that were not simulated to their end do not count
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
            links = self._links(prepared, rows)
            for first in range(0, self.channels * length, length):
                known = self.compared[rows, first : first + length]
                link = links * (known[:, 1:] & known[:, :-1])
                link = link.reshape(link.shape + (1,) * (table.ndim - 2))
                part = table[rows, first : first + length]
                part[:, 1:] = (part[:, 1:] - link * part[:, :-1]) / np.sqrt(1 - link**2)
                table[rows, first : first + length] = part
        table[:, : self.compared.shape[1]][~self.compared] = 0
        return table

    def _links(self, prepared: Prepared, rows: np.ndarray) -> np.ndarray:
        """Correlation of each sample of these segments with the one before."""
        return prepared.samples.links(prepared.memory)[self.segments.index[rows]][:, 1:]

    def _add_imperfections(self, values: np.ndarray, out: Evaluation) -> None:
        """What imperfections of the rig add to residuals and derivatives."""
        if not self.imperfections:
            return
        deviations, length = self._deviations(), self.segments.inside.shape[1]
        for index, one in enumerate(self.free):
            table = self.imperfections.get((one.path, one.record))
            if table is None:
                continue
            rows = self._rows_of(one.record)
            for channel in range(self.channels):
                columns = slice(channel * length, (channel + 1) * length)
                added = table[rows, channel] / deviations[rows, channel]
                out.residual[rows, columns] -= values[index] * added
                if out.by_parameter is not None:
                    out.by_parameter[rows, columns, index] += added

    def _deviations(self) -> np.ndarray:
        """Of the noise of x and v at the samples (segments, channels, length), infinite beside these."""
        count, length = self.segments.inside.shape
        found = np.full((count, self.channels, length), np.inf)
        for number, prepared in enumerate(self.prepared):
            rows = np.flatnonzero(self.segments.record == number)
            spread = prepared.samples.spread(prepared.memory)[self.segments.index[rows]]
            for channel, sigma in enumerate((prepared.sigma, prepared.velocity_sigma)[: self.channels]):
                if sigma:
                    found[rows, channel] = np.where(self.segments.inside[rows], sigma * spread, np.inf)
        return found

    def in_units(self, table: np.ndarray) -> np.ndarray:
        """Whitened columns of x and v (segments, channels*length, q) in units (..., channels, length, q)."""
        count, length = self.segments.inside.shape
        found, deviations = np.zeros((count, self.channels, length, table.shape[2])), self._deviations()
        for number, prepared in enumerate(self.prepared):
            rows = np.flatnonzero(self.segments.record == number)
            links = prepared.samples.links(prepared.memory)[self.segments.index[rows]][:, 1:]
            for channel in range(self.channels):
                columns = slice(channel * length, (channel + 1) * length)
                known, part = self.compared[rows, columns], table[rows, columns].copy()
                link = (links * (known[:, 1:] & known[:, :-1]) if prepared.memory else 0 * links)[:, :, None]
                for i in range(1, length):
                    before = link[:, i - 1]
                    part[:, i] = np.sqrt(1 - before**2) * part[:, i] + before * part[:, i - 1]
                sigma = deviations[rows, channel]
                sigma = np.where(known & np.isfinite(sigma), sigma, 0.0)
                found[rows, channel] = part * sigma[:, :, None]
        return found

    def machine_values(self, number: int, values: np.ndarray) -> dict[str, float]:
        """Values of the machine as it was during record `number`."""
        chosen = {
            path: number
            for one, value in zip(self.free, values, strict=True)
            if not one.is_nuisance
            for path, number in one.numbers(value).items()
        }
        prepared = self.prepared[number]
        scale = self._nuisance("nuisance:drive_scale", number, values, None)
        if scale is not None or prepared.drive_scale != 1.0:
            for path, value in self.amplitudes.items():
                chosen[path] = prepared.drive_scale * (1.0 if scale is None else scale) * value
        if prepared.frequency is not None:
            frequency = prepared.frequency * (1 + self._nuisance("nuisance:clock", number, values, 0.0))
            chosen |= self._driven_at(frequency, chosen)
        zero = self._nuisance(SENSOR_ZERO, number, values, None)
        if zero is not None:
            chosen[SENSOR_BIAS] = zero + chosen.get(SENSOR_BIAS, self.model.parameters[SENSOR_BIAS].value)
        return chosen

    def _nuisance(self, path: str, number: int, values: np.ndarray, absent: float | None) -> float | None:
        for one, value in zip(self.free, values, strict=True):
            if one.path == path and one.record in (None, number):
                return float(value)
        return absent

    def sample_times(self) -> np.ndarray:
        """Times of the samples since the start of their segment [s], (segments, length)."""
        times = np.zeros(self.segments.inside.shape)
        for number, prepared in enumerate(self.prepared):
            rows = np.flatnonzero(self.segments.record == number)
            t = prepared.samples.t[self.segments.index[rows]]
            times[rows] = t - t[:, :1]
        return times

    def crank_angle(self, number: int, values: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Angle of the crank at times `t` of a record [rad]; 0 without a crank."""
        prepared = self.prepared[number]
        if prepared.frequency is None:
            return np.zeros(np.shape(t))
        clock = self._nuisance("nuisance:clock", number, values, 0.0)
        phase = prepared.phase + self._nuisance("nuisance:phase", number, values, 0.0)
        return phase + prepared.frequency * (1 + clock) * (t - prepared.origin)

    def _active(self, number: int, values: np.ndarray, derivatives: bool) -> tuple:
        """Paths, their values, which free parameters move them, and in which directions (one row each)."""
        chosen = self.machine_values(number, values)
        active = list(chosen)
        given = np.array([chosen[path] for path in active])
        if not derivatives:
            return active, given, None, None
        chain = np.zeros((len(active), len(self.free)))
        for j, one in enumerate(self.free):
            if one.path == "nuisance:drive_scale":
                for path, value in self.amplitudes.items():
                    chain[active.index(path), j] = self.prepared[number].drive_scale * value
            elif one.path == SENSOR_ZERO and one.record == number:
                chain[active.index(SENSOR_BIAS), j] = 1.0
            elif not one.is_nuisance:
                for path, slope in one.slopes(values[j]).items():
                    chain[active.index(path), j] = slope
        if self.prepared[number].frequency is not None:
            self._follow_drive(number, values, chosen, chain)
        moves = chain.any(axis=0)
        return active, given, moves, chain.T[moves]

    def _crank_slopes(self, number: int, part: dict) -> np.ndarray:
        """Derivatives of the crank angles at the starts by the free parameters."""
        crank = np.zeros((part["starts"].size, len(self.free)))
        prepared = self.prepared[number]
        for j, one in enumerate(self.free):
            if one.path == "nuisance:phase" and one.record == number:
                crank[:, j] = 1
            elif one.path == "nuisance:clock" and one.record == number:
                crank[:, j] = prepared.frequency * (part["starts"] - prepared.origin)
        return crank
