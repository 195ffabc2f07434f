# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of a machine with a motor: a motion of the body, the crank, and what the motor was fed with.

The body shows `x`, `v` or `a.body`. The crank shows its angle `phi`, or a `pulse` per turn, whose rising
edges count. `current` is compared; a `voltage` is that at which the motor ran. Without the column,
`motor_voltage_v` in the header states it; of other motors `motor_speed_rad_s` is their speed without torque.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from separatrix.discovery.measured.bodies import BODY, CRANK
from separatrix.discovery.measured.preflight import check_periods
from separatrix.discovery.measured.records import Record
from separatrix.discovery.measured.sensors import SensedPrepared, Sensor
from separatrix.discovery.measured.signals import resolution_of, white_noise
from separatrix.discovery.measured.smoother import Smoothed, smooth
from separatrix.discovery.measured.tables import OF_MOTOR
from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError
from separatrix.library import Model

LAWS = ("linear", "kloss", "dc", "table")
"""Motors whose state a segment can begin with: the integral of a speed control shows in no sensor."""
ANGLE = f"x.{CRANK}"
_SUPPLY = {"dc": "motor.voltage", "linear": "motor.no_load_speed", "kloss": "motor.synchronous_speed"}


@dataclass
class CrankPrepared(SensedPrepared):
    """A record with a crank; `supply` are values of the motor that differ from record to record."""

    supply: dict[str, float] = field(default_factory=dict)
    # mean speed of the crank [rad/s], and what its sensor is thought to show at the angle 0 of the case [rad]
    turning: float = 0.0
    zero: float = 0.0

    @property
    def observed(self) -> str:
        """The body."""
        return BODY

    @property
    def period_samples(self) -> float:
        """Samples per turn of the crank."""
        return 2 * np.pi / abs(self.turning) / self.record.interval

    def smoothed(self, sensor: Sensor, period: float) -> Smoothed:
        """An angle is smoothed without its mean rotation."""
        if sensor.name != ANGLE:
            return super().smoothed(sensor, period)
        t = self.record.t
        even = self.turning * (t - t[0])
        found = smooth(t, sensor.values - even, sensor.sigma, period)
        found.state[:, 0] += even
        found.state[:, 1] += self.turning
        found.impacts = np.zeros(0, int)
        return found


def prepare_crank(record: Record, model: Model, rest: Record | None = None) -> CrankPrepared:
    """Find the sensors of a record, their noise, and what the motor ran at."""
    if rest is not None:
        raise SeparatrixError(
            f"{rest.file}: found a record at rest, allowed with a motor stated noise: noise.x.body"
        )
    if record.force is not None:
        raise SeparatrixError(f"{record.file}: found a column force, allowed with a motor current, voltage")
    notes = list(record.notes)
    sensors = [_of_body(record, name, values, notes) for name, values in _body_columns(record).items()]
    if not sensors:
        raise SeparatrixError(f"{record.file}: found no motion of the body, allowed x, v or a.body")
    sensors.append(_of_crank(record, notes))
    if "current" in record.sensors:
        if model.parameters.get("motor.resistance") is None:
            raise SeparatrixError(f'{record.file}: found a column current, allowed with motor.law = "dc"')
        sensors.append(_sensor(record, "current", "i", CRANK, record.sensors["current"], notes))
    first, angle = sensors[0], next(one for one in sensors if one.name == ANGLE)
    prepared = CrankPrepared(
        record,
        first.sigma,
        np.inf,
        resolution_of(first.values),
        notes=notes,
        origin=float(record.t[0]),
        sigma_stated=all(one.stated for one in sensors),
        sensors=sensors,
        supply=_supply(record, model),
        turning=float(np.polyfit(record.t - record.t[0], angle.values, 1)[0]),
    )
    check_periods(prepared)
    return prepared


def _body_columns(record: Record) -> dict[str, np.ndarray]:
    """Columns of the body by the name of their sensor."""
    found = {f"x.{BODY}": record.x} if record.own_x else {}
    found |= {} if record.v is None else {f"v.{BODY}": record.v}
    for name, values in record.sensors.items():
        if name in OF_MOTOR:
            continue
        if name[2:] != BODY or name[0] not in "xva":
            raise SeparatrixError(
                f"{record.file}: column '{name}': allowed with a motor x, v, a.{BODY}, phi, "
                f"{', '.join(OF_MOTOR)}"
            )
        if name in found:
            raise SeparatrixError(f"{record.file}: found columns {name[0]} and {name}, allowed one of them")
        found[name] = values
    return found


def _of_body(record: Record, name: str, values: np.ndarray, notes: list[str]) -> Sensor:
    return _sensor(record, name, name[0], BODY, values, notes)


def _sensor(record: Record, name: str, kind: str, of: str, values: np.ndarray, notes: list[str]) -> Sensor:
    if np.ptp(values) == 0:
        raise SeparatrixError(f"{record.file}: '{name}' is constant")
    stated = record.header.get(f"noise.{name}", 0.0)
    if not stated and kind in "xv" and of == BODY:
        stated = record.header.get({"x": "sensor_noise_sigma_m", "v": "sensor_noise_sigma_m_s"}[kind], 0.0)
    if not stated and name == ANGLE:
        stated = record.header.get("phi_noise_sigma_rad", 0.0)
    floor = resolution_of(values) / np.sqrt(12)
    sigma = float(np.hypot(stated, floor)) if stated else max(white_noise(values), floor)
    scatter = values if name != ANGLE else np.mod(values, 2 * np.pi)
    sigma = max(sigma, RECORDS.quiet * float(np.std(scatter)))
    if not stated:
        notes.append(f"noise of {name}: {sigma:.3g}, from fourth differences")
    return Sensor(name, kind, of, values, sigma, bool(stated))


def _of_crank(record: Record, notes: list[str]) -> Sensor:
    """The angle of the crank, measured or from pulses."""
    if record.phi is not None:
        return _sensor(record, ANGLE, "x", CRANK, np.unwrap(record.phi), notes)
    if "pulse" not in record.sensors:
        raise SeparatrixError(
            f"{record.file}: found neither phi nor pulse, allowed with a motor the angle of its crank or a "
            "pulse per turn: without them its speed is not known"
        )
    t, level = record.t, record.sensors["pulse"]
    middle = (np.max(level) + np.min(level)) / 2
    edges = np.flatnonzero((level[:-1] < middle) & (level[1:] >= middle))
    if edges.size < RECORDS.fewest_pulses:
        raise SeparatrixError(
            f"{record.file}: {edges.size} pulses, at least {RECORDS.fewest_pulses} are needed"
        )
    share = (middle - level[edges]) / (level[edges + 1] - level[edges])
    digital = np.unique(level).size == 2
    at = t[edges] + (0.5 if digital else share) * record.interval
    turns = CubicSpline(at, 2 * np.pi * np.arange(edges.size))
    known = np.zeros(t.size, bool)
    known[edges] = True
    speed = 2 * np.pi / float(np.median(np.diff(at)))
    # of an edge somewhere in an interval; a sloping one is known to some hundredths of it
    sigma = speed * record.interval * (1 / np.sqrt(12) if digital else 0.02)
    notes.append(f"{edges.size} pulses: the angle of the crank is compared at these, to {sigma:.3g} rad")
    return Sensor(ANGLE, "x", CRANK, turns(t), sigma, True, known)


def _supply(record: Record, model: Model) -> dict[str, float]:
    """What the motor ran at in a record, by the path of the case."""
    law = next(law for law in (*LAWS, "pi") if _is(model, law))
    path, header = _SUPPLY.get(law), record.header
    for key, only in (("motor_voltage_v", law == "dc"), ("motor_speed_rad_s", law in ("linear", "kloss"))):
        if key in header and not only:
            raise SeparatrixError(f'{record.file}: found {key}, not allowed with motor.law = "{law}"')
    if "voltage" in record.sensors:
        voltage = record.sensors["voltage"]
        if law != "dc":
            raise SeparatrixError(f'{record.file}: found a column voltage, allowed with motor.law = "dc"')
        mean, scatter = float(np.mean(voltage)), _slow_scatter(voltage)
        if scatter > RECORDS.steady_voltage * abs(mean):
            raise SeparatrixError(
                f"{record.file}: the voltage changes by {scatter:.3g} V about {mean:.4g} V, allowed at most "
                f"{RECORDS.steady_voltage:g} of it: a record of one voltage"
            )
        return {path: mean}
    for key in ("motor_voltage_v", "motor_speed_rad_s"):
        if key in header:
            return {path: float(header[key])}
    return {}


def _slow_scatter(values: np.ndarray) -> float:
    """Standard deviation of means over a twentieth of a record: noise is no change of the voltage."""
    parts = np.array_split(values, 20)
    return float(np.std([np.mean(part) for part in parts]))


def _is(model: Model, law: str) -> bool:
    """Whether the motor of a model has a law, by the parameters that only this law has."""
    own = {
        "linear": "motor.stall_torque",
        "kloss": "motor.breakdown_slip",
        "dc": "motor.resistance",
        "pi": "motor.reference",
        "table": "motor.torque[1]",
    }
    return own[law] in model.parameters


def law_of(model: Model) -> str:
    """The law of the motor of a model."""
    return next(law for law in (*LAWS, "pi") if _is(model, law))
