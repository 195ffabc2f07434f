# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured forces on bodies of several, and measured motions: a record is one period, by its harmonics."""

import h5py
import numpy as np
import pytest
from program import run, succeed

CASE = """\
[body.first]
mass = 1
[body.second]
mass = 0.5
[spring.ground]
between = ["first"]
stiffness = 4
damping = 0.3
[spring.between]
between = ["first", "second"]
stiffness = 2
damping = 0.1
[contact.stop]
between = ["second"]
law = "newton"
restitution = 0.7
upper = 0.6
[drive.shaker]
law = "force"
body = "first"
{drive}
[run]
duration = 30
window = 10
average = "window"
"""
STEP, SAMPLES = 0.05, 80


def _write(folder, force):
    rows = "".join(f"{float(k * STEP)!r},{float(value)!r}\n" for k, value in enumerate(force))
    (folder / "force.csv").write_text("# a shaker\nt,force\n" + rows)


def test_a_record_is_its_harmonics(separatrix, tmp_path):
    """The same motion as that of the series which the record samples."""
    angle = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    _write(tmp_path, 0.2 + np.cos(angle) - 0.5 * np.sin(2 * angle) + 0.25 * np.cos(7 * angle))
    series = f"frequency = {2 * np.pi / (STEP * SAMPLES)!r}\nmean = 0.2\n"
    series += "cosine = [1, 0, 0, 0, 0, 0, 0.25]\nsine = [0, -0.5]"
    motions = []
    for drive in ('record = "force.csv"', series):
        (tmp_path / "case.toml").write_text(CASE.format(drive=drive))
        succeed(separatrix, "trajectory", "case.toml", "--force", "-o", "motion.h5", folder=tmp_path)
        with h5py.File(tmp_path / "motion.h5") as file:
            motions.append((file["event_time"][:], file["second_x"][:]))
    assert len(motions[0][0]) > 5
    assert motions[0][0] == pytest.approx(motions[1][0], abs=1e-9)
    assert motions[0][1] == pytest.approx(motions[1][1], abs=1e-9)


def test_a_motion_is_recorded(separatrix, tmp_path):
    """A foot that moves as recorded moves a body as one that moves by the series; a force is no motion."""
    angle = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    motion = 0.2 + np.cos(angle) - 0.5 * np.sin(2 * angle)
    rows = "".join(f"{float(k * STEP)!r},{float(value)!r}\n" for k, value in enumerate(motion))
    (tmp_path / "foot.csv").write_text("t,x\n" + rows)
    _write(tmp_path, motion)
    case = "[body.ball]\nmass = 1\n[body.foot]\nmass = 1\n[spring.s]\n"
    case += 'between = ["foot", "ball"]\nstiffness = 4\ndamping = 0.3\n'
    case += '[drive.f]\nlaw = "motion"\nbody = "foot"\n'
    series = f"frequency = {2 * np.pi / (STEP * SAMPLES)!r}\nmean = 0.2\ncosine = [1]\nsine = [0, -0.5]\n"
    motions = []
    for drive in ('record = "foot.csv"\n', series):
        (tmp_path / "case.toml").write_text(case + drive)
        succeed(separatrix, "trajectory", "case.toml", "--force", "-o", "motion.h5", folder=tmp_path)
        with h5py.File(tmp_path / "motion.h5") as file:
            motions.append(file["x"][:])
    assert motions[0] == pytest.approx(motions[1], abs=1e-9)
    (tmp_path / "case.toml").write_text(case + 'record = "force.csv"\n')
    outcome = run(separatrix, "trajectory", "case.toml", "--force", folder=tmp_path)
    assert outcome.code == 65
    assert "allowed one with columns t and x" in outcome.err


def test_one_file_has_one_period(separatrix, tmp_path):
    """A record of one body and of parts: a last sample that is the first once more begins the next period."""
    one = '[body]\nmass = 1\n[restoring]\nlaw = "linear"\nstiffness = 4\n'
    one += '[friction]\nlaw = "viscous"\ndamping = 0.3\n'
    one += '[drive]\nlaw = "measured_force"\nforce = "force.csv"\n'
    parts = '[body.ball]\nmass = 1\n[spring.s]\nbetween = ["ball"]\nstiffness = 4\ndamping = 0.3\n'
    parts += '[drive.f]\nlaw = "force"\nbody = "ball"\nrecord = "force.csv"\n'
    for more, period in ((1, STEP * SAMPLES), (0, STEP * SAMPLES)):
        _write(tmp_path, np.sin(2 * np.pi * np.arange(SAMPLES + more) / SAMPLES))
        amplitudes = []
        for text in (one, parts):
            (tmp_path / "case.toml").write_text(text + "[run]\nduration = 80\n")
            ended = succeed(
                separatrix, "trajectory", "case.toml", "--force", "-o", "motion.h5", folder=tmp_path
            )
            assert "assumed: " in ended.out
            assert f"period {period:.5f} s" in ended.out.splitlines()[0]
            with h5py.File(tmp_path / "motion.h5") as file:
                assert file.attrs["drive_period"] == pytest.approx(period, rel=1e-12)
                amplitudes.append(file.attrs["amplitude"])
        assert amplitudes[0] == pytest.approx(amplitudes[1], rel=2e-3)


def test_what_is_refused(separatrix, tmp_path):
    """What the harmonics leave is reported; a record is not beside a series, and has to be there."""
    _write(tmp_path, np.where(np.arange(SAMPLES) == 3, 1.0, 0.0))

    def refusal(drive):
        (tmp_path / "case.toml").write_text(CASE.format(drive=drive))
        outcome = run(separatrix, "trajectory", "case.toml", "--force", folder=tmp_path)
        assert outcome.code in (65, 66)
        return outcome.err

    assert "'drive.shaker.record': found a record of which 32 harmonics leave 4" in refusal(
        'record = "force.csv"'
    )
    assert "'drive.shaker.mean': found beside a record" in refusal('record = "force.csv"\nmean = 1')
    assert "nowhere.csv" in refusal('record = "nowhere.csv"')
    # decimal commas make more columns, which were read as other numbers
    for row, expected in (
        ("1,1,5", "found 3 values in '1,1,5', allowed 2 like the header"),
        ("1", "found 1 values in '1', allowed 2"),
        ("1,nan", "found 'nan', allowed a finite number"),
        ("1,1-5", "found '1-5', allowed a finite number"),
    ):
        (tmp_path / "force.csv").write_text(f"t,force\n0,0\n{row}\n2,2\n")
        assert f"force.csv:3: {expected}" in refusal('record = "force.csv"')
    _write(tmp_path, np.where(np.arange(SAMPLES) == 3, 1.0, 0.0))
    (tmp_path / "case.toml").write_text(CASE.format(drive='record = "force.csv"\nharmonics = 8'))
    succeed(separatrix, "trajectory", "case.toml", "--force", folder=tmp_path)
