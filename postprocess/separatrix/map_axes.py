# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes of a map, as the API takes them and as a case has them."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from separatrix.cases import Case, linspace, quantity
from separatrix.errors import USAGE, CaseError
from separatrix.labelling import axis_values

Values = (
    linspace
    | tuple[float | str, float | str, int]
    | Sequence[float | str]
    | np.ndarray
    | int
    | float
    | str
    | None
)

_STARTS = ("x0", "v0", "crank_angle")


def with_axes(case: Case, asked: Mapping[str, Values]) -> Case:
    """Return the case with other axes."""
    if not asked:
        return case
    old = {str(axis["name"]): dict(axis) for axis in case.resolved.get("axis", [])}
    asked = {"drive.ratio" if name == "ratio" else name: values for name, values in asked.items()}
    # Initial conditions are the fastest axes; new axes over parameters come first.
    names = [name for name in asked if name not in old and name not in _STARTS]
    names += [*old, *(name for name in asked if name not in old and name in _STARTS)]
    axes = []
    for name in names:
        if name not in asked:
            axes.append(old[name])
        elif asked[name] is not None:
            axes.append({"name": name} | axis_keys(name, asked[name], old.get(name)))
    try:
        return case.with_({"axis": axes})
    except CaseError as error:
        # "axis=[...]: key 'axis[1]': found ..."
        text = re.sub(r"^axis(=\[.*\])?: ", "", str(error), flags=re.MULTILINE)
        text = re.sub(
            r"key 'axis\[(\d+)\](?:\.name)?", lambda found: f"axis '{axes[int(found[1]) - 1]['name']}", text
        )
        raise CaseError(f"{case.name}: {text}", error.code) from None


def axis_keys(name: str, values: Values, old: Mapping[str, object] | None) -> dict[str, object]:
    """Return the keys of an axis."""
    if isinstance(values, int | np.integer) and not isinstance(values, bool):
        if old is None:
            raise CaseError(
                f"axis {name}: found a count alone, allowed where the case has such an axis", USAGE
            )
        first, last = (old["from"], old["to"]) if "from" in old else (old["values"][0], old["values"][-1])
        return {"from": first, "to": last, "count": int(values)}
    if isinstance(values, float | np.floating | str):
        return {"values": [quantity(name, values)]}
    if isinstance(values, tuple) and len(values) == 3 and isinstance(values[2], int | np.integer):
        values = linspace(*values)
    if isinstance(values, linspace):
        return {"from": values.first, "to": values.last, "count": values.count}
    array = np.asarray(values)
    array = array if array.dtype.kind in "iuf" else np.asarray(values, object)
    if array.ndim != 1 or array.size == 0:
        raise CaseError(f"axis {name}: found shape {array.shape}, allowed a list of numbers", USAGE)
    return {"values": [quantity(name, value) for value in array]}


def evenly_spaced(case: Case, parameter: str, axis: dict[str, object]) -> dict[str, object]:
    """Return the first, the last and the number of values that must be evenly spaced."""
    if "values" not in axis:
        return axis
    values = np.array([case.in_si(parameter, value) for value in axis["values"]])
    even = {"from": float(values[0]), "to": float(values[-1]), "count": values.size}
    if not np.allclose(axis_values(even), values, rtol=1e-12, atol=1e-12 * np.abs(values).max()):
        raise CaseError("values: found unevenly spaced ones, allowed for a sweep is sx.linspace(...)", USAGE)
    return even


def axis_numbers(case: Case, name: str, values: Values) -> np.ndarray:
    """Return the values of an axis over a parameter in SI units."""
    axis = axis_keys(name, values, None)
    if "values" in axis:
        return np.array([case.in_si(name, value) for value in axis["values"]])
    return axis_values({**axis, **{end: case.in_si(name, axis[end]) for end in ("from", "to")}})


def size_of_axis(axis: Mapping[str, object]) -> int:
    """Return the number of values of an axis, by its keys."""
    return int(axis["count"]) if "count" in axis else len(axis["values"])
