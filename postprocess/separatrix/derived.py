# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Derived quantities of attractors (`[derived.NAME]` of the case) at the points of maps and of sweeps."""

import numpy as np
import xarray as xr

from separatrix.labels import plain
from separatrix.open import table
from separatrix.variables import is_start

__all__ = ["PREFIX", "at_points", "derived_names", "labels_of", "short_name", "slices_of"]

PREFIX = "derived_"


def labels_of(result: xr.Dataset) -> xr.DataArray:
    """Return the labels of the points of a map, or of the many starts of a sweep."""
    return result["attractor" if "attractor" in result else "branch_attractor"]


def slices_of(labels: xr.DataArray) -> np.ndarray:
    """Return the number of the slice of parameters of each label; starts have the length 1."""
    sizes = [1 if is_start(str(dim)) or dim == "start" else size for dim, size in labels.sizes.items()]
    return np.arange(np.prod(sizes)).reshape(sizes)


def derived_names(result: xr.Dataset) -> list[str]:
    """Return the names of the derived quantities of attractors, as in the catalogue: derived_NAME."""
    return [str(name) for name in table(result, "catalogue").data_vars if str(name).startswith(PREFIX)]


def at_points(result: xr.Dataset, name: str) -> xr.DataArray:
    """Return a derived quantity at every point: that of its attractor, NaN without one.

    Of the many starts of a sweep its name is branch_derived_NAME.
    """
    catalogue = table(result, "catalogue")
    labels = labels_of(result)
    # labels of a slice, in the order of the slices, after those of the slice before
    span = int(max(catalogue["attractor"].values.max(initial=0), labels.values.max(initial=0))) + 1
    keys = catalogue["slice"].values.astype(np.int64) * span + catalogue["attractor"].values
    order = np.argsort(keys, kind="stable")
    wanted = slices_of(labels) * span + labels.values.astype(np.int64)
    at = np.minimum(np.searchsorted(keys[order], wanted), keys.size - 1)
    found = np.append(catalogue[name].values[order], np.nan)
    values = found[np.where((keys[order][at] == wanted) & (labels.values > 0), at, keys.size)]
    attributes = {key: catalogue[name].attrs[key] for key in ("units", "long_name")}
    attributes["label"] = short_name(catalogue[name])
    whole = str(labels.name).removesuffix("attractor") + name
    return xr.DataArray(values, labels.coords, labels.dims, whole, attributes)


def short_name(variable: xr.DataArray) -> str:
    """Return what a derived quantity is, for an axis of a figure."""
    return plain(str(variable.attrs["long_name"]).removesuffix(" over the cycle or window"))
