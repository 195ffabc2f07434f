# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects that can be named in a machine with a motor: of the motor, of the crank, of the body.

An effect frees numbers of a law of the case, or gives the friction a law that contains its own.
"""

from collections.abc import Callable
from dataclasses import replace

from separatrix.discovery.fitting.catalogue import refuse_unknown
from separatrix.discovery.fitting.joint_effect import AT, JointEffect
from separatrix.discovery.fitting.locations import LocationScales
from separatrix.discovery.measured.bodies import Joint, Location
from separatrix.discovery.measured.cranks import law_of
from separatrix.errors import SeparatrixError
from separatrix.library import Model

MOTOR_LOCATIONS = ("motor", "friction", "restoring")
"""Laws that effects of these machines change."""
_LINE = {
    "linear": ("stall_torque", "no_load_speed"),
    "dc": ("torque_constant", "resistance"),
    "kloss": ("breakdown_torque", "breakdown_slip"),
}
_TWO_SPEEDS = "at one speed: a record at another voltage, or speed of the motor, distinguishes them"
_FIRST_ORDER = (
    "a current that lags takes k^2 L/R^2 off the inertia, to first order: a column current distinguishes them"
)
# of weight alone comes the dry friction of a case: without any it gets this [m/s^2]
_GRAVITY = 9.81


def _unbuilt(*_: object) -> str:
    raise AssertionError


def _row(name: str, meaning: str, family: str, **traits: object) -> JointEffect:
    return JointEffect(
        name, meaning, family, _unbuilt, dict, traits.pop("amplitudes", ()), of=("law", ""), **traits
    )


MOTOR_EFFECTS = {
    one.name: one
    for one in (
        _row("motor_line", "another torque of the motor over its speed", "torque over crank speed",
             sizes=tuple(key for keys in _LINE.values() for key in keys),
             confused={"bearing_friction": ("motor", _TWO_SPEEDS)}),
        _row("bearing_friction", "dry friction in the bearing of the crank", "torque over crank speed",
             amplitudes=("bearing_friction",), confused={"motor_line": ("motor", _TWO_SPEEDS)}),
        _row("crank_inertia", "another inertia of the crank", "inertia of the drive", sizes=("inertia",),
             confused={"current_lag": ("motor", _FIRST_ORDER)}),
        _row("lever_inertia", "an inertia of the lever", "inertia of the drive",
             amplitudes=("lever_inertia",)),
        _row("current_lag", "a current that lags behind the voltage", "torque over time",
             sizes=("inductance",), reach=2.0, confused={"crank_inertia": ("motor", _FIRST_ORDER)}),
        _row("viscous", "damping that grows with the speed", "friction over speed", amplitudes=("damping",)),
        _row("coulomb", "dry friction", "friction over speed", amplitudes=("kinetic_coefficient",)),
        _row("stribeck", "friction that falls with the speed", "friction over speed",
             sizes=("static_coefficient", "stribeck_velocity")),
        _row("static_excess", "friction that is larger at rest", "friction at rest",
             sizes=("static_coefficient",)),
        _row("offset_force", "a constant force", "force over position",
             amplitudes=("free_length",)),
    )
}  # fmt: skip
"""The table: one row for each effect."""
_OF_FRICTION = ("viscous", "coulomb", "stribeck", "static_excess")


def location_with_motor(kind: str) -> str:
    """The law that an effect changes."""
    if kind == "offset_force":
        return "restoring"
    return "friction" if kind in _OF_FRICTION else "motor"


def names_with_motor(model: Model, asked: tuple[str, ...] | None) -> list[str]:
    """Names of all effects that a machine with a motor may lack, of those that were asked for."""
    refuse_unknown(asked, MOTOR_EFFECTS)
    return [f"{kind}{AT}{location_with_motor(kind)}" for kind in MOTOR_EFFECTS if not asked or kind in asked]


def row_with_motor(kind: str, model: Model) -> JointEffect:
    """The effect for a machine: its change of the case, and what it frees from which values."""
    change, keys = _BUILT[kind](model)
    return replace(MOTOR_EFFECTS[kind], change=change, keys=keys)


Built = tuple[Callable[[dict, Location, Joint | None, LocationScales], str], Callable]


def _freed(path: str, values: Callable[[LocationScales], dict[str, list[float]]], why: str = "") -> Built:
    """Numbers of a law that are there already; `why` there is nothing to free, where that is so."""

    def change(*_: object) -> str:
        if why:
            raise SeparatrixError(why)
        return path

    return change, values


def _motor_line(model: Model) -> Built:
    law = law_of(model)
    names = _LINE.get(law, ())
    why = "" if names else f'the torque of motor.law = "{law}" has no line'
    return _freed("motor", lambda _: {key: [model.parameters[f"motor.{key}"].value] for key in names}, why)


def _bearing_friction(model: Model) -> Built:
    known = model.parameters["motor.bearing_friction"].value
    return _freed("motor", lambda s: {"bearing_friction": [known + 0.02 * s.force]})


def _crank_inertia(model: Model) -> Built:
    return _freed("motor", lambda _: {"inertia": [model.parameters["motor.inertia"].value]})


def _lever_inertia(model: Model) -> Built:
    lever = "drive.lever" in model.parameters or "drive.lever_length" in model.parameters
    why = "" if lever else "the drive has no lever"
    known = model.parameters["motor.lever_inertia"].value
    return _freed("motor", lambda s: {"lever_inertia": [known + 0.02 * s.mass]}, why)


def _current_lag(model: Model) -> Built:
    parameters = model.parameters
    why = "" if law_of(model) == "dc" else "the motor has no current"
    if not why and parameters["motor.inductance"].value > 0:
        why = "the current of the case lags"
    resistance = 1.0 if why else parameters["motor.resistance"].value

    def change(case: dict, *_: object) -> str:
        if why:
            raise SeparatrixError(why)
        return "motor"

    # a current that follows much sooner makes no difference, and its equations are stiff
    lags = (0.05, 0.2)
    return change, lambda s: {"inductance": [resistance * share / s.speed for share in lags]}


def _law_with(model: Model, dry: bool, viscous: bool) -> str:
    """The friction law with these parts besides those of the case."""
    dry = dry or "friction.kinetic_coefficient" in model.parameters
    viscous = viscous or "friction.damping" in model.parameters
    return "coulomb_viscous" if dry and viscous else "coulomb" if dry else "viscous"


def _relawed(model: Model, law: str, added: dict[str, float], why: str = "") -> Callable:
    """Another friction law with the numbers of that of the case and those `added`."""

    def change(case: dict, *_: object) -> str:
        if why:
            raise SeparatrixError(why)
        case["friction"] = {**added, **case["friction"], "law": law}
        if law != "viscous" and not case["body"].get("gravity"):
            case["body"]["gravity"] = _GRAVITY
        return "friction"

    return change


def _viscous(model: Model) -> Built:
    why = (
        "the friction of the case is of another form"
        if "friction.stribeck_velocity" in model.parameters
        else ""
    )
    change = _relawed(model, _law_with(model, False, True), {"damping": 0.0}, why)
    return change, lambda s: {"damping": [0.02 * s.force / s.speed]}


def _coulomb(model: Model) -> Built:
    weight = model.parameters["body.mass"].value * (model.parameters["body.gravity"].value or _GRAVITY)
    change = _relawed(model, _law_with(model, True, False), {"kinetic_coefficient": 0.0})
    return change, lambda s: {"kinetic_coefficient": [0.02 * s.force / weight]}


def _dry(model: Model) -> tuple[float, str]:
    """Coefficient of sliding, and why there is none that could grow at rest."""
    one = model.parameters.get("friction.kinetic_coefficient")
    if one is None or not one.value > 0:
        return 1.0, "there is no dry friction"
    return one.value, ""


def _stribeck(model: Model) -> Built:
    kinetic, why = _dry(model)
    if "friction.damping" in model.parameters:
        why = "no law of the case file has it beside viscous friction"
    added = {"static_coefficient": 1.3 * kinetic, "stribeck_velocity": 1.0}
    change = _relawed(model, "coulomb_stribeck", added, why)
    shares = (0.15, 0.04, 0.5)
    return change, lambda s: {
        "static_coefficient": [1.3 * kinetic],
        "stribeck_velocity": [share * s.speed for share in shares],
    }


def _static_excess(model: Model) -> Built:
    kinetic, why = _dry(model)
    return _freed("friction", lambda _: {"static_coefficient": [1.3 * kinetic, 2 * kinetic]}, why)


def _offset_force(model: Model) -> Built:
    length = model.parameters.get("restoring.free_length")
    why = "" if length is not None else "there is no spring"
    if length is not None and length.value != 0:
        why = "restoring.free_length of the case is one"
    return _freed("restoring", lambda s: {"free_length": [0.02 * s.length]}, why)


_BUILT: dict[str, Callable[[Model], Built]] = {
    "motor_line": _motor_line,
    "bearing_friction": _bearing_friction,
    "crank_inertia": _crank_inertia,
    "lever_inertia": _lever_inertia,
    "current_lag": _current_lag,
    "viscous": _viscous,
    "coulomb": _coulomb,
    "stribeck": _stribeck,
    "static_excess": _static_excess,
    "offset_force": _offset_force,
}
