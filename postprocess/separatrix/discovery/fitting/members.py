# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The families of effects that may be functions: their variables, and the function of a fitted machine."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.motions import extensions
from separatrix.discovery.policy import FIT
from separatrix.library import effects


@dataclass(frozen=True)
class Member:
    """An effect that is a table: the key of its knots and those of its values.

    One without knots is a series of harmonics; the first is what the scale and the phase of the drive are.
    """

    effect: str
    knots: str
    values: tuple[str, ...]
    # variable of the function, its unit, and the quantity that it gives
    variable: str
    unit: str
    quantity: str
    # free parameter of the machine that is equivalent to a constant of the table, and whether the table is
    # relative to it
    anchor: str | None
    by_share: bool
    # parameters of the machine that the table replaces
    replaces: str | None
    # force that it explains, by the names of the ceiling
    explains: str
    # values of the variable in a fitted motion, ascending
    seen: Callable[[Fitted], np.ndarray]
    # the function in a known machine beside a base at the knots, one for each of `values`, or None
    known: Callable[[Fitted, Fitted, np.ndarray], list[np.ndarray] | None]
    # on what a missing force depends that it can be, as hypotheses have it
    depends_on: tuple[str, ...] = ()
    # whether the knots begin at zero
    from_zero: bool = False
    # least value of the table
    least: float = -np.inf
    # parameter beside the table, and what to start it from
    beside: tuple[str, Callable[[Fitted], float]] | None = None
    # parameters of the machine that the variable counts from: moved with the function they change nothing
    origin: tuple[str, ...] = ()

    @property
    def family(self) -> str:
        """The function that it is one shape of."""
        return effects()[self.effect].family


def _impact_speeds(fitted: Fitted) -> np.ndarray:
    """Speeds of the impacts of the fitted motion [m/s], those of bounces that die out aside."""
    fit = fitted.fit
    found = [
        np.abs(impacts[fit.good[np.flatnonzero(fitted.problem.segments.record == number)][rows], 2])
        for number, impacts in enumerate(fit.evaluation.impacts)
        if impacts is not None and len(impacts)
        for rows in [impacts[:, 0].astype(int)]
    ]
    speeds = np.sort(np.concatenate(found)) if found else np.zeros(0)
    return speeds[speeds > FIT.dying_bounce * speeds.max(initial=0)]


def _speeds(fitted: Fitted) -> np.ndarray:
    """Speeds of the fitted motion at the samples [m/s]."""
    return np.sort(np.abs(fitted.fit.evaluation.v[_inside(fitted)]))


def _sliding_positions(fitted: Fitted) -> np.ndarray:
    """Positions of the fitted motion at the samples where it slides [m]."""
    inside = _inside(fitted)
    x, speed = fitted.fit.evaluation.x[inside], np.abs(fitted.fit.evaluation.v[inside])
    return np.sort(x[speed > FIT.dying_bounce * speed.max(initial=0)])


def _everywhere(fitted: Fitted) -> np.ndarray:
    """Positions of the fitted motion at the samples [m]."""
    return np.sort(fitted.fit.evaluation.x[_inside(fitted)])


def _extensions(fitted: Fitted) -> np.ndarray:
    """Extensions of the spring at the samples [m]; none without a linear spring."""
    found = extensions(fitted.problem, fitted.fit)
    return np.zeros(0) if found is None else np.sort(found[_inside(fitted)])


def _penetrations(fitted: Fitted) -> np.ndarray:
    """Penetrations into a soft barrier at the samples [m]."""
    values = _values(fitted)
    x = fitted.fit.evaluation.x[_inside(fitted)]
    depth = np.zeros(0)
    for path, side in (("contact.upper", 1), ("contact.lower", -1)):
        if path in fitted.model.parameters:
            depth = np.append(depth, side * (x - values.get(path, fitted.model.parameters[path].value)))
    return np.sort(depth[depth > 0])


def _angles(fitted: Fitted) -> np.ndarray:
    """Angles of the crank at the samples [rad], where there is a drive."""
    driven = any(one.frequency is not None for one in fitted.problem.prepared)
    return np.linspace(0, 2 * np.pi, _inside(fitted).sum()) if driven else np.zeros(0)


def _inside(fitted: Fitted) -> np.ndarray:
    return fitted.problem.segments.inside & fitted.fit.good[:, None]


def _known_restitution(known: Fitted, base: Fitted, speeds: np.ndarray) -> list[np.ndarray] | None:
    table = restitution_at(known.model, _values(known), speeds)
    return None if table is None else [table]


def _known_friction(known: Fitted, base: Fitted, speeds: np.ndarray) -> list[np.ndarray]:
    return [friction_at(known, speeds, direction, base) for direction in (1.0, -1.0)]


def _known_over_position(known: Fitted, base: Fitted, positions: np.ndarray) -> list[np.ndarray]:
    values = _values(known)
    slope = values.get("effect.position_dependent_friction.slope", 0.0)
    return [values["friction.kinetic_coefficient"] * np.maximum(1 + slope * positions, 0)]


def _known_spring(known: Fitted, base: Fitted, at: np.ndarray) -> list[np.ndarray]:
    values, case = _values(known), base.model.parameters["restoring.stiffness"].value
    stiffness = values.get("restoring.stiffness", case)
    slack = 0.5 * values.get("effect.backlash.gap", 0.0)
    cubic = values.get("effect.cubic_spring.stiffness", 0.0)
    return [(stiffness - case) * at + cubic * at**3 - stiffness * np.clip(at, -slack, slack)]


def _known_force(known: Fitted, base: Fitted, at: np.ndarray) -> list[np.ndarray]:
    return [np.full(at.size, _values(known).get("effect.offset_force.force", 0.0))]


def _known_contact(known: Fitted, base: Fitted, at: np.ndarray) -> list[np.ndarray] | None:
    for name, default in (("compliant_contact", 1.5), ("kelvin_voigt_contact", 1.0)):
        stiffness = _values(known).get(f"effect.{name}.stiffness")
        if stiffness is not None:
            exponent = known.model.parameters.get(f"effect.{name}.exponent")
            return [stiffness * at ** (default if exponent is None else exponent.value)]
    return None


def _contact_damping(known: Fitted) -> float:
    """Of a force that grows with the rate of penetration by this share [s/m]."""
    values = _values(known)
    for name in ("compliant_contact", "contact_curve"):
        if f"effect.{name}.damping" in values:
            return values[f"effect.{name}.damping"]
    deepest = _penetrations(known).max(initial=0.0)
    force = values["effect.kelvin_voigt_contact.stiffness"] * deepest / 2
    return values["effect.kelvin_voigt_contact.damping"] / max(force, 1e-300)


def _no_harmonics(known: Fitted, base: Fitted, orders: np.ndarray) -> list[np.ndarray]:
    return [np.zeros(orders.size), np.zeros(orders.size)]


def _values(fitted: Fitted) -> dict[str, float]:
    """Values of the machine as fitted, nuisances aside."""
    return {
        path: number
        for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True)
        if not one.is_nuisance
        for path, number in one.numbers(value).items()
    }


def restitution_at(model, values: dict[str, float], speeds: np.ndarray) -> np.ndarray | None:
    """Restitution at speeds of impact: what the simulator does with a body just before its barrier."""
    there = {path: values.get(path, model.parameters[path].value) for path in model.parameters if path in
             ("contact.upper", "contact.lower")}  # fmt: skip
    side = 1.0 if abs(there.get("contact.upper", np.inf)) < 1e100 else -1.0
    barrier = there.get("contact.upper" if side > 0 else "contact.lower", np.inf)
    if abs(barrier) >= 1e100:
        return None
    time = FIT.force_time / max(1.0, model.drive_frequency({}))
    start = np.column_stack([barrier - side * speeds * time, side * speeds, 0 * speeds])
    times = np.tile([0.0, 2 * time], speeds.size)
    flown = model.segments(
        list(values), np.array(list(values.values())), start, 2 * np.arange(speeds.size + 1), times,
        derivatives=False,
    )  # fmt: skip
    hit, first = np.unique(flown.impact.segment, return_index=True)
    if hit.size < speeds.size:
        return None
    return np.abs(flown.impact.speed_after[first] / flown.impact.speed_before[first])


_BY_DIRECTION = ("effect.asymmetric_friction.coulomb", "effect.asymmetric_friction.viscous")


def friction_at(
    known: Fitted, speeds: np.ndarray, direction: float, base: Fitted | None = None
) -> np.ndarray:
    """Friction [N] against the motion in a direction: what slows a body down in the simulator.

    That of the known machine beyond that of the base with the numbers of its case; without `base` all of it.
    An effect that differs by direction stays out of both: no machine has it without sliding friction.
    """
    values = _values(known) | {path: 0.0 for path in _BY_DIRECTION if path in known.model.parameters}
    model = known.model if base is None else base.model
    without = {path: value for path, value in values.items() if path in model.parameters}
    if base is None:
        without |= {path: 0.0 for path in model.parameters if _is_friction(path)}
    else:
        without = {path: value for path, value in without.items() if not _is_friction(path)}
    mass = values.get("body.mass", known.model.parameters["body.mass"].value)
    x = np.median(known.fit.evaluation.x[known.problem.segments.inside & known.fit.good[:, None]])
    # at rest there is no direction
    v = direction * np.maximum(speeds, 1e-3 * np.max(speeds))
    time = FIT.force_time / max(1.0, known.model.drive_frequency({}))
    start = np.column_stack([np.full(v.size, x), v, 0 * v])
    first, times = 2 * np.arange(v.size + 1), np.tile([0.0, time], v.size)
    ends = [
        machine.segments(
            list(chosen), np.array(list(chosen.values())), start, first, times,
            derivatives=False, tolerance=1e-12,
        ).v[1::2]
        for machine, chosen in ((known.model, values), (model, without))
    ]  # fmt: skip
    return -direction * mass * (ends[0] - ends[1]) / time


def _is_friction(path: str) -> bool:
    """Whether a parameter is a size of friction over speed."""
    law = path.startswith("friction.") and path.endswith(("coefficient", "damping"))
    return law or path.startswith(("effect.friction_curve.upwards", "effect.friction_curve.downwards"))


MEMBERS = (
    Member(
        "restitution_curve", "speed", ("change",), "impact speed", "m/s", "restitution",
        "contact.restitution", False, None, "impacts", _impact_speeds, _known_restitution, ("impact speed",),
    ),
    Member(
        "friction_curve", "speed", ("upwards", "downwards"), "speed", "m/s", "friction (N)",
        None, False, "friction.", "speed", _speeds, _known_friction, ("speed",), from_zero=True,
    ),
    Member(
        "friction_position_curve", "position", ("change",), "position", "m",
        "coefficient of kinetic friction", "friction.kinetic_coefficient", True, None, "speed and position",
        _sliding_positions, _known_over_position, ("speed", "position"),
    ),
    Member(
        "spring_curve", "extension", ("force",), "extension", "m", "force beyond the spring of the case (N)",
        None, False, "restoring.", "position", _extensions, _known_spring, ("extension",),
    ),
    Member(
        "force_curve", "position", ("force",), "position", "m", "force beyond the spring of the case (N)",
        None, False, "restoring.", "position", _everywhere, _known_force, ("position",),
    ),
    Member(
        "contact_curve", "penetration", ("force",), "penetration", "m", "contact force (N)",
        None, False, None, "time since impact", _penetrations, _known_contact, ("time since impact",),
        least=0.0, beside=("damping", _contact_damping), origin=("contact.lower", "contact.upper"),
    ),
    Member(
        "drive_harmonics", "", ("cosine", "sine"), "drive phase", "rad", "motion of the foot (m)",
        None, False, None, "phase", _angles, _no_harmonics, ("drive phase",),
    ),
)  # fmt: skip
