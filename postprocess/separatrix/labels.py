# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Symbols and units for axes and legends."""

import numpy as np
import xarray as xr

_SYMBOLS = {
    "x0": "initial position $x_0$",
    "v0": "initial velocity $v_0$",
    "crank_angle": r"initial crank angle $\varphi_0$",
    "drive_ratio": r"frequency ratio $\omega/\omega_0$",
    "ratio": r"frequency ratio $\omega/\omega_0$",
    "time": "time $t$",
    "x": "position $x$",
    "v": "velocity $v$",
    "settle_time": "settling time",
    "grazing_margin": "smallest distance to grazing",
    "amplitude": r"amplitude $(x_\mathrm{max} - x_\mathrm{min})/2$",
    "x_max": r"$x_\mathrm{max}$",
    "x_min": r"$x_\mathrm{min}$",
    "v_max": r"$v_\mathrm{max}$",
    "mean_impact_speed": "mean impact speed",
    "impacts_per_period": "impacts per drive period",
}
_SHORT = {
    "x0": "$x_0$",
    "v0": "$v_0$",
    "crank_angle": r"$\varphi_0$",
    "drive_ratio": r"$\omega/\omega_0$",
    "ratio": r"$\omega/\omega_0$",
    "friction_kinetic_coefficient": r"$\mu$",
    "friction_static_coefficient": r"$\mu_s$",
    "friction_damping": "$c$",
    "contact_restitution": "$e$",
}


def plain(text: str) -> str:
    """Return text from a file or a user so that it is printed as it is, not read as a formula."""
    return str(text).replace("\\", "\\\\").replace("$", r"\$") if "$" in str(text) else str(text)


def unit(variable: xr.DataArray) -> str:
    """Return the unit of a variable, empty for pure numbers."""
    text = str(variable.attrs.get("units", ""))
    return "" if text == "1" else text


def positions_are_angles(result: xr.Dataset) -> bool:
    """Whether the positions of a result are angles, by the units of the first of its positions."""
    for name in ("amplitude", "x0", "catalogue_x", "saddles_x"):
        if name in result:
            return unit(result[name]) in ("rad", "deg")
    return False


def axis_label(variable: xr.DataArray) -> str:
    """Return the label of an axis: what, symbol and unit."""
    name = str(variable.name)
    known = variable.attrs.get("label") or _SYMBOLS.get(name)
    text = known or plain(variable.attrs.get("long_name", name.replace("_", " ")))
    return f"{text} ({_raised(unit(variable))})" if unit(variable) else text


def _raised(unit_text: str) -> str:
    """Return a unit with its exponents as figures above the line."""
    return unit_text.replace("^2", "\u00b2").replace("^3", "\u00b3")


def symbol(variable: xr.DataArray) -> str:
    """Return the symbol of a variable, or its name where it has none."""
    name = str(variable.name)
    return (
        variable.attrs.get("symbol")
        or _SHORT.get(name)
        or plain(variable.attrs.get("long_name", name.replace("_", " ")))
    )


def value_label(variable: xr.DataArray, value: float) -> str:
    """Return 'symbol = value unit' for the title of a panel."""
    return f"{symbol(variable)} = {value:.5g} {_raised(unit(variable))}".rstrip()


def flag_text(name: str) -> str:
    """Return the name of a code as a reader expects it: 'non_impact' -> 'non-impact'."""
    return name.replace("non_", "non-").replace("_", " ")


def share_texts(counts: np.ndarray) -> list[str]:
    """Return the shares of counts in per cent, two decimals each, that add up to 100.00 as printed.

    The hundredths lost by rounding down go to the largest remainders; a share that is not zero but
    rounds to it is printed as '< 0.01 %'.
    """
    counts = np.asarray(counts, dtype=np.int64)
    total = int(counts.sum())
    scaled = [int(count) * 10000 for count in counts]
    parts = [value // total for value in scaled]
    order = sorted(range(len(parts)), key=lambda i: (-(scaled[i] % total), i))
    for i in order[: 10000 - sum(parts)]:
        parts[i] += 1
    return [
        "< 0.01 %" if part == 0 and count > 0 else f"{part / 100:.2f} %"
        for part, count in zip(parts, counts, strict=True)
    ]


def count_text(number: int) -> str:
    """Return a count with thin spaces between groups of three digits."""
    return f"{number:,}".replace(",", "\u2009")
