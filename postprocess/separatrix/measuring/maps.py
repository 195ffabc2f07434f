# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One slice of a map in the coordinates of the measures: velocities are divided by a frequency."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from separatrix.cases import Case
from separatrix.errors import USAGE, CaseError, SeparatrixError
from separatrix.measuring.machine import Machine
from separatrix.measuring.sampling import Region, generator, share_interval
from separatrix.open import table
from separatrix.variables import is_start

# Starts of a map that are labelled again.
_AGAIN = 256


@dataclass
class Slice:
    """Labels over scaled, ascending axes; the machine that labels new starts, None where there is none."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    scale: np.ndarray
    region: Region
    axes: list[np.ndarray]
    grid: np.ndarray
    settle: np.ndarray | None
    machine: Machine | None
    about: dict[str, object]
    limits: tuple[str, ...]
    entries: dict[int, dict[str, float]]
    seed: int = 1
    starts: int = 20000
    phases: int = 0
    shared: dict[str, object] = field(default_factory=dict)

    @property
    def points(self) -> np.ndarray:
        """The points of the grid, in the order of the grid."""
        return np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1).reshape(-1, len(self.axes))

    @property
    def even(self) -> bool:
        """Whether all axes are evenly spaced."""
        return all(
            len(axis) > 1 and np.allclose(np.diff(axis), axis[1] - axis[0], rtol=1e-6) for axis in self.axes
        )

    @property
    def unit(self) -> str:
        """The unit of distances."""
        return self.units[0]


def slice_of(
    result: xr.Dataset,
    wanted: Mapping[str, float] | None = None,
    frequency: float | None = None,
    threads: int | None = None,
    new_starts: bool = True,
) -> Slice:
    """Return one slice of a map.

    `wanted`: the values of its parameters (and of the crank angle, if it is an axis), the nearest of the map.
    `frequency` [rad/s]: velocities are divided by it; without one it is the natural frequency of the machine,
    or that of its drive.
    """
    _require_map(result)
    case = result.separatrix.case
    indices = indices_of(result, dict(wanted or {}))
    chosen = result.isel(indices)
    names = tuple(str(name) for name in chosen["attractor"].dims)
    if not names:
        raise SeparatrixError("measures: the map has no axis of starts but the crank angle", USAGE)
    for name in names:
        if chosen.sizes[name] < 2:
            raise SeparatrixError(
                f"measures: axis {name} of the map has one value, allowed are 2 or more: a line has no area",
                USAGE,
            )
    frequency, source = _frequency(case, _values(result, indices, case), frequency)
    scale = np.array([frequency if name.endswith("v0") or "_v0" in name else 1.0 for name in names])
    axes = [np.asarray(chosen[name].values, float) / one for name, one in zip(names, scale, strict=True)]
    grid = chosen["attractor"].values.astype(int)
    settle = chosen["settle_time"].values if "settle_time" in chosen else None
    reason = chosen["reason"].values if "reason" in chosen else np.ones_like(grid)
    grid = np.where((grid == 0) & (reason == 0), -1, grid)
    turns = _turns(case, names, axes)
    grid, settle, axes = _closed(grid, settle, axes, turns)
    region = Region(np.array([axis.min() for axis in axes]), np.array([axis.max() for axis in axes]), turns)
    units = ("rad" if _is_angle(case) else "m",) * len(names)
    entries = _entries(result, indices)
    title = str(result.attrs.get("title", ""))
    about = {"map": title} if title else {}
    about |= {name: float(result[name].values[at]) for name, at in indices.items()}
    about["window"] = "; ".join(
        f"{name} {low:.6g} to {high:.6g} {'rad/s' if unit == 'rad' and 'v0' in name else unit}"
        f"{'/s' if unit == 'm' and 'v0' in name else ''}"
        for name, low, high, unit in zip(
            names, region.lower * scale, region.upper * scale, units, strict=True
        )
    )
    about["distance"] = f"in {units[0]}; velocities are divided by {frequency:.9g} rad/s ({source})"
    found = Slice(
        names, units, scale, region, axes, grid, settle, None, about, _label_limits(grid, result), entries
    )
    if new_starts:
        _attach(found, case, _values(result, indices, case), indices, result, threads)
    return found


def _require_map(result: xr.Dataset) -> None:
    if result.separatrix.kind != "basin" or "attractor" not in result:
        raise SeparatrixError("measures: found no map of attractors, allowed the result of basin", USAGE)
    if "sample" in result["attractor"].dims:
        raise SeparatrixError(
            "measures: this map has starts drawn at random: it has basin_stability alone", USAGE
        )
    if "catalogue_attractor" not in result:
        raise SeparatrixError("measures: this map has no catalogue: none of its axes is a start", USAGE)


def indices_of(result: xr.Dataset, wanted: dict[str, float]) -> dict[str, int]:
    """Return the indices on the axes that are not position or velocity."""
    indices = {}
    for name in map(str, result["attractor"].dims):
        given = next(
            (
                key
                for key in wanted
                if key.replace(".", "_") in (name, "ratio") and (key != "ratio" or name == "drive_ratio")
            ),
            None,
        )
        if given is None and is_start(name) and name != "crank_angle":
            continue
        values = result[name].values
        if given is None and len(values) > 1:
            raise SeparatrixError(
                f"measures: the map has {len(values)} values of {name}; choose one (slice, --slice "
                f"{name}=VALUE), "
                "or go along them (measures_along, --along)",
                USAGE,
            )
        indices[name] = 0 if given is None else int(np.abs(values - wanted.pop(given)).argmin())
    if wanted:
        raise SeparatrixError(
            f"slice: found {', '.join(wanted)}, allowed {', '.join(map(str, result['attractor'].dims))}",
            USAGE,
        )
    return indices


def _values(result: xr.Dataset, indices: Mapping[str, int], case: Case) -> dict[str, float]:
    paths = {path.replace(".", "_").replace("[", "_").replace("]", ""): path for path in case.parameters}
    paths |= {
        str(axis["name"]).replace(".", "_"): str(axis["name"]) for axis in case.resolved.get("axis", [])
    }
    return {
        paths.get(name, name): float(result[name].values[at])
        for name, at in indices.items()
        if name != "crank_angle"
    }


def _is_angle(case: Case) -> bool:
    return case.resolved.get("restoring", {}).get("law") == "pendulum"


def _frequency(case: Case, values: Mapping[str, float], given: float | None) -> tuple[float, str]:
    """The frequency that velocities are divided by, and where it is from."""
    if given is not None:
        if not given > 0:
            raise SeparatrixError(f"frequency: found {given}, allowed > 0", USAGE)
        return float(given), "as asked for"
    parts = {**{path: one.value for path, one in case.parameters.items()}, **values}
    stiffness, mass = parts.get("restoring.stiffness", 0.0), parts.get("body.mass", 0.0)
    if stiffness > 0 and mass > 0:
        return float(np.sqrt(stiffness / mass)), "natural frequency"
    try:
        drive = case.model.drive_frequency(values)
    except CaseError:
        drive = 0.0
    return (float(drive), "frequency of the drive") if drive > 0 else (1.0, "there is no natural one")


def _turns(case: Case, names: tuple[str, ...], axes: list[np.ndarray]) -> np.ndarray:
    """2 pi for an angle whose axis goes all the way round."""
    turns = np.full(len(names), np.inf)
    for k, (name, axis) in enumerate(zip(names, axes, strict=True)):
        if _is_angle(case) and name == "x0" and len(axis) > 2:
            step = axis[1] - axis[0]
            if axis[-1] - axis[0] + step >= 2 * np.pi - 1e-9:
                turns[k] = 2 * np.pi
    return turns


def _closed(
    grid: np.ndarray, settle: np.ndarray | None, axes: list[np.ndarray], turns: np.ndarray
) -> tuple[np.ndarray, np.ndarray | None, list[np.ndarray]]:
    """With the first values of an angle once more at its end."""
    axes = list(axes)
    for k in np.flatnonzero(np.isfinite(turns)):
        if axes[k][-1] - axes[k][0] < turns[k] * (1 - 1e-9):
            axes[k] = np.append(axes[k], axes[k][0] + turns[k])
            grid = np.concatenate([grid, np.take(grid, [0], k)], axis=k)
            if settle is not None:
                settle = np.concatenate([settle, np.full_like(np.take(settle, [0], k), np.nan)], axis=k)
    return grid, settle, axes


def _entries(result: xr.Dataset, indices: Mapping[str, int]) -> dict[int, dict[str, float]]:
    """The catalogue of the slice by number."""
    catalogue = table(result, "catalogue")
    axes = [name for name in map(str, result["attractor"].dims) if not is_start(name)]
    number = 0
    for name in axes:
        number = number * result.sizes[name] + indices[name]
    rows = np.flatnonzero(catalogue["slice"].values == number)
    columns = [name for name, column in catalogue.items() if column.dims == ("entry",)]
    return {
        int(catalogue["attractor"].values[row]): {
            name: catalogue[name].values[row].item() for name in columns
        }
        for row in rows
    }


def _label_limits(grid: np.ndarray, result: xr.Dataset) -> tuple[str, ...]:
    limits = []
    lost = float(np.mean(grid == 0))
    if lost > 0:
        limits.append(f"{100 * lost:.3g} % of the map's starts have no known label")
    if "origin" in result:
        limits.append("the map is refined: most of its labels are inferred")
    return tuple(limits)


def _attach(
    found: Slice,
    case: Case,
    values: Mapping[str, float],
    indices: Mapping[str, int],
    result: xr.Dataset,
    threads: int | None,
) -> None:
    """Give the slice the machine of its case, where the library has it and it gives the labels of the map."""
    if not set(found.names) <= {"x0", "v0"}:
        found.limits += ("new starts are computed over x0 and v0 alone: everything is read from the map",)
        return
    try:
        machine = Machine(case, values, found.names, found.scale, threads)
        if "crank_angle" in indices:
            machine.start[2] = float(result["crank_angle"].values[indices["crank_angle"]])
        if found.entries:
            machine.take_numbers(list(found.entries.values()))
    except SeparatrixError as error:
        found.limits += (f"no new starts ({error}): everything is read from the map",)
        return
    points = found.points
    chosen = generator(1, 9).choice(len(points), min(_AGAIN, len(points)), replace=False)
    again = machine.labels(points[chosen])
    other = int(np.sum(again != found.grid.ravel()[chosen]))
    upper = share_interval(other, len(chosen))[1]
    found.about["labels"] = (
        f"{len(chosen)} starts of the map labelled again, {other} otherwise: at most {100 * upper:.2g} % are "
        "(95 % confidence)"
    )
    if other > 0.05 * len(chosen):
        found.limits += (
            f"new starts do not give the labels of the map ({other} of {len(chosen)} differ): everything is "
            "read from the map",
        )
        return
    if other:
        found.limits += (
            f"{other} of {len(chosen)} labels of the map came out otherwise when computed again",
        )
    found.machine = machine
