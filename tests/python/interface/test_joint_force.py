# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The force of a joint, as the simulator has it."""

import numpy as np
import pytest
from separatrix.errors import CaseError
from separatrix.library import Model

CASE = """
body.a.mass = 1.3
body.b.mass = 0.7
run.duration = 1
[spring.frame]
between = ["a"]
stiffness = 41
damping = 0.5
free_length = 0.02
[spring.coupling]
between = ["a", "b"]
law = "polynomial"
stiffness = 30
quadratic = 4
cubic = 900
damping = 0.2
[contact.buffer]
between = ["b"]
law = "kelvin_voigt"
stiffness = 900
damping = 2
upper = 0.08
lower = -0.05
[contact.stop]
between = ["a"]
law = "newton"
restitution = 0.7
upper = 0.3
[friction.rail]
between = ["a"]
force = 0.2
"""
S, U = (one.ravel() for one in np.meshgrid(np.linspace(-0.12, 0.12, 25), np.linspace(-3, 3, 7)))

pytestmark = pytest.mark.usefixtures("library")


@pytest.fixture
def model() -> Model:
    return Model.from_text(CASE)


def test_a_spring_pulls_its_end_back_by_its_law(model: Model) -> None:
    force, by_extension, by_speed = model.joint_force("spring.frame", [], np.zeros(0), S, U)
    np.testing.assert_allclose(force, 41 * (S - 0.02) + 0.5 * U, atol=1e-13)
    np.testing.assert_array_equal((by_extension, by_speed), np.broadcast_to([[41.0], [0.5]], (2, S.size)))
    force, by_extension, by_speed = model.joint_force("spring.coupling", [], np.zeros(0), S, U)
    np.testing.assert_allclose(force, 30 * S + 4 * S**2 + 900 * S**3 + 0.2 * U, atol=1e-13)
    np.testing.assert_allclose(by_extension, 30 + 8 * S + 2700 * S**2, rtol=1e-13)


def test_a_soft_contact_pushes_beyond_its_stops_and_never_pulls(model: Model) -> None:
    force, by_extension, by_speed = model.joint_force("contact.buffer", [], np.zeros(0), S, U)
    push = np.maximum(0, 900 * (S - 0.08) + 2 * U) * (S > 0.08)
    push -= np.maximum(0, 900 * (-0.05 - S) - 2 * U) * (S < -0.05)
    np.testing.assert_allclose(force, push, atol=1e-12)
    touches = push != 0
    assert 10 < touches.sum() < S.size
    np.testing.assert_allclose(by_extension, 900.0 * touches)
    np.testing.assert_allclose(by_speed, 2.0 * touches)


def test_other_values_are_those_of_another_case(model: Model) -> None:
    path = "spring.coupling.cubic"
    other = Model.from_text(CASE.replace("cubic = 900", "cubic = 700"))
    for one, two in zip(
        model.joint_force("spring.coupling", [path], np.array([700.0]), S, U),
        other.joint_force("spring.coupling", [], np.zeros(0), S, U),
        strict=True,
    ):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize(("joint", "why"), [
    ("spring.none", "found spring.none, which the machine does not have"),
    ("contact.stop", "found a rigid contact"),
    ("friction.rail", "allowed a spring or a contact"),
])  # fmt: skip
def test_a_joint_without_a_force_of_its_own_is_refused(model: Model, joint: str, why: str) -> None:
    with pytest.raises(CaseError, match=why):
        model.joint_force(joint, [], np.zeros(0), S, U)
