# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Signs that records are of another machine or in other units, rather than that physics is missing."""

import numpy as np
from scipy.signal import get_window

from separatrix.discovery.decision.misfit import record_chi2
from separatrix.discovery.fitting.data import Data
from separatrix.discovery.fitting.refit import Fitted
from separatrix.discovery.measured.preflight import Prepared
from separatrix.discovery.options import Options
from separatrix.discovery.wording import number, unit_of

# what is known of a machine before any record, and the factor by which it is not known
_KNOWN = ("body.mass", "restoring.stiffness", "restoring.moment")
_FACTOR = 3.0
_BARRIERS = ("contact.upper", "contact.lower")
# reduced chi^2 of a record that a wrong drive would leave
_MISSED = 10.0
# orders of harmonics and subharmonics of a drive that a motion may follow
_ORDERS = (1, 2, 3)
# error of the strongest line of a spectrum: share of its frequency, and of the distance of its bins
_LINE, _BIN = 0.02, 0.5


def other_machine(data: Data, base: Fitted, options: Options) -> list[str]:
    """Parameters of the fitted base machine that are far from those of the case, in one sentence."""
    spread = max(float(np.std(one.record.x)) for one in data.prepared)
    model = base.model
    strange = []
    for one, value in zip(base.problem.free, base.fit.values, strict=True):
        found = one.physical(value)
        if one.path == "nuisance:drive_scale":
            lowest, highest = options.drive_scales
            if not lowest < found < highest:
                strange.append(f"scale of the drive {number(found, 3)}")
            continue
        if one.path not in _KNOWN + _BARRIERS:
            continue
        case = model.parameters[one.path].value
        ratio = found / case if case else 1.0
        far = not 1 / _FACTOR < ratio < _FACTOR if one.path in _KNOWN else abs(found - case) > spread
        if far:
            unit = unit_of(one.path, model.parameters[one.path].unit, model.parameters)
            strange.append(f"{one.path} {number(found, 3)} {unit} (case: {number(case, 3)})")
    if not strange:
        return []
    said = ", ".join(strange)
    return [f"the fitted base machine is not that of the case: {said}: other units, or another machine"]


def other_drive(data: Data, base: Fitted) -> list[str]:
    """Records that the base machine misses and that move at another frequency than the drive is said to."""
    notes = []
    for place, (size, _) in record_chi2(data, base.fit).items():
        one = data.prepared[place]
        if size < _MISSED or one.frequency is None:
            continue
        line, apart = strongest_line(one)
        wanted = [one.frequency * p / q for p in _ORDERS for q in _ORDERS]
        if all(abs(line - known) > max(_LINE * known, _BIN * apart) for known in wanted):
            notes.append(
                f"{one.record.name}: x moves mostly at {number(line, 4)} rad/s, the drive is taken to "
                f"turn at {number(one.frequency, 4)} rad/s: is drive_ratio right?"
            )
    return notes


def strongest_line(one: Prepared) -> tuple[float, float]:
    """Frequency of the strongest line of x, and how far lines must be apart to be two [rad/s]."""
    x = one.record.x - one.record.x.mean()
    power = np.abs(np.fft.rfft(x * get_window("hann", x.size), 8 * x.size))
    power[:8] = 0.0
    apart = 2 * np.pi / (x.size * one.record.interval)
    return float(np.argmax(power)) * apart / 8, apart
