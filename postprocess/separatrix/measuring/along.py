# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures along a parameter: shares of the basins with bands, erosion of any measure."""

import json
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from separatrix.cases import Case, as_case
from separatrix.errors import CANNOT_CREATE, USAGE, SeparatrixError
from separatrix.kept_rows import KeptRows, write_dataset
from separatrix.map_axes import Values
from separatrix.maps import basin
from separatrix.measuring.api import NAMES, measures
from separatrix.measuring.maps import indices_of
from separatrix.open import open_result
from separatrix.progress import Progress, Report
from separatrix.variables import FORMAT_VERSION, is_start
from separatrix.version import __version__

__all__ = ["measures_along"]


def measures_along(
    source: xr.Dataset | Case | str | Path,
    parameter: str | None = None,
    values: Values = None,
    *,
    names: Sequence[str] | str | None = None,
    axes: Mapping[str, Values] | None = None,
    slice: Mapping[str, float] | None = None,
    output: str | Path | None = None,
    overwrite: bool = False,
    resume: bool = False,
    progress: bool | Report | None = None,
    **options: object,
) -> xr.Dataset:
    """Return measures of every basin at each value of a parameter.

    Parameters
    ----------
    source
        A map with the parameter as an axis, in which the attractors keep their numbers along it; or a case,
        of which such a map is computed.
    parameter, values
        Path of the parameter; of a case also its values, as those of an axis of `basin`. Of a map with one
        parameter it need not be given.
    names
        Measures, as for `measures`; by default the share of the window (GIM), of starts drawn at random the
        basin stability.
    axes
        Axes of the starts of a case: {"x0": 100, "v0": 100}.
    slice
        Values of the other parameters of a map.
    output, overwrite
        The file; without one the result is kept in memory. `separatrix-figures` draws it.
    resume
        Go on with a run into `output` that was stopped: values that are done are kept in OUTPUT.part.
    options
        Those of `measures`: frequency, deviation, starts, phases, seed, threads, new_starts, attractors.

    The Dataset has dimensions of the parameter and `basin` (numbers of the attractors), and for each measure
    NAME, NAME_lower and NAME_upper; nan where the attractor is not there, or nothing is known. `exists` is
    1 if an attractor is in the catalogue of a value, `limits` what limits the measures.

    Examples
    --------
    >>> case, axes = sx.load("examples/basin_coulomb.toml"), {"x0": 20, "v0": 20}
    >>> along = sx.measures_along(case, "drive.ratio", [1.2, 1.21], names="integrity_factor", axes=axes)
    >>> along["integrity_factor"].sizes["drive_ratio"]
    2
    """
    chosen = (names,) if isinstance(names, str) and names != "all" else names
    chosen = chosen if chosen is None else NAMES if chosen == "all" else tuple(chosen)
    target = None if output is None else Path(output)
    if target is not None and target.exists() and not overwrite:
        raise SeparatrixError(f"{target}: exists; overwrite=True replaces it", CANNOT_CREATE)
    result = _map_of(source, parameter, values, axes)
    if chosen is None:
        chosen = ("basin_stability",) if "sample" in result["attractor"].dims else ("global_integrity",)
    dim = _parameter(result, parameter, slice)
    done = KeptRows(
        target,
        _identity(result, dim, chosen, slice, options),
        resume,
        "is of another map, or of other measures",
    )
    rows = []
    with Progress(progress) as report:
        for number, value in enumerate(result[dim].values.tolist()):
            row = done.row(number)
            if row is None:
                fixed = {**(slice or {}), dim: value}
                found = measures(
                    result, chosen, slice=fixed, progress=False, **_there(result, fixed, options)
                )
                row = done.keep(number, [one.as_dict() for one in found])
            rows.append(row)
            report("values", number + 1, result.sizes[dim])
    data = _dataset(result, dim, rows)
    if target is None:
        return data
    write_dataset(data, target)
    done.remove()
    return open_result(target)


def _there(result: xr.Dataset, fixed: Mapping[str, float], options: Mapping) -> dict:
    """The options with those of the attractors asked for that have a basin at a value."""
    wanted = options.get("attractors")
    if wanted is None:
        return dict(options)
    asked = [wanted] if isinstance(wanted, int) else list(wanted)
    known = {int(one) for one in result["catalogue_attractor"].values}
    unknown = [one for one in asked if one not in known]
    if unknown:
        raise SeparatrixError(
            f"attractors: found {unknown[0]}, allowed {', '.join(map(str, sorted(known)))}", USAGE
        )
    if "sample" in result["attractor"].dims:
        return dict(options)
    present = {
        int(one) for one in np.unique(result["attractor"].isel(indices_of(result, dict(fixed))).values)
    }
    return {**options, "attractors": [one for one in asked if one in present]}


def _map_of(
    source: xr.Dataset | Case | str | Path,
    parameter: str | None,
    values: Values,
    axes: Mapping[str, Values] | None,
) -> xr.Dataset:
    if isinstance(source, xr.Dataset):
        return source
    if isinstance(source, str | Path) and Path(source).suffix == ".h5":
        return open_result(source)
    if parameter is None or values is None:
        raise SeparatrixError("measures_along: of a case the parameter and its values are needed", USAGE)
    return basin(as_case(source), {parameter: values, **(axes or {})}, progress=False)


def _parameter(result: xr.Dataset, parameter: str | None, chosen: Mapping[str, float] | None) -> str:
    if result.separatrix.kind != "basin" or "attractor" not in result:
        raise SeparatrixError(
            "measures_along: found no map of attractors, allowed the result of basin", USAGE
        )
    fixed = {key.replace(".", "_") for key in chosen or {}}
    free = [str(name) for name in result["attractor"].dims if not is_start(str(name)) and name not in fixed]
    if parameter is not None:
        free = [name for name in free if name == parameter.replace(".", "_")]
    if len(free) != 1:
        raise SeparatrixError(
            f"measures_along: found {len(free)} parameters in the map ({', '.join(free) or 'none'}), "
            f"allowed one; "
            "choose values of the others by slice",
            USAGE,
        )
    return free[0]


def _identity(result: xr.Dataset, dim: str, *more: object) -> str:
    """What decides the numbers: the map, the parameter, the measures and their options."""
    labels = np.ascontiguousarray(result["attractor"].values)
    # the number of threads decides nothing
    more = tuple(
        {k: v for k, v in one.items() if k != "threads"} if isinstance(one, dict) else one for one in more
    )
    content = json.dumps([result.attrs.get("resolved_case"), dim, *more], default=str, sort_keys=True)
    return f"{zlib.crc32(content.encode()):08x}{zlib.crc32(labels.tobytes()):08x}"


def _dataset(result: xr.Dataset, dim: str, rows: list[list[dict]]) -> xr.Dataset:
    numbers = sorted({int(one["of"]) for row in rows for one in row if one["of"] is not None})
    numbers = sorted({*numbers, *(int(one) for one in result["catalogue_attractor"].values)})
    data: dict[str, tuple] = {}
    kinds = {one["name"]: one for row in rows for one in row}
    for name, one in kinds.items():
        each = one["of"] is not None
        shape = (len(rows), len(numbers)) if each else (len(rows),)
        for part in ("value", "lower", "upper"):
            filled = np.full(shape, np.nan)
            for i, row in enumerate(rows):
                for item in row:
                    if item["name"] == name and item[part] is not None:
                        filled[(i, numbers.index(item["of"])) if each else i] = item[part]
            key = name if part == "value" else f"{name}_{part}"
            about = {"units": one["unit"], "long_name": one["definition"]}
            if part != "value":
                about["long_name"] = f"{part} end of the interval of {name.replace('_', ' ')}"
            data[key] = ((dim, "basin") if each else (dim,), filled, about)
    data |= _existence(result, dim, numbers, len(rows))
    # no start of the window in a basin whose attractor is there: a share of nothing, not an unknown one
    if "global_integrity" in data:
        share, exists = data["global_integrity"][1], data["exists"][1]
        share[np.isnan(share) & (exists == 1)] = 0.0
    limits = {limit for row in rows for one in row for limit in one["limits"]}
    coordinates = {
        dim: result[dim].astype(float),
        "basin": ("basin", np.array(numbers, np.int32), {"long_name": "number of the attractor"}),
    }
    about = {
        "Conventions": "CF-1.10",
        "format": "separatrix",
        "format_version": FORMAT_VERSION,
        "kind": "measures",
        "complete": 1,
        "title": str(result.attrs.get("title", "")),
        "source": f"Separatrix {__version__}",
        "parameter": dim,
        "resolved_case": str(result.attrs.get("resolved_case", "")),
        "limits": "; ".join(sorted(limits)),
        "starts_a_value": int(result["attractor"].size // len(rows)),
    }
    return xr.Dataset(data, coordinates, about)


def _existence(result: xr.Dataset, dim: str, numbers: list[int], count: int) -> dict[str, tuple]:
    """Which attractors the catalogue has at each value, at any of the other parameters."""
    exists = np.zeros((count, len(numbers)), np.int8)
    dims = [str(name) for name in result["attractor"].dims if not is_start(str(name))]
    indices = np.unravel_index(result["catalogue_slice"].values, [result.sizes[name] for name in dims])
    for at, label in zip(indices[dims.index(dim)], result["catalogue_attractor"].values, strict=True):
        exists[int(at), numbers.index(int(label))] = 1
    return {
        "exists": (
            (dim, "basin"),
            exists,
            {
                "units": "1",
                "long_name": "whether the attractor is in the catalogue",
                "flag_values": np.array([0, 1], np.int8),
                "flag_meanings": "absent present",
            },
        )
    }
