# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases with what neither the examples nor the documents have, as seeds of scripts/evidence/mutants."""

_BODY = """\
body = {{ mass = "1 kg", gravity = "1 m/s^2" }}
restoring = {{ law = "linear", stiffness = "88.8 N/m" }}
friction = {{ law = "coulomb_viscous", kinetic_coefficient = 0.03, static_coefficient = 0.05, damping = 0.5 }}
contact = {{ law = "newton", restitution = 0.7, upper = "0.12 m" }}
drive = {{ law = "{drive}", amplitude = "20 mm" }}
start = {{ x0 = "20 mm", v0 = "0 m/s" }}
run = {{ duration = "20 s", window = "5 s" }}
[motor]
inertia = "0.05 kg m^2"
bearing_damping = "0.002 N m s"
crank_speed = "10 rad/s"
{motor}
[[axis]]
name = "x0"
from = -0.1
to = 0.1
count = 3
[[axis]]
name = "motor.crank_speed"
from = 5
to = 18
count = 3
"""
_TWO = """\
[body.a]
mass = "1 kg"
[body.b]
mass = "2 kg"
v0 = "0.1 m/s"
[spring.a]
between = ["ground", "a"]
stiffness = "100 N/m"
damping = "1 N s/m"
[spring.b]
between = ["a", "b"]
stiffness = "200 N/m"
damping = "1 N s/m"
{more}
[start]
x0 = "1 mm"
v0 = 0
[run]
duration = "10 s"
[derived.mean_square]
quantity = "mean"
expression = "a_x^2"
unit = "m^2"
[[axis]]
name = "x0"
from = -0.01
to = 0.01
count = 3
[[axis]]
name = "v0"
from = -0.1
to = 0.1
count = 3
"""
_MOTORS = {
    "pi": """\
law = "pi"
reference = 12
proportional = 0.5
integral = 1
torque_limit = 3
start_integral = 0.1""",
    "kloss": """\
law = "kloss"
breakdown_torque = 2
breakdown_slip = 0.2
synchronous_speed = 15""",
    "table": """\
law = "table"
speed = [0, 5, 10, 20]
torque = [2, 1.8, 1, -0.5]""",
    "linear": """\
law = "linear"
stall_torque = 2
no_load_speed = 14
ramp_from = 3
ramp_time = 5""",
    "dc": """\
law = "dc"
voltage = 8
torque_constant = 0.5
resistance = 5
inductance = 0.1
start_current = 1""",
}
_OTHERS = {
    "base": """\
[drive.g]
law = "base"
position = "a*cos(phase) + b*t*exp(-t)"
a = "1 mm"
b = 0.001
frequency = 9""",
    "force": """\
[drive.f]
law = "expression"
body = "a"
force = "f*cos(phase) - k3*a.x^3"
f = 2
k3 = 100
frequency = 8""",
    "spring": """\
[spring.c]
law = "expression"
between = ["a", "b"]
force = "k*x + c*v*abs(v)"
k = 10
c = 1""",
    "load": """\
[friction.r]
law = "coulomb_load"
between = ["ground", "a"]
load = "10 + 2*abs(b.x)"
kinetic_coefficient = 0.1
static_coefficient = 0.2
velocity = 0.1""",
    "controller": """\
[drive.c]
law = "controller"
body = "b"
frequency = 6
amplitude = "5 mm"
proportional = 50
integral = 10
derivative = 1
sample_time = 0.01""",
    "impulse": """\
[drive.i]
law = "impulse"
body = "b"
impulse = 1
time = 2""",
    "stop": """\
[contact.s]
law = "hunt_crossley"
between = ["a", "b"]
upper = "5 mm"
stiffness = 1e6
damping = 1e5
[drive.f]
law = "force"
body = "a"
frequency = 10
amplitude = 2""",
    "memory": """\
[friction.r]
law = "lugre"
between = ["ground", "b"]
force = 1
static_force = 1.5
stribeck_velocity = 0.01
stiffness = 1e4
bristle_damping = 10
velocity = 0.02""",
}


def cases() -> dict[str, str]:
    """Return the text of each case by its name."""
    found = {f"motor_{name}": _BODY.format(drive="harmonic", motor=text) for name, text in _MOTORS.items()}
    unbalance = _MOTORS["dc"] + '\n[derived.heat]\nquantity = "power"\nof = "damping"'
    found["motor_rotor"] = _BODY.format(drive="unbalance", motor=unbalance).replace(
        'amplitude = "20 mm"', 'moment = "0.002 kg m"'
    )
    return found | {f"two_{name}": _TWO.format(more=text) for name, text in _OTHERS.items()}
