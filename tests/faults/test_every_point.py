# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every point of a map has a label or a reason, also where the machine is as unkind as may be."""

from collections import Counter

import h5py
import life
import numpy as np
import pytest
from program import CASE

MAP = [
    "--set",
    "axis[1].count=13",
    "--set",
    "axis[2].count=11",
    "--set",
    "run.duration=20",
    "--set",
    "attractors.sample=12",
]
FRICTIONLESS = "friction={law='none'}"
HARMONIC = "drive={law='harmonic', ratio=%s, amplitude=%s}"
CASES = {
    "restitution 0": ["contact.restitution=0"],
    "restitution 1": ["contact.restitution=1"],
    "no friction": [FRICTIONLESS],
    "no friction, restitution 1": [FRICTIONLESS, "contact.restitution=1"],
    "zero friction coefficient": ["friction.kinetic_coefficient=0"],
    "friction that holds everything": ["friction.kinetic_coefficient=50"],
    "resonance without friction or barrier": [FRICTIONLESS, "contact={law='none'}", HARMONIC % (1, 0.1)],
    "leaves the domain": [FRICTIONLESS, "contact={law='none'}", HARMONIC % (1, 0.1), "run.domain=1.2"],
    "barrier at the rest position": ["contact.upper=0.4", "restoring.free_length=0.4", "axis[1].to=0.4"],
    "barriers close together": [
        "contact.upper=1.1",
        "contact.lower=1.099",
        "axis[1].from=1.099",
        "start.x0=1.0995",
    ],
    "barriers at one position": [
        "contact.upper=0.5",
        "contact.lower=0.5",
        "axis[1]={name='v0', from=-6, to=6, count=13}",
        "axis[2]={name='crank_angle', from=0, to=6, count=11}",
        "start.x0=0.5",
    ],
    "huge stiffness": ["restoring.stiffness=1e12", "run.duration=2e-4"],
    "tiny stiffness": ["restoring.stiffness=1e-6", "run.duration=6e4"],
    "tiny event budget": ["integrator.event_budget=1"],
    "small event budget": ["integrator.event_budget=40"],
    "very fast drive": ["drive.ratio=1000", "run.duration=0.1"],
    "very slow drive": ["drive.ratio=0.01", "run.duration=100"],
    "no drive": ["drive={law='none'}"],
    "heavy body": ["body.mass=1e9", "run.duration=2e5"],
    "light body": ["body.mass=1e-9", "run.duration=5e-4"],
    "no gravity": ["body.gravity=0"],
    "huge speeds": ["axis[2].from=-1e9", "axis[2].to=1e9"],
    "adaptive, restitution 0": ["integrator.flight='adaptive'", "contact.restitution=0"],
    "adaptive, coarse": ["integrator.flight='adaptive'", "integrator.tolerance=1e-3"],
    "adaptive, huge speeds": [
        "integrator.flight='adaptive'",
        "axis[2].from=-1e9",
        "axis[2].to=1e9",
        "integrator.event_budget=1000",
    ],
    "stribeck, narrow layer": [
        "friction={law='coulomb_stribeck', kinetic_coefficient=0.2, static_coefficient=0.4,"
        " stribeck_velocity=1e-9}"
    ],
    "stribeck, steep": [
        "friction={law='coulomb_stribeck', kinetic_coefficient=0.1, static_coefficient=5,"
        " stribeck_velocity=0.1, stribeck_exponent=4}"
    ],
    "no extension": ["run.extension=1", "attractors.sample=1"],
    "a window as short as it can be": ["run.window=1e-9"],
}
# The short form; the long one takes all.
FEW = [
    "restitution 0",
    "restitution 1",
    "leaves the domain",
    "barriers at one position",
    "huge stiffness",
    "tiny event budget",
    "huge speeds",
]
SETTLED, TIME_OVER, UNRESOLVED = 1, 2, 0
ENDED = (SETTLED, TIME_OVER)


@pytest.mark.parametrize("name", CASES)
def test_codes_add_up(separatrix, tmp_path, figures, long_if, name):
    long_if(name not in FEW)
    # Without [sweep], whose bounds would have to follow.
    life.write_case(tmp_path, CASE[: CASE.index("[sweep]")])
    settings = [word for setting in CASES[name] for word in ("--set", setting)]
    command = ["basin", "case.toml", *MAP, *settings, "--partial", "-o", life.NAME]
    outcome = life.run(separatrix, *command, folder=tmp_path, timeout=20)
    assert outcome.code == 0, outcome
    with h5py.File(tmp_path / life.NAME) as file:
        reason, regime, attractor = (file[key][()].ravel() for key in ("reason", "regime", "attractor"))
        codes, meanings = (file["reason"].attrs[key] for key in ("flag_values", "flag_meanings"))
        codes, meanings = (file["reason"].attrs[key] for key in ("flag_values", "flag_meanings"))
        reasons = dict(zip(codes, meanings.split(), strict=True))
        regimes = set(file["regime"].attrs["flag_values"])
        # A map without attractors has no catalogue.
        known = set(file["catalogue/attractor"][()]) if "catalogue" in file else set()
        captured = file["catalogue/count"][()].sum() if "catalogue" in file else 0
    points = reason.size
    counts = Counter(reasons[code] for code in reason)
    assert points == 13 * 11
    assert counts.total() == points
    assert counts["not_run"] == 0
    assert set(regime) <= regimes
    # Captured or run to the end: a regime. Given up: none, and no label.
    assert np.all(attractor[reason == SETTLED] > 0)
    assert np.array_equal(regime == UNRESOLVED, ~np.isin(reason, ENDED))
    assert not np.any(attractor[regime == UNRESOLVED])
    assert set(attractor[attractor > 0]) <= known
    assert captured == np.sum(attractor > 0)
    life.sound(separatrix, tmp_path)
    figures.update(case=name, points=int(points), reasons=counts)
