# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured records: a positioning system with asymmetric friction, and a pendulum that is not viscous."""

import json
import os
import runpy
from pathlib import Path

import pytest
from separatrix.discovery.cli import main

ROOT = Path(__file__).resolve().parents[3]
FOLDER = os.environ.get("SEPARATRIX_MEASURED")

pytestmark = pytest.mark.skipif(
    not FOLDER, reason="asked for by SEPARATRIX_MEASURED=FOLDER with emps/ and single_pendulum/"
)

OPTIONS = {
    "emps": ["--segment-seconds", "0.5", "--effects", "asymmetric_friction"],
    "pendulum_large": [],
    "pendulum_small": ["--segment-seconds", "0.4"],
}


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """The records that scripts/evidence/measured_records makes."""
    out = tmp_path_factory.mktemp("records")
    make = runpy.run_path(str(ROOT / "scripts/evidence/measured_records"))["main"]
    assert make([FOLDER, "--out", str(out)]) == 0
    return out


def found(records: Path, *names: str) -> dict:
    """The verdict in part on records of one machine, others of it held out, and the figures of the field."""
    name = names[0]
    machine = "positioning" if name == "emps" else "pendulum"
    folder = records / "-".join(names)
    if not folder.is_dir():
        arguments = [str(ROOT / "examples" / f"measured_{machine}.toml")]
        arguments += [str(records / f"{one}.csv") for one in names]
        for one in names:
            held_out = "emps_pulses" if one == "emps" else f"{one}_low"
            arguments += ["--hold-out", str(records / f"{held_out}.csv")]
        arguments += ["--out", str(folder), *OPTIONS[name]]
        assert main([*arguments, "--partial", "--quick", "--quiet"]) == 0
    verdict = json.loads((folder / "verdict.json").read_text())
    figures = runpy.run_path(str(ROOT / "scripts/evidence/measured_figures"))
    options = figures["parsed"]([FOLDER, "--records", str(records)])
    measured = figures["force_errors" if name == "emps" else "loss_errors"](options, folder, verdict)
    return verdict | {"errors": measured}


def test_the_positioning_system_lacks_asymmetric_friction_and_remains_flexible(records):
    verdict = found(records, "emps")
    assert (verdict["outcome"], verdict["complete"]) == ("named", False)
    assert verdict["effects"] == ["asymmetric_friction"]
    # the authors: 166.7 and 240.4 N s/m
    viscous = verdict["parameters"]["effect.asymmetric_friction.viscous"]["value"]
    assert viscous == pytest.approx((166.7 - 240.4) / 2, rel=0.05)
    assert verdict["errors"]["emps"][1] <= 3.1 < 4.0 < verdict["errors"]["emps"][0]
    assert verdict["errors"]["emps_pulses"][1] < 5.4 < verdict["errors"]["emps_pulses"][0]
    assert any("emps_pulses" in reason and "flexible" in reason for reason in verdict["reasons"])


def test_large_oscillations_of_the_pendulum_lack_dry_friction_and_drag(records):
    verdict = found(records, "pendulum_large")
    assert (verdict["outcome"], verdict["complete"]) == ("named", False)
    assert verdict["effects"] == ["coulomb", "quadratic_drag"]
    before, after = verdict["errors"]["pendulum_large_low"]
    assert after < 17 < 25 < before


def test_small_oscillations_of_the_pendulum_have_the_same_dry_friction(records):
    small, large = found(records, "pendulum_small"), found(records, "pendulum_large")
    assert small["outcome"] == "named"
    assert {"coulomb", "dahl"} <= set(small["effects"])
    forces = [one["parameters"]["effect.coulomb.force"]["value"] for one in (small, large)]
    assert forces[0] == pytest.approx(forces[1], rel=0.15)
    before, after = small["errors"]["pendulum_small_low"]
    assert after < 0.3 * before


def test_a_spring_that_small_oscillations_suggest_is_refuted_by_large_ones(records):
    verdict = found(records, "pendulum_small", "pendulum_large")
    assert (verdict["outcome"], verdict["complete"]) == ("named", False)
    assert set(verdict["effects"]) == {"coulomb", "quadratic_drag", "dahl"}
    alone = found(records, "pendulum_large")["parameters"]["effect.coulomb.force"]["value"]
    assert verdict["parameters"]["effect.coulomb.force"]["value"] == pytest.approx(alone, rel=0.15)


def test_half_periods_alone_predict_the_small_pendulum_no_better(records):
    """Constant friction misses by more than the scatter; friction that may change is hardly known."""
    figures = runpy.run_path(str(ROOT / "scripts/evidence/measured_figures"))
    turns = [figures["half_periods"](records, name) for name in ("pendulum_small", "pendulum_small_low")]
    own, held_out, error = figures["half_periods_alone"](*turns[0], *turns[1], 0)
    assert own < 2 < 5 < held_out
    assert held_out > 3 * error
    _, held_out, error = figures["half_periods_alone"](*turns[0], *turns[1], 1)
    assert min(held_out, error) > 9
