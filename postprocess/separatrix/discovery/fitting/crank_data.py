# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of a machine with a motor ready to be fitted, and their likelihood: starts of body and crank."""

import numpy as np

from separatrix.discovery.fitting.coordinates import CoordinateProblem
from separatrix.discovery.fitting.machine import CRANK_ZERO, Free, bounds_of
from separatrix.discovery.fitting.motor_effects import names_with_motor
from separatrix.discovery.fitting.sensed import SensedData
from separatrix.discovery.measured.bodies import CRANKED
from separatrix.discovery.measured.cranks import ANGLE
from separatrix.discovery.measured.sensors import SensedPrepared, Sensor
from separatrix.discovery.policy import FIT

_TURN = 2 * np.pi
_ANGLE = CRANKED.index("crank")
# parameters that no motion at one scale of forces determines, or that another one represents
_FIXED = ("mass", "gravity", "free_length", "stribeck_exponent")
_TIED = ("friction.static_coefficient", "friction.kinetic_coefficient")


class CrankProblem(CoordinateProblem):
    """Records of body and crank cut into segments, a machine with a motor, and what is free."""

    def effects(self, asked: tuple[str, ...] | None) -> list[str]:
        """Effects with their locations, of those that were asked for."""
        return names_with_motor(self.model, asked)

    def machine_values(self, number: int, values: np.ndarray) -> dict[str, float]:
        """Values of the machine, with what the motor ran at in a record."""
        chosen = super().machine_values(number, values)
        for path, share in self._supplies(number).items():
            chosen[path] = share * chosen.get(path, self.model.parameters[path].value)
        return chosen

    def _supplies(self, number: int) -> dict[str, float]:
        """What the motor ran at in a record over that of the case."""
        of_case = self.model.parameters
        return {path: value / of_case[path].value for path, value in self.prepared[number].supply.items()}

    def _active(self, number: int, values: np.ndarray, derivatives: bool) -> tuple:
        active, given, moves, directions = super()._active(number, values, derivatives)
        if directions is not None:
            for path, share in self._supplies(number).items():
                directions = directions.copy()
                directions[:, active.index(path)] *= share
        return active, given, moves, directions

    def _missed(self, sensor: Sensor, difference: np.ndarray, values: np.ndarray) -> np.ndarray:
        if sensor.name != ANGLE:
            return difference
        found = [value for one, value in zip(self.free, values, strict=True) if one.path == CRANK_ZERO]
        zero = found[0] if found else self.prepared[0].zero
        return np.mod(difference - zero + np.pi, _TURN) - np.pi

    def _add_slopes(self, sensor: Sensor, by_parameter: np.ndarray) -> None:
        if sensor.name == ANGLE:
            by_parameter[:, [one.path == CRANK_ZERO for one in self.free]] += 1.0

    def _fly(self, part: dict, active: list[str], given: np.ndarray, start: np.ndarray, directions) -> tuple:
        """Motion, current and Jacobian at the samples and one and two instants later."""
        instant, times, offsets, each = part["instant"], part["times"], part["offsets"], 1
        if instant:
            each = 3
            times = (times[:, None] + instant * np.arange(each)).ravel()
            offsets = each * offsets
        result = self.model.segments(
            active,
            given,
            following(start),
            offsets,
            times,
            derivatives=directions is not None,
            tolerance=FIT.tolerance_of_cranks,
            directions=directions,
        )
        result.motion[:, _ANGLE] = np.mod(result.motion[:, _ANGLE], _TURN)
        motion = [result.motion[k::each] for k in range(each)]
        if directions is None:
            return result, motion, None
        return result, motion, [result.jacobian[k::each] for k in range(each)]

    def _shown(self, sensor: Sensor, part: dict, motion, jacobian, active, given, directions) -> tuple:
        if sensor.kind == "i":
            return motion[0][:, -1], None if jacobian is None else jacobian[0][:, -1]
        return super()._shown(sensor, part, motion, jacobian, active, given, directions)


class CrankData(SensedData):
    """Records of body and crank."""

    def problem(self, model, stage: int, free: list[Free]) -> CrankProblem:
        """The fit of a model to the segments of a stage."""
        return CrankProblem(model, self.prepared, self.stages[stage], free)

    def unknowns(self, model) -> list[Free]:
        """What is free in the base machine, and the zero of the crank."""
        parameters, found = model.parameters, []
        static, kinetic = (parameters.get(path) for path in _TIED)
        tied = static is not None and static.value == kinetic.value
        for path, parameter in parameters.items():
            family, _, key = path.partition(".")
            value = float(parameter.value)
            if family not in ("restoring", "friction", "contact") or key in _FIXED:
                continue
            if (tied and path == _TIED[0]) or (family != "contact" and not value > 0):
                continue
            lower, upper = bounds_of(parameter)
            if key == "stiffness":
                lower = max(lower, FIT.least_of_joint * value)
            also = _TIED[0] if tied and path == _TIED[1] else None
            found.append(Free(path, value, lower, upper, abs(value) or 1.0, also=also))
        return [*found, _zero(self.prepared[0].zero)]

    def find_zeros(self, model, free: list[Free]) -> None:
        """Try the zeros of a turn where pulses show the turns alone."""
        if all(one.sensor(ANGLE).known is None for one in self.prepared):
            return
        at = next(i for i, one in enumerate(free) if one.path == CRANK_ZERO)
        turns = np.arange(FIT.phases) * _TURN / FIT.phases
        best = float(turns[int(np.argmin([self._misfit(model, free, turn) for turn in turns]))])
        step = _TURN / FIT.phases / 2
        while step > FIT.zero_step:
            tried = [best - step, best, best + step]
            best = tried[int(np.argmin([self._misfit(model, free, turn) for turn in tried]))]
            step /= 2
        self._take_zero(best)
        free[at] = _zero(best)

    def _misfit(self, model, free: list[Free], zero: float) -> float:
        """Median misfit of short segments from their smoothed starts."""
        self._take_zero(zero)
        values = np.array([zero if one.path == CRANK_ZERO else one.value for one in free])
        found = self.problem(model, 0, free).evaluate(values, self.smoothed_starts(0), derivatives=False)
        squares = np.sum(found.residual**2 * found.used, axis=1)
        return float(np.median(np.where(found.failed, np.inf, squares)))

    def take_zeros(self, free: list[Free]) -> None:
        """Take the zero that a fit to other records has."""
        for one in free:
            if one.path == CRANK_ZERO:
                self._take_zero(one.value)

    def _take_zero(self, zero: float) -> None:
        for one in self.prepared:
            one.zero = zero
        self._guesses.clear()

    def measured(self, number: int) -> np.ndarray:
        """Measured positions and velocities, the angle of the crank within a turn; NaN elsewhere."""
        table = super().measured(number)
        table[:, _ANGLE] = np.mod(table[:, _ANGLE] - self.prepared[number].zero, _TURN)
        return table

    def as_recorded(self, prepared: SensedPrepared) -> tuple[np.ndarray, list[str]]:
        """What the motor ran at."""
        return np.array(list(prepared.supply.values()), float), list(prepared.supply)

    def fly(self, model, active: list, values: np.ndarray, start: np.ndarray, first, times) -> object:
        """Segments of a model without derivatives."""
        exact = {"derivatives": False, "tolerance": FIT.tolerance_of_cranks}
        found = model.segments(active, values, following(start), first, times, **exact)
        found.motion[:, _ANGLE] = np.mod(found.motion[:, _ANGLE], _TURN)
        return found


def following(start: np.ndarray) -> np.ndarray:
    """Starts whose current follows the speed, from those whose last number is the angle of a clock."""
    return np.column_stack([start[:, :-1], np.full(len(start), np.nan)])


def _zero(value: float) -> Free:
    # a turn either way: a fit may pass the end of one
    return Free(CRANK_ZERO, float(value), -_TURN, 2 * _TURN, 0.01)
