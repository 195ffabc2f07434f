# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Controllers of structures and impulses on them, beside those that pairs have."""

from pathlib import Path

import numpy as np
import pytest
from program import run, succeed
from separatrix.open import open_result

RUN = """
run = { duration = 20, window = 5, average = "window" }
start = { x0 = 0.02, v0 = 0.4 }
"""
BODIES = """
[body.frame]
mass = 1
x0 = 0.05
v0 = 0.1
[body.ball]
mass = 0.5
[watch]
body = "ball"
[friction.interface]
between = ["frame", "ball"]
force = 0.4
"""
SPRING = """
[spring.foot]
between = ["frame"]
stiffness = 2
damping = 0.1
"""
SERVO = """
[drive.servo]
law = "controller"
body = "frame"
sine = [0.3]
frequency = 2
proportional = 9
derivative = 2
"""
STOPS = """
[contact.stops]
between = ["frame", "ball"]
law = "newton"
restitution = 0.4
upper = 0.1
lower = -0.1
"""
FOOT = """
[body.foot]
mass = 1
[drive.foot]
law = "motion"
body = "foot"
sine = [1]
frequency = 2
"""
KNOCK = """
[drive.knock]
law = "impulse"
body = "ball"
impulse = -0.3
time = 3.7
"""
GAINS = "amplitude = 0.3, frequency = 2, proportional = 9, derivative = 2"
PAIR = 'law = "{}", mass = 1, driven_mass = 0.5, friction = 0.4, driver_x0 = 0.05, driver_v0 = 0.1'
SPRUNG = 'restoring = { law = "linear", stiffness = 2 }\nfriction = { law = "viscous", damping = 0.1 }\n'
RIGID = 'contact = { law = "newton", restitution = 0.4, upper = 0.1, lower = -0.1 }\n'

# name: the case of the pair, the parts of the structure
CASES = {
    "continuous": (
        SPRUNG
        + f"body = {{ {PAIR.format('friction_pair')} }}\n"
        + f'drive = {{ law = "pid_sine", {GAINS}, integral = 3 }}\n',
        SPRING + SERVO + "integral = 3\n",
    ),
    "sampled": (
        f"body = {{ {PAIR.format('friction_pair')} }}\n"
        f'drive = {{ law = "pid_sine", {GAINS}, integral = 3, sample_time = 0.05 }}\n',
        SERVO + "integral = 3\nsample_time = 0.05\n",
    ),
    "impulse": (
        RIGID
        + SPRUNG
        + f"body = {{ {PAIR.format('backlash_pair')}, impulse = -0.3, impulse_time = 3.7 }}\n"
        + 'drive = { law = "force", amplitude = 1, frequency = 2 }\n',
        STOPS
        + SPRING
        + KNOCK
        + '[drive.shaker]\nlaw = "force"\nbody = "frame"\namplitude = 1\nfrequency = 2\n',
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_both_forms_move_the_same(separatrix: Path, tmp_path: Path, name):
    pair, parts = CASES[name]
    runs = []
    for form, text in (("pair", RUN + pair), ("structure", RUN + BODIES + parts)):
        (tmp_path / f"{form}.toml").write_text(text)
        succeed(separatrix, "trajectory", f"{form}.toml", "-o", f"{form}.h5", folder=tmp_path)
        succeed(separatrix, "verify", f"{form}.h5", folder=tmp_path)
        with open_result(tmp_path / f"{form}.h5") as result:
            runs.append(result.load())
    pair, structure = runs
    for own, other in (("x", "x"), ("v", "v"), ("driver_x", "frame_x"), ("driver_v", "frame_v")):
        assert structure[other].values == pytest.approx(pair[own].values, abs=1e-9), own
    for column in ("energy", "kinetic_energy", "friction_loss", "damping_loss", "contact_loss", "drive_work"):
        assert structure[column].values == pytest.approx(pair[column].values, abs=1e-9), column


def test_labels_of_a_controller_with_an_integral(separatrix: Path, tmp_path: Path):
    """The integral is a coordinate of the section, and no rate of it: no multiplier is one."""
    axes = """
axis = [{ name = "x0", from = -0.5, to = 0.5, count = 5 }, { name = "v0", from = -1.0, to = 1.0, count = 5 }]
"""
    pair, parts = CASES["continuous"]
    duration = RUN.splitlines()[1].replace("20", "200")
    maps = []
    for form, text in (("pair", pair), ("structure", BODIES + parts)):
        (tmp_path / f"{form}.toml").write_text(duration + axes + text)
        succeed(separatrix, "basin", f"{form}.toml", "-o", f"{form}.h5", folder=tmp_path)
        with open_result(tmp_path / f"{form}.h5") as result:
            maps.append(result.load())
    pair, structure = maps
    assert len(structure["catalogue_count"]) == len(pair["catalogue_count"]) == 1
    for column in ("attractor", "period", "regime", "reason"):
        assert np.array_equal(pair[column], structure[column]), column
    largest = structure["catalogue_multiplier"].values
    assert largest == pytest.approx(pair["catalogue_multiplier"].values, abs=1e-6) and largest < 0.9


def test_a_release_by_a_sample_is_an_event(separatrix: Path, tmp_path: Path):
    """A block at rest slides from the sample on at which the force that is held exceeds its friction."""
    block = "[body.block]\nmass = 1\n[friction.ground]\nbetween = ['block']\nforce = 2.5\n"
    servo = SERVO.replace("frame", "block") + "sample_time = 0.05\n"
    (tmp_path / "case.toml").write_text("run = { duration = 8 }\n" + block + servo)
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", folder=tmp_path)
    with open_result(tmp_path / "out.h5") as result:
        names = result["event_kind"].attrs["flag_meanings"].split()
        kinds = [names[number - 1] for number in result["event_kind"].values]
        times = result["event_time"].values
    # 2.7 sin 2t + 1.2 cos 2t: above 2.5 from t = 0.2983 on
    assert kinds[0] == "release" and times[0] == pytest.approx(0.3)
    assert set(kinds) == {"release", "stick"}
    assert all(one != other for one, other in zip(kinds[:-1], kinds[1:], strict=True))


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (SERVO + SERVO.replace("servo", "other"), "found a controller beside another"),
        (SERVO + FOOT, "beside a body whose motion"),
        (KNOCK.replace("ball", "foot") + FOOT, "'drive.knock.body': found a body whose motion is given"),
    ],
)
def test_what_is_refused(separatrix: Path, tmp_path: Path, parts, message):
    (tmp_path / "case.toml").write_text(RUN + BODIES + parts)
    ended = run(separatrix, "trajectory", "case.toml", folder=tmp_path)
    assert ended.code == 65 and message in ended.err


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (SERVO + "integral = 3\n", "a controller adds up"),
        (SERVO + KNOCK, "depend on the time since the start"),
    ],
)
def test_variations_that_are_not_known(separatrix: Path, tmp_path: Path, parts, message):
    (tmp_path / "case.toml").write_text(RUN + BODIES + parts)
    ended = run(separatrix, "stability", "case.toml", folder=tmp_path)
    assert ended.code == 65 and message in ended.err
