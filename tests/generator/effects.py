# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be hidden in a record: the effects of the catalogue, and some that it does not have."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from simulator import POWER, SATURATING, STEP, Machine

SHAPES = (
    "quadratic_exponent stribeck_exponent cubic_exponent contact_exponent"
    " restitution_shape restitution_constant friction_wave"
).split()
"""Parameters of the machine that give a law another shape than that of the catalogue."""
SENSORS = ("sensor_bias", "sensor_gain", "sensor_delay")


@dataclass(frozen=True)
class Effect:
    """An effect with one size; `shape` draws what else it needs."""

    path: str
    """Parameter of the case file that is the size; nothing for what the catalogue lacks."""
    field: str
    """Parameter of the machine or sensor that is the size; for a second barrier its depth in the motion."""
    sizes: tuple[float, float]
    """Smallest and largest size worth asking for; from invisible to large, so a stiffness falls."""
    signed: bool = False
    shape: Callable[[Machine, np.random.Generator], dict[str, float]] = lambda machine, random: {}
    """Further parameters of the machine."""
    free: tuple[str, ...] = ()
    """Those of them that are unknown to whoever looks for the effect."""
    paths: dict[str, str] = field(default_factory=dict)
    """Names of the further parameters in the case file."""
    instead_of: tuple[str, ...] = ()
    """Parameters of the base machine that the effect makes void."""
    another: Callable[[np.random.Generator], dict[str, float]] | None = None
    """Draws another shape of the law than that of the catalogue."""


def _stribeck(machine: Machine, random: np.random.Generator) -> dict[str, float]:
    return {"stribeck_velocity": random.uniform(0.05, 0.3)}


def _ripple(machine: Machine, random: np.random.Generator) -> dict[str, float]:
    return {"ripple_harmonic": 1.0, "ripple_cosine": 0.0}


def _contact(machine: Machine, random: np.random.Generator) -> dict[str, float]:
    """The damping with which the barrier restores as much as the rigid one at 2 m/s."""
    e, low, high = machine.restitution, 1e-9, 1 / machine.restitution - 1e-9
    for _ in range(60):
        d = 0.5 * (low + high)
        low, high = (d, high) if np.log1p(d) - np.log1p(-e * d) < d * (1 + e) else (low, d)
    return {"contact_damping": d / 2 * random.uniform(0.9, 1.1)}


def _stiffness_wave(machine: Machine, random: np.random.Generator) -> dict[str, float]:
    return {"stiffness_wave_frequency": machine.frequency * random.uniform(1.3, 2.6)}


def _second_mode(machine: Machine, random: np.random.Generator) -> dict[str, float]:
    """A small oscillator of 2.2 to 5 times the natural frequency; its mass is the size, see `changes`."""
    return {"mode_frequency": random.uniform(2.2, 5), "mode_damping": 0.02}


def _delayed(machine: Machine, random: np.random.Generator) -> dict[str, float]:
    return {"delay": machine.period * random.uniform(0.1, 0.4)}


def _restitution_wave(machine: Machine, random: np.random.Generator) -> dict[str, float]:
    return {"restitution_wave_frequency": machine.frequency * random.uniform(0.13, 0.4)}


def _maxwell(machine: Machine, random: np.random.Generator) -> dict[str, float]:
    return {"maxwell_time": random.uniform(0.05, 0.3)}


def _exponent(field_: str, low: float, high: float) -> Callable[[np.random.Generator], dict[str, float]]:
    return lambda random: {field_: random.uniform(low, high)}


def _restitution(random: np.random.Generator) -> dict[str, float]:
    """A power law (a fifth: a viscoelastic body), one that saturates, or a step between two levels."""
    shape = int(random.choice([POWER, SATURATING, STEP]))
    drawn = {POWER: random.choice([0.2, random.uniform(0.25, 2)]), SATURATING: random.uniform(0.4, 1.5)}
    return {"restitution_shape": shape, "restitution_constant": drawn.get(shape, random.uniform(0.7, 1.6))}


CATALOGUE = {
    "viscous": Effect("damping", "viscous", (1e-4, 4)),
    "coulomb": Effect("force", "coulomb", (1e-3, 4)),
    "quadratic_drag": Effect(
        "coefficient", "quadratic", (1e-4, 1), another=_exponent("quadratic_exponent", 1.5, 3)
    ),
    "stribeck": Effect(
        "excess",
        "stribeck",
        (1e-3, 3),
        False,
        _stribeck,
        ("stribeck_velocity",),
        {"stribeck_velocity": "velocity"},
        another=_exponent("stribeck_exponent", 0.6, 3),
    ),
    "static_excess": Effect("force", "static_excess", (1e-3, 5)),
    "dahl": Effect("stiffness", "dahl", (1e4, 10)),
    "asymmetric_friction": Effect("coulomb", "asymmetric_coulomb", (1e-4, 1.5), True),
    "position_dependent_friction": Effect(
        "slope", "friction_slope", (1e-3, 0.85), True, another=_exponent("friction_wave", 4, 12)
    ),
    "cubic_spring": Effect(
        "stiffness", "cubic", (1e-2, 200), True, another=_exponent("cubic_exponent", 1.5, 5)
    ),
    "offset_force": Effect("force", "offset", (1e-3, 8), True),
    "restitution_slope": Effect("slope", "restitution_slope", (1e-4, 0.2), another=_restitution),
    "compliant_contact": Effect(
        "stiffness",
        "contact_stiffness",
        (1e9, 1e4),
        False,
        _contact,
        ("contact_damping",),
        {"contact_damping": "damping"},
        ("restitution",),
        _exponent("contact_exponent", 1, 2),
    ),
    "second_barrier": Effect("position", "lower", (1e-5, 0.15)),
    "drive_ripple": Effect(
        "sine",
        "ripple_sine",
        (1e-5, 0.3),
        True,
        _ripple,
        ("ripple_cosine",),
        {"ripple_cosine": "cosine", "ripple_harmonic": "harmonic"},
    ),
    "sensor_bias": Effect("bias", "sensor_bias", (1e-5, 0.2), True),
    "sensor_gain": Effect("gain", "sensor_gain", (1e-5, 0.3), True),
    "sensor_delay": Effect("delay", "sensor_delay", (1e-6, 0.05)),
}
"""By the names of the catalogue."""

ASYMMETRIC_VISCOUS = Effect("viscous", "asymmetric_viscous", (1e-4, 0.9), True)
"""The other half of `asymmetric_friction`."""

OUTSIDE = {
    "parametric_stiffness": Effect("", "stiffness_wave", (1e-4, 0.5), False, _stiffness_wave),
    "drifting_friction": Effect("", "friction_drift", (1e-4, 0.3)),
    "second_mode": Effect("", "second_mass", (1e-4, 0.5), False, _second_mode),
    "delayed_force": Effect("", "delayed_stiffness", (1e-2, 40), True, _delayed),
    "drifting_restitution": Effect("", "restitution_wave", (1e-4, 0.2), False, _restitution_wave),
    "maxwell_element": Effect("", "maxwell_stiffness", (1e-2, 60), False, _maxwell),
}
"""Effects that have no name in the catalogue."""

PAIRS = (
    ("quadratic_drag", "cubic_spring"),
    ("viscous", "offset_force"),
    ("restitution_slope", "quadratic_drag"),
    ("cubic_spring", "drive_ripple"),
    ("restitution_slope", "cubic_spring"),
    ("position_dependent_friction", "cubic_spring"),
)


def changes(machine: Machine, name: str, effect: Effect, size: float, shape: dict[str, float]) -> dict:
    """What the effect with this size changes in a machine."""
    found = dict(shape)
    if name in SENSORS:
        return {}
    if name == "second_mode":
        frequency = np.sqrt(machine.stiffness / machine.mass) * found.pop("mode_frequency")
        found["second_stiffness"] = size * frequency**2
        found["second_damping"] = 2 * found.pop("mode_damping") * size * frequency
    found[effect.field] = size
    if name == "second_barrier":
        found["lower"] = found.pop("lowest") + size
    if effect.field in ("viscous", "coulomb"):
        found[effect.field] += getattr(machine, effect.field)
    return found


def parameters(name: str, effect: Effect, size: float, shape: dict[str, float]) -> dict[str, float]:
    """The effect in the words of the case file."""
    if not effect.path:
        return {effect.field: size, **shape}
    if name == "second_barrier":
        return {"effect.second_barrier.position": shape["lowest"] + size}
    found = {effect.path: size} | {path: shape[key] for key, path in effect.paths.items()}
    return {f"effect.{name}.{key}": value for key, value in found.items()}
