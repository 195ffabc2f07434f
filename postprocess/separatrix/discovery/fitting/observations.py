# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is observed of a machine: how records are prepared and gathered for each kind of likelihood."""

from dataclasses import dataclass
from typing import Protocol

from separatrix.discovery.fitting.catalogue import Scales, names_of_body
from separatrix.discovery.fitting.crank_data import CrankData
from separatrix.discovery.fitting.data import Data, gather, scales_of
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.joint_effects import names_at_joints
from separatrix.discovery.fitting.locations import SensedScales, location_scales
from separatrix.discovery.fitting.motor_effects import names_with_motor
from separatrix.discovery.fitting.sensed import gather_sensed
from separatrix.discovery.measured.bodies import (
    has_motor,
    is_pair,
    is_structure,
    pair_as_structure,
    structure_of,
)
from separatrix.discovery.measured.cranks import LAWS, law_of, prepare_crank
from separatrix.discovery.measured.in_force import prepare_force
from separatrix.discovery.measured.preflight import Prepared, prepare
from separatrix.discovery.measured.records import Record
from separatrix.discovery.measured.sensors import prepare_sensors
from separatrix.discovery.options import Options
from separatrix.errors import USAGE, SeparatrixError
from separatrix.library import Model


class Observation(Protocol):
    """Records of one kind: prepared, gathered, and the scales that effects have in them."""

    model: Model
    # divisor of forces
    mass: float

    def effects(self, asked: tuple[str, ...] | None) -> list[str]:
        """Effects that may be missing, of those that were asked for."""

    def prepare(self, record: Record, rest: Record | None) -> Prepared:
        """Measure what the header does not state; refuse a record of another kind."""

    def gather(self, prepared: list[Prepared], options: Options) -> Data:
        """Smooth and cut records."""

    def scales(self, data: Data, fitted: Fitted) -> Scales | SensedScales:
        """Typical sizes in the records."""


def observation_of(model: Model, compare: str) -> Observation:
    """The observation of a machine; pairs become structures."""
    if has_motor(model):
        return OfMotor(model, compare)
    if is_pair(model):
        model = pair_as_structure(model)
    if not is_structure(model):
        return OfForce(model) if compare == "force" else OfMotion(model)
    structure_of(model)
    return OfBodies(model, compare)


@dataclass(frozen=True)
class OfMotion:
    """The motion of one body."""

    model: Model

    @property
    def mass(self) -> float:
        """Mass of the body [kg], 1 where it has none."""
        parameters = self.model.parameters
        return parameters["body.mass"].value if "body.mass" in parameters else 1.0

    def effects(self, asked: tuple[str, ...] | None) -> list[str]:
        """Effects that may be missing, of those that were asked for."""
        return names_of_body(asked)

    def prepare(self, record: Record, rest: Record | None) -> Prepared:
        """Measure the noise of x, find the drive."""
        self._check(record, rest)
        return prepare(record, self.model, rest)

    def _check(self, record: Record, rest: Record | None) -> None:
        """Refuse what is not of one body."""
        if record.sensors:
            found = ", ".join(record.sensors)
            raise SeparatrixError(
                f"{record.file}: found columns {found}, allowed for a base machine of one body x, v"
            )
        for one in (record, rest):
            if one is not None and not one.has_position:
                raise SeparatrixError(
                    f"{one.file}: found a speed and no x, allowed where the machine is written joint by "
                    "joint (body.NAME, spring.NAME, also of one body), without impacts: there each start is "
                    "fitted"
                )

    def gather(self, prepared: list[Prepared], options: Options) -> Data:
        """Smooth and cut records."""
        return gather(prepared, options.segment_periods, options.segment_seconds)

    def scales(self, data: Data, fitted: Fitted) -> Scales:
        """Typical sizes in the records."""
        return scales_of(data, self.model)


class OfForce(OfMotion):
    """The force that drives one body along a known motion."""

    def prepare(self, record: Record, rest: Record | None) -> Prepared:
        """Measure the noise of the force."""
        self._check(record, rest)
        return prepare_force(record, self.model, rest)


@dataclass(frozen=True)
class OfBodies:
    """Sensors on several bodies and in their joints."""

    model: Model
    compare: str = "motion"
    mass: float = 1.0

    def effects(self, asked: tuple[str, ...] | None) -> list[str]:
        """Effects with their locations, of those that were asked for."""
        return names_at_joints(self.model, asked)

    def prepare(self, record: Record, rest: Record | None) -> Prepared:
        """Find the body or joint of each sensor and its noise."""
        if self.compare == "force":
            raise SeparatrixError(
                "compare: found force, allowed for a machine of several bodies motion, with columns F.JOINT",
                USAGE,
            )
        return prepare_sensors(record, self.model, rest)

    def gather(self, prepared: list[Prepared], options: Options) -> Data:
        """Smooth and cut records."""
        return gather_sensed(prepared, options.segment_periods, options.segment_seconds, self.model)

    def scales(self, data: Data, fitted: Fitted) -> SensedScales:
        """Typical sizes along the fitted motion."""
        return location_scales(fitted.problem, fitted.fit)


@dataclass(frozen=True)
class OfMotor:
    """A body and the crank of the motor that drives it."""

    model: Model
    compare: str = "motion"
    mass: float = 1.0

    def __post_init__(self) -> None:
        """Refuse motors whose state no sensor shows."""
        if law_of(self.model) not in LAWS:
            raise SeparatrixError(
                f'motor.law: found "{law_of(self.model)}", allowed for a base machine {", ".join(LAWS)}: the '
                "integral of a speed control shows in no sensor"
            )
        if self.compare == "force":
            raise SeparatrixError("compare: found force, allowed with a motor motion", USAGE)

    def effects(self, asked: tuple[str, ...] | None) -> list[str]:
        """Effects with their locations, of those that were asked for."""
        return names_with_motor(self.model, asked)

    def prepare(self, record: Record, rest: Record | None) -> Prepared:
        """Find the sensors of body and crank and their noise."""
        return prepare_crank(record, self.model, rest)

    def gather(self, prepared: list[Prepared], options: Options) -> Data:
        """Smooth and cut records."""
        lengths = (options.segment_periods, options.segment_seconds)
        return gather_sensed(prepared, *lengths, self.model, CrankData)

    def scales(self, data: Data, fitted: Fitted) -> SensedScales:
        """Typical sizes along the fitted motion."""
        return location_scales(fitted.problem, fitted.fit)
