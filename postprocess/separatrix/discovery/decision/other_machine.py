# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Signs that records are of another machine or in other units, rather than that physics is missing."""

import numpy as np
from scipy.signal import get_window

from separatrix.discovery.decision.misfit import record_chi2
from separatrix.discovery.fitting.data import Data
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.forces import force_needed
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.measured.preflight import Prepared
from separatrix.discovery.options import Options
from separatrix.discovery.policy import SEARCH
from separatrix.discovery.wording import number, unit_of

# what is known of a machine before any record, and the factor by which it is not known
_KNOWN = ("body.mass", "restoring.stiffness", "restoring.moment")
_BARRIERS = ("contact.upper", "contact.lower")


def other_machine(data: Data, fitted: Fitted, options: Options) -> list[str]:
    """Parameters of the fitted machine that are far from those of the case, in one sentence."""
    spread = max(float(np.std(one.record.x)) for one in data.prepared)
    model = fitted.model
    strange = []
    for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True):
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
        far = (
            not 1 / SEARCH.other_factor < ratio < SEARCH.other_factor
            if one.path in _KNOWN
            else abs(found - case) > spread
        )
        if far:
            unit = unit_of(one.path, model.parameters[one.path].unit, model.parameters)
            strange.append(f"{one.path} {number(found, 3)} {unit} (case: {number(case, 3)})")
    if not strange:
        return []
    parameters = ", ".join(strange)
    return [f"the fitted machine is not that of the case: {parameters}: other units, or another machine"]


def other_units(data: Data, model) -> list[str]:
    """Measured forces that are a multiple of what the machine of the case takes along the motion.

    The factor is that of the mass, where force and acceleration determine it, else that of the whole force.
    """
    notes = []
    for one in data.prepared:
        if one.driven is None:
            continue
        motion, at, record = one.driven, one.driven.moves, one.record
        taken = force_needed(model, {}, motion, record.force, record.pieces)[at]
        factor = _factor(taken, record.force[at])
        columns = [motion.a[at], motion.v[at], np.sign(motion.v[at]), np.ones(at.sum())]
        if "restoring.stiffness" in model.parameters:
            columns.append(motion.x[at])
        mass, error, missed = _mass(np.stack(columns, axis=1), record.force[at])
        # a force that is missing leans on the acceleration, too
        of_mass = factor is not None and error < SEARCH.mass_known * mass and missed < SEARCH.force_missed
        if of_mass:
            factor = mass / one.mass
        if factor is not None and not 1 / SEARCH.unit_factor < factor < SEARCH.unit_factor:
            what = "the mass that force and acceleration give" if of_mass else "the force"
            notes.append(
                f"{record.name}: {what} is {number(factor, 2)} times that of the machine of the case: "
                "other units of force or position, or another machine"
            )
    return notes


def _factor(taken: np.ndarray, measured: np.ndarray) -> float | None:
    """By which one force is the other, None where it is another one."""
    product, size = float(taken @ measured), float(taken @ taken)
    if size == 0 or product < SEARCH.force_alike * np.sqrt(size * float(measured @ measured)):
        return None
    return product / size


def _mass(columns: np.ndarray, force: np.ndarray) -> tuple[float, float, float]:
    """Mass that a force needs beside what else there is, its standard error [kg], and the share of the force
    that all of it misses; the acceleration is the first of the columns.
    """
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    found, _, _, _ = np.linalg.lstsq(columns / scale, force, rcond=1e-9)
    rest = force - columns / scale @ found
    variance = np.linalg.pinv((columns / scale).T @ (columns / scale), rcond=1e-12)[0, 0]
    error = np.sqrt(variance * float(rest @ rest) / max(1, force.size - columns.shape[1]))
    missed = np.linalg.norm(rest) / max(np.linalg.norm(force - force.mean()), 1e-300)
    return float(found[0] / scale[0]), float(error / scale[0]), float(missed)


def other_drive(data: Data, base: Fitted) -> list[str]:
    """Records that the base machine misses and that oscillate at another frequency than the stated drive."""
    notes = []
    for index, (size, _) in record_chi2(data, base.fit).items():
        one = data.prepared[index]
        if size < SEARCH.drive_missed or one.frequency is None:
            continue
        line, apart, share = strongest_line(one)
        if share < SEARCH.clear_line:
            continue
        wanted = [one.frequency * p / q for p in SEARCH.drive_orders for q in SEARCH.drive_orders]
        if all(
            abs(line - known) > max(SEARCH.line_error * known, SEARCH.line_bin * apart) for known in wanted
        ):
            notes.append(
                f"{one.record.name}: x moves mostly at {number(line, 4)} rad/s, the drive is taken to "
                f"turn at {number(one.frequency, 4)} rad/s: is drive_ratio right?"
            )
    return notes


def other_phase(data: Data, fitted: Fitted | Prediction) -> list[str]:
    """Records whose headers state another phase of the drive than the fitted one."""
    notes = []
    for one, value in zip(fitted.problem.free, fitted.fit.values, strict=True):
        if one.path != "nuisance:phase":
            continue
        prepared = data.prepared[one.record]
        beside = float(np.angle(np.exp(1j * value)))
        if prepared.phase_known or not prepared.phase_stated or abs(beside) < SEARCH.another_phase:
            continue
        notes.append(
            f"{prepared.record.name}: the drive is {number(abs(beside), 2)} rad "
            f"{'ahead of' if beside > 0 else 'behind'} the phase of the header: another zero of the crank?"
        )
    return notes


def strongest_line(one: Prepared) -> tuple[float, float, float]:
    """Strongest line of x in its longest interval without gaps.

    Its frequency, how far lines must be apart to be two [rad/s], and its share of the power.
    """
    first, last = max(one.record.pieces, key=lambda piece: piece[1] - piece[0])
    x = one.record.x[first:last]
    power = np.abs(np.fft.rfft((x - x.mean()) * get_window("hann", x.size), SEARCH.finer_bins * x.size)) ** 2
    power[: SEARCH.finer_bins] = 0.0
    peak = int(np.argmax(power))
    # a Hann window spreads a line over two of its bins on either side
    share = power[max(0, peak - 2 * SEARCH.finer_bins) : peak + 2 * SEARCH.finer_bins + 1].sum() / power.sum()
    apart = 2 * np.pi / (x.size * one.record.interval)
    return peak * apart / SEARCH.finer_bins, apart, float(share)
