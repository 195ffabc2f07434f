# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects that can be named in machines of several bodies: each at a location, as a law of the case file.

An effect adds a joint, or gives an existing one a law that contains its own, so the result is an ordinary
case. A row of the table is an effect; its name in a verdict is `EFFECT@LOCATION`.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from separatrix.discovery.fitting.catalogue import Candidate, Scales, candidate, refuse_unknown
from separatrix.discovery.fitting.joint_effect import AT, JointEffect
from separatrix.discovery.fitting.locations import LocationScales, SensedScales
from separatrix.discovery.fitting.machine import Free, bounds_of
from separatrix.discovery.fitting.motor_effects import MOTOR_EFFECTS, MOTOR_LOCATIONS, row_with_motor
from separatrix.discovery.measured.bodies import (
    GROUND,
    Joint,
    Location,
    Structure,
    edited,
    has_motor,
    structure_of,
)
from separatrix.discovery.policy import FIT
from separatrix.errors import SeparatrixError
from separatrix.library import Effect, effects

# keys that a spring with free play in series must not have
_NO_PLAY = ("free_length", "modulation", "modulation_cosine", "modulation_sine")


def _new(family: str, **law: object) -> Callable[[dict, Location, Joint | None, LocationScales], str]:
    """A further joint at the location."""

    def change(case: dict, location: Location, _: Joint | None, scales: LocationScales) -> str:
        name = f"added_{len(case.setdefault(family, {})) + 1}"
        case[family][name] = {"between": list(location.ends), **law}
        return f"{family}.{name}"

    return change


def _relaw(law: str, **more: object) -> Callable[[dict, Location, Joint | None, LocationScales], str]:
    """Another law of an existing joint, which contains that of the case."""

    def change(case: dict, _: Location, joint: Joint, scales: LocationScales) -> str:
        family, name = joint.path.split(".")
        case[family][name] |= {"law": law, **more}
        return joint.path

    return change


def _load(case: dict, location: Location, _: Joint | None, scales: LocationScales) -> str:
    return f"body.{location.ends[1]}"


def _softened(case: dict, location: Location, joint: Joint, scales: LocationScales) -> str:
    family, name = joint.path.split(".")
    table = case[family][name]
    ends = {key: table[key] for key in ("upper", "lower") if key in table}
    stiffness = scales.mass * scales.impact_speed**2 / (0.03 * scales.length) ** 2
    case[family][name] = {
        "between": table["between"],
        "law": "kelvin_voigt",
        "stiffness": stiffness,
        "damping": 0.3 * scales.mass * scales.impact_speed / (0.03 * scales.length),
        "tension": 0.0,
        **ends,
    }
    return joint.path


def _played(case: dict, location: Location, joint: Joint, scales: LocationScales) -> str:
    """The spring acts beyond both ends of the free play, its damper always."""
    family, name = joint.path.split(".")
    table = case[family][name]
    if any(np.any(table.get(key, 0.0)) for key in _NO_PLAY):
        raise SeparatrixError("the spring of a play is not at its middle, or not of constant stiffness")
    contacts = case.setdefault("contact", {})
    added = f"added_{len(contacts) + 1}"
    half = 0.025 * scales.length
    contacts[added] = {
        "between": table["between"],
        "law": "kelvin_voigt",
        "stiffness": table["stiffness"],
        "upper": half,
        "lower": -half,
    }
    table["stiffness"] = 0.0
    return f"contact.{added}"


def _sprung(case: dict, location: Location, joint: Joint, scales: LocationScales) -> str:
    """Elastic friction in place of the friction, whose force is refitted: without elasticity it may be 0."""
    family, name = joint.path.split(".")
    table = case[family].pop(name)
    added = f"added_{len(case[family]) + 1}"
    kept = {key: table[key] for key in ("between", "velocity") if key in table}
    case[family][added] = {**kept, "law": "elastic_coulomb", "force": 1.0, "stiffness": 1.0}
    return f"{family}.{added}"


JOINT_EFFECTS = {
    one.name: one
    for one in (
        JointEffect(
            "viscous", "damping that grows with the speed", "friction over speed",
            _new("spring", damping=0.0),
            lambda s: {"damping": [0.02 * s.force / s.speed]}, ("damping",),
        ),
        JointEffect(
            "coulomb", "dry friction", "friction over speed", _new("friction", force=0.0),
            lambda s: {"force": [0.02 * s.force]}, ("force",),
        ),
        JointEffect(
            "quadratic_drag", "a drag that grows with the square of the speed", "friction over speed",
            _new("friction", law="coulomb_quadratic", force=0.0, drag=0.0),
            lambda s: {"drag": [0.02 * s.force / s.speed**2]}, ("drag",),
        ),
        JointEffect(
            "stribeck", "friction that falls with the speed", "friction over speed",
            _new("friction", law="coulomb_stribeck", force=0.0, static_force=0.0, stribeck_velocity=1.0,
                 stribeck_exponent=2.0),
            lambda s: {"static_force": [0.05 * s.force],
                       "stribeck_velocity": [share * s.speed for share in (0.15, 0.04, 0.5)]},
            ("static_force",), ("stribeck_velocity",),
        ),
        JointEffect(
            "cubic_spring", "a force that grows with the cube of the extension", "spring over extension",
            _new("spring", law="polynomial", stiffness=0.0, cubic=0.0),
            lambda s: {"cubic": [0.02 * s.force / s.length**3]}, ("cubic",),
        ),
        JointEffect(
            "quadratic_spring", "a force that grows with the square of the extension",
            "spring over extension",
            _new("spring", law="polynomial", stiffness=0.0, quadratic=0.0),
            lambda s: {"quadratic": [0.02 * s.force / s.length**2]}, ("quadratic",),
        ),
        JointEffect(
            "linear_spring", "a spring that the case lacks", "spring over extension",
            _new("spring", stiffness=0.0),
            lambda s: {"stiffness": [0.02 * s.force / s.length]}, ("stiffness",),
        ),
        JointEffect(
            "backlash", "free play in series with a spring", "spring over extension", _played,
            lambda s: {"upper": [share * s.length for share in (0.025, 0.1, 0.005)]}, (), ("upper",),
            ("spring", "linear"), moved=("stiffness",), mirrored=("upper", "lower"),
        ),
        JointEffect(
            "dahl", "friction with a spring before it slides", "friction before sliding",
            _sprung,
            lambda s: {"stiffness": [s.friction / (share * s.length) for share in (0.02, 0.005, 0.1)],
                       "force": [s.friction]},
            (), ("stiffness", "force"), ("friction", "coulomb"),
        ),
        JointEffect(
            "offset_force", "a constant force", "force over position", _load,
            lambda s: {"load": [0.02 * s.force]}, ("load",),
        ),
        JointEffect(
            "restitution_falloff", "restitution that falls with the impact speed", "restitution over "
            "impact speed",
            _relaw("newton_power", yield_speed=1.0, falloff=0.0),
            lambda s: {"falloff": [0.05], "yield_speed": [FIT.yields * s.impact_speed, 0.1 * s.impact_speed]},
            ("falloff",), ("yield_speed",), ("contact", "newton"), "barrier",
        ),
        JointEffect(
            "compliant_contact", "a stop that gives way", "contact over penetration", _softened,
            lambda s: {
                "stiffness": [
                    s.mass * s.impact_speed**2 / (share * s.length) ** 2 for share in (0.03, 0.008, 0.1)
                ],
                "damping": [0.3 * s.mass * s.impact_speed / (0.03 * s.length)],
            },
            (), ("stiffness", "damping"), ("contact", "newton"), "barrier",
        ),
    )
}  # fmt: skip
"""The table: one row for each effect."""


def effect_of(name: str) -> Effect:
    """Properties of an effect of one body, or of one at a location of several."""
    if AT not in name:
        return effects()[name]
    kind, _, where = name.partition(AT)
    row = MOTOR_EFFECTS[kind] if where in MOTOR_LOCATIONS else JOINT_EFFECTS[kind]
    confused = {f"{other}{AT}{law}": why for other, (law, why) in row.confused.items()}
    return Effect(name, row.meaning, {}, row.family, row.acts, row.amplitudes, row.sizes, "", confused)


def location_of(name: str) -> str:
    """The location in the name of an effect, '' of one body."""
    return name.partition(AT)[2]


def names_at_joints(model, asked: tuple[str, ...] | None) -> list[str]:
    """Names of all effects that a machine of several bodies may lack, of those that were asked for."""
    refuse_unknown(asked, JOINT_EFFECTS)
    structure = structure_of(model)
    return [
        f"{kind}{AT}{location}"
        for kind, row in JOINT_EFFECTS.items()
        if not asked or kind in asked
        for location in _locations(row, structure)
    ]


def _locations(row: JointEffect, structure: Structure) -> list[str]:
    """Locations at which an effect may act: those of its kind of joint, or all."""
    if row.of[0]:
        return [joint.path for joint in structure.joints if _is(joint, row)]
    if row.name == "offset_force":
        return [one.name for one in structure.locations if one.ends[0] == GROUND]
    return [one.name for one in structure.locations]


def _is(joint: Joint, row: JointEffect) -> bool:
    return joint.path.startswith(f"{row.of[0]}.") and joint.law == row.of[1]


def candidate_of(
    model, free: list[Free], names: tuple[str, ...], name: str, scales: Scales | SensedScales
) -> Candidate | str:
    """The machine with the effect `name` added, or why that makes no sense."""
    if AT not in name:
        return candidate(model, free, names, name, scales)
    kind, _, where = name.partition(AT)
    row, structure = (
        row_with_motor(kind, model) if has_motor(model) else JOINT_EFFECTS[kind],
        structure_of(model),
    )
    joint = structure.joint(where) if row.of[0] else None
    ends = joint.ends if joint else structure.location(where).ends
    location = Location(where, ends, joint.row if joint else structure.location(where).row, ())
    size = scales.at(where)
    why = _cannot_act(row, size, where in scales.measured)
    if why:
        return why
    path = ""

    def change(case: dict) -> None:
        nonlocal path
        path = row.change(case, location, joint, size)

    keys = row.keys(size)
    try:
        extended = edited(model, change)
    except SeparatrixError as reason:
        return str(reason)
    goes_over = {f"{joint.path}.{key}": f"{path}.{key}" for key in row.moved} if joint else {}
    whole = [replace(one, path=goes_over.get(one.path, one.path)) for one in free]
    whole = [one for one in whole if one.is_nuisance or one.path in extended.parameters]
    own = {f"{path}.{key}" for key in keys}
    if any(one.path in own for one in whole):
        return "the base machine has it, and it is fitted"
    added = [_free(row, key, values, path, extended) for key, values in keys.items()]
    at = tuple(range(len(whole), len(whole) + len(added)))
    linear = np.array([key in row.amplitudes for key in keys])
    choices = []
    for (key, values), one in zip(keys.items(), added, strict=True):
        signs = (1.0, -1.0) if key in row.amplitudes and one.lower < 0 else (1.0,)
        fitted = np.log(values) if one.positive else np.array(values)
        choices.append([float(sign * value) for value in fitted for sign in signs])
    starts = [np.array(values, float) for values in product(*choices)]
    forms = list(np.unique(np.where(linear, 0.0, np.array(starts)), axis=0))
    # what a form starts from must be a machine, whatever the joint of the case has
    extended = _with_starts(extended, added)
    return Candidate((*names, name), extended, whole + added, at, starts, forms, linear)


def _cannot_act(row: JointEffect, size: LocationScales | None, measured: bool) -> str:
    """Why an effect makes no sense at a joint whose force may be measured; '' if it does."""
    if size is None:
        return "nothing moves there in these records"
    if row.acts == "barrier" and not size.impact_speed > 0:
        return "there are no impacts in these records"
    if row.moved and measured:
        return "the force of this joint is measured, which would be that of two"
    if row.of[0] == "friction" and not size.friction > 0:
        return "there is no friction"
    return ""


def _free(row: JointEffect, key: str, values: list[float], path: str, model) -> Free:
    """A parameter of an effect, from the first of its usual sizes."""
    if key in row.sizes:
        reach = row.reach or FIT.far_joint_start
        ends = np.log([min(values) / reach, max(values) * reach])
        mirror = {"also": f"{path}.{row.mirrored[1]}", "mirrored": True} if key == row.mirrored[0] else {}
        start = float(np.log(values[0]))
        return Free(f"{path}.{key}", start, *ends, 0.1, positive=True, **mirror)
    lower, upper = bounds_of(model.parameters[f"{path}.{key}"])
    # -1 stands for the force of sliding
    lower = 0.0 if key == "static_force" else lower
    return Free(f"{path}.{key}", values[0], lower, upper, abs(values[0]))


def _with_starts(model, added: list[Free]):
    values: dict[str, float] = {}
    for one in added:
        values |= one.numbers(one.value)
    return type(model).from_text(model.to_text(values))
