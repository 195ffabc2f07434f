# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction with memory in a case of one body: the laws that several bodies have."""

import json

import h5py
import pytest
from program import run, succeed

# The second of a kind has the defaults.
LAWS = {
    "dahl": ("exponent = 1.5", ""),
    "bouc_wen": ("exponent = 1.5\nshape = 0.6", ""),
    "lugre": ("static_force = 1.5\nstribeck_velocity = 0.05\nbristle_damping = 3\ndamping = 0.1", ""),
}
LUGRE = f'[friction]\nlaw = "lugre"\nstiffness = 100\nforce = 1\n{LAWS["lugre"][0]}\n'
FRICTION = 'law = "{law}"\nvelocity = 0.1\nstiffness = 100\nforce = 1\n'
MOTION = """\
amplitude = 1.5
frequency = 1.1
[start]
v0 = 0.3
[run]
duration = 6
average = "window"
"""
ONE = f"""
[body]
mass = 1
[restoring]
law = "linear"
stiffness = 2
[drive]
law = "force"
{MOTION}[friction]
"""
PARTS = f"""
[body.m]
mass = 1
[spring.k]
between = ["m"]
stiffness = 2
[drive.f]
law = "force"
body = "m"
{MOTION}[friction.f]
between = ["m"]
"""
PENDULUM = """
[body]
mass = 1
[restoring]
law = "pendulum"
moment = "9 N m"
[start]
x0 = "30 deg"
[run]
duration = 2
[friction]
law = "dahl"
stiffness = "100 N m/rad"
force = "0.1 N m"
exponent = 2
"""


def last(separatrix, folder, text: str, *more: str) -> tuple[float, float]:
    """Position and velocity at the end of a trajectory."""
    (folder / "case.toml").write_text(text)
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", *more, folder=folder)
    with h5py.File(folder / "out.h5") as file:
        return float(file["x"][-1]), float(file["v"][-1])


@pytest.mark.parametrize(("law", "more"), [(law, more) for law in LAWS for more in LAWS[law]])
def test_one_body_moves_like_a_body_with_a_joint(separatrix, tmp_path, law, more):
    """To rounding, with the belt of the friction."""
    friction = FRICTION.format(law=law) + more + "\n"
    one = last(separatrix, tmp_path, ONE + friction)
    assert one == pytest.approx(last(separatrix, tmp_path, PARTS + friction), abs=1e-10)
    assert one != pytest.approx(
        last(separatrix, tmp_path, ONE + friction, "--set", "friction.force=0.9"), abs=1e-3
    )


def test_a_pendulum_has_moments(separatrix, tmp_path):
    """Units of the keys, and of the deflection."""
    last(separatrix, tmp_path, PENDULUM)
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["state_deflection"].attrs["units"] in ("rad", b"rad")
        assert 9e-4 < float(abs(file["state_deflection"][()]).max()) <= 1e-3


def test_the_drive_and_the_damper_of_a_pendulum_are_moments(separatrix, tmp_path):
    """N m was rejected, and N taken for it."""
    drive = '[drive]\nlaw = "force"\namplitude = "0.2 N m"\nfrequency = 1\n'
    damped = (
        PENDULUM[: PENDULUM.index("[friction]")] + '[friction]\nlaw = "viscous"\ndamping = "0.1 N m s/rad"\n'
    )
    (tmp_path / "case.toml").write_text(damped + drive)
    succeed(separatrix, "trajectory", "case.toml", "--validate", folder=tmp_path)
    (tmp_path / "case.toml").write_text(damped + drive.replace("N m", "N"))
    found = run(separatrix, "trajectory", "case.toml", "--validate", folder=tmp_path)
    assert "key 'drive.amplitude': found \"0.2 N\", allowed a number in N m" in found.err


def test_maps_over_the_friction_and_the_deflection(separatrix, tmp_path):
    """Axes of both. The force that holds a block depends on where its bristles begin."""
    axes = "".join(
        f'\n[[axis]]\nname = "{name}"\nvalues = {values}\n'
        for name, values in (
            ("friction.force", [1, 2]),
            ("state.deflection.start", [0, 0.005]),
            ("x0", [0, 0.2]),
        )
    )
    (tmp_path / "map.toml").write_text(ONE + FRICTION.format(law="dahl") + axes)
    succeed(separatrix, "basin", "map.toml", "--set", "attractors.sample=4", "-o", "map.h5", folder=tmp_path)
    with h5py.File(tmp_path / "map.h5") as file:
        resolved = file["provenance"].attrs["resolved_case"]
        assert file["attractor"].size == 8
    resolved = resolved.decode() if isinstance(resolved, bytes) else str(resolved)
    assert 'law = "dahl"' in resolved
    assert "deflection]" not in resolved


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ('[state.deflection]\nrate = "v"\n', "key 'state.deflection': found the name"),
        (
            '[force.friction]\nforce = "v"\n',
            "key 'force.friction': found the name that friction with memory has",
        ),
        (
            LUGRE.replace("1.5", "0.5"),
            "key 'friction.static_force': found 0.5 N, allowed at least the force 1.0",
        ),
        ("[effect.coulomb]\nforce = 1\n", "key 'effect.coulomb': not allowed with laws by expressions"),
    ],
)
def test_what_does_not_go_with_it(separatrix, tmp_path, more, problem):
    """Names that are taken, and effects."""
    text = FRICTION.format(law="dahl") + more
    if "law =" in more:
        text = more.partition("[friction]\n")[2]
    (tmp_path / "case.toml").write_text(ONE + text)
    found = run(separatrix, "trajectory", "case.toml", "--validate", folder=tmp_path)
    assert found.code == 65
    assert problem in found.err


@pytest.mark.parametrize("law", ["dahl", "bouc_wen"])
def test_exponents(separatrix, tmp_path, law):
    """Derivatives of powers have switches of their own: the command ended in a fault of memory."""
    (tmp_path / "case.toml").write_text(ONE + FRICTION.format(law=law))
    out = succeed(separatrix, "stability", "case.toml", "--periods", "64", "--json", folder=tmp_path).out
    found = [json.loads(line) for line in out.splitlines() if '"event": "exponent"' in line]
    assert [one["number"] for one in found] == [1, 2, 3]
    # Both of the oscillation, and the fast one of the deflection.
    assert found[0]["value"] == pytest.approx(-0.34, abs=0.03)
    assert found[1]["value"] == pytest.approx(found[0]["value"], abs=0.03)


def test_exponents_pass_a_narrow_stribeck_curve(separatrix, tmp_path):
    """Variational equations by SciPy's DOP853: steps went over the curve, and nothing was known."""
    (tmp_path / "case.toml").write_text(ONE + FRICTION.format(law="lugre") + LAWS["lugre"][0] + "\n")
    out = succeed(separatrix, "stability", "case.toml", "--periods", "64", "--json", folder=tmp_path).out
    found = [json.loads(line) for line in out.splitlines() if '"event": "exponent"' in line]
    assert [one["value"] for one in found[:2]] == pytest.approx([-0.27216946, -0.83573918], abs=1e-7)


@pytest.mark.long
def test_a_map_of_motions_that_never_settle_ends(separatrix, tmp_path):
    """On a belt every small amplitude stays: each of 256 starts was watched over 512 periods."""
    axes = "".join(f'[[axis]]\nname = "{name}"\nfrom = -1\nto = 1\ncount = 3\n' for name in ("x0", "v0"))
    drive = ONE[ONE.index("[drive]") : ONE.index("[start]")]
    case = ONE.replace(drive, "").replace('average = "window"\n', "") + FRICTION.format(law="dahl") + axes
    (tmp_path / "map.toml").write_text(case.replace("duration = 6", "duration = 20"))
    out = succeed(separatrix, "basin", "map.toml", "-o", "map.h5", folder=tmp_path).out
    assert "0 attractors and 8 motions not known to be periodic" in out
    assert "After 8 such and no attractor in a slice, its other starts are not followed" in out
    assert "ended as time_over: 9 points" in out
    assert "second look" not in out
