# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mechanisms that the catalogue lacks pass for friction: a force that lags is not named without doubt."""

import numpy as np
import pytest
from separatrix.discovery import Options
from separatrix.discovery.workflow import discover

pytestmark = pytest.mark.usefixtures("library")
LAG = 0.002


def verdict_of(source_dir, tmp_path, **changes):
    """The verdict on three records of the published machine with changes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(source_dir / "tests" / "generator"))
        from design import Case
        from experiment import REGIMES, Experiment
        from records import base_case, write_record

        regime = REGIMES["published"]
        base = regime.machine()
        random = np.random.default_rng(5)
        ratios = (0.8, 1.2, 1.0)
        three = [Experiment(one, float(random.uniform(0, 6)), 0.5, 0.3, 12, 100, 12) for one in ratios]
        machine = base.copy(**changes)
        quiet = (0.003, "white", False, True, True, [0.0] * 3, 0.0, [5, 0, 0])
        case = Case(0, "single", "published", base, machine, [], three[:2], three[2], *quiet)
        (tmp_path / "base.toml").write_text(base_case(regime, ratios[0]))
        files = [tmp_path / f"r{number}.csv" for number in range(3)]
        for file, one in zip(files, three, strict=True):
            write_record(file, case, one, 0.0, random)
    asked = ("viscous", "quadratic_drag", "stribeck", "cubic_spring", "sensor_delay")
    return discover(tmp_path / "base.toml", files[:2], files[2:], Options(candidates=asked))


def test_a_spring_force_that_lags_is_doubted_as_friction(source_dir, tmp_path):
    """Half of the spring lags by twice the time; its foot moves twice as far."""
    half = 4.5 * np.pi**2
    lags = {"stiffness": half, "delayed_stiffness": half, "delay": 2 * LAG, "scale": 2.0}
    verdict = verdict_of(source_dir, tmp_path, **lags)
    assert verdict["outcome"] == "ambiguous"
    assert "delayed_force" in verdict["alternatives"]
    reason = next(one for one in verdict["reasons"] if "lags" in one)
    assert float(reason.split("lags by ")[1].split(" s")[0]) == pytest.approx(LAG, rel=0.25)


def test_friction_that_falls_at_low_speed_alone_is_named(source_dir, tmp_path):
    verdict = verdict_of(source_dir, tmp_path, stribeck=0.6, stribeck_velocity=0.4)
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["stribeck"])
    assert verdict["alternatives"] == []


def verdict_of_mimic(source_dir, tmp_path, name, level=None):
    """The verdict on a case of a viscous machine whose sensor shows the past."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(source_dir / "tests" / "generator"))
        import mimics

        case = mimics.draw_mimic(3, 4, name, "viscous")
        case.level = level or case.level
        mimics.write_mimic(tmp_path, case)
    files = [tmp_path / one for one in ("first.csv", "second.csv", "held_out.csv")]
    asked = ("coulomb", "quadratic_drag", "sensor_gain", "sensor_delay")
    verdict = discover(tmp_path / "base.toml", files[:2], files[2:], Options(candidates=asked))
    return verdict, case.training[0].sensor[name]


def test_a_low_pass_of_the_sensor_is_no_delay(source_dir, tmp_path):
    verdict, time = verdict_of_mimic(source_dir, tmp_path, "sensor_lag")
    assert (verdict["outcome"], verdict["effects"]) == ("characterised", [])
    found = verdict["character"][0]
    assert found["depends_on"] == ["low pass of the sensor"]
    assert found["constant"]["value"] == pytest.approx(time, rel=0.2)


def test_a_delay_of_the_sensor_is_named(source_dir, tmp_path):
    verdict, time = verdict_of_mimic(source_dir, tmp_path, "sensor_delay")
    assert (verdict["outcome"], verdict["effects"]) == ("named", ["sensor_delay"])
    assert verdict["parameters"]["effect.sensor_delay.delay"]["value"] == pytest.approx(time, rel=0.05)


@pytest.mark.parametrize("name", ["sensor_lag", "sensor_delay"])
def test_noise_that_hides_the_difference_leaves_both(source_dir, tmp_path, name):
    verdict, _ = verdict_of_mimic(source_dir, tmp_path, name, level=0.1)
    assert (verdict["outcome"], verdict["effects"]) == ("ambiguous", ["sensor_delay"])
    assert "sensor_low_pass" in verdict["alternatives"]
    assert any("low pass" in one for one in verdict["reasons"])
