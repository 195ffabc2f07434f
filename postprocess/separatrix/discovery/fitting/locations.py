# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scales of motion and forces at the locations of a machine of several bodies, along a fitted motion."""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.measured.bodies import Structure, contact_paths, has_motor, structure_of
from separatrix.discovery.measured.signals import usual_size
from separatrix.discovery.policy import FIT


@dataclass(frozen=True)
class LocationScales:
    """Of a location, in SI units: mass that a force moves, extension, speed, force, impact speed (0: none).

    For a friction of the case also its force.
    """

    mass: float
    length: float
    speed: float
    force: float
    impact_speed: float
    friction: float = 0.0


@dataclass(frozen=True)
class SensedScales:
    """Typical sizes in the records, by location and joint."""

    locations: dict[str, LocationScales | None]
    # divisor of forces, which act on the coordinates themselves
    mass: float = 1.0
    # no one angular frequency: hypotheses of several bodies need none [rad/s]
    frequency: float = 1.0
    # joints whose force is a column
    measured: frozenset[str] = frozenset()

    def at(self, name: str) -> LocationScales | None:
        """Scales at a location, or joint; None where nothing moves."""
        return self.locations.get(name)


def location_scales(problem: Likelihood, fit: Fit) -> SensedScales:
    """Measure all locations along the motion of a fit."""
    structure = structure_of(problem.model)
    inside = problem.segments.inside & fit.good[:, None]
    if not inside.any():
        inside = problem.segments.inside & ~fit.evaluation.failed[:, None]
    motion = fit.evaluation.motion[inside]
    n = structure.n
    # accelerations from neighbours within segments; impacts are far above
    steps = np.diff(fit.evaluation.motion[:, :, n:], axis=1)
    both = inside[:, 1:] & inside[:, :-1]
    interval = float(np.median([one.record.interval for one in problem.prepared]))
    rates = steps[both] / interval
    found: dict[str, LocationScales | None] = {}
    # of an angle and a position none is small beside the other
    largest = 0.0 if has_motor(problem.model) else float(np.max(np.std(motion[:, :n], axis=0)))
    rows = {one.name: one.row for one in structure.locations}
    rows |= {one.path: one.row for one in structure.joints}
    for name, row in rows.items():
        length = float(np.std(motion[:, :n] @ row))
        speed = float(np.sqrt(np.mean((motion[:, n:] @ row) ** 2)))
        if length <= FIT.still * largest:
            found[name] = None
            continue
        mass = 1 / float(row @ (row / structure.mass))
        size = usual_size(rates @ row)
        found[name] = LocationScales(
            mass,
            length,
            speed,
            mass * size,
            _impact_speed(problem, fit, structure, name),
            _friction(problem, fit, name),
        )
    sensors = [sensor for one in problem.prepared for sensor in one.sensors]
    return SensedScales(found, measured=frozenset(one.of for one in sensors if one.kind == "F"))


def _friction(problem: Likelihood, fit: Fit, name: str) -> float:
    """Force of a friction as fitted, of the case where the fit has all but lost it; 0 of other joints [N]."""
    path = f"{name}.force"
    if not name.startswith("friction."):
        return 0.0
    of_case = problem.model.parameters[path].value
    fitted = problem.machine_values(0, fit.values).get(path, of_case)
    return fitted if fitted > FIT.lost_friction * of_case else of_case


def _impact_speed(problem: Likelihood, fit: Fit, structure: Structure, name: str) -> float:
    """Usual speed of impacts of a contact, 0 without any."""
    contacts = contact_paths(problem.model)
    if name not in contacts:
        return 0.0
    hits = [one for one in fit.evaluation.impacts if one is not None and len(one)]
    if not hits:
        return 0.0
    table = np.concatenate(hits)
    speeds = table[table[:, 5] == contacts.index(name), 2]
    return float(np.median(speeds)) if speeds.size else 0.0


def usual_speed(problem: Likelihood, fit: Fit, path: str) -> float:
    """Root mean square of the speed along a joint in the segments that are followed [m/s]."""
    good = problem.segments.inside & fit.good[:, None]
    speeds = fit.evaluation.motion[good][:, problem.structure.n :] @ problem.structure.joint(path).row
    return float(np.sqrt(np.mean(speeds**2))) if speeds.size else 0.0
