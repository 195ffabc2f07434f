# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of another machine, in other units or of another drive are distinguished from missing physics."""

from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.decision.other_machine import (
    other_drive,
    other_machine,
    other_phase,
    strongest_line,
)
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.options import Options

CASE = {"body.mass": (95.0, "kg"), "restoring.stiffness": (88.8, "N/m"), "contact.upper": (1.1, "m")}


def data(frequency: float, stated: float) -> SimpleNamespace:
    """One record of 5 s that oscillates at one frequency, with another stated for its drive."""
    t = np.arange(2500) / 500
    x = 0.3 * np.cos(frequency * t) + 0.02 * t
    record = SimpleNamespace(name="first", x=x, interval=1 / 500, pieces=[(0, t.size)])
    prepared = [SimpleNamespace(record=record, frequency=stated)]
    return SimpleNamespace(prepared=prepared, stages=[SimpleNamespace(record=np.zeros(20, int))], last=0)


def base(chi2: float = 1.0, **found: float) -> SimpleNamespace:
    """A base machine that was fitted to these values, by the last word of their paths."""
    paths = {path.split(".")[1]: path for path in CASE} | {"drive_scale": "nuisance:drive_scale"}
    fit = SimpleNamespace(
        condensed=lambda rows: (0.0, 0.0),
        values=np.array(list(found.values())),
        chi2=np.full(20, chi2 * 123),
        counts=np.full(20, 125),
        good=np.ones(20, bool),
        unknowns=2,
    )
    parameters = {path: SimpleNamespace(value=value, unit=unit) for path, (value, unit) in CASE.items()}
    free = [Free(paths[name], value) for name, value in found.items()]
    return SimpleNamespace(
        model=SimpleNamespace(parameters=parameters), problem=SimpleNamespace(free=free), fit=fit
    )


def test_a_machine_near_that_of_the_case_is_not_strange():
    near = base(mass=80.0, stiffness=120.0, upper=1.2, drive_scale=1.3)
    assert other_machine(data(9.0, 9.0), near, Options()) == []


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ({"mass": 0.095}, "body.mass 0.095 kg (case: 95)"),
        ({"stiffness": 8.3}, "restoring.stiffness 8.3 N/m (case: 88.8)"),
        ({"upper": -0.305}, "contact.upper -0.305 m (case: 1.1)"),
        ({"drive_scale": 5.0}, "scale of the drive 5"),
    ],
)
def test_parameters_far_from_the_case_are_reported(found, expected):
    (note,) = other_machine(data(9.0, 9.0), base(**found), Options())
    assert expected in note


def test_the_strongest_line_is_where_the_motion_is():
    line, apart, share = strongest_line(data(8.96, 8.96).prepared[0])
    assert share > 0.9
    assert line == pytest.approx(8.96, rel=0.01)
    assert apart == pytest.approx(2 * np.pi / 5, rel=1e-3)


def test_a_motion_without_a_clear_line_does_not_contradict_the_drive():
    chaotic = data(8.96, 11.3)
    chaotic.prepared[0].record.x = np.random.default_rng(2).standard_normal(2500)
    assert other_drive(chaotic, base(1e4)) == []


@pytest.mark.parametrize(
    ("frequency", "chi2", "notes"), [(8.96, 1e4, 1), (8.96, 1.2, 0), (11.3, 1e4, 0), (5.65, 1e4, 0)]
)
def test_another_frequency_than_the_drive_is_reported_where_the_machine_misses_it(frequency, chi2, notes):
    """Harmonics and subharmonics belong to the drive."""
    found = other_drive(data(frequency, 11.3), base(chi2))
    assert len(found) == notes
    assert all("is drive_ratio right?" in note for note in found)


def test_another_phase_than_that_of_the_header_is_reported():
    """One that was not stated was searched for, and whole turns are none."""
    found = {"a": 2.3, "b": -2.3 + 2 * np.pi, "c": 0.05, "d": 2 * np.pi, "e": 2.3, "f": 2.3}
    prepared = [
        SimpleNamespace(record=SimpleNamespace(name=name), phase_known=name == "e", phase_stated=name != "f")
        for name in found
    ]
    free = [Free("nuisance:phase", 0.0, record=index) for index in range(len(found))]
    fitted = SimpleNamespace(
        problem=SimpleNamespace(free=free), fit=SimpleNamespace(values=np.array(list(found.values())))
    )
    first, second = other_phase(SimpleNamespace(prepared=prepared), fitted)
    assert first.startswith("a: the drive is 2.3 rad ahead of the phase of the header")
    assert second.startswith("b: the drive is 2.3 rad behind the phase of the header")
