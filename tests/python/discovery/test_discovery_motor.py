# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of machines with a motor: sensors of body and crank, their likelihood, what is named."""

import sys
from pathlib import Path

import numpy as np
import pytest
from separatrix.discovery.fitting.crank_data import CrankData
from separatrix.discovery.fitting.machine import CRANK_ZERO
from separatrix.discovery.fitting.observations import observation_of
from separatrix.discovery.measured.cranks import ANGLE, prepare_crank
from separatrix.discovery.measured.records import make_record, read_record
from separatrix.discovery.options import Options
from separatrix.discovery.workflow import discover
from separatrix.errors import SeparatrixError
from separatrix.library import Model

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "generator"))

import cranks

pytestmark = pytest.mark.usefixtures("library")


def case_of(
    tmp_path: Path, effect: str, sensors: tuple[str, ...], machine: str = "impact"
) -> cranks.CrankCase:
    """A drawn case of one machine with these sensors, and its files."""
    number = next(n for n in range(100) if cranks.draw(3, n, effect).machine == machine)
    case = cranks.draw(3, number, effect)
    case.sensors = sensors
    cranks.write(tmp_path, case, 6.0)
    return case


def data_of(tmp_path: Path) -> tuple[Model, CrankData]:
    """The base machine and one record, ready to be fitted."""
    model = Model.read(tmp_path / cranks.BASE)
    seen = observation_of(model, "motion")
    return model, seen.gather([seen.prepare(read_record(tmp_path / "first.csv"), None)], Options())


def test_the_generator_moves_as_the_program(tmp_path: Path) -> None:
    """Two methods, one motion, with impacts and a current that lags."""
    case = case_of(tmp_path, "current_lag", ("x", "phi"))
    true = case.true | {"voltage": 8.0}
    states = cranks.simulate(true, np.array([0.3, 12.0, 0.05, 0.4, 0.2, 0.0]), 0.01, 150)
    model = Model.read(tmp_path / cranks.BASE)
    paths = {"stiffness": "restoring", "damping": "friction", "inductance": "motor"}
    values = {f"{family}.{name}": true[name] for name, family in paths.items()}
    start = states[0][[cranks.X, cranks.PHI, cranks.V, cranks.W, cranks.CURRENT]]
    found = model.segments(
        list(values), np.array(list(values.values())), start[None], np.array([0, 150]),
        0.01 * np.arange(150), derivatives=False,
    )  # fmt: skip
    assert found.impacts[0] > 0
    columns = states[:, [cranks.X, cranks.PHI, cranks.V, cranks.W, cranks.CURRENT]]
    near = np.abs(found.motion - columns)
    # a velocity beside an impact is that before or after it
    np.testing.assert_array_less(np.quantile(near, 0.95, axis=0), 1e-6)


def test_the_true_machine_leaves_noise(tmp_path: Path) -> None:
    """From smoothed starts that are fitted, with the true parameters, chi^2 is that of the noise."""
    case = case_of(tmp_path, "", ("x", "phi", "current"))
    model, data = data_of(tmp_path)
    free = data.unknowns(model)
    values = np.array([one.value for one in free])
    paths = [one.path for one in free]
    values[paths.index("restoring.stiffness")] = case.true["stiffness"]
    values[paths.index("friction.damping")] = case.true["damping"]
    from separatrix.discovery.fitting.fit import minimise

    problem = data.problem(model, 1, free)
    fit = minimise(problem, values, data.smoothed_starts(1), most=20, fixed=np.ones(values.size, bool))
    assert 0.85 < fit.reduced_chi2 < 1.15


def test_derivatives_of_residuals(tmp_path: Path) -> None:
    """By the free parameters, the zero of the crank and the starts, of all sensors."""
    case_of(tmp_path, "", ("a", "phi", "current"))
    model, data = data_of(tmp_path)
    free = data.unknowns(model)
    problem, values = data.problem(model, 0, free), np.array([one.value for one in free])
    starts = data.smoothed_starts(0)
    whole = problem.evaluate(values, starts)
    good = whole.steady & ~whole.failed
    assert good.mean() > 0.5
    for j, one in enumerate(free):
        step = 1e-5 * one.size * (np.arange(values.size) == j)
        ends = [problem.evaluate(values + sign * step, starts, derivatives=False) for sign in (1, -1)]
        numeric = (ends[0].residual - ends[1].residual)[good] / (2 * step[j])
        # residuals fall as what the machine shows grows
        error = np.abs(numeric + whole.by_parameter[good][:, :, j])
        assert np.quantile(error, 0.9) < 1e-3 * np.max(np.abs(numeric)), one.path


def test_an_impact_beside_a_sample_is_no_acceleration(tmp_path: Path) -> None:
    """Moved past the samples by a barrier that moves, it never shows as a jump of the speed over no time."""
    case_of(tmp_path, "", ("a", "phi"))
    model, data = data_of(tmp_path)
    free = data.unknowns(model)
    paths, values = [one.path for one in free], np.array([one.value for one in free])
    problem, largest = data.problem(model, 1, free), []
    for shift in np.linspace(0, 2e-3, 12):
        moved = values + shift * (np.array(paths) == "contact.upper")
        whole = problem.evaluate(moved, data.smoothed_starts(1), derivatives=False)
        assert whole.hits.sum() > 5
        # of the first sensor
        residual = whole.residual[~whole.failed, : problem.segments.inside.shape[1]]
        largest.append(np.abs(residual).max())
    # as a jump it would be 19000 noises
    assert max(largest) < 50


def test_pulses_show_the_zero(tmp_path: Path) -> None:
    """A pulse somewhere on the turn: where is found from the motion of the body."""
    case_of(tmp_path, "", ("x", "pulse"))
    model, data = data_of(tmp_path)
    (prepared,) = data.prepared
    sensor = prepared.sensor(ANGLE)
    assert 5 < np.count_nonzero(sensor.known) < 20
    free = data.unknowns(model)
    data.find_zeros(model, free)
    # the pulse rises at the angle 2 pi - 1
    zero = next(one.value for one in free if one.path == CRANK_ZERO)
    assert abs(np.mod(zero - 1.0 + np.pi, 2 * np.pi) - np.pi) < 0.3


def test_an_inertia_is_named(tmp_path: Path) -> None:
    """End to end, with the value."""
    case = case_of(tmp_path, "crank_inertia", ("x", "phi"), "free")
    records = [tmp_path / name for name in cranks.TRAINING]
    asked = Options(candidates=("crank_inertia", "viscous", "coulomb"), quick=True)
    verdict = discover(tmp_path / cranks.BASE, records, [tmp_path / cranks.HELD_OUT], asked)
    assert verdict["effects"] == ["crank_inertia@motor"]
    # the zero of the crank moves with the inertia, also where the record is predicted
    assert verdict["gap"]["held_out"]["after"] < 1.3
    found = verdict["parameters"]["motor.inertia"]
    assert abs(found["value"] - case.true["inertia"]) < 4 * found["standard_error"]


def record(**columns: np.ndarray) -> object:
    """A record of two seconds at 100 Hz."""
    t = np.arange(200) / 100
    return make_record("made", {"t": t, "x": 0.02 * np.sin(12 * t), **columns}, {"motor_voltage_v": 8})


def test_refusals_name_the_column(tmp_path: Path) -> None:
    """A record without a crank, of a motor without that column, of a voltage that changes; a control."""
    case_of(tmp_path, "", ("x", "phi"))
    model, t = Model.read(tmp_path / cranks.BASE), np.arange(200) / 100
    with pytest.raises(SeparatrixError, match="neither phi nor pulse"):
        prepare_crank(record(), model)
    phi = np.random.default_rng(1).normal(12 * t, 1e-3)
    with pytest.raises(SeparatrixError, match="the voltage changes"):
        prepare_crank(record(phi=phi, voltage=7 + t), model)
    with pytest.raises(SeparatrixError, match="allowed with a motor x, v, a.body"):
        prepare_crank(record(phi=phi, **{"x.other": t}), model)
    text = (tmp_path / cranks.BASE).read_text()
    head = text[: text.index("[motor]")]
    control = 'law = "pi"\nproportional = 0.5\nintegral = 0.5\nreference = 12\ninertia = 0.05\n'
    with pytest.raises(SeparatrixError, match="speed control shows in no sensor"):
        observation_of(Model.from_text(f"{head}[motor]\n{control}"), "motion")
