# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Size of an effect in standard errors, and the part of it that no other effect can imitate.

The records are cut into segments of half a drive period whose starts are free. The columns of
derivatives are finite differences at the true machine. d' is the size of the effect over its standard
error where the unknowns of the base machine, the phase of the drive and the further parameters of the
effect are fitted as well.
"""

from dataclasses import dataclass

import numpy as np
from effects import CATALOGUE
from experiment import Experiment
from simulator import NOWHERE, Machine, V, X, simulate_pieces

COARSE = 400
"""Steps per drive period."""
SHIFTS = (1e-6, 1e-5)
"""Of the start in x and v."""
GRAZING = 0.3
"""Standard deviations of the noise."""
STEPS = {"phase": 1e-5, "scale": 1e-4, "restitution": 1e-4, "upper": 1e-6}
RELATIVE = 1e-4

IMITATORS = {
    "viscous": ("viscous",),
    "coulomb": ("coulomb",),
    "quadratic_drag": ("quadratic",),
    "stribeck": ("stribeck",),
    "static_excess": ("static_excess",),
    "asymmetric_friction": ("asymmetric_coulomb", "asymmetric_viscous"),
    "position_dependent_friction": ("friction_slope",),
    "cubic_spring": ("cubic",),
    "offset_force": ("offset",),
    "restitution_slope": ("restitution_slope",),
    "drive_ripple": ("ripple_sine", "ripple_cosine"),
    "sensor_bias": ("sensor_bias",),
    "sensor_gain": ("sensor_gain",),
    "sensor_delay": ("sensor_delay",),
}
"""Effects that have a derivative where they are absent, and their parameters."""
AT_ALL = {"lower": -NOWHERE, "static_excess": 0.0}
"""Parameters whose effect is their whole change of the motion, and their values where they are absent. The
extra duration of a stick is quadratic in the holding force or jumps, which the derivative does not show."""


@dataclass
class Noise:
    """Of the sensor."""

    sigma: tuple[float, float]
    """Of position and velocity."""
    memory: float
    """Correlation of neighbouring samples."""
    velocity: bool
    """Whether the velocity is recorded."""

    def whitened(self, signal: np.ndarray) -> np.ndarray:
        """Segments (n, samples, 2) in units of independent noise, (n, values)."""
        scaled = signal / self.sigma
        white = scaled.copy()
        white[:, 1:] = (scaled[:, 1:] - self.memory * scaled[:, :-1]) / np.sqrt(1 - self.memory**2)
        channels = 2 if self.velocity else 1
        return white[:, :, :channels].reshape(len(white), -1)


class Segments:
    """The segments of one experiment with their derivatives."""

    def __init__(self, machine: Machine, experiment: Experiment, noise: Noise) -> None:
        self.driven, self.experiment, self.noise = experiment.driven(machine), experiment, noise
        self.substeps = experiment.substeps(COARSE)
        states, self.impacts = experiment.states(self.driven, COARSE)
        self.clean = experiment.observe(self.driven, states, COARSE)
        self.length = experiment.samples_per_period // 2
        count = (len(states) - 1) // self.length
        index = np.arange(count) * self.length
        self.starts, self.t0 = np.ascontiguousarray(states[index]), index * experiment.interval
        self.first = np.arange(count + 1) * self.length
        self.base, self.counts = self._fly(self.driven, self.starts)
        self.steady = np.ones(count, dtype=bool)
        self._mask_grazing()
        self.basis = self._start_basis()

    def _fly(self, driven: Machine, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        interval = self.experiment.interval
        states, impacts = simulate_pieces(driven, starts, self.t0, self.first, interval, self.substeps)
        seen = states[:, [X, V]].reshape(len(starts), self.length, 2)
        seen[:, :, X] *= 1 + self.experiment.sensor.get("sensor_gain", 0.0)
        return seen, impacts

    def _difference(self, plus: tuple, minus: tuple) -> np.ndarray:
        (high, counts), (low, other) = self._fly(*plus), self._fly(*minus)
        self.steady &= (counts == self.counts) & (other == self.counts)
        return high - low

    def _mask_grazing(self) -> None:
        """Leave out segments whose impacts another start within the noise would change."""
        for column, sigma in zip((X, V), self.noise.sigma, strict=True):
            move = np.zeros_like(self.starts)
            move[:, column] = GRAZING * sigma
            self._difference((self.driven, self.starts + move), (self.driven, self.starts - move))

    def _start_basis(self) -> np.ndarray:
        columns = []
        for column, shift in zip((X, V), SHIFTS, strict=True):
            move = np.zeros_like(self.starts)
            move[:, column] = shift
            change = self._difference((self.driven, self.starts + move), (self.driven, self.starts - move))
            columns.append(self.noise.whitened(change / (2 * shift)))
        return np.linalg.qr(np.stack(columns, axis=-1))[0]

    def without_starts(self, column: np.ndarray) -> np.ndarray:
        """What is left of a signal (n, samples, 2) when the starts are refitted."""
        white = self.noise.whitened(column)
        return white - np.einsum("nik,nk->ni", self.basis, np.einsum("nik,ni->nk", self.basis, white))

    def column(self, name: str, largest: float) -> np.ndarray:
        """Derivative with respect to a parameter, or what it changes at all over its size."""
        if name in ("sensor_bias", "sensor_gain", "sensor_delay"):
            change = np.zeros_like(self.base)
            gain = 1 + self.experiment.sensor.get("sensor_gain", 0.0)
            unit = {
                "sensor_bias": 1.0,
                "sensor_gain": self.base[:, :, X] / gain,
                "sensor_delay": -self.base[:, :, V],
            }
            change[:, :, X] = unit[name]
            return self.without_starts(change)
        value = getattr(self.driven, name)
        if name == "lower" or value != AT_ALL.get(name, value):
            return self.without_starts(self._at_all(name))
        step = STEPS.get(name, RELATIVE * max(abs(value), 0 if value else 1e-2 * largest))
        both = [(self.driven.copy(**{name: value + sign * step}), self.starts) for sign in (1, -1)]
        return self.without_starts(self._difference(*both) / (2 * step))

    def _at_all(self, name: str) -> np.ndarray:
        """What a parameter changes at all, over its size; the second barrier has none."""
        free, counts = self._fly(self.driven.copy(**{name: AT_ALL[name]}), self.starts)
        if name == "lower":
            return self.base - free
        self.steady &= counts == self.counts
        return (self.base - free) / getattr(self.driven, name)


class Information:
    """Derivatives of all records of a case, free starts taken out."""

    def __init__(self, machine: Machine, experiments: list[Experiment], noise: list[Noise]) -> None:
        pairs = zip(experiments, noise, strict=True)
        self.parts = [Segments(machine, experiment, its_noise) for experiment, its_noise in pairs]
        self.columns: dict[str, list[np.ndarray]] = {}

    def _columns(self, name: str) -> list[np.ndarray]:
        if name not in self.columns:
            largest = max((max(e.sizes) for e in CATALOGUE.values() if e.field == name), default=1.0)
            self.columns[name] = [part.column(name, largest) for part in self.parts]
        return self.columns[name]

    def _matrix(self, shared: list[str], separate: list[str]) -> np.ndarray:
        """All rows; a separate parameter has a column for each record."""
        everything = {name: self._columns(name) for name in [*shared, *separate]}
        rows = []
        for i, part in enumerate(self.parts):
            block = [everything[name][i] for name in shared]
            for name in separate:
                zero = np.zeros_like(everything[name][i])
                block += [everything[name][i] if i == k else zero for k in range(len(self.parts))]
            rows.append(np.stack([column[part.steady].ravel() for column in block], axis=-1))
        return np.concatenate(rows)

    def surviving(self, name: str, shared: list[str], separate: list[str]) -> float:
        """Length, in standard errors per unit, of what is left of a column when all others are fitted."""
        matrix = self._matrix([name, *(other for other in shared if other != name)], separate)
        size = np.linalg.norm(matrix, axis=0)
        matrix = matrix[:, size > 0] / size[size > 0]
        if size[0] == 0:
            return 0.0
        if matrix.shape[1] == 1:
            return float(size[0])
        left, singular, _ = np.linalg.svd(matrix[:, 1:], full_matrices=False)
        left = left[:, singular > 1e-7 * singular[0]]
        return float(size[0] * np.linalg.norm(matrix[:, 0] - left @ (left.T @ matrix[:, 0])))
