# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction between parts by an expression of the sliding speed; a load that grows from nothing."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from program import run, succeed

CASE = """
[body.a]
mass = 1
[body.b]
mass = 1.2
[spring.a]
between = ["a"]
stiffness = "1 N/m"
[spring.ab]
between = ["a", "b"]
stiffness = "2 N/m"
damping = "0.05 N s/m"
[friction.a]
between = ["a"]
velocity = "0.1 m/s"
{friction}
[friction.ab]
law = "coulomb"
between = ["a", "b"]
force = "0.1 N"
static_force = "0.15 N"
[run]
duration = 60
average = "window"
"""
OWN = 'law = "expression"\nfc = "0.4 N"\nfs = "1 N"\nvs = "0.1 m/s"\nc = "0.2 N s/m"\nforce = '
STRIBECK = """law = "coulomb_stribeck"
force = 0.4
static_force = 1
stribeck_velocity = 0.1
stribeck_exponent = 2
damping = 0.2"""
PAIRS = {
    "hyperbolic": (
        'law = "coulomb_hyperbolic"\nforce = 0.4\nstatic_force = 1\nfading_velocity = 0.1',
        OWN.replace('c = "0.2 N s/m"\n', "") + '"fc + (fs - fc)/(1 + speed/vs)"',
    ),
    "stribeck": (
        STRIBECK,
        OWN + '"fc + (fs - fc)*exp(-(speed/vs)^2) + c*speed"',
    ),
}


def end_of(separatrix: Path, folder: Path, friction: str) -> tuple[np.ndarray, int]:
    """Positions and velocities at the end, and the number of events."""
    (folder / "case.toml").write_text(CASE.format(friction=friction))
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", "-q", folder=folder)
    with h5py.File(folder / "out.h5") as file:
        names = ("a_x", "a_v", "b_x", "b_v")
        return np.array([file[name][-1] for name in names]), len(file["event_time"])


@pytest.mark.parametrize("name", PAIRS)
def test_a_law_of_the_catalogue_by_an_expression(separatrix, tmp_path, name):
    catalogue, own = (end_of(separatrix, tmp_path, friction) for friction in PAIRS[name])
    assert catalogue[1] > 10
    assert own[1] == catalogue[1]
    assert own[0] == pytest.approx(catalogue[0], abs=1e-8)


@pytest.mark.parametrize(("force", "allowed"), [
    ("fc*speeed/vs", "speed"), ("fc*speed", "N"), ("-fc", "at least 0"),
])  # fmt: skip
def test_what_is_no_friction_is_rejected_by_its_key(separatrix, tmp_path, force, allowed):
    own = OWN.replace('fs = "1 N"\n', "").replace('c = "0.2 N s/m"\n', "")
    own = own if "vs" in force else own.replace('vs = "0.1 m/s"\n', "")
    (tmp_path / "case.toml").write_text(CASE.format(friction=own + f'"{force}"'))
    ended = run(separatrix, "trajectory", "case.toml", "-o", "out.h5", folder=tmp_path)
    assert ended.code == 65
    assert "friction.a.force" in ended.err
    assert allowed in ended.err


UNLOADED = """
[body.a]
mass = 0.02
[friction.a]
law = "coulomb_load"
between = ["a"]
kinetic_coefficient = 0.4
static_coefficient = 0.5
load = "98*t + 9.8e5*t^2"
[drive.push]
law = "expression"
body = "a"
force = "growth*t"
growth = {rate}
[run]
duration = 1e-3
average = "window"
"""


@pytest.mark.parametrize("rate", [67, -67, 48, -48])
def test_friction_without_a_load_at_the_start(separatrix, tmp_path, rate) -> None:
    # Load and force begin at zero: their rates decide. The body slides until the load has grown.
    (tmp_path / "case.toml").write_text(UNLOADED.format(rate=rate))
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", folder=tmp_path)
    slope, bend = abs(rate) - 0.4 * 98, 0.4 * 9.8e5
    end = 1.5 * slope / bend
    moved = (slope * end**3 / 6 - bend * end**4 / 12) / 0.02 if abs(rate) > 49 else 0.0
    with h5py.File(tmp_path / "out.h5") as file:
        times, x = file["event_time"][()], float(file["x"][-1])
    np.testing.assert_allclose(times, [end] if moved > 0 else [], rtol=1e-9)
    np.testing.assert_allclose(x, np.sign(rate) * moved, rtol=1e-9)
