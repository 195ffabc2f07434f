# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of several sensors ready to be fitted: smoothed, cut, with starts of all coordinates.

An observer guesses what no sensor shows: the machine of the case is simulated along the record, and measured
coordinates are reset at short intervals. A damped machine forgets the rest of its start. Then starts are
fitted segment by segment, each from the end of the one before.
"""

from dataclasses import dataclass, field

import numpy as np

from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.data import Data, oscillation_samples
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.machine import Free, bounds_of, drive_nuisances
from separatrix.discovery.fitting.noise import noise_of
from separatrix.discovery.fitting.rescue import solve_starts
from separatrix.discovery.measured.bodies import Structure, structure_of
from separatrix.discovery.measured.segments import cut
from separatrix.discovery.measured.sensors import SensedPrepared
from separatrix.discovery.measured.smoother import Smoothed
from separatrix.discovery.policy import FIT
from separatrix.errors import SeparatrixError

# parameters of joints that records hardly determine, or that another parameter represents
_FIXED = ("free_length", "exponent", "tension", "velocity")


@dataclass
class SensedData(Data):
    """Records of several sensors; `bodies` are the smoothed positions and speeds by sensor."""

    model: object = None
    bodies: list[dict[str, Smoothed]] = field(default_factory=list)
    _guesses: dict[tuple, np.ndarray] = field(default_factory=dict)

    @property
    def structure(self) -> Structure:
        """What the machine is made of."""
        return structure_of(self.model)

    def problem(self, model, stage: int, free: list[Free]) -> CoordinateProblem:
        """The fit of a model to the segments of a stage."""
        return CoordinateProblem(model, self.prepared, self.stages[stage], free)

    def unknowns(self, model) -> list[Free]:
        """What is free in the base machine."""
        forces = any(sensor.kind == "F" for one in self.prepared for sensor in one.sensors)
        return joint_parameters(model, forces) + drive_nuisances(model, self.prepared)

    def measured_by_sensor(self, problem: CoordinateProblem, fit: Fit) -> bool:
        """Measure the noise of each sensor."""
        measure_sensors(self, problem, fit)
        return True

    def details(self, number: int) -> dict[str, tuple[np.ndarray, dict]]:
        """What each sensor shows: there is no motion of one body."""
        sensors = {one.name: (one.values, {"sigma": one.sigma}) for one in self.prepared[number].sensors}
        return sensors | {"impacts": (np.zeros((0, 6)), {})}

    def smoothed_starts(self, stage: int) -> np.ndarray:
        """Starts (segments, 2 n) of a stage: smoothed where there is a sensor, guessed elsewhere."""
        return self._at_starts(stage, [self.guess(r) for r in range(len(self.prepared))])

    def smoothed_errors(self, stage: int) -> np.ndarray:
        """Standard errors of those starts."""
        n, tables = self.structure.n, []
        for r, seen in enumerate(self.bodies):
            guess = self.guess(r)
            table = np.tile(FIT.guessed * np.std(guess, axis=0), (guess.shape[0], 1))
            for name, one in seen.items():
                body = self.structure.names.index(name[2:])
                error = np.sqrt(np.einsum("kii->ki", one.covariance))
                if name[0] == "x":
                    table[:, body] = error[:, 0]
                if name[0] == "v" or f"v.{name[2:]}" not in seen:
                    table[:, n + body] = error[:, 1 if name[0] == "x" else 0]
            tables.append(table)
        return self._at_starts(stage, tables)

    def carried_starts(self, stage: int, known: int, fit: Fit) -> np.ndarray:
        """Starts of a stage from the motion fitted at stage `known`; guessed where it failed."""
        starts = self.smoothed_starts(stage)
        old, new = self.stages[known], self.stages[stage]
        for r, one in enumerate(self.prepared):
            motion = np.full((one.record.t.size, 2 * self.structure.n), np.nan)
            for i in np.flatnonzero((old.record == r) & ~fit.evaluation.failed):
                inside = old.inside[i]
                motion[old.index[i, inside]] = fit.evaluation.motion[i, inside]
            rows = np.flatnonzero(new.record == r)
            carried = motion[new.first[rows]]
            known_rows = np.all(np.isfinite(carried), axis=1)
            starts[rows[known_rows]] = carried[known_rows]
        return starts

    def _at_starts(self, stage: int, tables: list[np.ndarray]) -> np.ndarray:
        segments = self.stages[stage]
        found = np.zeros((segments.count, 2 * self.structure.n))
        for r, table in enumerate(tables):
            rows = segments.record == r
            found[rows] = table[segments.first[rows]]
        return found

    def guess(self, number: int) -> np.ndarray:
        """Positions and velocities of all coordinates at the samples of a record (samples, 2 n)."""
        prepared = self.prepared[number]
        key = (number, prepared.phase, prepared.frequency)
        if key not in self._guesses:
            known = self.measured(number)
            unseen = np.isnan(known[0])
            self._guesses = {one: table for one, table in self._guesses.items() if one[0] != number}
            self._guesses[key] = known
            if unseen.any():
                observed = self._observed(prepared, known, unseen)
                self._guesses[key] = self._chained(number, known, observed, unseen)
        return self._guesses[key]

    def measured(self, number: int) -> np.ndarray:
        """Measured positions and velocities; NaN elsewhere."""
        structure, seen = self.structure, self.bodies[number]
        n = structure.n
        table = np.full((self.prepared[number].record.t.size, 2 * n), np.nan)
        for name, one in seen.items():
            body = structure.names.index(name[2:])
            if name[0] == "x":
                table[:, body] = one.state[:, 0]
                if np.isnan(table[0, n + body]):
                    table[:, n + body] = one.state[:, 1]
            else:
                table[:, n + body] = one.state[:, 0]
        return table

    def _chained(
        self, number: int, known: np.ndarray, observed: np.ndarray, unseen: np.ndarray
    ) -> np.ndarray:
        """The motion of the machine of the case that follows the sensors, segment by segment.

        The start of each is fitted from the end of the segment before and from the guess of the observer.
        """
        whole = self.problem(self.model, FIT.chained_stage, [])
        rows = np.flatnonzero(whole.segments.record == number)
        begins = whole.segments.first[rows]
        starts, costs = np.full((rows.size, known.shape[1]), np.nan), np.full(rows.size, np.inf)
        motions: list[np.ndarray] = [np.zeros(0)] * rows.size

        def follow(i: int, tried: list[np.ndarray]) -> None:
            one = whole.of_segments(np.full(len(tried), rows[i]))
            found, cost = solve_starts(one, np.zeros(0), np.array(tried))
            best = int(np.argmin(cost))
            if cost[best] < costs[i]:
                flown = one.evaluate(np.zeros(0), found, derivatives=False)
                starts[i], costs[i] = found[best], cost[best]
                motions[i] = flown.motion[best, : whole.segments.last[rows[i]] - begins[i]]

        for i, first in enumerate(begins):
            tried = [observed[first]]
            if i and motions[i - 1].size:
                tried.append(np.where(unseen, motions[i - 1][-1], known[first]))
            follow(i, tried)
        # a drive is periodic: a lost segment may move as its neighbours do
        lost = np.flatnonzero(costs > FIT.chain_lost * np.median(costs))
        for i in lost:
            near = [
                j
                for j in np.argsort(np.abs(np.arange(rows.size) - i))[1 : 1 + FIT.chain_neighbours]
                if j not in lost
            ]
            if near:
                follow(i, [np.where(unseen, starts[j], known[begins[i]]) for j in near])
        found = observed.copy()
        for first, motion in zip(begins, motions, strict=True):
            if motion.size:
                found[first : first + len(motion), unseen] = motion[:, unseen]
        return found

    def as_recorded(self, prepared: SensedPrepared) -> tuple[np.ndarray, list[str]]:
        """Values of parameters that differ between records, and their paths."""
        return np.zeros(0), []

    def fly(self, model, active: list, values: np.ndarray, start: np.ndarray, first, times) -> object:
        """Segments of a model without derivatives."""
        exact = {"derivatives": False, "tolerance": FIT.tolerance_of_bodies}
        return model.segments(active, values, start, first, times, **exact)

    def _observed(self, prepared: SensedPrepared, known: np.ndarray, unseen: np.ndarray) -> np.ndarray:
        """The motion of the machine of the case, corrected by the measurement."""
        model, t = self.model, prepared.record.t
        period = prepared.period_samples or oscillation_samples(_moving(prepared))
        every = max(1, round(period / FIT.corrections))
        values, active = self.as_recorded(prepared)
        if prepared.frequency is not None:
            active = [
                path for path in model.parameters if path.startswith("drive.") and path.endswith(".frequency")
            ]
            values = np.full(len(active), prepared.frequency)
        found = known.copy()
        state = np.where(unseen, 0.0, known[0])
        for first in range(0, t.size, every):
            rows = np.arange(first, min(first + every + 1, t.size))
            state = np.where(unseen, state, known[first])
            angle = 0.0
            if prepared.frequency is not None:
                angle = prepared.phase + prepared.frequency * (t[first] - prepared.origin)
            start, offsets = np.append(state, angle)[None], np.array([0, rows.size])
            flown = self.fly(model, active, values, start, offsets, t[rows] - t[first])
            if flown.reason[0] == 0:
                found[np.ix_(rows[:-1], unseen)] = flown.motion[:-1, : state.size][:, unseen]
                state = flown.motion[-1, : state.size]
            else:
                # the measurement lies beyond a stop of the case
                found[np.ix_(rows[:-1], unseen)] = state[unseen]
        found[-1, unseen] = state[unseen]
        return found


def gather_sensed(
    prepared: list[SensedPrepared], periods: float, seconds: float | None, model, kind: type = SensedData
) -> SensedData:
    """Smooth and cut records of several sensors, as `gather` those of one body, into data of a kind."""
    structure = structure_of(model)
    bodies, calm, lengths = [], [], []
    for one in prepared:
        record = one.record
        oscillation = oscillation_samples(_moving(one))
        seen = {
            sensor.name: one.smoothed(sensor, one.period_samples or oscillation)
            for sensor in one.sensors
            if sensor.kind in "xv"
        }
        bodies.append(seen)
        for name, moved in seen.items():
            if name[0] == "x":
                one.leave_out(moved.impacts)
        calm.append(_calm(structure, record.t, seen))
        unseen = sum(name[0] == "x" for name in seen) < structure.n
        share = max(periods, FIT.unseen_periods) if unseen else periods
        period = one.period_samples or oscillation
        length = seconds / record.interval if seconds is not None else share * period
        lengths.append(int(np.clip(length, FIT.fewest_segments, record.t.size / 3)))
    stages = [
        cut(
            [one.samples for one in prepared],
            calm,
            [max(FIT.fewest_segments, int(share * n)) for n in lengths],
        )
        for share in FIT.stage_lengths
    ]
    for number, one in enumerate(prepared):
        if not np.any(stages[-1].record == number):
            raise SeparatrixError(f"{one.record.file}{one.record.part}: gaps leave no interval to be fitted")
    return kind(prepared, calm, stages, model=model, bodies=bodies)


def _moving(one: SensedPrepared) -> np.ndarray:
    """A signal that oscillates with the machine: the first position, else the first speed, or what it is."""
    if one.record.has_position:
        return one.record.x
    return next((sensor.values for sensor in one.sensors if sensor.kind == "v"), one.record.x)


def _calm(structure: Structure, t: np.ndarray, seen: dict[str, Smoothed]) -> Smoothed:
    """A motion that is slow where any speed along a joint is, because friction switches there."""
    speeds = {name[2:]: one.state[:, 1 if name[0] == "x" else 0] for name, one in seen.items()}
    slowest = np.full(t.size, np.inf)
    rows = [np.eye(structure.n)[structure.names.index(name)] for name in speeds]
    rows += [one.row for one in structure.joints if one.path.startswith("friction.")]
    for row in rows:
        if all(name in speeds for name, share in zip(structure.names, row, strict=True) if share):
            pairs = zip(structure.names, row, strict=True)
            speed = sum(share * speeds[name] for name, share in pairs if share)
            slowest = np.minimum(slowest, np.abs(speed) / max(float(np.sqrt(np.mean(speed**2))), 1e-300))
    impacts = np.concatenate(
        [np.zeros(0, int), *(one.impacts for name, one in seen.items() if name[0] == "x")]
    )
    impacts = np.unique(impacts)
    state = np.zeros((t.size, 3))
    state[:, 1] = slowest
    return Smoothed(t, state, np.zeros((t.size, 3, 3)), impacts)


def joint_parameters(model, forces: bool) -> list[Free]:
    """The parameters of a structure that records can determine.

    Without a measured force the common scale of masses and forces is undetermined: the heaviest body keeps
    its mass.
    """
    structure = structure_of(model)
    kept = None if forces else f"body.{structure.names[int(np.argmax(structure.mass))]}.mass"
    found, tied = [], _tied(model)
    for path, parameter in model.parameters.items():
        family, _, key = path.split("[")[0].partition(".")
        key = key.rpartition(".")[2]
        value = float(parameter.value)
        if path == kept or path in tied.values() or not _is_fitted(family, key, value):
            continue
        if family == "body" and path.split(".")[1] not in structure.names:
            continue
        lower, upper = bounds_of(parameter)
        if key in ("mass", "stiffness", "moment") and value > 0:
            lower = max(lower, FIT.least_of_joint * value)
        found.append(Free(path, value, lower, upper, abs(value) or 1.0, also=tied.get(path)))
    return found


def _is_fitted(family: str, key: str, value: float) -> bool:
    """Whether a parameter of a case is fitted: one of an active law."""
    if family == "body":
        return key == "mass"
    if family not in ("spring", "friction", "contact") or key in _FIXED:
        return False
    return (
        key in ("upper", "lower", "restitution")
        or value > 0
        or (key in ("quadratic", "cubic") and value != 0)
    )


def _tied(model) -> dict[str, str]:
    """Break-away forces that are those of sliding."""
    parameters = model.parameters
    found = {}
    for path, parameter in parameters.items():
        static = path.removesuffix(".force") + ".static_force"
        if path.startswith("friction.") and path.endswith(".force") and static in parameters:
            other = parameters[static].value
            if other == parameter.value:
                found[path] = static
    return found


def measure_sensors(data: SensedData, problem: CoordinateProblem, fit: Fit) -> None:
    """Set the noise of all sensors that records do not state, and its memory."""
    memories, factors = [], {}
    for channel, name in enumerate(problem.columns):
        found = noise_of(problem, fit, channel, 1.0)
        memories.append(found.memory)
        for number, factor in found.factors.items():
            sensor = data.prepared[number].sensor(name)
            if sensor is not None:
                factors[id(sensor)] = (sensor, factor)
    # noise that is known does not grow with a misfit
    white = [1.0 if sensor.stated else factor**2 for sensor, factor in factors.values()]
    misfit = fit.reduced_chi2 / max(float(np.median(white or [1.0])), 1e-300)
    for sensor, factor in factors.values():
        if not sensor.stated:
            sensor.sigma *= factor
    for one in data.prepared:
        one.sigma = one.sensors[0].sigma
        # of all sensors alike, or none
        one.memory = float(np.median(memories)) if misfit < FIT.misfit_of_sensors else 0.0
