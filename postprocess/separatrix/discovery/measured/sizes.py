# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a record has the size that its machine can have under its drive, and moves at all."""

from typing import TYPE_CHECKING

import numpy as np

from separatrix.discovery.measured.records import Record
from separatrix.discovery.measured.signals import resolution_of, white_noise
from separatrix.discovery.policy import RECORDS
from separatrix.discovery.wording import units_of
from separatrix.errors import SeparatrixError

if TYPE_CHECKING:
    from separatrix.discovery.measured.preflight import Prepared

# beyond this a barrier is not there
_NOWHERE = 1e100


def moves(record: Record, sigma: float, rest: Record | None, unit: str) -> bool:
    """Whether a record shows a motion beyond its noise `sigma`: by its scatter, or by its slow part alone.

    A record at rest whose own slow part exceeds its noise is refused where the motion is as small.
    """
    if np.std(record.x) >= RECORDS.moving * sigma:
        return True
    if rest is not None:
        own = max(white_noise(rest.x), resolution_of(rest.x) / np.sqrt(12))
        drift = np.polyval(np.polyfit(rest.t, rest.x, 1), rest.t)
        if _slow_scatter(rest.x - drift) > RECORDS.moving * own:
            raise SeparatrixError(
                f"{rest.file}: x scatters by {sigma:.3g} {unit}, in {record.file} by {np.std(record.x):.3g} "
                f"{unit}, and slowly: not a record at rest"
            )
    return _slow_scatter(record.x) > RECORDS.moving * sigma


def at_rest(prepared: "Prepared", model) -> None:
    """Mark a record in which dry friction may hold the body; refuse another one without motion."""
    record, unit = prepared.record, units_of(model.parameters).position
    text = f"x scatters by {np.std(record.x):.3g} {unit} at a noise of {prepared.sigma:.3g} {unit}"
    if not _may_hold(model.parameters, _foot(prepared, model.parameters)):
        raise SeparatrixError(f"{record.file}: {text}: nothing but noise")
    prepared.rests = True
    prepared.notes.append(f"{text}: the body rests, as friction may hold it against this drive")


def _slow_scatter(x: np.ndarray) -> float:
    """Scatter of the means of blocks, which of white noise is that of a sample."""
    width = max(1, x.size // RECORDS.slow_blocks)
    count = x.size // width
    return float(np.std(x[: count * width].reshape(count, width).mean(axis=1)) * np.sqrt(width))


def check_size(prepared: "Prepared", model) -> None:
    """Refuse a record far larger or smaller than its drive lets the machine be: wrong units, another machine.

    Dry friction may hold a body that is driven weakly; then the position shows the units.
    """
    record, parameters = prepared.record, model.parameters
    foot = _foot(prepared, parameters)
    barriers = [abs(parameters[path].value) for path in _barriers(parameters)]
    if prepared.frequency is None or not (foot or barriers):
        return
    unit = units_of(parameters).position
    largest = max([foot, *barriers])
    spread, seen = float(np.ptp(record.x)), "x ranges over"
    least = foot / _beyond_resonance(prepared) if foot else largest
    if _may_hold(parameters, foot):
        spread, seen, least = float(np.max(np.abs(record.x))), "x reaches", largest
    if least / RECORDS.size_ratio < spread < RECORDS.size_ratio * largest:
        _check_barriers(record, model, unit)
        return
    expected = least if spread < least else largest
    raise SeparatrixError(
        f"{record.file}: {seen} {spread:.3g} {unit}, the machine under its drive over {expected:.3g} {unit}: "
        "wrong units, or a record of another machine"
    )


def _foot(prepared: "Prepared", parameters: dict) -> float:
    """Amplitude of the driven foot in a record [m], 0 where the drive has none."""
    amplitudes = [
        one.value
        for path, one in parameters.items()
        if path.startswith(("drive.cosine", "drive.sine", "drive.amplitude"))
    ]
    return float(np.sqrt(np.sum(np.square(amplitudes)))) * abs(prepared.drive_scale)


def _beyond_resonance(prepared: "Prepared") -> float:
    """Factor by which inertia reduces the motion where the drive is faster than the machine."""
    ratio = prepared.frequency / prepared.natural if prepared.natural else 1.0
    return max(1.0, ratio**2 - 1)


def _may_hold(parameters: dict, foot: float) -> bool:
    """Whether dry friction, which may be larger than in the case, could hold the body against its drive."""
    paths = ("restoring.stiffness", "friction.kinetic_coefficient", "body.mass", "body.gravity")
    if not all(path in parameters for path in paths):
        return False
    stiffness, *friction = (abs(parameters[path].value) for path in paths)
    return float(np.prod(friction)) > RECORDS.holding * stiffness * foot


def _barriers(parameters: dict) -> list[str]:
    """Paths of the barriers that are there, in the order upper, lower."""
    found = [path for path in ("contact.upper", "contact.lower") if path in parameters]
    return [path for path in found if 0 < abs(parameters[path].value) < _NOWHERE]


def _check_barriers(record: Record, model, unit: str) -> None:
    """Refuse a record that lies beyond a rigid barrier."""
    if "contact.stiffness" in model.parameters:
        return
    for path, sign in (("contact.upper", 1), ("contact.lower", -1)):
        barrier = model.parameters.get(path)
        if barrier is None or abs(barrier.value) > _NOWHERE:
            continue
        beyond = sign * (record.x - barrier.value)
        if np.median(beyond) > 0:
            row = int(np.argmax(beyond))
            raise SeparatrixError(
                f"{record.file}: x lies beyond {path} = {barrier.value:g} {unit} most of the time "
                f"({record.x[row]:g} {unit} at {record.t[row]:g} s): a record of another machine"
            )
