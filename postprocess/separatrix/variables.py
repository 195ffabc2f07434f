# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names, types, units and meanings of what a map and a trajectory hold, as their files have them.

A test compares them with the files of the program.
"""

import re

import numpy as np

#: The version of the files that are written; older ones are read too (docs/file-format.md).
FORMAT_VERSION = 2
# names in older files, of variables and of axes over parameters
RENAMED = {
    "strobe_x": "section_x", "strobe_v": "section_v",
    "body_blow": "body_impulse", "body_blow_time": "body_impulse_time",
} | {
    f"critical_blow{end}": f"critical_impulse{end}" for end in ("", "_lower", "_upper")
}  # fmt: skip
# events in older files
RENAMED_EVENTS = {"blow": "impulse"}

_REGIMES = "unresolved non_impact impact sticking mixed chattering at_rest stuck"
_REASONS = "not_run settled time_over left_domain not_finite event_budget step_failed step_budget mode_cycle"
_EVENTS = (
    "impact_upper impact_lower stick release turning_point chatter_upper chatter_lower barrier_release "
    "touch_upper touch_lower separation impulse"
)
_MODES = "slip_plus slip_minus stick upper_barrier lower_barrier held"


# Axes over starts: of one body, of bodies and structures by name, the count of starts drawn at random.
_START = re.compile(
    r"x0|v0|crank_angle|sample|motor_(?:crank_speed|start_current|start_integral)|body_.+_[xv]0|structure_.+_[xv]0_\d+"
)


def is_start(axis: str) -> bool:
    """Whether an axis of a file is one of starts, not of a parameter of the machine."""
    return _START.fullmatch(axis) is not None


def _flags(meanings: str, first: int = 0) -> dict[str, object]:
    count = len(meanings.split())
    return {"flag_values": np.arange(first, first + count, dtype=np.int8), "flag_meanings": meanings}


# name: type, unit, meaning, further attributes; the table of src/maps/point_columns.f90
MAP = {
    "regime": (np.int8, "1", "regime of the motion", _flags(_REGIMES)),
    "attractor": (np.int32, "1", "label of the attractor in the catalogue, 0 = none", {}),
    "reason": (np.int8, "1", "why the trajectory ended", _flags(_REASONS)),
    "period": (np.int16, "1", "period in drive periods, 0 = not periodic", {}),
    "event_word": (np.float64, "1", "events of one period of the motion, three bits each", {}),
    "impacts_per_period": (np.float32, "1", "impacts per drive period", {}),
    "mean_impact_speed": (np.float32, "m/s", "mean speed just before impact", {}),
    "amplitude": (np.float32, "m", "half the range of the position", {}),
    "x_max": (np.float32, "m", "largest position", {}),
    "x_min": (np.float32, "m", "smallest position", {}),
    "v_max": (np.float32, "m/s", "largest velocity towards the upper barrier", {}),
    "settle_time": (np.float32, "s", "time from the start to capture by the attractor", {}),
    "grazing_margin": (
        np.float32,
        "m",
        "smallest distance to a barrier at a turning point that missed it",
        {},
    ),
}
# name: unit, meaning, further attributes
STARTS = {
    "x0": ("m", "initial position", {}),
    "v0": ("m/s", "initial velocity", {}),
    "crank_angle": ("rad", "initial crank angle", {}),
}
KINDS = ("cycle", "rest", "chaotic", "not_known", "family")
# name: type, unit, meaning, further attributes
CATALOGUE = {
    "slice": (np.int32, "1", "slice of the parameter axes, C order from 0", {}),
    "attractor": (np.int32, "1", "label", {}),
    "regime": (np.int8, "1", "regime of the motion", _flags(_REGIMES)),
    "period": (np.int16, "1", "period in drive periods", {}),
    "cycle_time": (np.float64, "s", "time that one cycle takes; 0 of what is none", {}),
    "event_word": (np.float64, "1", "events of one period", {}),
    "x": (np.float64, "m", "position at the section, crank angle 0", {}),
    "v": (np.float64, "m/s", "velocity at the section, crank angle 0", {}),
    "multiplier": (np.float64, "1", "largest modulus of the multipliers", {}),
    "capture_radius": (np.float64, "1", "radius of the neighbourhood found to contract", {}),
    "amplitude": (np.float64, "m", "half the range of the position", {}),
    "x_max": (np.float64, "m", "largest position", {}),
    "x_min": (np.float64, "m", "smallest position", {}),
    "v_max": (np.float64, "m/s", "largest velocity", {}),
    "impacts_per_period": (np.float64, "1", "impacts per drive period", {}),
    "mean_impact_speed": (np.float64, "m/s", "mean speed before impact", {}),
    "grazing_margin": (np.float64, "m", "smallest distance to a barrier missed", {}),
    "count": (np.int64, "1", "points of the map captured", {}),
    "kind": (
        np.int8,
        "1",
        "whether it is a cycle, rest, chaotic, a family of cycles, or nothing of them is known",
        _flags(" ".join(KINDS), 1),
    ),
}
# name: dimensions, unit, meaning
CYCLES = {
    "multiplier_real": (("entry", "coordinate"), "1", "real parts of the multipliers"),
    "multiplier_imaginary": (("entry", "coordinate"), "1", "imaginary parts of the multipliers"),
    "point_entry": (
        ("cycle_point",), "1", "entry that has the section point, from 0; its points are in order of time",
    ),
    "point": (("cycle_point", "coordinate"), "SI", "section points of the cycles: of one body x and v"),
}  # fmt: skip
SAMPLES = {
    "time": ("s", "time since the start", {}),
    "x": ("m", "position", {}),
    "v": ("m/s", "velocity", {}),
    "mode": ("1", "mode", _flags(_MODES, 1)),
    "drive": ("m", "position of the foot of the spring", {}),
    "driver_x": ("m", "position of the driving body", {}),
    "driver_v": ("m/s", "velocity of the driving body", {}),
    "contact_force": ("N", "force of the barriers on the body", {}),
    "energy": ("J", "energy of spring and bodies", {}),
    "kinetic_energy": ("J", "kinetic energy", {}),
    "potential_energy": ("J", "energy of the spring", {}),
    "friction_loss": ("J", "energy lost to dry friction since the start", {}),
    "damping_loss": ("J", "energy lost to viscous damping since the start", {}),
    "contact_loss": (
        "J",
        "energy put into barriers since the start; of a pressed soft one, part comes back",
        {},
    ),
    "drive_work": ("J", "work of drive and impulses since the start", {}),
}
EVENTS = {
    "kind": ("1", "kind of event", _flags(_EVENTS, 1)),
    "time": ("s", "time of the event", {}),
    "x": ("m", "position", {}),
    "v_before": ("m/s", "velocity just before", {}),
    "v_after": ("m/s", "velocity just after", {}),
    "driver_x": ("m", "position of the driving body", {}),
    "driver_v": ("m/s", "velocity of the driving body", {}),
}
REGIMES = tuple(_REGIMES.split())
REASONS = tuple(_REASONS.split())


# units of a motion on a line, and of an angle
_TURNED = {"m": "rad", "m/s": "rad/s", "N": "N m"}


def attributes(row: tuple[str, str, dict], angle: bool = False) -> dict[str, object]:
    """Return the attributes of a variable of a motion along a line, or of an angle."""
    unit, meaning, more = row
    return {"units": _TURNED.get(unit, unit) if angle else unit, "long_name": meaning, **more}
