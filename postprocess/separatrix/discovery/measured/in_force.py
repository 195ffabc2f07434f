# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of a known motion whose force is compared: a joint driven along x(t), as friction is tested."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from separatrix.discovery.measured.condense import stride
from separatrix.discovery.measured.driven import driven
from separatrix.discovery.measured.preflight import Prepared, check_velocity, velocity_noise
from separatrix.discovery.measured.records import Record
from separatrix.discovery.measured.sensor_imperfections import check_clipped_force
from separatrix.discovery.measured.signals import resolution_of, white_noise
from separatrix.discovery.measured.smoother import Smoothed, smooth
from separatrix.discovery.policy import RECORDS
from separatrix.discovery.wording import units_of
from separatrix.errors import SeparatrixError


@dataclass
class DrivenPrepared(Prepared):
    """A record whose force is compared: sigma and resolution are its own, the motion is known."""

    noise_key: ClassVar[str] = "force_noise_sigma_n"
    near_mass: ClassVar[bool] = True
    # noise of the positions, mass of the case [kg]
    motion_sigma: float = 0.0
    mass: float = 0.0

    @property
    def column(self) -> np.ndarray:
        """The force."""
        return self.record.force

    @property
    def noise(self) -> tuple:
        """Memory of the noise and its size."""
        return (self.memory, self.sigma)

    @noise.setter
    def noise(self, known: tuple) -> None:
        self.memory, self.sigma = known

    def details(self) -> dict[str, tuple[np.ndarray, dict]]:
        """The force."""
        return {"force": (self.record.force, {})}

    def deviation(self, rows: np.ndarray) -> np.ndarray:
        """Standard deviation of the noise of the force, with the error of mass times acceleration."""
        return np.hypot(self.sigma, self.driven.inertia_error)[rows]

    def known_motion(self, oscillation: float) -> Smoothed:
        """Smooth the motion, and keep it."""
        record = self.record
        every = stride(oscillation, record.t.size)
        found = smooth(record.t, record.x, self.motion_sigma, oscillation, every)
        self.driven = driven(found, record.v, self.velocity_sigma, self.mass, record.pieces)
        return found


def prepare_force(record: Record, model, rest: Record | None = None) -> Prepared:
    """Noise of force and position; a record that is not of a driven joint is refused."""
    if record.force is None:
        raise SeparatrixError(f"{record.file}: no column 'force' (or 'F'), the force that is compared")
    if 'law = "measured_force"' not in model.to_text({}):
        raise SeparatrixError(
            f'drive.law: allowed with --compare force "measured_force": the force that {record.file} has is '
            "all that drives the body; foot, crank and other drives are not known there"
        )
    notes = list(record.notes)
    if record.v is not None:
        check_velocity(record, notes)
    unit = units_of(model.parameters).force
    force, t = record.force, record.t
    check_clipped_force(force, unit, lambda row: f"{record.file}, at {t[row]:.6g} s", notes)
    record = _thinned(record, notes)
    if np.ptp(record.force) == 0:
        raise SeparatrixError(f"{record.file}: 'force' is constant")
    stated = record.header.get("force_noise_sigma_n") if rest is None else _at_rest(rest)
    resolution = resolution_of(record.force)
    least = max(RECORDS.exact_force * float(np.std(record.force)), resolution / np.sqrt(12))
    sigma = max(stated / np.sqrt(_together(record)) if stated else white_noise(record.force), least)
    if not stated:
        notes.append(f"noise of the force {sigma:.3g} {unit}, from fourth differences")
    scatter = float(np.std(record.force))
    if scatter**2 < 2 * sigma**2:
        notes.append(
            f"the force is smaller than its noise: it scatters by {scatter:.3g} {unit} at a noise of "
            f"{sigma:.3g} {unit}"
        )
    of_x = max(white_noise(record.x), resolution_of(record.x) / np.sqrt(12))
    of_sensor = (record.header.get("sensor_noise_sigma_m") or 0.0) / np.sqrt(_together(record))
    motion = max(of_sensor or of_x, RECORDS.quiet * float(np.std(record.x)))
    return DrivenPrepared(
        record,
        sigma,
        velocity_noise(record),
        resolution,
        notes=notes,
        origin=float(record.t[0]),
        sigma_stated=bool(stated),
        motion_sigma=motion,
        mass=model.parameters["body.mass"].value,
    )


def _at_rest(rest: Record) -> float:
    """Scatter of the force while nothing moves, about a straight line [N]."""
    if rest.force is None:
        raise SeparatrixError(f"{rest.file}: no column 'force' (or 'F'), whose scatter is the noise")
    return float(np.std(rest.force - np.polyval(np.polyfit(rest.t, rest.force, 1), rest.t)))


def _together(record: Record) -> int:
    """Samples of which each row of a record is the mean."""
    return int(record.header.get("rows_together", 1))


def _thinned(record: Record, notes: list[str]) -> Record:
    """Means of neighbours where there are far more samples than a law of the joint needs."""
    count = -(-record.t.size // RECORDS.most_in_force)
    if count == 1:
        return record
    rows, pieces = [], []
    for first, last in record.pieces:
        begun = sum(len(one) for one in rows)
        rows.append(np.arange(first, last - count + 1, count))
        pieces.append((begun, begun + len(rows[-1])))
    at = np.concatenate(rows)[:, None] + np.arange(count)
    columns = {
        name: None if getattr(record, name) is None else getattr(record, name)[at].mean(axis=1)
        for name in ("t", "x", "v", "force")
    }
    notes.append(f"{record.t.size} samples: means of {count} neighbours are compared")
    header = {**record.header, "rows_together": float(count)}
    return replace(record, **columns, phi=None, pieces=pieces, header=header)
