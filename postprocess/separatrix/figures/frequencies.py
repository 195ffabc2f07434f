# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which variables of a result are frequencies, ratios to the natural frequency included, and their rad/s."""

import re
import tomllib

import numpy as np
import xarray as xr

from separatrix.errors import USAGE, SeparatrixError

FREQUENCY = "frequency"
_RATIOS = ("drive_ratio", "ratio")
# brackets of limits, and curves of branches, over the parameter of the file
_OVER_PARAMETER = re.compile(r"limits_(observed_)?(lower|upper)|(curve_|equilibrium_|rest_)?parameter")
# label and symbol of the frequency of the drive
_LABELS = {
    "Hz": ("drive frequency $f$", "$f$"),
    "rpm": ("drive speed $n$", "$n$"),
    "rad/s": (r"drive frequency $\omega$", r"$\omega$"),
}


def angular(result: xr.Dataset, key: str) -> float | None:
    """Return what one of a variable is in rad/s; None unless it is a frequency.

    SeparatrixError for a ratio to a natural frequency that varies or that the machine does not have.
    """
    name, si = _name(result, key), result[key].attrs.get("units")
    if name in _RATIOS and si == "1":
        return _natural_frequency(result)
    return 1.0 if si == "rad/s" and re.search(r"frequency(_\d+)?$", name) else None


def renamed(result: xr.Dataset, key: str, unit: str) -> dict[str, object]:
    """Return the attributes of a frequency in another unit; that of the only drive has a symbol."""
    attributes, name = result[key].attrs, _name(result, key)
    drives = _case(result).get("drive", {})
    single = sum(isinstance(one, dict) for one in drives.values()) <= 1
    if name in _RATIOS or (name.startswith("drive_") and single):
        label, symbol = _LABELS[unit]
        return {**attributes, "units": unit, "long_name": label, "label": label, "symbol": symbol}
    text = str(attributes.get("long_name", "frequency")).replace("angular frequency", "frequency")
    return {**attributes, "units": unit, "long_name": text}


def _case(result: xr.Dataset) -> dict:
    return tomllib.loads(str(result.attrs.get("resolved_case", "")))


def _natural_frequency(result: xr.Dataset) -> float:
    """The natural angular frequency that ratios refer to [rad/s]: sqrt(c/m) of the linear spring."""
    case = _case(result)
    stiffness, mass = (case.get(a, {}).get(b) for a, b in (("restoring", "stiffness"), ("body", "mass")))
    reason = "" if stiffness and mass else "there is no linear spring"
    for path in ("restoring.stiffness", "body.mass"):
        if path.replace(".", "_") in _varying(result):
            reason = f"{path} varies"
    if reason:
        raise SeparatrixError(f"units: the ratio refers to no single natural frequency: {reason}", USAGE)
    return float(np.sqrt(stiffness / mass))


def _name(result: xr.Dataset, key: str) -> str:
    """The axis or parameter whose values a variable holds."""
    if key == "curve_free":
        key = str(result.attrs.get("free", key))
    elif _OVER_PARAMETER.fullmatch(key):
        swept = [str(one) for one in result["x_max"].dims if one != "direction"] if "x_max" in result else []
        key = str(result.attrs.get("parameter", swept[0] if swept else key))
    return re.sub("^(piece|saddles)_", "", key.replace(".", "_"))


def _varying(result: xr.Dataset) -> set[str]:
    found = {str(one) for one in result.variables} | set(str(result.attrs.get("axes", "")).split())
    return found | {_name(result, key) for key in ("parameter", "curve_free")}
