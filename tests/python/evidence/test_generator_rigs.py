# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ten machines that are not the published one: their cases, what they hide, and a record in closed form."""

import json
import time
from types import ModuleType

import numpy as np
import pytest
from separatrix.discovery import Options, discover
from separatrix.discovery.fitting.observations import observation_of
from separatrix.discovery.fitting.shapes import FORM_OF
from separatrix.library import Model

SEED = 31


@pytest.fixture(scope="module")
def rigs(source_dir) -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(source_dir / "tests" / "generator"))
        import rigs

        yield rigs


@pytest.mark.usefixtures("library")
def test_every_case_is_a_machine_and_what_it_hides_has_a_name(rigs: ModuleType) -> None:
    assert len(rigs.RIGS) == 10
    for name, draw in rigs.RIGS.items():
        rig = draw(np.random.default_rng([SEED, 15, 0]))
        known = observation_of(Model.from_text(rig.case), "motion").effects(None)
        assert set(rig.hidden) <= {*known, *FORM_OF}, name
        # another number draws another machine, the same one the same
        again = draw(np.random.default_rng([SEED, 15, 0]))
        assert again.machine(rig.drives[0]).mass == rig.machine(rig.drives[0]).mass


@pytest.mark.long
@pytest.mark.usefixtures("library")
@pytest.mark.parametrize("machine", ["belt", "play", "chain", "duffing", "decay", "force", "hammer"])
def test_what_a_machine_hides_is_named_within_a_minute_of_processor_time(
    rigs: ModuleType, tmp_path, machine: str
) -> None:
    hidden = rigs.write_rig(tmp_path, SEED, 0, machine).hidden
    training, held_out = [tmp_path / name for name in rigs.RECORDS[:2]], [tmp_path / rigs.RECORDS[2]]
    begun = time.process_time()
    verdict = discover(tmp_path / rigs.BASE, training, held_out, Options(seed=1))
    assert (verdict["outcome"], verdict["effects"]) == ("named", list(hidden))
    assert time.process_time() - begun < 60


@pytest.mark.long
@pytest.mark.usefixtures("library")
@pytest.mark.parametrize("machine", ["decay", "pendulum", "force"])
def test_four_times_as_many_samples_have_the_same_verdict(
    rigs: ModuleType, tmp_path, monkeypatch, machine: str
) -> None:
    draw = rigs.RIGS[machine]

    def denser(random: np.random.Generator):
        rig = draw(random)
        rig.rate *= 4
        return rig

    monkeypatch.setitem(rigs.RIGS, "denser", denser)
    verdicts = []
    for name in (machine, "denser"):
        folder = tmp_path / name
        rigs.write_rig(folder, SEED, 0, name)
        paths = [folder / record for record in rigs.RECORDS]
        verdict = discover(folder / rigs.BASE, paths[:2], paths[2:], Options(seed=1))
        verdicts.append((verdict["outcome"], verdict["effects"]))
    assert verdicts[0] == verdicts[1] == ("named", list(draw(np.random.default_rng(1)).hidden))


def test_a_decay_is_that_of_dry_and_viscous_friction(rigs: ModuleType, tmp_path) -> None:
    rigs.write_rig(tmp_path, SEED, 0, "decay")
    assert json.loads((tmp_path / "truth.json").read_text())["effects"] == ["coulomb"]
    dry = np.random.default_rng([SEED, 15, 0]).uniform(0.05, 0.1)
    t, x = np.loadtxt(tmp_path / "first.csv", delimiter=",", skiprows=3).T
    assert t.size == 30_000
    # from rest at 0.3 m to the first turn: about the middle that friction shifts
    rate = -0.05 + 1j * np.sqrt(40 - 0.05**2)
    half = t < np.pi / rate.imag
    amplitude = (0.3 - dry / 40) * np.array([1, -rate.real / rate.imag])
    turn = rate.imag * t[half]
    wanted = dry / 40 + np.exp(rate.real * t[half]) * (
        amplitude[0] * np.cos(turn) + amplitude[1] * np.sin(turn)
    )
    noise = 2e-3 * np.std(x)
    assert np.std(x[half] - wanted) == pytest.approx(noise, rel=0.1)
    assert abs(np.mean(x[half] - wanted)) < 5 * noise / np.sqrt(half.sum())
