# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Captions: the case that a figure shows, from the resolved case of its file."""

import functools
import re
import tomllib

import numpy as np
import xarray as xr

from separatrix.errors import CaseError
from separatrix.figures.look import Look
from separatrix.figures.parts import numbers_of_parts, parts, several_bodies
from separatrix.labels import positions_are_angles
from separatrix.library import Model

# Symbols are those of docs/start.md and docs/theory.md: m, c, k, e, omega.
# symbol and unit of the parameters that matter for a caption, in this order; the library knows better units
_FRICTION = {
    "kinetic_coefficient": (r"$\mu$", ""),
    "static_coefficient": (r"$\mu_s$", ""),
    "damping": ("$c$", "N s/m"),
    "stribeck_velocity": ("$v_s$", "m/s"),
    "stribeck_exponent": (r"$\delta$", ""),
}
_CONTACT = {
    "restitution": ("restitution $e$", ""),
    "upper": (r"$x_\mathrm{upper}$", "m"),
    "lower": (r"$x_\mathrm{lower}$", "m"),
}
_BODIES = {"mass": ("$m_1$", "kg"), "driven_mass": ("$m_2$", "kg"), "friction": ("$b$", "N")}
_STOP = {
    "restitution": ("$e$", ""),
    "stiffness": ("$k_c$", ""),
    "exponent": ("$n$", ""),
    "damping": ("damping", ""),
}
_SOFT = {key: _STOP[key] for key in ("stiffness", "exponent", "damping")}
# the numbers of the other laws: what a caption needs besides so that the run can be repeated
_FURTHER = {
    "body.mass": "$m$",
    "body.gravity": "$g$",
    "restoring.stiffness": "$k$",
    "restoring.free_length": "$l_0$",
}
# not mentioned where they are 0, as they are by default
_ZERO = ("drive.mean", "drive.angle", "drive.periodic", "restoring.free_length")
_START = {"x0": ("$x_0$", "m"), "v0": ("$v_0$", "m/s")}
_LAW_NAMES = {
    "none": "no",
    "coulomb": "Coulomb",
    "viscous": "viscous",
    "coulomb_viscous": "Coulomb-viscous",
    "coulomb_stribeck": "Coulomb-Stribeck",
    "dahl": "Dahl",
    "bouc_wen": "Bouc-Wen",
    "lugre": "LuGre",
}
_OF_ROTATION = {
    "kg": "kg m^2", "m": "rad", "m/s": "rad/s", "N": "N m", "N/m": "N m", "N s/m": "N m s",
}  # fmt: skip
# values beyond this mean "absent", and are not numbers to print
_HUGE = 1e300
# of a list; of a longer one the range is given
_MOST_NUMBERS = 12


def resolved_case(result: xr.Dataset) -> dict:
    """Return the resolved case of a file as nested dictionaries; empty if none can be read."""
    try:
        return tomllib.loads(result.attrs.get("resolved_case", ""))
    except tomllib.TOMLDecodeError:
        return {}


def describe_case(result: xr.Dataset) -> list[str]:
    """Return short pieces of a caption: friction, contact and drive ratio, or two bodies and what joins them.

    A parameter that is an axis of the map or of the sweep, or differs between the points, is left out; so is
    the ratio of a machine without a drive.
    """
    case = resolved_case(result)
    axes, units = _axes(result, case), _units_of(result, case)
    if "driven_mass" in case.get("body", {}):
        return _two_bodies(case, axes, units)
    if several_bodies(case):
        return [numbers_of_parts(case)]
    pieces = []
    friction = case.get("friction")
    if isinstance(friction, dict):
        law = str(friction.get("law", ""))
        name = f"{_LAW_NAMES.get(law, law.replace('_', ' '))} friction".strip()
        pieces.append(", ".join([name, *_values(friction, _FRICTION, "friction", axes, units)]))
    contact = case.get("contact")
    if isinstance(contact, dict):
        values = _values(contact, _CONTACT, "contact", axes, units)
        if "stiffness" in contact:
            soft = _values(contact, _SOFT, "contact", axes, units)
            values = [str(contact["law"]).replace("_", "-"), *soft, *values]
        pieces.append(", ".join(values) if values else "no barrier")
    ratio = _drive_ratio(result, case)
    if ratio is not None and "drive_ratio" not in axes:
        pieces.append(rf"$\omega/\omega_0$ = {ratio:g}")
    return pieces


def caption_pieces(result: xr.Dataset, look: Look, short: list[str]) -> list[str]:
    """Return the pieces of a caption on what was computed: `short`, and all else in a full one."""
    return [*short, *(machine_pieces(result) if look.caption == "full" else [])]


def shown(pieces: list[str], look: Look) -> list[str]:
    """Return the pieces of a caption, or none where none is wanted."""
    return [] if look.caption == "none" else pieces


def machine_pieces(result: xr.Dataset) -> list[str]:
    """Return what `describe_case` leaves out of the machine and its run, to six digits and with units."""
    case = resolved_case(result)
    axes, units = _axes(result, case), _units_of(result, case)
    pieces = []
    several = several_bodies(case)
    for family in () if several else ("body", "restoring", "friction", "contact", "drive"):
        law = case.get(family)
        if isinstance(law, dict):
            pieces += _law_pieces(case, family, law, axes, units)
    if several:
        units = {path: raised(unit) for path, unit in units.items()}
        pieces += parts(case, axes, units)
    for name, effect in case.get("effect", {}).items():
        pieces += _law_pieces(case, f"effect.{name}", effect, axes, units)
    run = case.get("run", {})
    if "duration" in run:
        extended = result.attrs.get("kind") == "basin" and run["extension"] > 1
        longer = f", at most {run['extension']:g} times that" if extended else ""
        pieces.append(f"duration {run['duration']:.6g} s{longer}")
    return pieces


def _has_weight(case: dict) -> bool:
    """Whether gravity acts: by the weight that a friction coefficient multiplies; a pendulum has a moment."""
    friction = case.get("friction", {})
    return isinstance(friction, dict) and any(key.endswith("_coefficient") for key in friction)


def _law_pieces(case: dict, family: str, law: dict, axes: set[str], units: dict[str, str]) -> list[str]:
    worded = {"friction": _FRICTION, "contact": {**_CONTACT, **_STOP}, "body": _BODIES}.get(family, {})
    if family == "body" and "driven_mass" not in law:
        worded = {}
    texts = []
    for key, value in law.items():
        path = f"{family}.{key}"
        if key == "law" or key in worded or path == "drive.ratio" or path.replace(".", "_") in axes:
            continue
        numbers = value if isinstance(value, list) else [value]
        if (value == 0 and path in _ZERO) or (path == "body.gravity" and not _has_weight(case)):
            continue
        if not all(isinstance(one, int | float) and abs(one) < _HUGE for one in numbers):
            continue
        if path == "drive.periodic":
            texts.append("repeated")
            continue
        shown = ", ".join(f"{one:.6g}" for one in numbers)
        shown = f" = ({shown})" if isinstance(value, list) else f" = {shown}"
        if len(numbers) > _MOST_NUMBERS:
            shown = f": {len(numbers)} values from {min(numbers):.6g} to {max(numbers):.6g}"
        name = _FURTHER.get(path, key.replace("_", " "))
        if path == "body.mass" and case.get("restoring", {}).get("law") == "pendulum":
            name = "$J$"
        unit = units.get(f"{path}[1]" if isinstance(value, list) else path, "")
        texts.append(f"{name}{shown} {'' if unit == '1' else raised(unit)}".rstrip())
    law_name = str(law.get("law", "")).replace("_", " ")
    heading = {
        "drive": f"{law_name.replace('fourier', 'Fourier')} drive",
        "restoring": f"{law_name} spring",
    }.get(family, "")
    if family.startswith("effect."):
        heading = family.removeprefix("effect.").replace("_", " ")
    if law_name in ("linear", "none", "harmonic") and family == "restoring":
        heading = ""
    return [", ".join([heading, *texts] if heading else texts)] if texts else []


def _units_of(result: xr.Dataset, case: dict) -> dict[str, str]:
    """Units of the parameters of a case; of a pendulum, whose position is an angle, those of a rotation."""
    units = {
        # without the library
        "contact.stiffness": "N/m", "contact.damping": "N s/m", "friction.damping": "N s/m",
        # a measured force is data, not parameters that the library knows the units of
        "drive.interval": "s", "drive.force[1]": "N",
    } | _units(str(result.attrs.get("resolved_case", "")))  # fmt: skip
    if case.get("restoring", {}).get("law") == "pendulum":
        units = {path: _OF_ROTATION.get(unit, unit) for path, unit in units.items()}
    return units


@functools.lru_cache(4)
def _units(resolved: str) -> dict[str, str]:
    """Units of the parameters of a case, as the library knows them; without it, none."""
    try:
        return {path: one.unit for path, one in Model.from_text(resolved).parameters.items()}
    except CaseError:
        return {}


def raised(unit: str) -> str:
    """Return a unit with its powers raised."""
    return re.sub(r"\^(-?[\d.]+|n)", lambda power: f"$^{{{power[1]}}}$", unit)


def _two_bodies(case: dict, axes: set[str], units: dict[str, str]) -> list[str]:
    """The bodies, the friction between them, the drive and the stop; what is an axis is left out."""
    body, drive, contact = (case.get(name, {}) for name in ("body", "drive", "contact"))
    pieces = [
        ", ".join(_values(body, _BODIES, "body", axes, units)),
        f"drive: {drive.get('law', 'none')}".replace("_", " "),
    ]
    law = str(contact.get("law", "none"))
    if law != "none":
        carrier = "the driving body" if body["law"] == "backlash_pair" else "the ground"
        stop = (
            [f"stop on {carrier}"]
            if law.startswith("newton")
            else [f"stop on {carrier}", law.replace("_", "-")]
        )
        pieces.append(", ".join([*stop, *_values(contact, _STOP, "contact", axes, units)]))
    return pieces


def start_pieces(result: xr.Dataset) -> list[str]:
    """Return the start values that are no axis; a crank angle of 0 is not mentioned."""
    start = resolved_case(result).get("start")
    if not isinstance(start, dict):
        return []
    symbols = _START
    if positions_are_angles(result):
        symbols = {key: (symbol, unit.replace("m", "rad")) for key, (symbol, unit) in _START.items()}
    varying = {str(name) for name in result.dims} | set(str(result.attrs.get("axes", "")).split())
    pieces = _values(start, symbols, "", varying, {})
    if start.get("crank_angle") and "crank_angle" not in varying:
        pieces += _values(start, {"crank_angle": (r"$\varphi_0$", "rad")}, "", set(), {})
    return [", ".join(pieces)] if pieces else []


def version_text(result: xr.Dataset) -> str:
    """Return program, version and commit that wrote the file."""
    source = str(result.attrs.get("source", "Separatrix"))
    commit = str(result.attrs.get("provenance_commit", ""))
    return f"{source} ({commit[:10]})" if commit else source


def _axes(result: xr.Dataset, case: dict) -> set[str]:
    """Names of what varies in a file."""
    axes = {str(name) for name in result.dims}
    if result.attrs.get("kind") == "boundary":
        axes.update(str(result.attrs.get("axes", "")).split())
        axes.update(str(name).removeprefix("piece_") for name in result.data_vars)
    if result.attrs.get("kind") == "branches":
        axes.add(str(result.attrs.get("parameter", "")).replace(".", "_"))
    if "ratio" in result and np.ptp(result["ratio"].values) > 0:
        axes.add("drive_ratio")
    friction = case.get("friction")
    # an axis over the kinetic coefficient moves a static one that equals it
    if (
        "friction_kinetic_coefficient" in axes
        and isinstance(friction, dict)
        and friction.get("static_coefficient") == friction.get("kinetic_coefficient")
    ):
        axes.add("friction_static_coefficient")
    return axes


def _drive_ratio(result: xr.Dataset, case: dict) -> float | None:
    drive = case.get("drive")
    value = result.attrs.get("drive_ratio", drive.get("ratio") if isinstance(drive, dict) else None)
    if "ratio" in result:
        value = float(result["ratio"].values[0])
    return float(value) if isinstance(value, int | float) and value > 0 else None


def _values(section: dict, symbols: dict, family: str, axes: set, units: dict[str, str]) -> list[str]:
    texts = []
    for key, (symbol, unit) in symbols.items():
        value = section.get(key)
        name = f"{family}_{key}" if family else key
        if not isinstance(value, int | float) or name in axes or not abs(value) < _HUGE:
            continue
        unit = units.get(f"{family}.{key}", unit)
        texts.append(f"{symbol} = {value:g} {'' if unit == '1' else raised(unit)}".rstrip())
    return texts
