# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects named in part: a pair of which the records show only a combination is reported as a pair."""

from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.decision.stages.in_part import hardly_apart
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
