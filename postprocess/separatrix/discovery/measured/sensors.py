# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of machines of several bodies: a column for each sensor, named by its kind and its body or joint.

`x.BODY`, `v.BODY`, `a.BODY` are position, velocity and acceleration of a body, `F.JOINT` is the force of a
spring or a soft contact, positive where it pulls the second of its ends back towards the first. Not every
body needs a sensor. `x` and `v` without a body are of the watched one.
"""

from dataclasses import dataclass, field

import numpy as np

from separatrix.discovery.measured.bodies import Structure, structure_of
from separatrix.discovery.measured.condense import whole
from separatrix.discovery.measured.preflight import Prepared, check_periods, from_measured_angle
from separatrix.discovery.measured.records import Record
from separatrix.discovery.measured.signals import clipped_noise, resolution_of, white_noise
from separatrix.discovery.measured.smoother import Smoothed, smooth
from separatrix.discovery.measured.thinned_record import (
    block_length,
    means_of,
    smooth_rows,
    thinned_record,
)
from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError
from separatrix.library import Model

# laws of joints whose force follows from extension and speed
FORCES = ("linear", "polynomial", "kelvin_voigt")


@dataclass
class Sensor:
    """One column: kind (x, v, a, F, i), body or path of the joint, values [SI], noise, whether it is known.

    `known`: the samples that were measured, where others are interpolated.
    """

    name: str
    kind: str
    of: str
    values: np.ndarray
    sigma: float
    stated: bool
    known: np.ndarray | None = None


@dataclass
class SensedPrepared(Prepared):
    """A record of several sensors; `sigma` is the noise of the first."""

    sensors: list[Sensor] = field(default_factory=list)
    # samples of which a row is the mean
    block: int = 1

    @property
    def observed(self) -> str:
        """The body of the first position sensor, or without any of the first speed."""
        return min((one for one in self.sensors if one.kind in "xv"), key=lambda one: one.kind != "x").of

    @property
    def signal(self) -> np.ndarray:
        """What the first sensor shows."""
        return self.sensors[0].values

    @property
    def noise(self) -> tuple:
        """Noise of all sensors and its memory."""
        return (self.memory, *(one.sigma for one in self.sensors))

    @noise.setter
    def noise(self, known: tuple) -> None:
        self.memory = known[0]
        for one, sigma in zip(self.sensors, known[1:], strict=True):
            one.sigma = sigma
        self.sigma = self.sensors[0].sigma

    @property
    def sensor_noise(self) -> dict[str, float]:
        """Noise of each sensor."""
        return {one.name: one.sigma for one in self.sensors}

    def smoothed(self, sensor: Sensor, period: float) -> Smoothed:
        """Smooth what a sensor of position or speed shows."""
        return smooth(self.record.t, sensor.values, sensor.sigma, period)

    def leave_out(self, impacts: np.ndarray) -> None:
        """Do not compare the rows of a thinned record between which, or in which, an impact lies."""
        if self.block == 1 or not impacts.size:
            return
        beside = (impacts[:, None] + np.arange(-1, 3)).clip(0, self.record.t.size - 1)
        for one in self.sensors:
            one.known[beside] = False

    def sensor(self, name: str) -> Sensor | None:
        """The sensor of a column, if this record has it."""
        return next((one for one in self.sensors if one.name == name), None)


def prepare_sensors(record: Record, model: Model, rest: Record | None = None) -> SensedPrepared:
    """Find the body or joint of each column of a record, its noise, and the drive."""
    structure = structure_of(model)
    notes = list(record.notes)
    if rest is not None:
        raise SeparatrixError(
            f"{rest.file}: found a record at rest, allowed for several bodies stated noise: "
            "noise.x.BODY in the header"
        )
    if record.force is not None:
        raise SeparatrixError(
            f"{record.file}: found a column force, allowed F.JOINT of a machine of several bodies"
        )
    if record.t.size > RECORDS.most_of_bodies:
        raise SeparatrixError(
            f"{record.file}: {record.t.size} samples, at most {RECORDS.most_of_bodies} a record of several "
            "bodies: keep a part "
            f"of it, or every {-(-record.t.size // RECORDS.most_of_bodies)}th row"
        )
    if not record.has_position:
        _check_impacts(record, structure)
    columns = _by_body(record, structure.watched)
    sensors = [_sensor(record, name, values, structure, notes) for name, values in columns.items()]
    first = sensors[0]
    prepared = SensedPrepared(
        record,
        first.sigma,
        np.inf,
        resolution_of(first.values),
        notes=notes,
        origin=record.header.get("phase_origin_s", float(record.t[0])),
        sigma_stated=all(one.stated for one in sensors),
        sensors=sensors,
    )
    prepared.drive_scale = record.header.get("drive_scale", 1.0)
    _find_drive(prepared, model)
    _thin(prepared)
    return prepared


def _thin(prepared: SensedPrepared) -> None:
    """Replace a record that is sampled far faster than it moves by one with fewer rows."""
    record, sensors = prepared.record, prepared.sensors
    sigmas = {one.name: one.sigma for one in sensors}
    # means of values on a grid that is coarser than the noise are no finer
    if any(resolution_of(one.values) > one.sigma for one in sensors):
        return
    columns = {one.name: one.values for one in sensors}
    size = block_length(record, columns, sigmas)
    if size == 1:
        return
    means = {one.name: means_of(record, one.values, size) for one in sensors}
    known = np.all([smooth_rows(means[one.name], one.sigma / np.sqrt(size)) for one in sensors], axis=0)
    thin = prepared.record = thinned_record(record, size)
    watched = {"x": thin.x, "v": thin.v}
    for one in sensors:
        sigma = one.sigma if one.stated else max(clipped_noise(one.values), prepared.resolution / np.sqrt(12))
        one.values = thin.sensors.get(one.name, watched.get(one.kind))
        # noise with memory is not as much smaller; white noise is known better than any fit shows it
        # the correction of the curvature adds the noise of the means two blocks apart
        expected, seen = sigma * np.sqrt((1 + 1 / 24) / size), white_noise(one.values)
        one.sigma, one.stated = max(expected, seen), one.stated or seen < RECORDS.white * expected
        one.known = known.copy()
    prepared.block, prepared.samples, prepared.sigma = size, whole(thin), sensors[0].sigma
    prepared.resolution /= np.sqrt(size)
    prepared.notes.append(
        f"{record.t.size} samples, fitted as {thin.t.size} values, each of {size}: in "
        f"{np.count_nonzero(~known)} of them the motion jumps, and they are not compared"
    )


def _check_impacts(record: Record, structure: Structure) -> None:
    """Refuse speeds alone with impacts: they give neither the position of a stop nor the side of a sample."""
    hard = [one.path for one in structure.joints if one.path.startswith("contact.") and one.law not in FORCES]
    if hard:
        raise SeparatrixError(
            f"{record.file}: found velocities but no position for a machine with impacts "
            f"({', '.join(hard)}), allowed with x or x.BODY"
        )


def _by_body(record: Record, watched: str) -> dict[str, np.ndarray]:
    """Columns by body or joint; `x` and `v` are of the watched body."""
    own_x = {f"x.{watched}": record.x} if record.own_x else {}
    own_v = {} if record.v is None else {f"v.{watched}": record.v}
    for name in (own_x | own_v).keys() & record.sensors.keys():
        raise SeparatrixError(
            f"{record.file}: found columns {name[0]} and {name}, allowed one of them: {watched} is watched"
        )
    return own_x | record.sensors | own_v


def _sensor(record: Record, name: str, values: np.ndarray, structure: Structure, notes: list[str]) -> Sensor:
    kind, _, of = name.partition(".")
    if kind == "F":
        joints = {one.path: one for one in structure.joints}
        named = [path for path in joints if of in (path, path.partition(".")[2])]
        if len(named) != 1:
            raise SeparatrixError(
                f"{record.file}: column '{name}': {'several joints' if named else 'no joint'} of this "
                "name; allowed "
                f"{', '.join(f'F.{path}' for path in joints)}"
            )
        if joints[named[0]].law not in FORCES:
            raise SeparatrixError(
                f"{record.file}: column '{name}': the force of a joint with law "
                f"{joints[named[0]].law} is no function "
                f"of extension and speed; allowed {', '.join(FORCES)}"
            )
        if any(np.any(value) for key, value in joints[named[0]].table.items() if "modulation" in key):
            raise SeparatrixError(
                f"{record.file}: column '{name}': the strength of the spring changes with time, "
                "allowed constant"
            )
        of = named[0]
    elif of not in structure.names:
        raise SeparatrixError(
            f"{record.file}: column '{name}': no coordinate of this name; allowed "
            f"{', '.join(structure.names)}"
        )
    if np.ptp(values) == 0:
        raise SeparatrixError(f"{record.file}: '{name}' is constant")
    stated = record.header.get(f"noise.{name}", 0.0)
    if not stated and kind == "x":
        stated = record.header.get("sensor_noise_sigma_m", 0.0)
    if not stated and kind == "v":
        stated = record.header.get("sensor_noise_sigma_m_s", 0.0)
    floor = resolution_of(values) / np.sqrt(12)
    sigma = float(np.hypot(stated, floor)) if stated else max(white_noise(values), floor)
    sigma = max(sigma, RECORDS.quiet * float(np.std(values)))
    if not stated:
        notes.append(f"noise of {name}: {sigma:.3g}, from fourth differences")
    unit = "m/s" if kind == "v" else "m"
    if (kind == "x" or not record.has_position) and kind in "xv" and np.std(values) < 5 * sigma:
        raise SeparatrixError(
            f"{record.file}: {name} scatters by {np.std(values):.3g} {unit} at a noise of {sigma:.3g} "
            f"{unit}: nothing but noise"
        )
    return Sensor(name, kind, of, values, sigma, bool(stated))


def _find_drive(prepared: SensedPrepared, model: Model) -> None:
    """Frequency and phase of the drives of a case."""
    record, header = prepared.record, prepared.record.header
    frequencies = {
        parameter.value
        for path, parameter in model.parameters.items()
        if path.startswith("drive.") and path.endswith(".frequency") and parameter.value
    }
    if not frequencies:
        return
    if len(frequencies) > 1:
        raise SeparatrixError(
            "drive: found drives of several frequencies, allowed for a base machine one frequency"
        )
    if "drive_ratio" in header:
        raise SeparatrixError(
            f"{record.file}: found drive_ratio, allowed for several bodies drive_frequency_rad_s: "
            "there is no one "
            "natural frequency"
        )
    if record.phi is not None:
        from_measured_angle(prepared)
    else:
        prepared.frequency = header.get("drive_frequency_rad_s", frequencies.pop())
        prepared.phase = header.get("phase", 0.0)
        prepared.phase_stated = "phase" in header
        if "drive_frequency_rad_s" not in header:
            prepared.notes.append(
                f"no drive_frequency_rad_s: that of the case, {prepared.frequency:g}, is taken"
            )
        if not prepared.phase_stated:
            prepared.notes.append("no phase: it is searched for")
    check_periods(prepared)
