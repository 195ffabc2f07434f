# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of machines that nobody tuned the program for: small basins, long transients, steady values."""

import json
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import FOLD, differences

WEAK = (
    FOLD.replace("0.099985", "0.5")
    .replace("ratio = 1", "ratio = 1.5")
    .replace("damping = 0.1", "damping = 0.002")
)


def run(separatrix: Path, folder: Path, case: str, *command: str) -> list[dict]:
    (folder / "case.toml").write_text(case)
    done = subprocess.run(
        [separatrix, *command, "--json", "--force"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr + done.stdout
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def impact_orbit(
    amplitude: float, damping: float = 0.1, restitution: float = 0.8, wall: float = 1.0
) -> tuple:
    """Speeds before impact and multipliers of the orbits with one impact a period, at resonance."""
    period, g = 2 * np.pi, damping / 2
    w = np.sqrt(1 - g * g)
    c, s, decay = np.cos(w * period), np.sin(w * period), np.exp(-g * period)
    flight = decay * np.array([[c + g / w * s, s / w], [-s / w, c - g / w * s]])
    # Deviation from the response just before impact, per unit of speed: F [(a, b) - (0, 1 + e)] = (a, b).
    deviation = np.linalg.solve(np.eye(2) - flight, flight @ [0, -(1 + restitution)])
    response = amplitude / damping
    alpha, beta = deviation[0], 1 - deviation[1]
    roots = np.roots([alpha**2 + beta**2, -2 * wall * alpha, wall**2 - response**2])
    results = []
    for speed in roots.real:
        # The response is (A/c) sin t, so that the force A cos t is c times its velocity.
        force = damping * beta * speed
        before = force - damping * speed - wall
        after = force + damping * restitution * speed - wall
        jump = np.array([[-restitution, 0], [(after + restitution * before) / speed, -restitution]])
        results.append((speed, np.linalg.eigvals(jump @ flight)))
    return tuple(results)


def test_a_small_basin_is_found_from_the_points_of_the_map(separatrix: Path, tmp_path: Path) -> None:
    log = run(separatrix, tmp_path, FOLD, "basin", "case.toml", "-o", "map.h5")
    with h5py.File(tmp_path / "map.h5") as file:
        catalogue = {name: file["catalogue"][name][()] for name in file["catalogue"]}
        reason, attractor = file["reason"][()], file["attractor"][()]
    assert catalogue["regime"].tolist() == [1, 2]
    assert catalogue["period"].tolist() == [1, 1]
    assert catalogue["impacts_per_period"].tolist() == [0, 1]
    assert (reason == 1).all()
    assert catalogue["count"].tolist() == [(attractor == 1).sum(), (attractor == 2).sum()]
    # Of the two orbits of the closed form the faster one attracts.
    speed, multipliers = max(impact_orbit(0.099985), key=lambda orbit: orbit[0])
    assert catalogue["mean_impact_speed"][1] == pytest.approx(speed, rel=1e-9)
    found = catalogue["multiplier_real"][1] + 1j * catalogue["multiplier_imaginary"][1]
    assert sorted(found, key=abs) == pytest.approx(sorted(multipliers, key=abs), rel=1e-3)
    # Without impact the oscillator is linear.
    found = catalogue["multiplier_real"][0] + 1j * catalogue["multiplier_imaginary"][0]
    turn = 2 * np.pi * complex(-0.05, np.sqrt(1 - 0.0025))
    assert sorted(found, key=np.imag) == pytest.approx(
        sorted([np.exp(turn), np.exp(turn.conjugate())], key=np.imag), rel=1e-13
    )
    events = {line["event"]: line for line in log}
    assert events["second_look"]["found"] == 1
    assert events["second_look"]["left"] == 0
    # 1 - 0.05^(1/256)
    assert "1.16 %" in events["missed"]["message"]


def test_a_second_look_does_not_depend_on_how_the_map_is_computed(separatrix: Path, tmp_path: Path) -> None:
    run(separatrix, tmp_path, FOLD, "basin", "case.toml", "-o", "whole.h5")
    run(separatrix, tmp_path, FOLD, "basin", "case.toml", "-o", "tiles.h5", "--set", "grid.tile=[7, 11]")
    for share in ("1/2", "2/2"):
        run(separatrix, tmp_path, FOLD, "basin", "case.toml", "-o", "m.h5", "--shard", share)
    shares = sorted(str(path) for path in tmp_path.glob("m.h5.shard*"))
    run(separatrix, tmp_path, FOLD, "merge", "merged.h5", *shares)
    for other in ("tiles.h5", "merged.h5"):
        assert differences(tmp_path / "whole.h5", tmp_path / other) == []
    subprocess.run(
        [separatrix, "verify", "whole.h5", "--sample", "50"], cwd=tmp_path, check=True, capture_output=True
    )
    run(
        separatrix, tmp_path, FOLD, "basin", "case.toml", "-o", "none.h5", "--set", "attractors.second_look=0"
    )
    with h5py.File(tmp_path / "none.h5") as file:
        assert file["catalogue/regime"][()].tolist() == [1]
        assert (file["attractor"][()] == 0).any()


def test_long_transients_are_no_attractors(separatrix: Path, tmp_path: Path) -> None:
    short = ("--set", "run.duration=60", "--set", "run.extension=1")
    run(separatrix, tmp_path, WEAK, "basin", "case.toml", "-o", "map.h5", *short)
    with h5py.File(tmp_path / "map.h5") as file:
        assert file["catalogue/regime"][()].tolist() == [1, 2]
        assert file["catalogue/period"][()].tolist() == [1, 1]
        assert file["catalogue/kind"][()].tolist() == [1, 1]


def test_steady_values_are_over_whole_periods(separatrix: Path, tmp_path: Path) -> None:
    case = FOLD[: FOLD.index("[[axis]]")].replace("0.099985", "1") + "[start]\nx0 = 0\nv0 = 0\n"
    run(separatrix, tmp_path, case, "trajectory", "case.toml", "-o", "t.h5")
    with h5py.File(tmp_path / "t.h5") as file:
        assert file.attrs["period"] == 1
        assert file.attrs["impacts_per_period"] == 1
        # COCO's impact oscillator.
        assert file.attrs["mean_impact_speed"] == pytest.approx(1.695732937595, abs=1e-10)
    run(separatrix, tmp_path, case, "trajectory", "case.toml", "-o", "t.h5", "--set", 'run.average="window"')
    with h5py.File(tmp_path / "t.h5") as file:
        assert file.attrs["period"] == 0
        assert file.attrs["impacts_per_period"] == pytest.approx(24 / (150 / (2 * np.pi)), rel=1e-9)
