# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of several bodies with forces that are not linear: events beside those of another simulator."""

import csv
import sys
from math import cos, exp, pi, sin
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import succeed
from scipy.special import mathieu_a

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "referee"))
import random_structures
from structures import Friction, Rigid, Soft, Structure

TIES = """
[body.first]
mass = 1
[body.second]
mass = 1.3
x0 = 0.1
[start]
x0 = 0.3
[drive.force]
law = "force"
body = "second"
amplitude = 0.9
frequency = 0.8
[run]
duration = 12
window = 8
[spring.first]
between = ["first"]
{spring}
[spring.coupling]
between = ["first", "second"]
stiffness = 1.2
"""
STRIBECK = """
[friction.belt]
between = ["first"]
law = "coulomb_stribeck"
force = 0.6
static_force = 1
stribeck_velocity = 0.15
velocity = 0.2
[friction.between]
between = ["first", "second"]
law = "coulomb_hyperbolic"
force = 0.1
static_force = 0.3
fading_velocity = 0.3
"""
HERTZ = """
[contact.soft]
between = ["first", "second"]
law = "hunt_crossley"
stiffness = 2000
damping = 0.2
upper = 0.3
lower = -0.4
[friction.ground]
between = ["first"]
law = "coulomb_viscous"
force = 0.05
damping = 0.1
"""
STOP = """
[contact.stop]
between = ["first", "second"]
law = "newton_linear"
slope = 0.1
upper = 0.25
"""


def forces(restoring):
    """Of the two bodies but for the joints."""

    def force(t, q, v):
        pull = 1.2 * (q[1] - q[0])
        return np.array([restoring(q[0], v[0]) + pull, -pull + 0.9 * cos(0.8 * t)])

    return force


def hertz(p, rate):
    """Hunt and Crossley's force."""
    return 2000 * np.sign(p) * abs(p) ** 1.5 * (1 + 0.2 * rate)


MACHINES = {
    "stribeck": (
        TIES.format(spring="stiffness = 1\ndamping = 0.02") + STRIBECK,
        lambda: Structure(
            [1, 1.3],
            forces(lambda x, v: -x - 0.02 * v),
            [
                Friction([1, 0], lambda u: 0.6 + 0.4 * exp(-u / 0.15), 1.0, 0.2),
                Friction([-1, 1], lambda u: 0.1 + 0.2 / (1 + u / 0.3), 0.3),
            ],
        ),
    ),
    "double well, hertz": (
        TIES.format(spring='law = "polynomial"\nstiffness = -1\ncubic = 1\ndamping = 0.6') + HERTZ,
        lambda: Structure(
            [1, 1.3],
            forces(lambda x, v: x - x**3 - 0.6 * v),
            [Friction([1, 0], lambda u: 0.05 + 0.1 * u, 0.05)],
            soft=[Soft([-1, 1], 0.3, 1, hertz), Soft([-1, 1], -0.4, -1, hertz)],
        ),
    ),
    "modulated mesh, stop": (
        TIES.format(
            spring='law = "polynomial"\nstiffness = 1\ncubic = 0.3\ndamping = 0.05\n'
            "modulation = 0.4\nmodulation_sine = [0, 0.3]"
        )
        + STOP,
        lambda: Structure(
            [1, 1.3],
            lambda t, q, v: np.array(
                [
                    -(q[0] + 0.3 * q[0] ** 3) * (1 + 0.4 * cos(0.8 * t) + 0.3 * sin(1.6 * t))
                    - 0.05 * v[0]
                    + 1.2 * (q[1] - q[0]),
                    -1.2 * (q[1] - q[0]) + 0.9 * cos(0.8 * t),
                ]
            ),
            rigid=[Rigid([-1, 1], 0.25, 1, lambda u: max(0.0, 1 - 0.1 * u))],
        ),
    ),
    "condenser, stop": (
        TIES.format(spring='law = "electrostatic"\nattraction = 0.1\ngap = 4\nmodulation_cosine = [0, -1]')
        + STOP
        + '[spring.ground]\nbetween = ["first"]\nstiffness = 1.1\ndamping = 0.03\n',
        lambda: Structure(
            [1, 1.3],
            lambda t, q, v: np.array(
                [
                    0.1 * (1 - cos(1.6 * t)) / (4 - q[0]) ** 2
                    - 1.1 * q[0]
                    - 0.03 * v[0]
                    + 1.2 * (q[1] - q[0]),
                    -1.2 * (q[1] - q[0]) + 0.9 * cos(0.8 * t),
                ]
            ),
            rigid=[Rigid([-1, 1], 0.25, 1, lambda u: max(0.0, 1 - 0.1 * u))],
        ),
    ),
    "pendulum, stop": (
        TIES.format(spring='law = "pendulum"\nmoment = 3\ndamping = 0.1') + STOP,
        lambda: Structure(
            [1, 1.3],
            forces(lambda x, v: -3 * sin(x) - 0.1 * v),
            rigid=[Rigid([-1, 1], 0.25, 1, lambda u: max(0.0, 1 - 0.1 * u))],
        ),
    ),
}


@pytest.mark.parametrize("name", MACHINES)
def test_events_are_those_of_the_referee(separatrix, name, tmp_path):
    """Every event, in order, to 1e-9 s: scipy locates them no better than its tolerance."""
    text, build = MACHINES[name]
    (tmp_path / "case.toml").write_text(text)
    succeed(separatrix, "trajectory", "case.toml", "--csv", "events.csv", folder=tmp_path)
    with (tmp_path / "events.csv").open() as file:
        # What a joint that stops does to another is an event of its own, at the same time.
        ours = sorted({float(row["time"]) for row in csv.DictReader(file)})
    referee = build()
    referee.run([0.3, 0.1], [0.0, 0.0], 12.0)
    theirs = [at for _, _, at in referee.events]
    assert len(ours) >= 5
    assert ours == pytest.approx(theirs, abs=1e-9)


@pytest.mark.parametrize("spring", ['law = "polynomial"\ncubic = 1', "modulation = 0.5"])
def test_what_nothing_moves_stays(separatrix, spring, tmp_path):
    """No force, no speed, no length that is known: the motion was given up, and the program crashed."""
    (tmp_path / "case.toml").write_text(
        f"""
[body.bob]
mass = 1
[spring.ground]
between = ["bob"]
stiffness = 1
{spring}
[drive.clock]
law = "force"
body = "bob"
frequency = 2
[run]
duration = 20
window = 10
"""
    )
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", folder=tmp_path)
    with h5py.File(tmp_path / "out.h5") as file:
        assert len(file["x"]) > 100
        assert not np.any(file["x"][:])


@pytest.mark.parametrize(("order", "q"), [(1, 0.3), (1, 1.5), (2, 0.8)])
def test_a_modulated_spring_is_mathieus(separatrix, order, q, tmp_path):
    """x'' + (a - 2 q cos 2t) x = 0 at a characteristic number of order n has trace 2 (-1)^n over pi."""
    a = mathieu_a(order, q)
    (tmp_path / "case.toml").write_text(
        f"""
[body.bob]
mass = 1
[spring.ground]
between = ["bob"]
stiffness = {a}
modulation = {-2 * q / a}
[drive.clock]
law = "force"
body = "bob"
frequency = 2
[run]
duration = {pi}
window = {pi}
"""
    )
    trace, balance = 0.0, []
    for x, v in ((1, 0), (0, 1)):
        words = ["--set", f"start.x0={x}", "--set", f"start.v0={v}", "-o", "out.h5", "--force"]
        succeed(separatrix, "trajectory", "case.toml", *words, folder=tmp_path)
        with h5py.File(tmp_path / "out.h5") as file:
            trace += file["v" if v else "x"][-1]
            balance += [file["energy"][-1] - file["energy"][0] - file["drive_work"][-1]]
    assert trace == pytest.approx(2 * (-1) ** order, abs=1e-9)
    assert balance == pytest.approx([0, 0], abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_machines_that_nobody_chose(separatrix, seed, tmp_path):
    """Drawn at random: the referee meets the same events, and no time has many of them."""
    events, lost, of_one_time = random_structures.compared(seed, str(separatrix), tmp_path)
    assert events >= 5
    assert not lost
    assert of_one_time < 8


CAVITY = """
[body.frame]
mass = 1
[body.particle]
mass = 1
{contacts}
[drive.frame]
law = "motion"
body = "frame"
amplitude = 0.5
frequency = 1
[watch]
body = "particle"
[start]
x0 = 0.1
v0 = 1
[run]
duration = 40
window = 7
"""
STOP_OF = """
[contact.{name}]
between = ["frame", "particle"]
law = "newton"
restitution = 0.6
{stops}
"""


def test_the_work_of_moving_stops_is_that_of_each(separatrix, tmp_path):
    """Two stops that move, as one contact or as two: the same losses, and the same work of the drive."""
    both = STOP_OF.format(name="cavity", stops="upper = 1\nlower = -1")
    two = STOP_OF.format(name="floor", stops="lower = -1") + STOP_OF.format(name="roof", stops="upper = 1")
    books = []
    for contacts in (both, two):
        (tmp_path / "case.toml").write_text(CAVITY.format(contacts=contacts))
        succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", folder=tmp_path)
        with h5py.File(tmp_path / "out.h5") as file:
            books.append([file.attrs[f"energy_{name}"] for name in ("lost_to_contacts", "put_in")])
    assert books[0][0] > 1
    assert books[0] == pytest.approx(books[1], rel=1e-9)
