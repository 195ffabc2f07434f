# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects named in part: a pair of which the records show only a combination is reported as a pair."""

from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.decision.stages.in_part import hardly_apart, imitated
from separatrix.discovery.fitting.machine import Free

PATHS = ("body.mass", "effect.offset_force.force", "effect.sensor_bias.bias", "effect.coulomb.coefficient")


def fitted(between: float) -> SimpleNamespace:
    """An offset, a bias with that correlation to it, and dry friction that is known by itself."""
    size = np.array([0.1, 2.0, 3e-3, 0.5])
    correlation = np.eye(4)
    correlation[1, 2] = correlation[2, 1] = between
    # parameters of the case are no effects, however correlated
    correlation[0, 3] = correlation[3, 0] = 0.999
    return SimpleNamespace(
        names=("coulomb", "offset_force", "sensor_bias"), added=(1, 2, 3),
        problem=SimpleNamespace(free=[Free(path, 1.0) for path in PATHS]),
        covariance=correlation * np.outer(size, size),
    )  # fmt: skip


@pytest.mark.parametrize("between", [0.995, -0.995])
def test_effects_that_cancel_are_a_pair(between):
    reasons = hardly_apart(fitted(between))
    assert len(reasons) == 1
    assert reasons[0].startswith("offset_force and sensor_bias are known as a pair only")
    assert f"{between:.4f}" in reasons[0]


def test_effects_that_are_known_apart_are_not():
    assert hardly_apart(fitted(0.9)) == []


def beside_a_bias(between: float, *names: str) -> SimpleNamespace:
    """The same where the bias is one of the case, and all of `names` are added."""
    found = fitted(between)
    found.names = names
    found.added = tuple(i for i, path in enumerate(PATHS) if path.split(".")[1] in names)
    return found


@pytest.mark.parametrize("between", [0.995, -0.995])
def test_an_effect_that_one_of_the_case_cancels_is_not_named(between):
    """An offset of 20 N m was named beside a bias of the encoder of five times the amplitude."""
    found = imitated(beside_a_bias(between, "coulomb", "offset_force"))
    assert list(found) == ["offset_force"]
    assert "that of effect.sensor_bias.bias of the case have a correlation of 0.9950" in found["offset_force"]
    assert imitated(beside_a_bias(0.9, "coulomb", "offset_force")) == {}
    # both added are a pair, which hardly_apart reports
    assert imitated(fitted(between)) == {}


def test_an_effect_with_a_number_that_is_known_by_itself_is_named():
    found = beside_a_bias(0.995, "offset_force")
    found.problem.free[3] = Free("effect.offset_force.slope", 1.0)
    found.added = (1, 3)
    assert imitated(found) == {}
