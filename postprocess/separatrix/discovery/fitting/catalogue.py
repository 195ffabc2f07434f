# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The effects that can be named: their parameters and the sizes to start from.

A size to start from is a few per cent of the machine's own forces, lengths and speeds in the records.
"""

import tomllib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from separatrix.cases import toml
from separatrix.discovery.fitting.machine import Free, bounds_of
from separatrix.discovery.policy import FIT
from separatrix.errors import USAGE, SeparatrixError
from separatrix.library import Effect, effects


@dataclass(frozen=True)
class Scales:
    """Typical sizes in the records, in SI units."""

    mass: float
    length: float
    speed: float
    force: float
    impact_speed: float
    friction: float
    lowest: float
    highest: float
    interval: float

    @property
    def frequency(self) -> float:
        """Angular frequency of the motion [rad/s]."""
        return self.speed / self.length


Starts = Callable[[Scales], dict[str, list[float]]]


def _asymmetry(scales: Scales) -> dict[str, list[float]]:
    """Both parts of friction that differs with the direction; the dry part within the machine's friction."""
    dry = {"coulomb": [min(0.02 * scales.force, 0.5 * scales.friction)]} if scales.friction > 0 else {}
    return dry | {"viscous": [0.02 * scales.force / scales.speed]}


ON_REQUEST = {
    "cubic_damping": "it is tried on request: few records distinguish it from viscous and quadratic_drag",
}
"""Effects that are not tried by themselves, and why."""

STARTS: dict[str, Starts] = {
    "viscous": lambda s: {"damping": [0.02 * s.force / s.speed]},
    "coulomb": lambda s: {"force": [0.02 * s.force]},
    "quadratic_drag": lambda s: {"coefficient": [0.02 * s.force / s.speed**2]},
    "cubic_damping": lambda s: {"coefficient": [0.02 * s.force / s.speed**3]},
    "stribeck": lambda s: {
        "excess": [0.05 * s.force],
        "velocity": [0.15 * s.speed, 0.04 * s.speed, 0.5 * s.speed],
    },
    # a small one has no effect on a body that does not stick without it; a slow one yields to friction alone
    "static_excess": lambda s: {
        "force": [share * max(s.force, 10 * s.friction) for share in (0.1, 0.03, 0.3)]
    },
    "dahl": lambda s: {"stiffness": [s.friction / (share * s.length) for share in (0.02, 0.005, 0.1)]},
    "asymmetric_friction": _asymmetry,
    "position_dependent_friction": lambda s: {"slope": [0.1 / s.length]},
    "cubic_spring": lambda s: {"stiffness": [0.02 * s.force / s.length**3]},
    "backlash": lambda s: {"gap": [share * s.length for share in (0.05, 0.2, 0.01)]},
    "offset_force": lambda s: {"force": [0.02 * s.force]},
    "restitution_slope": lambda s: {"slope": [0.1 / s.impact_speed]},
    "compliant_contact": lambda s: {
        "stiffness": [
            1.25 * s.mass * s.impact_speed**2 / (share * s.length) ** 2.5 for share in (0.03, 0.008, 0.1)
        ],
        "damping": [0.6 / s.impact_speed],
    },
    "kelvin_voigt_contact": lambda s: {
        "stiffness": [s.mass * s.impact_speed**2 / (share * s.length) ** 2 for share in (0.03, 0.008, 0.1)],
        "damping": [0.3 * s.mass * s.impact_speed / (0.03 * s.length)],
    },
    "contact_hardening": lambda s: {"change": [0.2]},
    "second_barrier": lambda s: {"position": [np.nan]},
    "drive_ripple": lambda s: {"sine": [0.02], "cosine": [0.02]},
    "sensor_bias": lambda s: {"bias": [0.01 * s.length]},
    "sensor_gain": lambda s: {"gain": [0.01]},
    "sensor_delay": lambda s: {"delay": [0.2 * s.interval]},
}
"""Per effect and parameter the sizes to start from; the first is the usual one.

All else that is known of an effect stands in the tables of laws, which the library hands out (`effects`).
"""


def names_of_body(asked: tuple[str, ...] | None) -> list[str]:
    """Names of all effects that one body may lack, of those that were asked for."""
    refuse_unknown(asked, STARTS)
    return [name for name in STARTS if not asked or name in asked]


def refuse_unknown(asked: tuple[str, ...] | None, known: Iterable[str]) -> None:
    """Refuse effects that a machine cannot have."""
    unknown = [name for name in asked or () if name not in known]
    if unknown:
        raise SeparatrixError(
            f"effects: found {', '.join(unknown)}, allowed for this machine {', '.join(known)}", USAGE
        )


@dataclass(frozen=True)
class Candidate:
    """Effects added to a machine: its model, what is free, and the values to start from."""

    names: tuple[str, ...]
    model: object
    free: list[Free]
    # indices of the parameters of the last effect in `free`
    added: tuple[int, ...]
    starts: list[np.ndarray]
    # forms of the effect to screen: absent but for its shape, or of usual size where it is never absent
    forms: list[np.ndarray]
    # which of the added parameters are linear
    linear: np.ndarray


def candidate(model, free: list[Free], names: tuple[str, ...], name: str, scales: Scales) -> Candidate | str:
    """The machine with the effect `name` added, or why that makes no sense."""
    effect = effects()[name]
    if effect.needs and not _has(model, effect.needs):
        if effect.needs == "contact.restitution" and _has(model, "contact.stiffness"):
            return "the barriers of the machine yield already, and this effect is for rigid ones"
        return f"the machine has no {effect.needs}"
    sizes = STARTS[name](scales)
    if name == "second_barrier":
        positions = _free_side(model, scales)
        if isinstance(positions, str):
            return positions
        sizes = {"position": positions}
    first = {key: float(values[0]) for key, values in sizes.items()}
    fixed = {"penetration": _half_way_in(model, scales)} if name == "contact_hardening" else {}
    if not all(size > 0 for size in fixed.values()):
        return "the barriers of the machine are not pressed in these records"
    try:
        extended = _opened(model, name, sizes, scales).with_effect(name, first | fixed)
    except SeparatrixError as reason:
        return str(reason)
    added = []
    whole = [one for one in free if one.path in extended.parameters or one.is_nuisance]
    for key, value in first.items():
        path = f"effect.{name}.{key}"
        lower, upper = bounds_of(extended.parameters[path])
        if key in effect.sizes:
            ends = np.log([min(sizes[key]) / FIT.far_start, max(sizes[key]) * FIT.far_start])
            added.append(Free(path, float(np.log(value)), *ends, 0.1, positive=True))
        else:
            added.append(Free(path, value, lower, upper, abs(value) or 1.0))
    indices = tuple(range(len(whole), len(whole) + len(added)))
    starts = _starts(effect, sizes, added)
    linear = np.array([key in effect.amplitudes for key in first])
    forms = np.unique(np.where(linear, 0.0, np.array(starts)), axis=0)
    return Candidate((*names, name), extended, whole + added, indices, starts, list(forms), linear)


def _half_way_in(model, scales: Scales) -> float:
    """Half of the deepest penetration into the barriers of the case [m], negative without one."""
    upper, lower = (model.parameters.get(f"contact.{end}") for end in ("upper", "lower"))
    depths = [scales.highest - upper.value] if upper else []
    depths += [lower.value - scales.lowest] if lower else []
    return max(depths, default=-1.0) / 2


def _opened(model, name: str, sizes: dict[str, list[float]], scales: Scales):
    """The model; if a barrier is added, with starts that all its trial positions allow."""
    if name != "second_barrier":
        return model
    reach = 0.2 * (scales.highest - scales.lowest)
    if "contact.upper" in model.parameters:
        ends = (max(sizes["position"]) + reach, model.parameters["contact.upper"].value)
    else:
        ends = (model.parameters["contact.lower"].value, min(sizes["position"]) - reach)
    return within_barriers(model, *ends)


def within_barriers(model, lower: float, upper: float):
    """The model with positions to start from that lie between the barriers."""
    text = model.to_text({})
    settings = [
        f"{path}={toml(np.clip(found, lower, upper).tolist())}"
        for path, found in _positions(tomllib.loads(text))
    ]
    return type(model).from_settings(text, "case", settings)


def _positions(table: dict, within: str = "") -> Iterator[tuple[str, float | list[float]]]:
    """Positions to start from in a case, by the path of their key."""
    for key, value in table.items():
        path = f"{within}{key}"
        if isinstance(value, dict):
            yield from _positions(value, f"{path}.")
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for number, one in enumerate(value, start=1):
                yield from _positions(one, f"{path}[{number}].")
        elif key == "x0" or (key in ("from", "to") and table.get("name") == "x0"):
            yield path, value


def _starts(effect: Effect, sizes: dict[str, list[float]], added: list[Free]) -> list[np.ndarray]:
    """Combinations of the sizes, and the other sign of the linear ones where it is allowed."""
    choices = []
    for (key, values), one in zip(sizes.items(), added, strict=True):
        signs = (1.0, -1.0) if key in effect.amplitudes and one.lower < 0 else (1.0,)
        fitted = np.log(values) if key in effect.sizes else np.array(values)
        choices.append([float(sign * value) for value in fitted for sign in signs])
    found = [np.array(values, float) for values in product(*choices)]
    # two linear parameters: one sign of the first, both of the second
    return found[:2] if len(effect.amplitudes) == 2 else found


def _has(model, need: str) -> bool:
    return any(path == need or path.startswith(need + ".") for path in model.parameters)


def _free_side(model, scales: Scales) -> list[float] | str:
    """Positions for a second barrier: inside of the extreme of the records on the side without one."""
    upper, lower = ("contact.upper" in model.parameters, "contact.lower" in model.parameters)
    if upper == lower:
        return "the machine has no side without a barrier" if upper else "the machine has no barrier"
    reach = scales.highest - scales.lowest
    shares = (0.0, 0.02, 0.06)
    if upper:
        return [scales.lowest + share * reach for share in shares]
    return [scales.highest - share * reach for share in shares]
