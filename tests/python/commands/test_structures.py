# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of several bodies through the whole program: files, ranks, quadruple precision."""

import csv
import re

import h5py
import numpy as np
import pytest
from program import differences, run, succeed

SMALL = ["--set", "axis[1].count=9", "--set", "axis[2].count=9"]


def test_map_of_four_dimensions(mpi_separatrix, source_dir, tmp_path):
    """Two attractors, the same bits on two ranks, and the labels of quadruple precision."""
    case = source_dir / "examples" / "structure_two_masses.toml"
    for ranks in (1, 2):
        path = tmp_path / f"{ranks}.h5"
        succeed(mpi_separatrix, "basin", case, "-o", path, *SMALL, folder=tmp_path, ranks=ranks)
    assert differences(tmp_path / "1.h5", tmp_path / "2.h5") == []
    with h5py.File(tmp_path / "1.h5") as file:
        assert set(np.unique(file["attractor"])) == {1, 2}
    text = succeed(mpi_separatrix, "verify", tmp_path / "1.h5", "--sample", "8", folder=tmp_path).out
    assert "0 differ from the file" in text
    assert " 0 label flips" in text


def test_bodies_have_columns_and_the_book_closes(separatrix, source_dir, tmp_path):
    for example, bodies, joints in (
        ("structure_blocks_on_a_belt", ("first", "second"), ["friction.first", "friction.second"]),
        ("structure_impact_damper", ("structure", "particle"), ["contact.cavity"]),
        ("structure_capsule", ("shell", "inner"), ["friction.ground", "contact.stop"]),
    ):
        path = tmp_path / f"{example}.h5"
        succeed(
            separatrix, "trajectory", source_dir / "examples" / f"{example}.toml", "-o", path, folder=tmp_path
        )
        with h5py.File(path) as file:
            watched = "particle" if "particle" in bodies else bodies[0]
            assert np.array_equal(file["x"], file[f"{watched}_x"])
            assert {f"{name}_v" for name in bodies} <= set(file)
            assert file["event_joint"].attrs["flag_meanings"].split() == joints
            assert abs(file.attrs["energy_closing_error"]) < 1e-9 * max(1, file.attrs["energy_put_in"])
            assert file.attrs["energy_put_in"] == pytest.approx(
                file.attrs["energy_end"]
                - file.attrs["energy_start"]
                + file.attrs["energy_lost_to_friction"]
                + file.attrs["energy_lost_to_damping"]
                + file.attrs["energy_lost_to_contacts"],
                rel=1e-9,
            )


def test_progress_of_the_capsule(separatrix, source_dir, tmp_path):
    """Forward with a heavy shell, backward with a light one."""
    for mass, progress in ((5, 1.158146350), (2, -0.292790117)):
        path = tmp_path / f"capsule{mass}.h5"
        case = source_dir / "examples" / "structure_capsule.toml"
        words = ["--set", f"body.shell.mass={mass}", "--set", "run.duration=2500", "--force"]
        succeed(separatrix, "trajectory", case, "-o", path, *words, folder=tmp_path)
        with h5py.File(path) as file:
            samples = 200
            period = file.attrs["drive_period"]
            x = file["shell_x"][:]
            time = file["time"][:]
            per_period = round(period / (time[1] - time[0]))
            assert per_period == samples
            last = (len(x) - 2) // per_period * per_period
            assert x[last] - x[last - per_period] == pytest.approx(progress, abs=2e-8)


def test_a_restitution_at_a_flexible_point_is_warned_of(separatrix, source_dir, tmp_path):
    """All modes of a cantilever move its tip alike: half of what yields are the upper half of them."""
    case = source_dir / "examples" / "validation" / "structures" / "cantilever.toml"
    text = case.read_text()
    (tmp_path / "one.toml").write_text(text)
    four = text.replace("frequency = [1]", "frequency = [1, 6.26689, 17.5475, 34.3861]")
    (tmp_path / "four.toml").write_text(four.replace("[2]", "[2, -2, 2, -2]"))
    short = ["--set", "run.duration=14", "--set", "run.window=7"]
    assert "warning" not in succeed(separatrix, "trajectory", "one.toml", *short, folder=tmp_path).out
    output = succeed(separatrix, "trajectory", "four.toml", *short, folder=tmp_path).out
    assert "warning: contact.stop: the upper half of the modes makes 50 %" in output


def test_the_attractor_of_nine_bodies_is_found(separatrix, tmp_path):
    """They have 18 coordinates on the section."""
    bodies = "".join(
        f'[body.b{i}]\nmass = 1\n[spring.s{i}]\nbetween = ["b{i}"]\nstiffness = {i}\ndamping = 0.1\n'
        for i in range(1, 10)
    )
    axes = "".join(f'[[axis]]\nname = "{name}"\nfrom = 0\nto = 1\ncount = 2\n' for name in ("x0", "v0"))
    drive = '[drive.force]\nlaw = "force"\nbody = "b1"\namplitude = 1\nfrequency = 1\n'
    (tmp_path / "case.toml").write_text(bodies + drive + "[run]\nduration = 20\nwindow = 7\n" + axes)
    output = succeed(separatrix, "basin", "case.toml", folder=tmp_path).out
    assert "1 attractor in 1 slice discovered" in output
    assert "no attractors are looked for" not in output


RING = """
[body.a]
mass = 1
[body.b]
mass = 1.3
[body.c]
mass = 0.7
[spring.a]
between = ["a"]
stiffness = 20
damping = 0.2
[spring.b]
between = ["b"]
stiffness = 30
[spring.c]
between = ["c"]
stiffness = 10
[friction.ab]
between = ["a", "b"]
force = 1.0
[friction.bc]
between = ["b", "c"]
force = 0.8
[friction.ca]
between = ["c", "a"]
force = 0.9
static_force = 1.3
[drive.push]
body = "a"
law = "force"
frequency = 3
amplitude = 6
[start]
v0 = 0.3
[run]
duration = 60
"""


def test_events_of_a_ring_of_friction_are_those_of_what_moves(separatrix, tmp_path):
    """A joint slides from its release to its stick and stands still else, also where others hold it."""
    (tmp_path / "ring.toml").write_text(RING)
    succeed(separatrix, "trajectory", "ring.toml", "--csv", "events.csv", folder=tmp_path)
    with (tmp_path / "events.csv").open() as file:
        events = list(csv.DictReader(file))
    for joint in (1, 2, 3):
        mine = [event for event in events if float(event["joint"]) == joint]
        assert any(event["kind"] == "release" for event in mine)
        slides = mine[0]["kind"] != "release"
        for before, event in zip([mine[0], *mine], mine, strict=False):
            assert (event["kind"] == "release") != slides, f"joint {joint} at {event['time']} s"
            moved = abs(float(event["joint_x"]) - float(before["joint_x"]))
            assert event is before or (moved > 1e-9) == slides
            slides = event["kind"] != "stick"


PULLED = """
[body.box]
mass = 1
[friction.one]
between = ["{surface}", "box"]
{one}
[friction.two]
between = ["{surface}", "box"]
{two}
[run]
duration = 3
"""
FORCE = """
[drive.force]
law = "force"
body = "box"
sine = [2]
frequency = 1
"""
GIVEN = """
[body.belt]
mass = 1
[drive.belt]
law = "motion"
body = "belt"
sine = [-2]
frequency = 1
[start]
v0 = -2
[watch]
body = "box"
"""
PLAIN = "force = 0\nstatic_force = {}"
STRIBECK = 'law = "coulomb_stribeck"\nforce = 0.5\nstatic_force = {}\nstribeck_velocity = {}'
FADING = 'law = "coulomb_hyperbolic"\nforce = 0.5\nstatic_force = {}\nfading_velocity = {}'
DRAG = 'law = "coulomb_quadratic"\nforce = {}\ndrag = 2'


@pytest.mark.parametrize(
    ("one", "two"),
    [
        (STRIBECK.format(1, 0.3), PLAIN.format(0.5)),
        (PLAIN.format(0.5), STRIBECK.format(1, 0.3)),
        (STRIBECK.format(0.8, 0.3), STRIBECK.format(0.7, 0.4)),
        (STRIBECK.format(0.8, 0.3), STRIBECK.format(0.7, 0.3)),
        (FADING.format(0.8, 0.3), FADING.format(0.7, 0.3)),
        (FADING.format(1, 0.3), "force = 0.5"),
        (DRAG.format(1), STRIBECK.format(0.5, 0.3)),
    ],
)
def test_friction_on_one_surface_adds_up(separatrix, tmp_path, one, two):
    """A box lets go where its force reaches the sum of the break-away forces, whatever the laws."""
    case, path = tmp_path / "case.toml", tmp_path / "a.h5"
    case.write_text(PULLED.format(surface="ground", one=one, two=two) + FORCE)
    succeed(separatrix, "trajectory", case, "-o", path, folder=tmp_path)
    with h5py.File(path) as file:
        assert file["event_time"][0] == pytest.approx(np.arcsin(0.75), abs=1e-12)


def test_friction_on_one_moving_body_adds_up(separatrix, tmp_path):
    """The same between a box and a belt whose motion is given, in either order of the two."""
    case, path = tmp_path / "case.toml", tmp_path / "a.h5"
    text = PULLED.format(surface="belt", one=PLAIN.format(1), two=PLAIN.format(0.5))
    case.write_text(text.replace('["belt", "box"]', '["box", "belt"]', 1) + GIVEN)
    succeed(separatrix, "trajectory", case, "-o", path, folder=tmp_path)
    with h5py.File(path) as file:
        assert file["event_time"][0] == pytest.approx(np.arcsin(0.75), abs=1e-12)


def test_friction_that_does_not_add_up_is_refused(separatrix, tmp_path):
    case = tmp_path / "case.toml"
    text = PULLED.format(surface="ground", one=FADING.format(1, 0.3), two=PLAIN.format(0.5))
    case.write_text(text + FORCE)
    done = run(separatrix, "trajectory", case, "--validate", folder=tmp_path)
    assert done.code == 65
    assert "friction.two.law': found friction on the surface of friction.one" in done.err


def test_a_chatter_is_reported_when_it_is_over(separatrix, tmp_path):
    """Each of two balls comes to rest where its bounces add up to; events stand in the order of time."""
    heights = {"one": 1.0, "two": 0.9992}
    lines = ["[start]", "x0 = 1.0", "[run]", "duration = 10"]
    for name, height in heights.items():
        lines += [f"[body.{name}]", "mass = 1", "load = -10", *([f"x0 = {height}"] if name == "two" else [])]
        lines += [
            f"[contact.{name}]",
            f'between = ["{name}"]',
            'law = "newton"',
            "restitution = 0.8",
            "lower = 0",
        ]
    (tmp_path / "case.toml").write_text('title = "Two balls"\n' + "\n".join(lines) + "\n")
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", folder=tmp_path)
    with h5py.File(tmp_path / "out.h5") as file:
        names = file["event_kind"].attrs["flag_meanings"].split()
        time, kind, joint = (file[name][:] for name in ("event_time", "event_kind", "event_joint"))
        assert file["event_x"][:].min() > -1e-15
    assert np.all(np.diff(time) >= 0)
    ends = {int(joint[k]): time[k] for k in np.flatnonzero(kind == names.index("chatter_lower") + 1)}
    for number, height in enumerate(heights.values(), start=1):
        fall = np.sqrt(2 * height / 10)
        assert ends[number] == pytest.approx(fall * (1 + 2 * 0.8 / (1 - 0.8)), abs=1e-12)
    assert "invariants hold" in succeed(separatrix, "verify", "out.h5", folder=tmp_path).out


CURVED = """
title = "A curved spring, a belt and a stop"

[body.block]
mass = 0.5

[spring.curved]
between = ["ground", "block"]
law = "polynomial"
stiffness = 1.0
quadratic = 0.3
cubic = 3.0
damping = 0.05

[friction.belt]
between = ["ground", "block"]
law = "coulomb"
force = 0.422
velocity = -1.0

[contact.stop]
between = ["ground", "block"]
law = "newton"
restitution = 0.3
lower = -0.366

[drive.shaker]
law = "force"
body = "block"
amplitude = 0.84
angle = 0.3
frequency = 4.9

[start]
v0 = -1.438

[run]
duration = 12

[integrator]
event_budget = 3000
"""


def test_a_chatter_under_a_curved_spring_ends(separatrix, tmp_path):
    """No impact beyond the stop; within a chatter none is faster than the rebound before it."""
    (tmp_path / "case.toml").write_text(CURVED)
    out = succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", folder=tmp_path).out
    assert "time_over" in out
    with h5py.File(tmp_path / "out.h5") as file:
        names = ["no event", *file["event_kind"].attrs["flag_meanings"].split()]
        kinds = [names[kind] for kind in file["event_kind"]]
        before, after, time = (
            file[f"event_{name}"][:] for name in ("joint_v_before", "joint_v_after", "time")
        )
        assert file["x"][:].min() > -0.366 - 1e-15
    assert kinds.count("chatter_lower") >= 3
    pairs = [
        (k, k + 1)
        for k in range(len(kinds) - 1)
        if kinds[k] == kinds[k + 1] == "impact_lower" and time[k + 1] - time[k] < 1e-3
    ]
    assert len(pairs) > 20
    assert all(-before[later] <= after[one] * (1 + 1e-6) for one, later in pairs)


def test_slow_transients_are_no_attractors(separatrix, tmp_path):
    """Motions that still come together are reported in a line, and not counted as attractors."""
    (tmp_path / "case.toml").write_text(
        """
title = "Two bodies that come to one motion slowly"

[body.first]
mass = 1.0

[body.second]
mass = 2.0
load = -0.198
v0 = -1.822

[spring.first]
between = ["ground", "first"]
stiffness = 40.0
damping = 0.1

[friction.ground]
between = ["ground", "second"]
law = "elastic_coulomb"
force = 0.956
stiffness = 15.0

[friction.between]
between = ["first", "second"]
law = "elastic_coulomb"
force = 1.16
stiffness = 15.0

[drive.shaker]
law = "force"
body = "first"
amplitude = 3.24
angle = 0.3
frequency = 1.73

[run]
duration = 60

[attractors]
sample = 8
second_look = 0

[[axis]]
name = "x0"
from = -0.008
to = 0.009
count = 3

[[axis]]
name = "v0"
from = -1.7
to = 1.9
count = 3
"""
    )
    out = succeed(separatrix, "basin", "case.toml", "-o", "map.h5", folder=tmp_path).out
    found = re.search(r"^0 attractors and (\d+) motions not known to be periodic in 1 slice discovered", out)
    assert found is not None, out
    assert re.search(
        rf"^  1 to {found[1]}: .*, amplitude 0.07\d+ to 0.07\d+ m, .*come together by 0.99", out, re.M
    )
    assert "an attractor that was not found" not in out


def cradle(masses, restitution, in_sequence, start):
    """A row of balls of equal period that touch at rest: x0 of each."""
    text = f"[body]\nin_sequence = {in_sequence}\n"
    for i, mass in enumerate(masses):
        text += f"[body.b{i}]\nmass = {mass}\n" + (f"x0 = {start[i]}\n" if i else "")
        text += f'[spring.b{i}]\nbetween = ["b{i}"]\nstiffness = {9.81 * mass!r}\n'
        if i:
            text += f'[contact.c{i}]\nbetween = ["b{i - 1}", "b{i}"]\nlaw = "newton"\n'
            text += f"restitution = {restitution}\nlower = 0\n"
    return text + f"[start]\nx0 = {start[0]}\n[run]\nduration = 2.9\n"


def pairwise(v, masses, restitution):
    """Velocities after impacts of pairs, the fastest first."""
    v = np.array(v, float)
    while (speed := v[:-1] - v[1:]).max() > 1e-9:
        i = int(speed.argmax())
        impulse = (1 + restitution) * speed[i] / (1 / masses[i] + 1 / masses[i + 1])
        v[i] -= impulse / masses[i]
        v[i + 1] += impulse / masses[i + 1]
    return v


@pytest.mark.parametrize(
    ("masses", "restitution", "start"),
    [
        ([1] * 5, 1.0, [-0.1, 0, 0, 0, 0]),
        ([1] * 8, 1.0, [-0.1, -0.1, -0.1, 0, 0, 0, 0, 0]),
        ([1] * 4, 0.9, [0, 0, 0, 0.2]),
        ([1, 2, 0.7, 1.3], 0.9, [-0.1, 0, 0, 0.05]),
        ([1] * 4, 0.9, [-0.3, -0.3, -0.3, 0]),
    ],
)
def test_newtons_cradle(separatrix, tmp_path, masses, restitution, start):
    """All come back at once, every half period after the first quarter; impacts of pairs in between."""
    (tmp_path / "case.toml").write_text(cradle(masses, restitution, 1, start))
    output = succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", folder=tmp_path).out
    assert "note:" not in output
    rate = np.sqrt(9.81)
    with h5py.File(tmp_path / "out.h5") as file:
        assert file.attrs["reason"] == "time_over"
        assert abs(file.attrs["energy_closing_error"]) < 1e-12
        time = file["time"][:]
        found = np.array([file[f"b{i}_v"][:] for i in range(len(masses))])
        assert file["event_time"][0] == pytest.approx(np.pi / 2 / rate, abs=1e-9)
    v = -np.array(start) * rate
    for turn in range(3):
        v = pairwise(v, masses, restitution)
        at = np.searchsorted(time, (0.5 + turn) * np.pi / rate) + 5
        if at >= len(time):
            break
        assert found[:, at] / np.cos(rate * time[at] - (0.5 + turn) * np.pi) == pytest.approx(v, abs=1e-8)
        v = -v
    assert turn == 2


def test_a_row_of_bodies_that_touch_is_noted(separatrix, tmp_path):
    """Where impacts of contacts that touch come at once, by a run and by its check; not of two balls."""
    for balls, in_sequence, noted in ((4, 0, True), (4, 1, False), (2, 0, False)):
        (tmp_path / "case.toml").write_text(cradle([1] * balls, 0.5, in_sequence, [-0.1] + [0] * (balls - 1)))
        for words in (["--validate"], ["--force"]):
            output = succeed(separatrix, "trajectory", "case.toml", *words, folder=tmp_path).out
            assert ("note: bodies touch in a row (contact.c2, contact.c3)" in output) == noted
