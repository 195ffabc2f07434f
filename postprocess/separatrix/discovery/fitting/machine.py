# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Free quantities of a fit: parameters of the machine, drive scale; phase, clock and zero of each record;
imperfections of the rig.
"""

from dataclasses import dataclass, replace

import numpy as np

from separatrix.discovery.policy import FIT

# not fitted: a scale of all forces, or a parameter equivalent to an offset force
_FIXED = (
    "body.gravity",
    "restoring.free_length",
    "drive.mean",
    "drive.angle",
    "drive.ratio",
    "drive.interval",
)
_FIXED_ENDS = ("exponent", "harmonic", "tension", "rounding", "penetration")
_KNOTS = ("speed[", "position[", "extension[", "penetration[")
SENSOR_BIAS = "effect.sensor_bias.bias"
SENSOR_ZERO = "nuisance:sensor_zero"
CRANK_ZERO = "nuisance:crank_zero"
"""What a sensor of the crank shows at the crank angle 0 of the case [rad]."""
IMPERFECTION = "nuisance:imperfection_of_rig:"
_AMPLITUDES = ("drive.amplitude", "drive.cosine", "drive.sine")
_TIED = {"friction.static_coefficient": "friction.kinetic_coefficient"}
_NEVER_ZERO = ("stiffness", "mass", "moment", "velocity")
_UNBOUNDED = 1e100


@dataclass(frozen=True)
class Free:
    """One free number of a fit; `path` of the machine, or a nuisance (`nuisance:...`) of all records or of
    one.

    A `positive` one is fitted by its logarithm, which `value`, `lower` and `upper` are of.
    """

    path: str
    value: float
    lower: float = -np.inf
    upper: float = np.inf
    size: float = 1.0
    record: int | None = None
    positive: bool = False
    # each record has its own beside it
    varies: bool = False
    # standard error of a nuisance about 0, from its own measurement or of such imperfections
    error: float | None = None
    # another path of the machine that has the same value, or minus that
    also: str | None = None
    mirrored: bool = False

    @property
    def paths(self) -> tuple[str, ...]:
        """All paths that have this value."""
        return (self.path,) if self.also is None else (self.path, self.also)

    def physical(self, value: float) -> float:
        """The number itself, from what is fitted."""
        return float(np.exp(value)) if self.positive else float(value)

    def numbers(self, value: float) -> dict[str, float]:
        """The numbers of all paths, from what is fitted."""
        return self._over_paths(self.physical(value))

    def slopes(self, value: float) -> dict[str, float]:
        """Derivatives of those numbers by what is fitted."""
        return self._over_paths(self.slope(value))

    def _over_paths(self, number: float) -> dict[str, float]:
        found = {self.path: number}
        if self.also is not None:
            found[self.also] = -number if self.mirrored else number
        return found

    def slope(self, value: float) -> float:
        """Derivative of the number by what is fitted."""
        return float(np.exp(value)) if self.positive else 1.0

    @property
    def is_nuisance(self) -> bool:
        """Whether this is no parameter of the case file."""
        return self.path.startswith("nuisance:")

    @property
    def is_imperfection(self) -> bool:
        """Whether this is the size of a small imperfection of the rig, which adds to what is measured."""
        return self.path.startswith(IMPERFECTION)


def base_parameters(model, measured_force: bool, near_mass: bool = False) -> list[Free]:
    """The parameters of the base machine that a record can determine.

    With `near_mass` the mass stays near that of the case, as a slow joint hardly determines it.
    """
    free = []
    for path, parameter in model.parameters.items():
        if not _is_fitted(path, measured_force) or _is_tied(path, model):
            continue
        value = float(parameter.value)
        if abs(value) >= _UNBOUNDED:
            continue
        lower, upper = bounds_of(parameter)
        if path.endswith(_NEVER_ZERO):
            lower = max(lower, 1e-3 * value)
        if near_mass and path == "body.mass":
            lower, upper = value / FIT.mass_factor, value * FIT.mass_factor
        free.append(Free(path, value, lower, upper, abs(value) or 1.0, varies=path == SENSOR_BIAS))
    return free


def _is_fitted(path: str, measured_force: bool) -> bool:
    if path == "body.mass":
        return measured_force
    if path.split(".")[-1].startswith(_KNOTS):
        # knots of a table
        return False
    if path.startswith((*_AMPLITUDES, "drive.force")) or path in _FIXED or path.endswith(_FIXED_ENDS):
        return False
    return path.split(".")[0] in ("restoring", "friction", "contact", "drive", "effect")


def _is_tied(path: str, model) -> bool:
    other = _TIED.get(path)
    parameters = model.parameters
    return other in parameters and parameters[path].value == parameters[other].value


def bounds_of(parameter) -> tuple[float, float]:
    """Bounds of a parameter, infinite where there are none."""
    lower = -np.inf if parameter.lower is None or parameter.lower < -_UNBOUNDED else float(parameter.lower)
    upper = np.inf if parameter.upper is None or parameter.upper > _UNBOUNDED else float(parameter.upper)
    return lower, upper


def drive_amplitudes(model) -> dict[str, float]:
    """The coefficients of the drive that one scale multiplies."""
    return {
        path: float(parameter.value)
        for path, parameter in model.parameters.items()
        if _is_amplitude(path) and parameter.value != 0
    }


def _is_amplitude(path: str) -> bool:
    """Also of one of several drives: `drive.shaker.amplitude`."""
    first, _, last = path.rpartition(".")
    return first.startswith("drive") and f"drive.{last}".startswith(_AMPLITUDES)


def drive_nuisances(model, prepared: list) -> list[Free]:
    """Scale of the drive; zero of the crank (where phi was not measured) and clock of each record."""
    if prepared[0].frequency is None:
        return []
    free = []
    if drive_amplitudes(model):
        free.append(Free("nuisance:drive_scale", 1.0, 0.2, 5.0, 0.01))
    return free + record_nuisances(prepared)


def record_nuisances(prepared: list) -> list[Free]:
    """What is free for each record by itself: a measured crank angle within its errors."""
    free = [
        Free("nuisance:phase", 0.0, size=0.01, record=i, error=one.phase_error or None)
        for i, one in enumerate(prepared)
        if one.phase_error or not one.phase_known
    ]
    return free + [
        Free("nuisance:clock", 0.0, -0.02, 0.02, 1e-4, record=i, error=one.clock_error or None)
        for i, one in enumerate(prepared)
    ]


def sensor_zeros(free: list[Free], count: int) -> list[Free]:
    """The zero of the sensor in each record but the first, beside the bias that the base machine has.

    Records of other days have other zeros.
    """
    return [
        Free(SENSOR_ZERO, 0.0, size=one.size, record=i) for one in free if one.varies for i in range(1, count)
    ]


def on_other_records(free: list[Free], prepared: list) -> list[Free]:
    """What is free on other records: what `free` has for all of them, and what each record has of its own."""
    # a common imperfection was fitted in training and is not fitted again
    own = [replace(one, error=None) for one in free if one.record is None]
    if prepared[0].frequency:
        own += record_nuisances(prepared)
    for i, one in enumerate(prepared):
        # a part of a record that was fitted has its zero
        if not one.record.part:
            own += [Free(SENSOR_ZERO, 0.0, size=bias.size, record=i) for bias in free if bias.varies]
        # its curve, about its own middle, also of a part: what one range shows is another one there
        curves = (one for one in free if one.is_imperfection and one.record is not None)
        own += dict.fromkeys(replace(one, record=i, value=0.0) for one in curves)
    return own


def with_values(free: list[Free], values: np.ndarray) -> list[Free]:
    """The same parameters with other values."""
    return [replace(one, value=float(value)) for one, value in zip(free, values, strict=True)]
