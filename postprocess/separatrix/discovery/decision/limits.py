# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes of effects that these records could not show, and measurements that separate names of one motion."""

from dataclasses import replace

import numpy as np

from separatrix.discovery.decision.rounds import Round, SearchContext
from separatrix.discovery.fitting.catalogue import Candidate
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.joint_effects import effect_of
from separatrix.discovery.fitting.screen import screen, signature
from separatrix.discovery.policy import SEARCH
from separatrix.discovery.wording import unit_of

_LADDER = 4.0 ** np.arange(-3, 4)
_CALIBRATE = "calibrate the sensor at two known positions"
_ADVICE = {
    frozenset(
        ("offset_force", "asymmetric_friction")
    ): "stop the drive and let the body stick: the middle between the "
    "positions where it breaks away in either direction is off by force/stiffness for a constant force, not "
    "for friction that differs with the direction",
    frozenset(
        ("offset_force", "sensor_bias")
    ): "measure the position of the barrier: the sensor's error shifts it, a force does not",
    frozenset(
        ("asymmetric_friction", "sensor_bias")
    ): "measure the position of the barrier: the sensor's error shifts it, friction does not",
    frozenset(("sensor_gain", "sensor_bias")): _CALIBRATE,
    frozenset(("sensor_gain", "offset_force")): _CALIBRATE,
    frozenset(("sensor_gain", "asymmetric_friction")): _CALIBRATE,
    frozenset(("sensor_delay", "drive_ripple")): "record the crank angle phi with the position",
}


def detectable(context: SearchContext, found: Round) -> dict[str, dict]:
    """Smallest size of each effect that these records would have shown at `visible` standard errors.

    None, with a reason, where no size can be given.
    """
    sizes = {
        name: {"size": None, "path": None, "unit": None, "reason": reason}
        for name, reason in found.absent.items()
    }
    for name, made in found.candidates.items():
        if name not in found.screened.names:
            continue
        path = made.free[made.added[0]].path
        unit = unit_of(path, made.model.parameters[path].unit, made.model.parameters)
        reason = ""
        if not found.screened.seen(name):
            size, reason = None, "the base machine can imitate it"
        elif found.screened.live[name][:1].any():
            usual = made.free[made.added[0]].size
            size = context.options.visible * float(found.screened.error[name][0]) * usual
            if size > SEARCH.believed_sizes * usual:
                size, reason = None, "the base machine can all but imitate it"
        elif not made.linear.any() and not context.options.quick:
            size = _by_ladder(context, found, made)
            reason = "" if size is not None else "no size that was tried stands out so much"
        else:
            size, reason = None, "its size is not proportional to what it does"
            reason += ": see a run without --quick" if context.options.quick else ""
        sizes[name] = {"size": size, "path": path, "unit": unit, "reason": reason}
    return sizes


def _by_ladder(context: SearchContext, found: Round, made: Candidate) -> float | None:
    """The size at which d' is what counts as visible, between the rungs of a ladder around the usual size."""
    index = made.added[0]
    usual = made.free[index].physical(made.free[index].value)
    if made.names[-1] == "second_barrier":
        depths = np.abs(context.scales.highest - context.scales.lowest) * 0.002 * _LADDER
        inward = 1 if usual < 0.5 * (context.scales.highest + context.scales.lowest) else -1
        edge = context.scales.lowest if inward > 0 else context.scales.highest
        rungs = edge + inward * depths
    else:
        rungs = usual * _LADDER
    visible = []
    for rung in rungs:
        free = list(made.free)
        free[index] = replace(free[index], value=float(np.log(rung) if free[index].positive else rung))
        here = np.array([free[i].value for i in made.added])
        shown = signature(found.base.problem, found.base.fit, replace(made, free=free, forms=[here]))
        if shown is None:
            visible.append(0.0)
            continue
        error = screen(found.base.fit, [shown]).error[made.names[-1]]
        visible.append(float(1 / error[0]) if error.size else 0.0)
    logarithm = np.log(np.maximum(visible, 1e-12))
    wanted = np.log(context.options.visible)
    crossings = np.flatnonzero((logarithm[:-1] - wanted) * (logarithm[1:] - wanted) <= 0)
    if not crossings.size:
        return None
    i = int(crossings[0])
    share = (wanted - logarithm[i]) / (logarithm[i + 1] - logarithm[i])
    return float(rungs[i] + share * (rungs[i + 1] - rungs[i]))


def advice(one: Fitted, others: list[Fitted]) -> str:
    """Known measurement that separates two names of one motion where no drive does; '' if there is none."""
    pairs = (frozenset((one.names[-1], other.names[-1])) for other in others if one.names and other.names)
    found = next((_ADVICE[pair] for pair in pairs if pair in _ADVICE), "")
    has_barrier = any(path.startswith("contact.") for path in one.model.parameters)
    return _CALIBRATE if "barrier" in found and not has_barrier else found


def equivalents(names: list[str]) -> list[str]:
    """Why effects of the catalogue are the same motion, in words."""
    return [
        f"{one} and {other}: {effect_of(one).confused[other]}"
        for i, one in enumerate(names)
        for other in names[i + 1 :]
        if other in effect_of(one).confused
    ]
