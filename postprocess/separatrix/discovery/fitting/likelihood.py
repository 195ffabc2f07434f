# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every observation of a machine provides to fits, searches and verdicts.

There are three: one body in motion, one body in force (`one_body`), several bodies (`coordinates`).
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from separatrix.discovery.fitting.evaluation import Evaluation
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.measured.preflight import Prepared
from separatrix.discovery.measured.segments import Segments
from separatrix.discovery.wording import Units
from separatrix.library import Effect, Model

if TYPE_CHECKING:
    from separatrix.discovery.fitting.fit import Fit
    from separatrix.discovery.fitting.hypotheses import Hypothesis, Motion
    from separatrix.discovery.fitting.noise import Left
    from separatrix.discovery.fitting.regions import Region


class Likelihood(Protocol):
    """Records cut into segments, a model and what is free: residuals and what they show."""

    model: Model
    prepared: Sequence[Prepared]
    segments: Segments
    free: list[Free]
    # what imperfections of the rig add to the motion, where they are fitted
    imperfections: Mapping[tuple[str, int | None], np.ndarray]
    # numbers of a start, unknowns of a segment, columns that are compared
    starts: int
    unknowns: int
    channels: int
    # whether the residual is nearly linear in the parameters
    exact: bool
    # whether imperfections can be fitted, hidden states be tried, and laws that are tables be added
    fits_imperfections: bool
    has_memories: bool
    has_tables: bool
    # whether one signal is compared, and whether effects and gaps have a location
    one_signal: bool
    locates: bool
    # the kind of experiment that can be proposed, '' for none
    experiment: str

    def evaluate(
        self, values: np.ndarray, starts: np.ndarray, derivatives: bool = True, by_start_alone: bool = False
    ) -> Evaluation:
        """Residuals of all segments from their starts, with derivatives."""

    def like(self, model: Model, free: list[Free], segments: Segments | None = None) -> "Likelihood":
        """The same records with another model, or other segments."""

    def of_segments(self, rows: np.ndarray) -> "Likelihood":
        """The same with these segments only."""

    def imitating(self, motion: Evaluation) -> "Likelihood | None":
        """The same with a computed motion in place of the measured one; None where none is compared."""

    def machine_values(self, number: int, values: np.ndarray) -> dict[str, float]:
        """Values of the machine as it was during a record."""

    def crank_angle(self, number: int, values: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Angle of the crank at times of a record [rad]."""

    def sample_times(self) -> np.ndarray:
        """Times of the samples since the start of their segment [s]."""

    def whitened(self, table: np.ndarray) -> np.ndarray:
        """Rows over their noise, freed of the memory of the noise."""

    def observed(self, fit: "Fit") -> np.ndarray:
        """What is compared, as the machine has it (segments, length)."""

    def unit(self, units: Units) -> str:
        """Unit of what is compared."""

    def effects(self, asked: tuple[str, ...] | None) -> list[str]:
        """Effects that may be missing, of those that were asked for."""

    def cannot_show(self, effect: Effect) -> str:
        """Why an effect would change nothing in these records; '' if it may."""

    def force_columns(self, fit: "Fit", forces: np.ndarray, mass: float) -> np.ndarray:
        """Columns (segments, width, q) of forces (segments, length, q) [N] given at the samples."""

    def families(self, fit: "Fit", mass: float) -> dict[str, np.ndarray]:
        """Columns of free forces by what they depend on."""

    def imperfection_columns(self, fit: "Fit", usual: float | None = None) -> np.ndarray:
        """Columns of imperfections of one standard deviation along a fit."""

    def left_of_noise(self, fit: "Fit", channel: int, mass: float) -> "tuple[Left, list[Left], float]":
        """Residuals from which the noise is measured; those of blocks; the largest memory of a sensor."""

    def motion(self, fit: "Fit", data: object, mass: float, natural: float) -> "Motion":
        """The motion along which hypotheses are tried."""

    def hypotheses(self, training: "Motion") -> "list[Hypothesis]":
        """Dependences of a missing force."""

    def regions(self, fit: "Fit", mass: float, units: Units) -> "list[Region]":
        """Bins of the motion in which a missing force is estimated."""

    def locations(self, names: list[str]) -> dict[str, str]:
        """Where effects act among several bodies, in words."""
