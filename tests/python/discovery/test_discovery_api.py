# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`sx.discover`: the verdict of the command, a case to compute with, progress, and what it refuses."""

import json
from pathlib import Path

import pytest
import separatrix as sx
from program import CASE, succeed

pytestmark = pytest.mark.usefixtures("library")

EFFECTS = ("viscous", "offset_force")


@pytest.fixture(scope="module")
def machine(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with records of a machine with drag at three frequencies, and the case without it."""
    folder = tmp_path_factory.mktemp("machine")
    (folder / "base.toml").write_text(CASE)
    (folder / "true.toml").write_text(CASE + "[effect.viscous]\ndamping = 0.4\n")
    for seed, (name, ratio) in enumerate({"first": 0.8, "second": 1.25, "held_out": 0.95}.items()):
        settings = (
            f"drive.ratio={ratio}", "run.duration=6", f'record={{rate=200, noise="1 mm", seed={seed}}}',
        )  # fmt: skip
        words = [word for setting in settings for word in ("--set", setting)]
        record = folder / f"{name}.csv"
        succeed(separatrix, "trajectory", "true.toml", "--force", "--record", record, *words, folder=folder)
    return folder


def test_the_effect_is_in_the_case_that_comes_back(machine: Path, tmp_path: Path) -> None:
    reported: list[tuple] = []
    base = sx.load(machine / "base.toml")
    found = sx.discover(
        base,
        [machine / "first.csv", machine / "second.csv"],
        hold_out=machine / "held_out.csv",
        effects=EFFECTS,
        out=tmp_path / "found",
        quick=True,
        progress=lambda *what: reported.append(what),
    )
    assert (found.outcome, found.effects) == ("named", ("viscous",))
    assert "viscous" in str(found)
    size = found.verdict["parameters"]["effect.viscous.damping"]
    assert abs(size["value"] - 0.4) < 4 * size["standard_error"] < 0.2
    assert found.case.parameters["effect.viscous.damping"].value == size["value"]
    # the machine that comes back computes, and loses more energy than the one that was believed
    lost = [sx.trajectory(case, duration=2.0).attrs["energy_lost_to_damping"] for case in (found.case, base)]
    assert abs(lost[0]) > abs(lost[1])
    written = json.loads(found.files["verdict.json"].read_text())
    assert written["parameters"]["effect.viscous.damping"] == size
    assert (written["outcome"], tuple(written["effects"])) == (found.outcome, found.effects)
    assert sx.load(found.files["extended.toml"]).parameters["effect.viscous.damping"].value == size["value"]
    done = [number for _, number, _ in reported]
    assert done == sorted(done) and reported[-1][1:] == (1000, 1000)


def test_without_a_gap_there_is_no_case(machine: Path) -> None:
    """One record of the machine that the case describes; nothing is written."""
    before = set(machine.rglob("*"))
    true = sx.load(machine / "true.toml")
    found = sx.discover(true, machine / "first.csv", effects=["offset_force"], quick=True)
    assert (found.outcome, found.effects, found.case, found.files) == ("none", (), None, {})
    assert set(machine.rglob("*")) == before


def test_what_makes_no_sense_is_refused(machine: Path, tmp_path: Path) -> None:
    case, record = machine / "base.toml", machine / "first.csv"
    for wrong, message in (
        ({"records": tmp_path / "none.csv"}, r"none\.csv"),
        ({"records": record, "hold_out": record}, r"first\.csv"),
        ({"records": record, "effects": ["viscos"]}, "^effects: found viscos, allowed"),
        ({"records": record, "effects": ["coulomb", "viscos"]}, "^effects: found viscos, allowed"),
        ({"records": record, "compare": "forces"}, "^compare: found 'forces', allowed motion and force"),
        ({"records": []}, "record"),
    ):
        with pytest.raises(sx.SeparatrixError, match=message):
            sx.discover(case, **wrong)
    with pytest.raises(sx.CaseError, match="cannot be read"):
        sx.discover(tmp_path / "none.toml", record)
