# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies with an inertia turn: the same motion as masses of the same numbers, in units of rotation."""

import numpy as np
import pytest
import separatrix as sx

CASE = """
[body.rotor]
inertia = "200 kg cm^2"
[body.load]
inertia = "0.05 kg m^2"
load = "30 mN m"
x0 = "1 deg"
v0 = "3 rpm"
[spring.shaft]
between = ["rotor"]
stiffness = "0.5 N m/deg"
damping = "0.02 N m s/rad"
free_length = "2 deg"
[contact.play]
law = "kelvin_voigt"
between = ["rotor", "load"]
stiffness = "500 N m/rad"
damping = "0.1 N m s/rad"
upper = "35 mrad"
lower = "-2 deg"
[friction.brake]
between = ["load"]
force = "0.1 N m"
static_force = "120 mN m"
velocity = "90 deg/s"
[drive.motor]
law = "force"
body = "rotor"
amplitude = "1.5 N m"
frequency = "600 rpm"
[spring.drag]
law = "expression"
between = ["load"]
force = "-d*v"
d = "1 mN m s/rad"
[start]
x0 = "2 deg"
v0 = "10 rpm"
[run]
duration = 1
average = "window"
"""
TURN = np.pi / 180
MASSES = {
    "body.rotor": {"mass": 0.02},
    "body.load": {"mass": 0.05, "load": 0.03, "x0": TURN, "v0": 6 * np.pi / 60},
    "spring.shaft": {
        "between": ["rotor"], "stiffness": 0.5 * 180 / np.pi, "damping": 0.02, "free_length": 2 * TURN,
    },
    "contact.play": {
        "law": "kelvin_voigt", "between": ["rotor", "load"], "stiffness": 500.0, "damping": 0.1,
        "upper": 0.035, "lower": -2 * TURN,
    },
    "friction.brake": {"between": ["load"], "force": 0.1, "static_force": 0.12, "velocity": 90 * TURN},
    "drive.motor": {"law": "force", "body": "rotor", "amplitude": 1.5, "frequency": 20 * np.pi},
    "spring.drag": {"law": "expression", "between": ["load"], "force": "-1e-3*v"},
    "start": {"x0": 2 * TURN, "v0": 20 * np.pi / 60},
}  # fmt: skip


@pytest.fixture
def case(tmp_path):
    """A rotor with play, in units of rotation."""
    (tmp_path / "case.toml").write_text(CASE)
    return sx.load(tmp_path / "case.toml")


def test_a_body_with_an_inertia_moves_as_a_mass(case):
    """All numbers in SI units are the same, and so is the motion; columns are in rad and rad/s."""
    turning = sx.trajectory(case)
    straight = sx.trajectory(case.with_(MASSES))
    np.testing.assert_allclose(turning.x, straight.x, rtol=0, atol=1e-9)
    units = {name: turning[name].attrs["units"] for name in turning if name.endswith(("_x", "_v", "_before"))}
    assert {unit for name, unit in units.items() if name.endswith("_x")} == {"rad"}
    assert {unit for name, unit in units.items() if not name.endswith("_x")} == {"rad/s"}
    assert turning.x.attrs["units"] == "rad"
    assert straight.x.attrs["units"] == "m"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"spring.shaft.stiffness": "40 N/m"},
            r"spring.shaft.stiffness.*N m/rad, mN m/rad, kN m/rad, N m/deg",
        ),
        ({"body.load.inertia": "2 kg"}, "body.load.inertia.*kg m"),
        ({"body.load.mass": 1}, "body.load.inertia.*found beside a mass"),
        ({"body.load": {"x0": 0}}, "body.load.mass.*missing, allowed a mass, or an inertia"),
        ({"body.load": {"mass": 1}}, "contact.play.between.*an inertia and one with a mass"),
        ({"drive.motor.amplitude": "2 N"}, "drive.motor.amplitude.*N m"),
        ({"spring.drag.d": "1 N s/m"}, r"spring.drag.force.*kg s.*allowed in N m"),
        ({"body.load.v0": "3 m/s"}, "body.load.v0.*rad/s.*rpm"),
    ],
)
def test_units_of_a_line_are_refused(case, changes, message):
    """Each with what is allowed."""
    with pytest.raises(sx.CaseError, match=message):
        sx.trajectory(case.with_(changes))


def test_an_inertia_is_a_parameter(case, tmp_path):
    """Of sweeps and sets; the mass, which the body lacks, is none. The resolved case reads back."""
    heavier = case.with_({"body.load.inertia": 0.1})
    assert float(sx.trajectory(heavier).x[-1]) != float(sx.trajectory(case).x[-1])
    axes = [
        {"name": "body.load.mass", "from": 1, "to": 2, "count": 2},
        {"name": "x0", "from": 0, "to": 1, "count": 2},
    ]
    with pytest.raises(sx.CaseError, match=r"body\.load\.inertia"):
        sx.basin(case.with_({"axis": axes}), progress=False)
    assert case.resolved["body"]["load"]["inertia"] == 0.05
    assert "mass" not in case.resolved["body"]["load"]
    (tmp_path / "again.toml").write_text(sx.trajectory(case).attrs["resolved_case"])
    assert sx.load(tmp_path / "again.toml").resolved == case.resolved


def test_a_parameter_may_be_called_load(case):
    """A name that is a key in another table is none in this one."""
    motion = sx.trajectory(
        case.with_(
            {"spring.drag": {"law": "expression", "between": ["load"], "force": "-load", "load": "1 mN m"}}
        )
    )
    assert motion.attrs["complete"] == 1
