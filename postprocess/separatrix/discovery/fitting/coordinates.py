# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The short-segment likelihood of machines of several bodies: any sensors, starts of all coordinates."""

from functools import cached_property

import numpy as np

from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.hypotheses import Hypothesis
from separatrix.discovery.fitting.joint_effects import location_of, names_at_joints
from separatrix.discovery.fitting.joint_forces import families_of, imperfection_columns_of
from separatrix.discovery.fitting.joint_hypotheses import SensedMotion, hypotheses_at, motion_at
from separatrix.discovery.fitting.joint_response import columns_of
from separatrix.discovery.fitting.joint_sensors import joint_force
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.noise import Left, left_of_motion
from separatrix.discovery.fitting.problem import Problem
from separatrix.discovery.fitting.regions import Region, regions_of_joints
from separatrix.discovery.measured.bodies import structure_of
from separatrix.discovery.measured.segments import Segments, padded_table
from separatrix.discovery.measured.sensors import SensedPrepared, Sensor
from separatrix.discovery.policy import FIT
from separatrix.discovery.wording import Units
from separatrix.library import Effect
from separatrix.segments import Impacts


class CoordinateProblem(Problem):
    """Records of several sensors cut into segments, a structure, and what is free."""

    exact = False
    fits_imperfections = False
    has_memories = False
    has_tables = False
    one_signal = False
    locates = True
    experiment = ""

    def __init__(self, model, prepared: list[SensedPrepared], segments: Segments, free: list[Free]) -> None:
        """Collect what every evaluation needs."""
        self.structure = structure_of(model)
        self.starts = 2 * self.structure.n
        self.columns = list(dict.fromkeys(one.name for record in prepared for one in record.sensors))
        self._frequencies = [
            path
            for path, parameter in model.parameters.items()
            if path.startswith("drive.") and path.endswith(".frequency") and parameter.value
        ]
        super().__init__(model, prepared, segments, free)

    @property
    def channels(self) -> int:
        """How many sensors the records have in all."""
        return len(self.columns)

    @cached_property
    def compared(self) -> np.ndarray:
        """Samples of each sensor that are compared (segments, channels*length)."""
        inside = self.segments.inside
        found = np.zeros((inside.shape[0], len(self.columns), inside.shape[1]), bool)
        for number, prepared in enumerate(self.prepared):
            rows = np.flatnonzero(self.segments.record == number)
            for channel, name in enumerate(self.columns):
                sensor = prepared.sensor(name)
                if sensor is not None:
                    known = True if sensor.known is None else sensor.known[self.segments.index[rows]]
                    found[rows, channel] = inside[rows] & known
        return found.reshape(inside.shape[0], -1)

    def _part(self, number: int) -> dict:
        """The segments of one record as lists for the simulator."""
        prepared, instant = self.prepared[number], 0.0
        if any(one.kind == "a" for one in prepared.sensors):
            radian = 1 / prepared.frequency if prepared.frequency else np.inf
            instant = min(FIT.slope_share * prepared.record.interval, FIT.slope_angle * radian)
        return super()._part(number) | {"instant": instant}

    def _driven_at(self, frequency: float, chosen: dict[str, float]) -> dict[str, float]:
        """Every harmonic drive turns at the frequency of the record."""
        return dict.fromkeys(self._frequencies, frequency)

    def _follow_drive(self, number: int, values: np.ndarray, chosen: dict, chain: np.ndarray) -> None:
        """Derivatives of the frequencies of the drives by the clock of the record."""
        paths = list(chosen)
        for j, one in enumerate(self.free):
            if one.path == "nuisance:clock" and one.record == number:
                for path in self._frequencies:
                    chain[paths.index(path), j] = self.prepared[number].frequency

    def effects(self, asked: tuple[str, ...] | None) -> list[str]:
        """Effects with their locations, of those that were asked for."""
        return names_at_joints(self.model, asked)

    def cannot_show(self, effect: Effect) -> str:
        """Why an effect would change nothing here; '' if it may."""
        return ""

    def imitating(self, motion: Evaluation) -> None:
        """Sensors show a part of a motion only."""

    def observed(self, fit: Fit) -> np.ndarray:
        """The position of the body that is watched."""
        return fit.evaluation.x

    def unit(self, units: Units) -> str:
        """Its unit."""
        return units.position

    def force_columns(self, fit: Fit, forces: np.ndarray, mass: float) -> np.ndarray:
        """Columns of forces on each body by itself."""
        return columns_of(self, fit, forces)

    def families(self, fit: Fit, mass: float) -> dict[str, np.ndarray]:
        """Columns of free forces by what they depend on, and where."""
        return families_of(self, fit)

    def imperfection_columns(self, fit: Fit, usual: float | None = None) -> np.ndarray:
        """Columns of imperfections of one standard deviation along a fit."""
        return imperfection_columns_of(self, fit)

    def left_of_noise(self, fit: Fit, channel: int, mass: float) -> tuple[Left, list[Left], float]:
        """Residuals from which the noise is measured."""
        return left_of_motion(self, fit, channel, mass)

    def motion(self, fit: Fit, data: object, mass: float, natural: float) -> SensedMotion:
        """The motion of a fit, along which hypotheses are tried."""
        return motion_at(self, fit, data)

    def hypotheses(self, training: SensedMotion) -> list[Hypothesis]:
        """Dependences of a missing force, and where it acts."""
        return list(hypotheses_at(training))

    def regions(self, fit: Fit, mass: float, units: Units) -> list[Region]:
        """Bins of the motion at each location in which a missing force is estimated."""
        return regions_of_joints(self, fit)

    def locations(self, names: list[str]) -> dict[str, str]:
        """Where effects act, in words."""
        found = {}
        for name in names:
            where = location_of(name)
            known = [
                one.text() for one in self.structure.locations if one.name == where or where in one.joints
            ]
            found[name] = known[0] if known else where
        return found

    def _evaluate_record(
        self,
        number: int,
        part: dict,
        values: np.ndarray,
        starts: np.ndarray,
        wanted: tuple[bool, bool],
        out: Evaluation,
    ) -> None:
        prepared, n = self.prepared[number], self.structure.n
        derivatives, by_start_alone = wanted
        active, given, moves, directions = self._active(number, values, derivatives)
        if derivatives and by_start_alone:
            moves, directions = np.zeros_like(moves), directions[:0]
        rows, inside = part["rows"], part["inside"]
        angle = self.crank_angle(number, values, part["starts"])
        start = np.column_stack([starts[rows], angle])
        result, motion, jacobian = self._fly(part, active, given, start, directions)
        length = inside.shape[1]
        failed = np.asarray(result.reason) != 0
        shown = padded_table(motion[0][:, : 2 * n], inside)
        failed |= np.any(inside[:, :, None] & ~np.isfinite(shown), axis=(1, 2))
        out.failed[rows] = failed
        watched = self.structure.names.index(prepared.observed)
        if out.motion is None:
            out.motion = np.zeros((*self.segments.inside.shape, 2 * n))
        out.motion[rows] = shown
        out.x[rows], out.v[rows] = shown[:, :, watched], shown[:, :, n + watched]
        out.hits[rows] = result.impacts
        hits = result.impact
        out.impacts[number] = np.column_stack(
            [hits.segment, hits.time, hits.speed_before, hits.speed_after, hits.side, hits.contact]
        )
        if derivatives:
            out.steady[rows] = np.asarray(result.steady, bool)
            d = len(directions)
            out.transition[rows] = padded_table(jacobian[0][:, : 2 * n, d : d + 2 * n], inside)
            crank = np.repeat(self._crank_slopes(number, part), np.diff(part["offsets"]), axis=0)
        for channel, name in enumerate(self.columns):
            sensor = prepared.sensor(name)
            if sensor is None:
                continue
            columns = slice(channel * length, (channel + 1) * length)
            shows, by_all = self._shown(sensor, part, motion, jacobian, active, given, directions)
            residual = self._missed(sensor, sensor.values[part["samples"]] - shows, values) / sensor.sigma
            if sensor.kind == "a":
                hidden = _beside_impacts(part, hits)
                residual[hidden] = 0.0
                if derivatives:
                    by_all[hidden] = 0.0
            out.residual[rows, columns] = np.nan_to_num(padded_table(residual, inside))
            out.used[rows, columns] = self.compared[rows, columns]
            if derivatives:
                by_parameter = by_all[:, -1:] * crank
                by_parameter[:, moves] += by_all[:, :d]
                self._add_slopes(sensor, by_parameter)
                table = np.nan_to_num(padded_table(by_all[:, d : d + 2 * n] / sensor.sigma, inside))
                out.by_start[rows, columns] = table
                out.by_parameter[rows, columns] = np.nan_to_num(
                    padded_table(by_parameter / sensor.sigma, inside)
                )

    def _missed(self, sensor: Sensor, difference: np.ndarray, values: np.ndarray) -> np.ndarray:
        """What a sensor shows less what the machine would make it show."""
        return difference

    def _add_slopes(self, sensor: Sensor, by_parameter: np.ndarray) -> None:
        """Derivatives of what a sensor shows by what is its own."""

    def _fly(self, part: dict, active: list[str], given: np.ndarray, start: np.ndarray, directions) -> tuple:
        """Motion and Jacobian at the samples and, for accelerations, one and two instants later."""
        instant = part["instant"]
        times, offsets, each = part["times"], part["offsets"], 1
        if instant:
            each = 3
            times = (times[:, None] + instant * np.arange(each)).ravel()
            offsets = each * offsets
        result = self.model.segments(
            active,
            given,
            start,
            offsets,
            times,
            derivatives=directions is not None,
            directions=directions,
            tolerance=FIT.tolerance_of_bodies,
        )
        motion = [result.motion[k::each] for k in range(each)]
        jacobian = None if directions is None else [result.jacobian[k::each] for k in range(each)]
        return result, motion, jacobian

    def _shown(
        self,
        sensor: Sensor,
        part: dict,
        motion: list[np.ndarray],
        jacobian: list[np.ndarray] | None,
        active: list[str],
        given: np.ndarray,
        directions: np.ndarray | None,
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """What a sensor shows at the samples, and its derivatives by directions, start and crank angle."""
        structure = self.structure
        n = structure.n
        if sensor.kind == "F":
            return joint_force(
                structure, sensor.of, motion, jacobian, (active, given, directions), self.model
            )
        body = structure.names.index(sensor.of)
        if sensor.kind in "xv":
            column = body + n * (sensor.kind == "v")
            return motion[0][:, column], None if jacobian is None else jacobian[0][:, column]
        weights = np.array([-1.5, 2.0, -0.5]) / part["instant"]
        found = sum(w * one[:, n + body] for w, one in zip(weights, motion, strict=True))
        if jacobian is None:
            return found, None
        return found, sum(w * one[:, n + body] for w, one in zip(weights, jacobian, strict=True))


def _beside_impacts(part: dict, impact: Impacts) -> np.ndarray:
    """Samples with an impact before the last instant that their acceleration is from.

    The jump of the speed is no acceleration, and would be a wall that no step of a fit passes.
    """
    found = np.zeros(part["times"].size, bool)
    for segment, time in zip(impact.segment, impact.time, strict=True):
        first, last = part["offsets"][segment : segment + 2]
        passed = time - part["times"][first:last]
        found[first:last] |= (passed >= 0) & (passed <= 2 * part["instant"])
    return found
