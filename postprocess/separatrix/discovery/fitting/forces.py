# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The force that a known motion needs: mass times acceleration less the forces of the machine along it.

The simulator gives the forces of the machine, by a flight from each sample that is too short for any change,
under the measured force, so that the body does not stop. Only friction with memory needs the whole path: its
state follows from Dahl's equation, which has a closed form between turning points.
"""

import numpy as np

from separatrix.discovery.measured.driven import Driven
from separatrix.discovery.measured.preflight import Prepared, even_interval
from separatrix.discovery.measured.thinned_force import thinned
from separatrix.discovery.policy import FIT
from separatrix.errors import SeparatrixError

_DAHL = "effect.dahl.stiffness"
_OVER_POSITION = ("effect.position_dependent_friction.", "effect.friction_position_curve.")


def force_needed(
    model, values: dict[str, float], motion: Driven, measured: np.ndarray, pieces: list[tuple[int, int]]
) -> np.ndarray:
    """The force [N] that the machine with these values takes at the samples of a record; 0 at rest."""
    acceleration = _accelerations(model, values, motion, measured)
    force = _value(model, values, "body.mass") * (motion.a - acceleration) + measured
    if _DAHL in model.parameters:
        share = _share_at_position(model, values, motion, measured)
        force = force + share * _unslipped(model, values, motion, pieces)
    return np.where(motion.moves, force, 0.0)


def _accelerations(model, values: dict[str, float], motion: Driven, measured: np.ndarray) -> np.ndarray:
    """Accelerations under the measured force at all samples, 0 where the body does not move."""
    rows = np.flatnonzero(motion.moves)
    mass = _value(model, values, "body.mass")
    usual = (np.ptp(measured) + mass * np.max(np.abs(motion.a), initial=0.0)) / mass
    time = np.minimum(FIT.instant, FIT.instant_share * np.abs(motion.v[rows]) / max(usual, 1e-300))
    start = np.column_stack([motion.x[rows], motion.v[rows], np.zeros(rows.size)])
    series = np.append(measured, measured[-1])
    flown = model.segments(
        list(values), np.array(list(values.values())), start, 2 * np.arange(rows.size + 1),
        np.column_stack([np.zeros(rows.size), time]).ravel(), force=(rows.astype(float), 1.0, series),
        derivatives=False, tolerance=FIT.force_tolerance,
    )  # fmt: skip
    if np.any(flown.reason != 0):
        raise SeparatrixError("a position or speed of the record that the machine cannot have")
    found = np.zeros(motion.v.size)
    found[rows] = (flown.v[1::2] - motion.v[rows]) / time
    return found


def _unslipped(model, values: dict[str, float], motion: Driven, pieces: list[tuple[int, int]]) -> np.ndarray:
    """State of Dahl's friction less that after a long slip in the direction of the motion [N]."""
    stiffness, dry = _value(model, values, _DAHL), dry_friction(model, values)
    more = _value(model, values, "effect.asymmetric_friction.coulomb")
    found = np.zeros(motion.x.size)
    for first, last in pieces:
        # the motion before the record is unknown: a long slip is assumed
        behind, level, before = 0.0, 0.0, None
        for a, b, sign, begun in motion.strokes(first, last):
            if before is not None:
                behind *= np.exp(-stiffness * abs(begun - before) / max(abs(level), 1e-300))
                behind += level - _slipping(sign, dry, more)
            level, before = _slipping(sign, dry, more), begun
            way = np.abs(motion.x[a:b] - begun)
            found[a:b] = behind * np.exp(-stiffness * way / max(abs(level), 1e-300))
    return found


def dry_friction(model, values: dict[str, float]) -> float:
    """Constant dry friction of a machine with these values [N]."""
    weight = _value(model, values, "body.mass") * _value(model, values, "body.gravity")
    constant = _value(model, values, "effect.coulomb.force")
    return constant + _value(model, values, "friction.kinetic_coefficient") * weight


def _slipping(sign: int, dry: float, more: float) -> float:
    """State of Dahl's friction after a long slip in a direction [N]."""
    return sign * max(dry + sign * more, 0.0)


def _share_at_position(model, values: dict[str, float], motion: Driven, measured: np.ndarray) -> np.ndarray:
    """Friction at each sample over that of the law without dependence on position."""
    if not any(path.startswith(_OVER_POSITION) for path in model.parameters):
        return np.ones(motion.x.size)
    path = "friction.kinetic_coefficient"
    more = {**values, path: _value(model, values, path) + 1.0}
    changed = _accelerations(model, more, motion, measured) - _accelerations(model, values, motion, measured)
    gravity = _value(model, values, "body.gravity")
    # without weight there is no friction that could depend on position
    return np.abs(changed) / gravity if gravity > 0 else np.ones(motion.x.size)


def _value(model, values: dict[str, float], path: str) -> float:
    """Value of a parameter; 0 of one that the machine lacks."""
    if path in values:
        return values[path]
    return float(model.parameters[path].value) if path in model.parameters else 0.0


def force_argument(prepared: Prepared, first: np.ndarray, mass: float):
    """Force of a record for segments that begin at the offsets `first`, in samples.

    Time is counted in samples, so that offsets in the force are right after a gap too. One more sample leaves
    room for the last times, which need not be quite even. A force that changes little between samples is
    thinned, as far as a body of the `mass` [kg] moves within a share of the noise as under all samples.
    """
    record = prepared.record
    if record.force is None:
        return None
    interval = even_interval(record)
    series = np.append(record.force, record.force[-1])
    if len(record.pieces) > 1:
        # across a gap nothing is known of the force
        return first * interval, interval, series
    spread = float(np.min(prepared.samples.spread(prepared.memory)))
    position = FIT.tolerance_share * prepared.sigma * spread
    speed = np.inf if record.v is None else FIT.tolerance_share * prepared.velocity_sigma * spread
    if prepared.thinned is None or prepared.thinned[0] != (position, speed, mass):
        prepared.thinned = ((position, speed, mass), thinned(series, interval, mass, position, speed))
    return first * interval, *prepared.thinned[1]
