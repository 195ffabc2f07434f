# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The effects that can be named: their parameters, sizes to start from, and what they cannot be told from.

A size to start from is a few per cent of what the machine's own forces, lengths and speeds are in the
records.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from separatrix.discovery.fitting.machine import Free, bounds_of
from separatrix.errors import SeparatrixError


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


@dataclass(frozen=True)
class Effect:
    """One row of the catalogue. `starts` gives, per parameter, the sizes to start from; the first is the
    usual one.

    `linear`: the parameters that the residual is linear in near zero (both signs are tried where bounds
    allow); `positive`: those that are fitted by their logarithm. `needs`: families or paths that the base
    machine must have.
    """

    name: str
    starts: Callable[[Scales], dict[str, list[float]]]
    linear: tuple[str, ...] = ()
    positive: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    # effects that are the same motion, and when
    equivalent: dict[str, str] = field(default_factory=dict)


_FAR = 20.0
_SLIDING = "while the body slides, friction that differs with the direction by a constant is a constant force"
_GAIN = (
    "where friction, barrier and the scale of the drive are fitted, a gain of the sensor is a constant force"
)
_SHIFT = "where the position of the barrier is fitted, a shifted sensor is a constant force"


def _asymmetry(scales: Scales) -> dict[str, list[float]]:
    """Both parts of friction that differs with the direction; the dry part within the machine's friction."""
    dry = {"coulomb": [min(0.02 * scales.force, 0.5 * scales.friction)]} if scales.friction > 0 else {}
    return dry | {"viscous": [0.02 * scales.force / scales.speed]}


CATALOGUE: tuple[Effect, ...] = (
    Effect("viscous", lambda s: {"damping": [0.02 * s.force / s.speed]}, ("damping",)),
    Effect("coulomb", lambda s: {"force": [0.02 * s.force]}, ("force",)),
    Effect("quadratic_drag", lambda s: {"coefficient": [0.02 * s.force / s.speed**2]}, ("coefficient",)),
    Effect(
        "stribeck",
        lambda s: {"excess": [0.05 * s.force], "velocity": [0.15 * s.speed, 0.04 * s.speed, 0.5 * s.speed]},
        ("excess",),
        ("velocity",),
    ),
    # a body that does not stick without it shows nothing of a small one
    Effect(
        "static_excess",
        lambda s: {"force": [share * s.force for share in (0.1, 0.03, 0.3)]},
        positive=("force",),
    ),
    Effect(
        "dahl",
        lambda s: {"stiffness": [s.friction / (share * s.length) for share in (0.02, 0.005, 0.1)]},
        positive=("stiffness",),
        needs=("friction",),
    ),
    Effect(
        "asymmetric_friction",
        _asymmetry,
        ("coulomb", "viscous"),
        equivalent={"offset_force": _SLIDING, "sensor_bias": _SHIFT, "sensor_gain": _GAIN},
    ),
    Effect(
        "position_dependent_friction",
        lambda s: {"slope": [0.1 / s.length]},
        ("slope",),
        needs=("friction",),
    ),
    Effect("cubic_spring", lambda s: {"stiffness": [0.02 * s.force / s.length**3]}, ("stiffness",)),
    Effect(
        "offset_force",
        lambda s: {"force": [0.02 * s.force]},
        ("force",),
        equivalent={"asymmetric_friction": _SLIDING, "sensor_bias": _SHIFT, "sensor_gain": _GAIN},
    ),
    Effect(
        "restitution_slope",
        lambda s: {"slope": [0.1 / s.impact_speed]},
        ("slope",),
        needs=("contact.restitution",),
    ),
    Effect(
        "compliant_contact",
        lambda s: {
            "stiffness": [
                1.25 * s.mass * s.impact_speed**2 / (share * s.length) ** 2.5 for share in (0.03, 0.008, 0.1)
            ],
            "damping": [0.6 / s.impact_speed],
        },
        positive=("stiffness", "damping"),
        needs=("contact.restitution",),
    ),
    Effect("second_barrier", lambda s: {"position": [np.nan]}, needs=("contact.restitution",)),
    Effect(
        "drive_ripple",
        lambda s: {"sine": [0.02], "cosine": [0.02]},
        ("sine", "cosine"),
        needs=("drive.ratio",),
    ),
    Effect(
        "sensor_bias",
        lambda s: {"bias": [0.01 * s.length]},
        ("bias",),
        equivalent={"offset_force": _SHIFT, "asymmetric_friction": _SHIFT, "sensor_gain": _GAIN},
    ),
    Effect(
        "sensor_gain",
        lambda s: {"gain": [0.01]},
        ("gain",),
        equivalent={"offset_force": _GAIN, "asymmetric_friction": _GAIN, "sensor_bias": _GAIN},
    ),
    Effect("sensor_delay", lambda s: {"delay": [0.2 * s.interval]}, ("delay",)),
)

BY_NAME = {effect.name: effect for effect in CATALOGUE}


@dataclass(frozen=True)
class Candidate:
    """Effects added to a machine: its model, what is free, and the values to start from."""

    names: tuple[str, ...]
    model: object
    free: list[Free]
    # places of the parameters of the last effect in `free`
    added: tuple[int, ...]
    starts: list[np.ndarray]
    # forms of the effect to screen: absent but for its shape, or of usual size where it is never absent
    forms: list[np.ndarray]
    # which of the added parameters are linear
    linear: np.ndarray


def text_with(text: str, effect: str, values: dict[str, float]) -> str:
    """A case with the table of an effect."""
    lines = [f"{key} = {value!r}" for key, value in values.items()]
    return "\n".join([text.rstrip(), "", f"[effect.{effect}]", *lines, ""])


def candidate(model, free: list[Free], names: tuple[str, ...], name: str, scales: Scales) -> Candidate | str:
    """The machine with the effect `name` added, or why that makes no sense."""
    effect = BY_NAME[name]
    missing = [need for need in effect.needs if not _has(model, need)]
    if missing:
        return f"the machine has no {missing[0]}"
    sizes = effect.starts(scales)
    if name == "second_barrier":
        place = _free_side(model, scales)
        if isinstance(place, str):
            return place
        sizes = {"position": place}
    first = {key: float(values[0]) for key, values in sizes.items()}
    try:
        extended = type(model).from_text(text_with(_open_text(model, name, sizes, scales), name, first))
    except SeparatrixError as reason:
        return str(reason)
    added = []
    whole = [one for one in free if one.path in extended.parameters or one.is_nuisance]
    for key, value in first.items():
        path = f"effect.{name}.{key}"
        lower, upper = bounds_of(extended.parameters[path])
        if key in effect.positive:
            ends = np.log([min(sizes[key]) / _FAR, max(sizes[key]) * _FAR])
            added.append(Free(path, float(np.log(value)), *ends, 0.1, positive=True))
        else:
            added.append(Free(path, value, lower, upper, abs(value) or 1.0))
    place = tuple(range(len(whole), len(whole) + len(added)))
    starts = _starts(effect, sizes, added)
    linear = np.array([key in effect.linear for key in first])
    forms = np.unique(np.where(linear, 0.0, np.array(starts)), axis=0)
    return Candidate((*names, name), extended, whole + added, place, starts, list(forms), linear)


def _open_text(model, name: str, sizes: dict[str, list[float]], scales: Scales) -> str:
    """The case; where a barrier is added, its starts lie where all places that are tried leave room."""
    text = model.to_text({})
    if name != "second_barrier":
        return text
    reach = 0.2 * (scales.highest - scales.lowest)
    if "contact.upper" in model.parameters:
        return within_barriers(text, max(sizes["position"]) + reach, model.parameters["contact.upper"].value)
    return within_barriers(text, model.parameters["contact.lower"].value, min(sizes["position"]) - reach)


def within_barriers(text: str, lower: float, upper: float) -> str:
    """A resolved case in which positions to start from lie between the barriers."""
    table, axis, lines = "", "", []
    for line in text.splitlines():
        header = re.fullmatch(r"\[+(.*?)\]+", line.strip())
        key, equals, value = (part.strip() for part in line.partition("="))
        if header:
            table, axis = header.group(1), ""
        elif equals and key == "name":
            axis = value.strip('"')
        if equals and ((table == "axis" and axis == "x0" and key in ("from", "to")) or key == "x0"):
            numbers = re.findall(r"[-+0-9.eE]+", value)
            kept = [repr(float(np.clip(float(number), lower, upper))) for number in numbers]
            line = f"{key} = [{', '.join(kept)}]" if value.startswith("[") else f"{key} = {kept[0]}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def _starts(effect: Effect, sizes: dict[str, list[float]], added: list[Free]) -> list[np.ndarray]:
    """Combinations of the sizes, and the other sign of the linear ones where it is allowed."""
    choices = []
    for (key, values), one in zip(sizes.items(), added, strict=True):
        signs = (1.0, -1.0) if key in effect.linear and one.lower < 0 else (1.0,)
        fitted = np.log(values) if key in effect.positive else np.array(values)
        choices.append([float(sign * value) for value in fitted for sign in signs])
    found = [np.array(values, float) for values in product(*choices)]
    # two linear parameters: one sign of the first, both of the second
    return found[:2] if len(effect.linear) == 2 else found


def _has(model, need: str) -> bool:
    return any(path == need or path.startswith(need + ".") for path in model.parameters)


def _free_side(model, scales: Scales) -> list[float] | str:
    """Places for a second barrier: inside of the extreme of the records on the side without one."""
    upper, lower = ("contact.upper" in model.parameters, "contact.lower" in model.parameters)
    if upper == lower:
        return "the machine has no side without a barrier" if upper else "the machine has no barrier"
    reach = scales.highest - scales.lowest
    shares = (0.0, 0.02, 0.06)
    if upper:
        return [scales.lowest + share * reach for share in shares]
    return [scales.highest - share * reach for share in shares]
