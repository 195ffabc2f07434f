# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each effect is, in words for readers who do not know its name."""

from separatrix.discovery.wording import words

PHRASES = {
    "viscous": "damping in proportion to the speed",
    "coulomb": "dry friction",
    "quadratic_drag": "a drag that grows with the square of the speed",
    "cubic_damping": "a damping that grows with the cube of the speed",
    "stribeck": "dry friction that falls with the sliding speed",
    "static_excess": "friction that is larger at break-away than while sliding",
    "dahl": "friction that yields like a spring before it slides",
    "asymmetric_friction": "friction that differs with the direction of the motion",
    "position_dependent_friction": "dry friction that changes with the position",
    "friction_curve": "friction that depends on the speed in another way than in the case",
    "friction_position_curve": "dry friction that depends on the position",
    "linear_spring": "a spring that the case lacks",
    "quadratic_spring": "a spring force that grows with the square of the extension",
    "cubic_spring": "a spring force that grows with the cube of the extension",
    "spring_curve": "a spring force that depends on the extension in another way than in the case",
    "backlash": "free play in series with the spring",
    "force_curve": "a force that depends on the position",
    "offset_force": "a constant force, as of a preload or a tilt",
    "restitution_slope": "restitution that falls with the impact speed",
    "restitution_falloff": "restitution that falls with the impact speed",
    "restitution_curve": "restitution that depends on the impact speed",
    "compliant_contact": "a barrier that yields, stiffer the deeper it is pressed",
    "kelvin_voigt_contact": "a barrier that yields like a spring with a damper",
    "contact_hardening": "a barrier whose force grows with another power of the penetration than in the case",
    "contact_curve": "a barrier whose force depends on the penetration in another way than in the case",
    "second_barrier": "a barrier on the free side",
    "drive_ripple": "a crank whose angle fluctuates within each turn",
    "drive_harmonics": "higher harmonics in the motion of the drive",
    "sensor_bias": "a sensor with another zero",
    "sensor_gain": "a sensor with another scale",
    "sensor_delay": "a sensor that lags",
    "motor_line": "another torque of the motor over its speed",
    "bearing_friction": "dry friction in the bearing of the crank",
    "crank_inertia": "another inertia of the crank",
    "lever_inertia": "an inertia of the lever",
    "current_lag": "a motor current that lags behind the voltage",
}


def explained(name: str) -> str:
    """An effect's name as words, and what it is."""
    phrase = PHRASES.get(name.partition("@")[0])
    return words(name) + (f" ({phrase})" if phrase else "")
