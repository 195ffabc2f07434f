# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""From records of a machine with a hidden effect to its name, its size, and a case that has it."""

import json
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from program import CASE, succeed
from separatrix.discovery.cli import main
from separatrix.discovery.decision import verdict
from separatrix.discovery.decision.verdict import _candidate, _parameters
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.wording import unit_of, units_of, with_error

pytestmark = pytest.mark.usefixtures("library")

RATIOS = {"first": 0.8, "second": 1.25, "held_out": 0.95}


def records(separatrix: Path, folder: Path, effect: str, noise: str = "1 mm") -> list[Path]:
    """Records of the machine with an effect, at three frequencies; the base case beside them."""
    (folder / "base.toml").write_text(CASE)
    (folder / "true.toml").write_text(CASE + effect)
    made = []
    for seed, (name, ratio) in enumerate(RATIOS.items()):
        path = folder / f"{name}.csv"
        settings = (
            f"drive.ratio={ratio}",
            "run.duration=9",
            f'record={{rate=200, noise="{noise}", seed={seed}}}',
        )
        words = [word for setting in settings for word in ("--set", setting)]
        succeed(separatrix, "trajectory", "true.toml", "--force", "--record", path, *words, folder=folder)
        made.append(path)
    return made


def asked(folder: Path, made: list[Path], out: str, *more: str) -> dict:
    """The verdict on these records."""
    first, second, held_out = map(str, made)
    arguments = [
        str(folder / "base.toml"),
        first,
        second,
        "--hold-out",
        held_out,
        "--out",
        str(folder / out),
        "-q",
    ]
    assert main([*arguments, *more]) == 0
    return json.loads((folder / out / "verdict.json").read_text())


def test_a_hidden_effect_is_named_added_and_predicts(separatrix, tmp_path):
    made = records(separatrix, tmp_path, "[effect.viscous]\ndamping = 0.3\n")
    few = ("--effects", "viscous,restitution_slope,offset_force,drive_ripple")
    verdict = asked(tmp_path, made, "out", *few)
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["viscous"])
    assert all(verdict["gates"].values())
    found = verdict["parameters"]["effect.viscous.damping"]
    assert found["unit"] == "N s/m"
    assert abs(found["value"] - 0.3) < 4 * found["standard_error"] < 0.15
    gap = verdict["gap"]["held_out"]
    assert gap["before"] > 1.3
    assert gap["after"] < 1.15
    assert verdict["where"]
    succeed(separatrix, "trajectory", "out/extended.toml", "--validate", folder=tmp_path)
    assert "viscous added" in (tmp_path / "out" / "extended.toml").read_text()
    with h5py.File(tmp_path / "out" / "details.h5") as file:
        assert np.array(file["confusability/matrix"]) == pytest.approx(
            np.array(verdict["confusability"]["matrix"])
        )
        after = np.std(file["held_out/held_out/after/residual"])
        assert after < np.std(file["held_out/held_out/before/residual"])


def test_nothing_is_found_where_nothing_is_and_twice_the_same(separatrix, tmp_path):
    made = records(separatrix, tmp_path, "")
    few = ("--effects", "restitution_slope,viscous,offset_force,drive_ripple")
    verdict = asked(tmp_path, made, "out", *few)
    assert (verdict["outcome"], verdict["effects"]) == ("none", [])
    assert not (tmp_path / "out" / "extended.toml").exists()
    assert 0 < verdict["detectable"]["offset_force"]["size"] < 0.5
    assert set(verdict["detectable"]) == set(few[1].split(","))
    (tmp_path / "again").mkdir()
    (tmp_path / "again" / "extended.toml").write_text("of an earlier run")
    again = asked(tmp_path, made, "again", *few)
    assert not (tmp_path / "again" / "extended.toml").exists()
    for one in (verdict, again):
        del one["runtime_s"]
    assert again == verdict


def test_noise_that_nobody_states_is_that_of_the_sensor_and_hides_no_gap(separatrix, tmp_path):
    made = records(separatrix, tmp_path, "[effect.viscous]\ndamping = 0.6\n", "20 um")[:1]
    text = made[0].read_text()
    made[0].write_text("\n".join(line for line in text.splitlines() if "sensor_noise" not in line))
    arguments = [str(tmp_path / "base.toml"), str(made[0]), "--out", str(tmp_path / "out"), "-q"]
    assert main([*arguments, "--effects", "viscous,restitution_slope", "--quick"]) == 0
    verdict = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert verdict["effects"] == ["viscous"]
    assert [one["sigma"] for one in verdict["records"]] == pytest.approx([2e-5, 2e-5], rel=0.25)
    assert 0.7 < verdict["gap"]["held_out"]["after"] < 1.4


@pytest.mark.long
def test_effects_that_are_one_motion_are_reported_together(separatrix, tmp_path):
    made = records(separatrix, tmp_path, "[effect.offset_force]\nforce = 0.6\n")
    few = ("--effects", "viscous,offset_force,sensor_bias,sensor_gain")
    verdict = asked(tmp_path, made, "out", *few)
    assert verdict["outcome"] == "ambiguous"
    assert {"offset_force", "sensor_bias"} <= {*verdict["effects"], *verdict["alternatives"]}
    assert verdict["equivalent"]
    assert verdict["separating_experiment"]


@pytest.mark.long
def test_a_part_is_named_where_more_is_missing(separatrix, tmp_path):
    """Drag is among the effects that are asked for, the ripple of the drive is not."""
    hidden = "[effect.viscous]\ndamping = 0.4\n[effect.drive_ripple]\nsine = 0.03\n"
    made = records(separatrix, tmp_path, hidden)
    few = ("--effects", "viscous,restitution_slope,offset_force")
    found = asked(tmp_path, made, "out", *few, "--quick", "--partial")
    assert (found["outcome"], found["complete"]) == ("named", False)
    assert found["effects"][0] == "viscous"
    assert found["parameters"]["effect.viscous.damping"]["value"] == pytest.approx(0.4, rel=0.2)
    held_out = found["gap"]["held_out"]
    assert 1.05 < held_out["after"] < held_out["before"]
    assert (tmp_path / "out" / "extended.toml").exists()


def test_a_parameter_at_its_bound_is_reported_without_an_interval(monkeypatch):
    monkeypatch.setattr(
        verdict, "with_imperfections", lambda *_: SimpleNamespace(errors=np.array([0.0, 0.5]))
    )
    free = [Free("contact.restitution", 1.0, 0.0, 1.0), Free("restoring.stiffness", 89.0)]
    fitted = SimpleNamespace(
        problem=SimpleNamespace(free=free),
        fit=SimpleNamespace(values=np.array([1.0, 89.0]), at_bound=np.array([True, False])),
        model=SimpleNamespace(parameters={}),
    )
    held, known = _parameters(fitted).values()
    assert (held["standard_error"], held["interval_95"], held["note"]) == (None, None, "at its bound")
    assert known["interval_95"] == pytest.approx([89 - 0.98, 89 + 0.98])
    assert with_error(held) == "1, at its bound"
    assert with_error(known) == "89 +- 0.5"
    precise = {"value": 1.1, "standard_error": 2.8e-7, "interval_95": [], "unit": "m"}
    assert with_error(precise | {"value": 1.10000031}) == "1.10000031 +- 2.8e-07 m"
    assert with_error(precise | {"value": 20.000652, "standard_error": 1.2e-3}) == "20.0007 +- 0.0012 m"
    assert with_error(precise | {"value": 1.0000012, "standard_error": 9.9e-5}) == "1.000001 +- 9.9e-05 m"


def test_the_x_of_a_pendulum_is_an_angle():
    pendulum, body = {"body.mass", "restoring.moment"}, {"body.mass", "restoring.stiffness"}
    assert (units_of(pendulum).position, units_of(pendulum).force) == ("rad", "N m")
    assert units_of(body).velocity == "m/s"
    assert unit_of("friction.damping", "N s/m", pendulum) == "N m s/rad"
    assert unit_of("effect.quadratic_drag.coefficient", "N s^2/m^2", pendulum) == "N m s^2/rad^2"
    assert unit_of("restoring.moment", "N m", pendulum) == "N m"
    assert unit_of("", "friction (N)", pendulum) == "friction (N m)"
    assert unit_of("", "m/s", pendulum) == "rad/s"
    assert unit_of("friction.damping", "N s/m", body) == "N s/m"


def test_a_fit_worse_than_the_machine_that_it_contains_is_not_called_converged():
    fit = SimpleNamespace(converged=True, reduced_chi2=9.0, sample_chi2=9.0, values=np.array([0.8]))
    free = [Free("effect.viscous.damping", 0.8)]
    fitted = SimpleNamespace(
        names=("viscous",), fit=fit, problem=SimpleNamespace(free=free), added=(0,), tries=1
    )
    scored = SimpleNamespace(name="viscous", fitted=fitted, held_out=0.0, evidence=0.0, imperfections=None)
    entries = {gain: _candidate(SimpleNamespace(**vars(scored), training=gain)) for gain in (-0.5, -400.0)}
    assert entries[-0.5]["converged"]
    assert not entries[-400.0]["converged"]
