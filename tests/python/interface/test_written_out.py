# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A pair that the library writes out body by body and joint by joint moves like the pair."""

from pathlib import Path

import numpy as np
import pytest
from separatrix.errors import CaseError
from separatrix.library import Model
from separatrix.simulate import trajectory

PAIR = """
[body]
law = "{law}"
mass = 1.0
driven_mass = 0.5
friction = 0.3
driver_x0 = 0.02
driver_v0 = 0.1
{hammer}
[restoring]
law = "linear"
stiffness = 40.0
free_length = 0.01
[friction]
law = "viscous"
damping = 0.2
[contact]
law = "{stop}"
{contact}
upper = 0.05
lower = -0.04
[drive]
{drive}
[start]
v0 = 0.4
[run]
duration = 8
"""
FORCE = 'law = "force"\nmean = 0.1\namplitude = 2.0\nfrequency = 5.0'
SINE = 'law = "sine"\namplitude = 0.06\nfrequency = 6.0'
PID = 'law = "pid_sine"\namplitude = 0.06\nfrequency = 6.0\nproportional = 50\nintegral = 20\nderivative = 3'
RIGID, SOFT = "restitution = 0.7", "stiffness = 3e4\nrestitution = 0.7"
HAMMER = "impulse = 0.2\nimpulse_time = 1.5"


def model_of(law: str, drive: str, stop: str = "newton", contact: str = RIGID, hammer: str = "") -> Model:
    return Model.from_text(PAIR.format(law=law, drive=drive, stop=stop, contact=contact, hammer=hammer))


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize("model", [
    ("friction_pair", FORCE),
    ("backlash_pair", FORCE, "newton", RIGID, HAMMER),
    ("backlash_pair", SINE),
    ("friction_pair", SINE, "kelvin_voigt_restitution", SOFT),
    ("backlash_pair", PID),
    pytest.param(("backlash_pair", FORCE, "hunt_crossley_exact", SOFT), marks=pytest.mark.long),
], ids=["force", "hammer", "shaken", "soft", "controller", "soft-carried"])  # fmt: skip
def test_a_pair_that_is_written_out_moves_like_the_pair(model: tuple[str, ...]) -> None:
    pair = model_of(*model)
    first, second = (trajectory(one, (0.0, 0.4, 0.0)) for one in (pair, pair.written_out()))
    assert np.ptp(first.samples["x"]) > 0.05
    np.testing.assert_allclose(second.samples["x"], first.samples["x"], atol=1e-9)


@pytest.mark.usefixtures("library")
def test_the_parts_have_the_numbers_of_the_pair() -> None:
    written = model_of("backlash_pair", FORCE, hammer=HAMMER).written_out()
    assert written.coordinates == ("driving", "driven")
    values = {path: one.value for path, one in written.parameters.items()}
    wanted = {
        "body.driving.mass": 1.0,
        "body.driving.x0": 0.02,
        "body.driven.mass": 0.5,
        "spring.frame.stiffness": 40.0,
        "spring.frame.free_length": 0.01,
        "spring.frame.damping": 0.2,
        "friction.interface.force": 0.3,
        "contact.stop.restitution": 0.7,
        "contact.stop.upper": 0.05,
        "drive.force.mean": 0.1,
        "drive.hammer.impulse": 0.2,
        "drive.hammer.time": 1.5,
    }
    assert {path: values[path] for path in wanted} == wanted


@pytest.mark.usefixtures("library")
def test_what_no_table_has_is_refused(source_dir: Path) -> None:
    with pytest.raises(
        CaseError, match=r"drive\.law: found .velocity., allowed where a pair is written out"
    ) as refused:
        Model.read(source_dir / "examples" / "pair_platform.toml").written_out()
    assert refused.value.code == 65
    with pytest.raises(
        CaseError, match=r"body\.law: found .point_mass., allowed friction_pair, backlash_pair"
    ):
        Model.read(source_dir / "examples" / "sweep_coulomb.toml").written_out()
