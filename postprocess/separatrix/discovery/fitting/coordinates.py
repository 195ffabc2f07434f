# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The short-segment likelihood of machines of several bodies: any sensors, starts of all coordinates."""

import numpy as np

from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.problem import Problem
from separatrix.discovery.measured.bodies import Structure, structure_of
from separatrix.discovery.measured.segments import Segments, padded_table
from separatrix.discovery.measured.sensors import SensedPrepared, Sensor
from separatrix.discovery.policy import FIT


class CoordinateProblem(Problem):
    """Records of several sensors cut into segments, a structure, and what is free."""

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

    @property
    def compared(self) -> np.ndarray:
        """Samples of each sensor that are compared (segments, channels*length)."""
        has = np.array([[one.sensor(name) is not None for name in self.columns] for one in self.prepared])
        of_segments = has[self.segments.record]
        inside = self.segments.inside
        return (of_segments[:, :, None] & inside[:, None, :]).reshape(inside.shape[0], -1)

    def _part(self, number: int) -> dict:
        """The segments of one record as lists for the simulator."""
        prepared = self.prepared[number]
        rows = np.flatnonzero(self.segments.record == number)
        first, last = self.segments.first[rows], self.segments.last[rows]
        offsets = np.concatenate([[0], np.cumsum(last - first)])
        samples = np.concatenate(
            [np.arange(a, b) for a, b in zip(first, last, strict=True)] or [np.zeros(0, int)]
        )
        starts = prepared.record.t[first]
        times = prepared.record.t[samples] - np.repeat(starts, last - first)
        instant = 0.0
        if any(one.kind == "a" for one in prepared.sensors):
            radian = 1 / prepared.frequency if prepared.frequency else np.inf
            instant = min(FIT.slope_share * prepared.record.interval, FIT.slope_angle * radian)
        return {
            "rows": rows,
            "offsets": offsets,
            "times": times,
            "starts": starts,
            "inside": self.segments.inside[rows],
            "samples": samples,
            "instant": instant,
        }

    def _driven_at(self, frequency: float, chosen: dict[str, float]) -> dict[str, float]:
        """Every harmonic drive turns at the frequency of the record."""
        return dict.fromkeys(self._frequencies, frequency)

    def _ratio_slope(self, one: Free, value: float, number: int, chosen: dict[str, float]) -> float:
        """No ratio of frequencies here."""
        raise AssertionError

    def _chain(self, number: int, values: np.ndarray) -> tuple[list[str], np.ndarray, np.ndarray, np.ndarray]:
        """Paths, their values, which free parameters move them, and in which directions (one row each)."""
        active, given, moves, directions = self._active(number, values, derivatives=True)
        clock = [
            j for j, one in enumerate(self.free) if one.path == "nuisance:clock" and one.record == number
        ]
        if not clock or self.prepared[number].frequency is None:
            return active, given, moves, directions
        chain = np.zeros((len(self.free), len(active)))
        chain[moves] = directions
        for path in self._frequencies:
            chain[clock[0], active.index(path)] = self.prepared[number].frequency
        moves = chain.any(axis=1)
        return active, given, moves, chain[moves]

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
        if derivatives:
            active, given, moves, directions = self._chain(number, values)
            if by_start_alone:
                moves, directions = np.zeros_like(moves), directions[:0]
        else:
            active, given, moves, directions = self._active(number, values, derivatives=False)
        rows, inside = part["rows"], part["inside"]
        angle = self.crank_angle(number, values, part["starts"])
        start = np.column_stack([starts[rows], angle])
        result, motion, jacobian = self._fly(part, active, given, start, directions)
        length = inside.shape[1]
        failed = np.asarray(result.reason) != 0
        shown = padded_table(motion[0], inside)
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
            [hits.segment, hits.time, hits.speed_before, hits.speed_after, hits.side, result.contact]
        )
        if derivatives:
            out.steady[rows] = np.asarray(result.steady, bool)
            d = len(directions)
            out.transition[rows] = padded_table(jacobian[0][:, :, d : d + 2 * n], inside)
            crank = np.repeat(self._crank_slopes(number, part), np.diff(part["offsets"]), axis=0)
        for channel, name in enumerate(self.columns):
            sensor = prepared.sensor(name)
            if sensor is None:
                continue
            columns = slice(channel * length, (channel + 1) * length)
            shows, by_all = self._shown(sensor, part, motion, jacobian, active, given, directions)
            residual = (sensor.values[part["samples"]] - shows) / sensor.sigma
            out.residual[rows, columns] = np.nan_to_num(padded_table(residual, inside))
            out.used[rows, columns] = self.compared[rows, columns]
            if derivatives:
                by_parameter = by_all[:, -1:] * crank
                by_parameter[:, moves] += by_all[:, :d]
                table = np.nan_to_num(padded_table(by_all[:, d : d + 2 * n] / sensor.sigma, inside))
                out.by_start[rows, columns] = table
                out.by_parameter[rows, columns] = np.nan_to_num(
                    padded_table(by_parameter / sensor.sigma, inside)
                )

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

    def _fly(self, part: dict, active: list[str], given: np.ndarray, start: np.ndarray, directions) -> tuple:
        """Motion and Jacobian at the samples and, for accelerations, one and two instants later."""
        instant = part["instant"]
        times, offsets, each = part["times"], part["offsets"], 1
        if instant:
            each = 3
            times = (times[:, None] + instant * np.arange(each)).ravel()
            offsets = each * offsets
        result = self.model.coordinate_segments(
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


def joint_force(
    structure: Structure,
    path: str,
    motion: list[np.ndarray],
    jacobian: list[np.ndarray] | None,
    chosen: tuple,
    model,
) -> tuple[np.ndarray, np.ndarray | None]:
    """Force of a spring or soft contact [N] and its derivatives; positive: it pulls its second end back."""
    joint = structure.joint(path)
    active, given, directions = chosen
    n = structure.n
    s, u = motion[0][:, :n] @ joint.row, motion[0][:, n:] @ joint.row
    own = {
        name.rpartition(".")[2]: parameter.value
        for name, parameter in model.parameters.items()
        if name.startswith(f"{path}.")
    }
    indices = {name.rpartition(".")[2]: i for i, name in enumerate(active) if name.startswith(f"{path}.")}
    own |= {key: given[i] for key, i in indices.items()}
    force, by_extension, by_speed = _force(joint.law, own, s, u)
    if jacobian is None:
        return force, None
    slopes = by_extension[:, None] * np.einsum("kij,i->kj", jacobian[0][:, :n], joint.row)
    slopes += by_speed[:, None] * np.einsum("kij,i->kj", jacobian[0][:, n:], joint.row)
    for key, i in indices.items():
        step = FIT.joint_step * max(abs(own[key]), 1e-6)
        moved = (_force(joint.law, {**own, key: own[key] + step}, s, u)[0] - force) / step
        slopes[:, : len(directions)] += moved[:, None] * directions[:, i]
    return force, slopes


def _force(law: str, own: dict[str, float], s: np.ndarray, u: np.ndarray) -> tuple:
    """Force of a joint and its slopes over extension and speed."""
    if law in ("linear", "polynomial"):
        extension = s - own.get("free_length", 0.0)
        k, k2, k3, c = (own.get(key, 0.0) for key in ("stiffness", "quadratic", "cubic", "damping"))
        force = k * extension + k2 * extension**2 + k3 * extension**3 + c * u
        return force, k + 2 * k2 * extension + 3 * k3 * extension**2, np.full(s.shape, c)
    k, c = own["stiffness"], own.get("damping", 0.0)
    force, by_extension, by_speed = np.zeros(s.shape), np.zeros(s.shape), np.zeros(s.shape)
    for key, side in (("upper", 1.0), ("lower", -1.0)):
        depth = side * (s - own.get(key, side * np.inf))
        push = k * depth + side * c * u
        touches = (depth > 0) & ((push > 0) | (own.get("tension", 0.0) > 0))
        force[touches] = side * push[touches]
        by_extension[touches], by_speed[touches] = k, c
    return force, by_extension, by_speed
