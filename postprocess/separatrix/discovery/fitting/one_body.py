# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The likelihoods of one body: its motion is compared, or the force along a known motion."""

import numpy as np

from separatrix.discovery.fitting.catalogue import names_of_body
from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.forces import force_argument, force_needed
from separatrix.discovery.fitting.free_forces import families_of_body
from separatrix.discovery.fitting.hypotheses import Hypothesis, Motion, hypotheses, motion_of, of_known_motion
from separatrix.discovery.fitting.late import DELAY, Flown, flown_late
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.noise import Left, left_of_force, left_of_motion
from separatrix.discovery.fitting.problem import Problem
from separatrix.discovery.fitting.regions import Region, regions_of_body
from separatrix.discovery.fitting.response import columns_of_force, columns_of_motion, kicks_of_motion
from separatrix.discovery.fitting.rig_columns import columns_of_rig
from separatrix.discovery.measured.preflight import Prepared
from separatrix.discovery.measured.segments import padded_table
from separatrix.discovery.policy import FIT
from separatrix.discovery.wording import Units
from separatrix.library import Effect


def flight_tolerance(prepared: Prepared) -> float:
    """Return the relative tolerance of flights whose errors are far below the noise of a record."""
    farthest = np.max(np.abs(prepared.samples.x), initial=0.0)
    allowed = FIT.tolerance_share * prepared.sigma
    if allowed >= FIT.tolerance * farthest:
        return FIT.tolerance
    return float(max(FIT.tolerance_least, allowed / farthest))


class OneBody(Problem):
    """What both observations of one body have."""

    # laws that are tables can be added; a force is known by the variable that it depends on
    has_tables = True
    one_signal = True
    locates = False

    def effects(self, asked: tuple[str, ...] | None) -> list[str]:
        """Effects that may be missing, of those that were asked for."""
        return names_of_body(asked)

    def families(self, fit: Fit, mass: float) -> dict[str, np.ndarray]:
        """Columns of free forces by what they depend on."""
        return families_of_body(self, fit, mass)

    def imperfection_columns(self, fit: Fit, usual: float | None = None) -> np.ndarray:
        """Columns of imperfections of one standard deviation along a fit."""
        return columns_of_rig(self, fit, usual)

    def motion(self, fit: Fit, data: object, mass: float, natural: float) -> Motion:
        """The motion of a fit, along which hypotheses are tried."""
        return motion_of(self, fit, mass, natural)

    def hypotheses(self, training: Motion) -> list[Hypothesis]:
        """Dependences of a missing force."""
        return list(hypotheses(training))

    def regions(self, fit: Fit, mass: float, units: Units) -> list[Region]:
        """Bins of the motion in which a missing force is estimated."""
        return regions_of_body(self, fit, mass, units)

    def locations(self, names: list[str]) -> dict[str, str]:
        """Where effects act, in words: at the body."""
        return {}

    def _driven_at(self, frequency: float, chosen: dict[str, float]) -> dict[str, float]:
        """What makes the drive of the machine with the chosen values turn at a frequency [rad/s]."""
        ratio = self.model.parameters["drive.ratio"].value
        frequency_of_ratio = self.model.drive_frequency(chosen | {"drive.ratio": ratio})
        return {"drive.ratio": ratio * frequency / frequency_of_ratio}

    def _follow_drive(self, number: int, values: np.ndarray, chosen: dict, chain: np.ndarray) -> None:
        """Derivatives of drive.ratio, which keeps the frequency that of the record."""
        row = list(chosen).index("drive.ratio")
        for j, one in enumerate(self.free):
            chain[row, j] = self._ratio_slope(one, values[j], number, chosen) * one.slope(values[j])

    def _ratio_slope(self, one: Free, value: float, number: int, chosen: dict[str, float]) -> float:
        """How drive.ratio follows a parameter, so that the frequency stays that of the record."""
        ratio = chosen["drive.ratio"]
        if one.path == "nuisance:clock" and one.record == number:
            return ratio / (1 + value)
        if one.path not in ("restoring.stiffness", "restoring.moment", "body.mass"):
            return 0.0
        step = 1e-5 * abs(chosen[one.path])
        ends = [
            self.model.drive_frequency({**chosen, one.path: chosen[one.path] + sign * step})
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / (2 * step)
        return -ratio * slope / (0.5 * (ends[0] + ends[1]))


class BodyInMotion(OneBody):
    """Position, and velocity where it is measured, of one body."""

    # what a linearised fit can do, and which experiments and searches there are
    exact = False
    fits_imperfections = True
    has_memories = True
    experiment = "drive"

    @property
    def channels(self) -> int:
        """How many of x and v are compared."""
        return 2 if any(part["v"] is not None for part in self._parts) else 1

    def cannot_show(self, effect: Effect) -> str:
        """Why an effect would change nothing here; '' if it may."""
        return ""

    def observed(self, fit: Fit) -> np.ndarray:
        """What is compared, as the machine has it."""
        return fit.evaluation.x

    def unit(self, units: Units) -> str:
        """Its unit."""
        return units.position

    def force_columns(self, fit: Fit, forces: np.ndarray, mass: float) -> np.ndarray:
        """Columns (segments, width, q) of forces (segments, length, q) [N] given at the samples."""
        return columns_of_motion(self, fit, forces, mass)

    def kick_columns(self, fit: Fit, kicks: np.ndarray) -> np.ndarray:
        """Columns of sudden changes of velocity (segments, length, q) [m/s] at the samples."""
        return kicks_of_motion(self, fit, kicks)

    def left_of_noise(self, fit: Fit, channel: int, mass: float) -> Left:
        """Residuals from which the noise is measured."""
        return left_of_motion(self, fit, channel, mass)

    def imitating(self, motion: Evaluation) -> "BodyInMotion":
        """The same problem with a computed motion in place of x and v as they were measured."""
        found = self.like(self.model, self.free)
        for part in found._parts:
            part["x"] = motion.x[part["rows"]][part["inside"]]
            if part["v"] is not None:
                part["v"] = motion.v[part["rows"]][part["inside"]]
        return found

    def _part(self, number: int) -> dict:
        prepared, part = self.prepared[number], super()._part(number)
        fitted = prepared.samples
        first = self.segments.first[part["rows"]]
        parameters = self.model.parameters
        mass = parameters["body.mass"].value if "body.mass" in parameters else 1.0
        return part | {
            "x": fitted.x[part["samples"]],
            "v": None if fitted.v is None else fitted.v[part["samples"]],
            "force": force_argument(prepared, fitted.offset[first], mass),
            "tolerance": flight_tolerance(prepared),
        }

    def _evaluate_record(
        self,
        number: int,
        part: dict,
        values: np.ndarray,
        starts: np.ndarray,
        wanted: tuple[bool, bool],
        out: Evaluation,
    ) -> None:
        prepared = self.prepared[number]
        derivatives, by_start_alone = wanted
        active, given, moves, directions = self._active(number, values, derivatives)
        if derivatives and by_start_alone:
            moves, directions = np.zeros_like(moves), directions[:0]
        start = np.column_stack([starts[part["rows"]], self.crank_angle(number, values, part["starts"])])
        seen = self._simulate(number, part, active, given, start, directions)
        result = seen.shown
        rows, inside = part["rows"], part["inside"]
        length = inside.shape[1]
        failed = np.asarray(result.reason) != 0
        finite = padded_table(np.isfinite(result.x) & np.isfinite(result.v), inside)
        failed |= np.any(inside & (finite == 0), axis=1)
        out.failed[rows] = failed
        out.x[rows] = padded_table(result.x, inside)
        out.v[rows] = padded_table(result.v, inside)
        out.hits[rows] = result.impacts
        hits = result.impact
        out.impacts[number] = np.column_stack(
            [hits.segment, hits.time, hits.speed_before, hits.speed_after, hits.side]
        )
        jacobians = (None, None)
        if derivatives:
            out.steady[rows] = np.asarray(result.steady, bool)
            jacobians = self._derivatives(number, part, moves, seen)
            n = len(directions)
            out.transition[rows, :, 0, :] = padded_table(result.jacobian[:, 0, n : n + 2], inside)
            out.transition[rows, :, 1, :] = padded_table(result.jacobian[:, 1, n : n + 2], inside)
        spread = prepared.samples.spread(prepared.memory)[part["samples"]]
        for channel, (measured, computed, size) in enumerate(
            ((part["x"], result.x, prepared.sigma), (part["v"], seen.v, prepared.velocity_sigma))
        ):
            if measured is None:
                continue
            columns = slice(channel * length, (channel + 1) * length)
            sigma = size * spread
            out.residual[rows, columns] = np.nan_to_num(padded_table((measured - computed) / sigma, inside))
            out.used[rows, columns] = self.compared[rows, columns]
            if derivatives:
                by_start, by_parameter = jacobians[channel]
                out.by_start[rows, columns] = np.nan_to_num(padded_table(by_start / sigma[:, None], inside))
                out.by_parameter[rows, columns] = np.nan_to_num(
                    padded_table(by_parameter / sigma[:, None], inside)
                )

    def _simulate(
        self,
        number: int,
        part: dict,
        active: list[str],
        given: np.ndarray,
        start: np.ndarray,
        directions: np.ndarray | None,
    ) -> Flown:
        more = {} if part["force"] is None else {"force": part["force"]}
        more |= {
            "derivatives": directions is not None,
            "directions": directions,
            "tolerance": part["tolerance"],
        }
        flight = (active, given, start, part["offsets"], part["times"])
        if DELAY in active and part["v"] is not None and self.prepared[number].frequency is not None:
            frequency = self.model.drive_frequency(dict(zip(active, given, strict=True)))
            return flown_late(self.model, *flight, frequency, **more)
        result = self.model.segments(*flight, **more)
        velocity = None if directions is None else result.jacobian[:, 1]
        return Flown(result, result.v, velocity)

    def _derivatives(self, number: int, part: dict, moves: np.ndarray, seen: Flown) -> list:
        """Derivatives of x and v by the start, and by the free parameters through machine and crank."""
        n = np.count_nonzero(moves)
        crank = np.repeat(self._crank_slopes(number, part), np.diff(part["offsets"]), axis=0)
        found = []
        for whole in (seen.shown.jacobian[:, 0], seen.velocity_jacobian):
            by_parameter = whole[:, n + 2 : n + 3] * crank
            by_parameter[:, moves] += whole[:, :n]
            found.append((whole[:, n : n + 2], by_parameter))
        return found


class BodyInForce(OneBody):
    """The force that drives one body along its known motion."""

    # the force is nearly linear in the parameters; nothing moves, so that nothing is carried on
    exact = True
    unknowns = 0
    channels = 1
    fits_imperfections = False
    has_memories = True
    experiment = "motion of the joint"

    def cannot_show(self, effect: Effect) -> str:
        """Why an effect would change nothing here; '' if it may."""
        return "" if effect.acts == "flight" else "it does nothing to the force along a known motion"

    def hypotheses(self, training: Motion) -> list[Hypothesis]:
        """Dependences of a missing force, also those that a force shows alone."""
        return list(hypotheses(training, of_known_motion(training)))

    def observed(self, fit: Fit) -> np.ndarray:
        """What is compared, as the machine has it."""
        return fit.evaluation.force

    def unit(self, units: Units) -> str:
        """Its unit."""
        return units.force

    def force_columns(self, fit: Fit, forces: np.ndarray, mass: float) -> np.ndarray:
        """Columns of forces: a force on the body in its direction reduces the measured one."""
        return columns_of_force(self, fit, forces)

    def kick_columns(self, fit: Fit, kicks: np.ndarray) -> np.ndarray:
        """A known motion has no kicks."""
        return np.zeros_like(kicks)

    def left_of_noise(self, fit: Fit, channel: int, mass: float) -> Left:
        """Residuals from which the noise is measured."""
        return left_of_force(self, fit)

    def imitating(self, motion: Evaluation) -> None:
        """No other motion than the measured one is compared."""

    def _links(self, prepared: Prepared, rows: np.ndarray) -> np.ndarray:
        return super()._links(prepared, rows) * prepared.driven.moves[self.segments.index[rows]][:, :-1]

    def _evaluate_record(
        self,
        number: int,
        part: dict,
        values: np.ndarray,
        starts: np.ndarray,
        wanted: tuple[bool, bool],
        out: Evaluation,
    ) -> None:
        """Residuals of the force of a record."""
        if out.force is None:
            out.force = np.zeros(self.segments.inside.shape)
        derivatives, _ = wanted
        prepared, rows, inside, at = self.prepared[number], part["rows"], part["inside"], part["samples"]
        motion, record, length = prepared.driven, prepared.record, inside.shape[1]

        def needed(chosen: np.ndarray) -> np.ndarray:
            machine = self.machine_values(number, chosen)
            return force_needed(self.model, machine, motion, record.force, record.pieces)[at]

        force, sigma, used = needed(values), prepared.deviation(at), motion.moves[at]
        for table, at_samples in ((out.x, motion.x[at]), (out.v, motion.v[at]), (out.force, force)):
            table[rows] = padded_table(at_samples, inside)
        out.used[rows, :length] = padded_table(used.astype(float), inside)
        out.residual[rows, :length] = padded_table(used * (record.force[at] - force) / sigma, inside)
        if derivatives:
            slopes = np.zeros((at.size, values.size))
            for j, one in enumerate(self.free):
                # nearly linear; derivatives of so short a flight are not exact for all effects
                step = (
                    FIT.force_step
                    * one.size
                    * (1 if values[j] + FIT.force_step * one.size <= one.upper else -1)
                )
                moved = values + step * (np.arange(values.size) == j)
                slopes[:, j] = (needed(moved) - force) / (step * sigma)
            out.by_parameter[rows, :length] = padded_table(slopes, inside)
