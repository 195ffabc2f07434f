# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of machines with a motor: torque over speed, basins over the speed of the crank."""

from pathlib import Path

import numpy as np
import pytest
import separatrix as sx
from separatrix.figures import motor

pytestmark = pytest.mark.usefixtures("library")

IMPACT = Path(__file__).resolve().parents[3] / "examples" / "motor_impact.toml"
# The yoke of docs/howto/through-resonance.md.
YOKE = """\
body = { mass = 1, gravity = 1 }
restoring = { law = "linear", stiffness = 88.82643960980423 }
friction = { law = "viscous", damping = 0.5 }
drive = { law = "harmonic", amplitude = 0.02 }
start = { x0 = 0.02, v0 = 0 }
run = { duration = 40, window = 10 }
[motor]
law = "dc"
voltage = 8
torque_constant = 0.5
resistance = 5
inertia = 0.05
bearing_damping = 0.002
crank_speed = 15
"""
MOTORS = {
    "linear": {"stall_torque": 0.9, "no_load_speed": 16.0},
    "kloss": {"breakdown_torque": 0.4, "breakdown_slip": 0.2, "synchronous_speed": 16.0},
    "dc": {"voltage": 8.0, "torque_constant": 0.5, "resistance": 5.0},
}


@pytest.mark.parametrize("law", MOTORS)
def test_the_torque_of_a_motor_is_that_of_the_motion(law: str) -> None:
    """At every sample of a run-up, by the formula beside the simulator."""
    values = {f"motor.{name}": value for name, value in MOTORS[law].items()}
    case = sx.load(IMPACT).with_({"motor": {"law": law, "inertia": 0.05} | MOTORS[law]})
    assert all(case.parameters[path].value == value for path, value in values.items())
    motion = sx.trajectory(case, duration=3.0)
    found = motor.torque_of(case.resolved["motor"], motion["crank_speed"].values)
    np.testing.assert_allclose(found, motion["motor_torque"].values, rtol=1e-10, atol=1e-12)


def test_a_speed_control_has_no_line() -> None:
    """Its torque is no function of the speed."""
    assert motor.torque_of({"law": "pi"}, np.ones(3)) is None


@pytest.mark.long
def test_torque_over_speed_has_orbits_and_lines(tmp_path: Path) -> None:
    """The orbit of a voltage lies on the line of that voltage; its torque is the mean of its motion."""
    (tmp_path / "yoke.toml").write_text(YOKE)
    case = sx.load(tmp_path / "yoke.toml")
    branches = sx.branches(case, "motor.voltage", 7.9, 8.1)
    figure = branches.separatrix.plot("torque")
    (ax,) = figure.axes
    assert ax.get_xlabel() == "mean speed of the crank (rad/s)"
    motion = sx.trajectory(case, samples=200)
    last = motion["time"].values > 30
    speed, torque = (float(motion[name].values[last].mean()) for name in ("crank_speed", "motor_torque"))
    shown = np.concatenate([path.vertices for one in ax.collections for path in one.get_paths()])
    near = shown[np.argmin(np.abs(shown[:, 0] - speed))]
    np.testing.assert_allclose(near, (speed, torque), rtol=2e-3)
    lines = [line for line in ax.lines if len(line.get_xdata()) == 400]
    assert len(lines) == 6
    of_speed = [np.interp(speed, *line.get_data()) for line in lines]
    assert min(of_speed) < torque < max(of_speed)
    assert "8.1 V" in [text.get_text() for text in ax.texts]


def test_basins_over_the_speed_mark_the_cycles() -> None:
    """An arrow at the mean speed of every cycle in the picture, with its label."""
    case = sx.load(IMPACT).with_({"run.duration": 8.0, "run.window": 2.0, "attractors.sample": 8})
    result = sx.basin(case, {"motor.crank_speed": (5, 18, 5), "x0": (-0.1, 0.1, 4)})
    (ax,) = result.separatrix.plot("attractor").axes
    speeds = result.separatrix.attractors["crank_speed"].dropna()
    marked = {text.get_text(): text.xy[0] for text in ax.texts}
    assert {str(label) for label in speeds.index} == set(marked)
    for label, speed in speeds.items():
        assert marked[str(label)] == pytest.approx(speed)
