# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A machine with a motor by the library: segments, motions and labels are those of the program."""

from pathlib import Path

import numpy as np
import pytest
import separatrix as sx
from program import CASE
from separatrix.library import CaseError, Model, Segments
from separatrix.simulate import Catalogue, section_points, trajectory

pytestmark = pytest.mark.usefixtures("library")

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
IMPACT = EXAMPLES / "motor_impact.toml"
SHORT = {"run.duration": 6.0, "run.window": 2.0, "attractors.sample": 6}
# x [m], crank angle [rad], v [m/s], crank speed [rad/s], current [A]
START = (0.05, 0.1, 0.0, 12.0, 0.0)
ACTIVE = ["motor.inertia", "motor.resistance", "restoring.stiffness", "friction.damping"]


def fly(model: Model, times: np.ndarray, start=START, active=(), values=(), **options) -> Segments:
    """One segment."""
    first, starts = np.array([0, times.size]), np.array([start])
    return model.segments(list(active), np.array(values), starts, first, times, **options)


def flown(case: sx.Case, start: tuple = START) -> object:
    """The motion of the program from a start."""
    fast = case.with_({"motor.crank_speed": start[3]})
    return sx.trajectory(fast, start[0], start[2], start[1], duration=4.0, samples=50)


@pytest.mark.parametrize("name", ["motor_impact", "motor_lever", "motor_unbalance"])
def test_segments_are_the_motion_of_the_program(name: str) -> None:
    """Position, crank and current at the samples, through impacts and turning points."""
    case = sx.load(EXAMPLES / f"{name}.toml")
    motion = flown(case)
    found = fly(case.model, motion.time.values, derivatives=False, tolerance=1e-13)
    assert found.reason[0] == 0
    for column, name_of in enumerate(("x", "crank_angle", "v", "crank_speed")):
        np.testing.assert_allclose(found.motion[:, column], motion[name_of], rtol=0, atol=1e-8)
    if "current" in motion:
        np.testing.assert_allclose(found.motion[:, 4], motion["current"], rtol=0, atol=1e-9)
    hits = motion["event_time"].values[np.isin(motion["event_kind"].values, (1, 2))]
    np.testing.assert_allclose(found.impact.time, hits, rtol=0, atol=1e-9)


def test_impacts_are_met() -> None:
    """The comparison above is of a motion that hits the stop."""
    assert fly(Model.read(IMPACT), np.linspace(0, 4, 50), (0.1, 0.1, 1.0, 12.0, 0.0)).impacts[0] > 0


def test_derivatives_are_differences() -> None:
    """By parameters and by the start, on either side of an impact."""
    model, times = Model.read(IMPACT), np.linspace(0, 1.0, 40)
    values = np.array([model.parameters[path].value for path in ACTIVE])
    start = (0.1, 0.1, 1.0, 12.0, 0.0)

    def motion(change: np.ndarray) -> np.ndarray:
        moved = (*(np.array(start[:4]) + change[4:]), 0.0)
        exactly = {"derivatives": False, "tolerance": 1e-13}
        return fly(model, times, moved, ACTIVE, values + change[:4], **exactly).motion

    found = fly(model, times, start, ACTIVE, values, tolerance=1e-13)
    assert found.impacts[0] > 0
    for k in range(8):
        step = 1e-6 * np.eye(8)[k] * (values[k] if k < 4 else 1.0)
        numeric = (motion(step) - motion(-step)) / (2 * step[k])
        error = np.abs(numeric - found.jacobian[:, :, k])
        # samples next to the impact are on either side of it
        assert np.quantile(error / np.max(np.abs(numeric), axis=0), 0.9) < 1e-4


def test_a_current_follows_the_speed() -> None:
    """A start without a current soon moves as one that had it, unlike one with another current."""
    model = sx.load(IMPACT).with_({"motor.inductance": 0.05}).model
    whole = fly(model, np.linspace(0, 1.0, 101), derivatives=False).motion
    later = np.linspace(0, 0.3, 31)
    begin = whole[60]
    kept = fly(model, later, tuple(begin), derivatives=False).motion
    np.testing.assert_allclose(kept[:, 4], whole[60:91, 4], rtol=0, atol=1e-7)
    guessed = fly(model, later, (*begin[:4], np.nan), derivatives=False).motion
    other = fly(model, later, (*begin[:4], 2 * begin[4]), derivatives=False).motion
    of_guess, of_other = (np.abs(one[:, 3] - kept[:, 3]).max() for one in (guessed, other))
    assert of_guess < 0.01 * of_other
    changed = fly(model, later, (*begin[:4], np.nan))
    assert changed.steady[0]
    assert np.isfinite(changed.jacobian).all()
    np.testing.assert_array_equal(changed.jacobian[:, :, 4], 0.0)


def test_maps_in_memory_have_the_bits_of_the_program(tmp_path: Path) -> None:
    """Over the speed at the start, over a parameter, and without labels of other slices mixed up."""
    case = sx.load(IMPACT).with_(SHORT)
    for axes in (
        {"motor.crank_speed": (6, 14, 4), "x0": (-0.1, 0.1, 3)},
        {"motor.crank_speed": (6, 14, 3), "motor.inertia": (0.04, 0.06, 2), "x0": (-0.1, 0.1, 2)},
    ):
        mine, path = sx.basin(case, axes), tmp_path / "map.h5"
        with sx.basin(case, axes, output=path, overwrite=True) as file:
            assert set(mine.variables) == set(file.variables) >= {"crank_speed", "crank_outcome"}
            for name, column in mine.variables.items():
                np.testing.assert_array_equal(column.values, file[name].values, err_msg=name)


def test_labels_take_the_speed_of_the_crank() -> None:
    """A start of five numbers is that of a case with this speed; three have the speed of the case."""
    case = sx.load(IMPACT).with_(SHORT)
    catalogue = Catalogue(case.model).search()
    slow, fast = catalogue.labels(np.array([[0.0, 0.0, 0.0, speed, 0.0] for speed in (5.0, 17.0)]))["v_max"]
    assert slow != fast
    own = catalogue.labels(np.zeros((1, 3)))["v_max"][0]
    speed = case.parameters["motor.crank_speed"].value
    assert catalogue.labels(np.array([[0.0, 0.0, 0.0, speed, 0.0]]))["v_max"][0] == own
    with pytest.raises(CaseError, match="allowed without a motor 3"):
        Catalogue(Model.from_text(CASE)).labels(np.zeros((1, 5)))


def test_a_motion_has_foot_and_crank() -> None:
    """The column of the foot is that of the scotch yoke at the angle beside it."""
    model = Model.read(IMPACT)
    samples = trajectory(model, (0.05, 0.0, 0.3), duration=3.0).samples
    assert samples["driver_v"][0] == pytest.approx(0.3)
    assert samples["driver_v"][-1] > 2 * np.pi
    np.testing.assert_allclose(samples["driver_x"], 0.03 * np.cos(samples["driver_v"]), atol=1e-12)


def test_refusals_name_the_key() -> None:
    """What does not apply to a machine with a motor, and what only applies to one."""
    model, one = Model.read(IMPACT), (np.array([0, 1]), np.array([0.1]))
    none = ([], np.zeros(0))
    with pytest.raises(CaseError, match=r"start: found shape \(1, 3\), allowed \(1, 5\)"):
        model.segments(*none, np.zeros((1, 3)), *one)
    with pytest.raises(CaseError, match=r"start: found shape \(1, 5\), allowed \(1, 3\)"):
        Model.from_text(CASE).segments(*none, np.zeros((1, 5)), *one)
    ramp = sx.load(IMPACT).with_({"motor.ramp_time": 5.0}).model
    with pytest.raises(CaseError, match=r"motor\.ramp_time"):
        ramp.segments(*none, np.zeros((1, 5)), *one)
    with pytest.raises(CaseError, match=r"effect\.viscous"):
        model.with_effect("viscous", {"damping": 0.1})
    with pytest.raises(CaseError, match="motor: found a machine with a motor"):
        section_points(model, (0.0, 0.0), 1)
    assert model.segments(*none, np.full((1, 5), np.nan), *one).reason[0] == 65
