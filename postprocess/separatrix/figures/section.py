# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The points of the attractors of a map on its section, flown by the library."""

from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from separatrix import simulate
from separatrix.errors import CaseError, SeparatrixError
from separatrix.figures.caption import resolved_case
from separatrix.library import Model
from separatrix.open import table
from separatrix.variables import is_start

# Attractors of a slice, and points of one, beyond which marks hide the map.
_MOST, _LONGEST = 12, 64
# Coordinates that the plane of x0 and v0 shows all of.
_PLANE = 2


def points(result: xr.Dataset, indices: Mapping[str, int]) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield label, positions and velocities of each periodic attractor of one slice.

    They are those at the crank angle of the starts, not numbers where they cannot be computed.
    `indices`: those on the axes that are not x0 and v0.
    Nothing comes of several bodies, whose section has more coordinates, of a file without a case, and without
    the library.
    """
    if coordinates(result) > _PLANE:
        return
    catalogue = table(result, "catalogue")
    case = resolved_case(result)
    if "attractor" not in catalogue or not case:
        return
    parameters = [name for name in result["regime"].dims if not is_start(name)]
    shape = tuple(result.sizes[name] for name in parameters)
    number = int(np.ravel_multi_index([indices[name] for name in parameters], shape)) if parameters else 0
    rows = np.flatnonzero((catalogue["slice"].values == number) & (catalogue["count"].values > 0))
    angle = float(case.get("start", {}).get("crank_angle", 0.0))
    if "crank_angle" in indices:
        angle = float(result["crank_angle"].values[indices["crank_angle"]])
    try:
        model = Model.from_text(str(result.attrs["resolved_case"]))
        paths = {path.replace(".", "_"): path for path in model.parameters}
        values = {paths[name]: float(result[name].values[indices[name]]) for name in parameters}
        for row in rows[:_MOST]:
            entry = {name: catalogue[name].values[row] for name in ("attractor", "period", "x", "v")}
            if 0 < entry["period"] <= _LONGEST:
                point = float(entry["x"]), float(entry["v"])
                yield (
                    int(entry["attractor"]),
                    *_points_of_cycle(model, point, int(entry["period"]), angle, values),
                )
    except (CaseError, KeyError):
        return


def _points_of_cycle(
    model: Model, point: tuple[float, float], period: int, angle: float, values: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of a cycle; not numbers where it cannot be computed."""
    try:
        return tuple(simulate.section_points(model, point, period, angle, values).T)
    except SeparatrixError:
        return np.full(period, np.nan), np.full(period, np.nan)


def coordinates(result: xr.Dataset) -> int:
    """Return the number of coordinates of the section: 2 of one body."""
    if "driven_mass" in resolved_case(result).get("body", {}):
        return 2 * _PLANE
    return int(result.sizes.get("coordinate", _PLANE))
