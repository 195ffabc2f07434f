# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The given motion of a part by an expression."""

import numpy as np
import pytest
import separatrix as sx

SERIES = {
    "law": "motion",
    "body": "shaker",
    "frequency": 7.0,
    "mean": 0.01,
    "cosine": [0.02],
    "sine": [0.0, 0.005],
}
OWN = {
    "law": "motion", "body": "shaker", "frequency": 7.0, "position": "c + a*cos(phase) + b*sin(14*t)",
    "a": "2 cm", "b": "5 mm", "c": "1 cm",
}  # fmt: skip
CASE = {
    "body": {"mass": {"mass": 1}, "shaker": {"mass": 1}},
    "spring": {
        "coupling": {"between": ["shaker", "mass"], "stiffness": 30, "damping": 0.3},
        "hard": {"law": "expression", "between": ["shaker", "mass"], "force": "-4e4*x^3 - 0.1*shaker.v"},
    },
    "friction": {"guide": {"between": ["shaker", "mass"], "force": 0.2}},
    "contact": {
        "stop": {"between": ["shaker", "mass"], "law": "newton", "restitution": 0.7, "upper": "25 mm"}
    },
    "drive": {"shaker": OWN},
    "run": {"duration": 3, "average": "window"},
}


@pytest.fixture
def case():
    """A mass in a frame that moves."""
    return sx.Case.from_dict(CASE)


def test_an_expression_is_its_series(case):
    """Sines and cosines give the machine of the series, with events at the same times."""
    own, series = sx.trajectory(case), sx.trajectory(case.with_({"drive.shaker": SERIES}))
    assert own.sizes["event"] == series.sizes["event"] > 10
    np.testing.assert_allclose(own.event_time, series.event_time, rtol=0, atol=1e-11)
    np.testing.assert_allclose(own.x, series.x, rtol=0, atol=1e-12)


def test_its_parameters_can_be_changed(case):
    """By their names, as in any expression."""
    larger = sx.trajectory(case.with_({"drive.shaker.a": "3 cm"}))
    series = sx.trajectory(case.with_({"drive.shaker": SERIES | {"cosine": [0.03]}}))
    np.testing.assert_allclose(larger.x, series.x, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"position": "a*sign(sin(phase))"},
            "position.: found a motion that 96 harmonics do not describe.*jump or a corner",
        ),
        ({"position": "a*abs(sin(phase))"}, "position.: found a motion that 96 harmonics do not describe"),
        ({"position": "a*phase"}, "position.: found a motion that 96 harmonics do not describe"),
        ({"position": "a*tanh(t)"}, "position.: found a motion that does not repeat.*law = .base."),
        ({"position": "a*log(sin(phase))"}, "position.: found a motion that is not defined at the phase"),
        ({"position": "a*mass.x"}, "position.: column 3: found name 'mass.x'"),
        ({"position": "a/t"}, "position.: found a quantity in m s.*allowed in m"),
        ({"amplitude": 1.0}, "amplitude.*found beside a position"),
        ({"frequency": 0}, "frequency.: missing"),
    ],
)
def test_other_motions_are_refused(case, changes, message):
    """Each with the reason."""
    kept = {key: value for key, value in OWN.items() if key not in ("b", "c") or "position" not in changes}
    with pytest.raises(sx.CaseError, match=message):
        sx.trajectory(case.with_({"drive.shaker": kept | changes}))
