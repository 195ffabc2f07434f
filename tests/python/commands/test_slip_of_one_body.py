# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Elements of spring and slider in a case of one body: SciPy with events, and the same machine as parts."""

import h5py
import numpy as np
import pytest
from program import run, succeed
from scipy.integrate import solve_ivp

OMEGA = np.pi
LAWS = {
    "maxwell_slip": ([400, 150, 60], [1, 1.2, 0.8]),
    "elastic_coulomb": (400, 2),
}
FRICTION = 'law = "{law}"\nstiffness = {stiffness}\nforce = {force}\nvelocity = 0.1\n'
DRIVES = {
    "force": "amplitude = 9",
    "harmonic": "amplitude = 0.3",
    "base": 'position = "0.3*cos(phase)"',
}
ONE = """
[body]
mass = "1.2 kg"
[restoring]
law = "linear"
stiffness = 30
free_length = 0.05
[start]
x0 = 0.2
[run]
duration = 5.1
average = "window"
[drive]
law = "{drive}"
frequency = "0.5 Hz"
{more}
[friction]
"""
PARTS = """
[body.m]
mass = "1.2 kg"
[spring.k]
between = ["m"]
stiffness = 30
free_length = 0.05
[start]
x0 = 0.2
[run]
duration = 5.1
average = "window"
[drive.f]
law = "force"
body = "m"
frequency = "0.5 Hz"
amplitude = 9
[friction.f]
between = ["m"]
"""


def last(separatrix, folder, text: str, *more: str) -> tuple[float, float]:
    """Position and velocity at the end of a trajectory."""
    (folder / "case.toml").write_text(text)
    succeed(separatrix, "trajectory", "case.toml", "-o", "out.h5", "--force", *more, folder=folder)
    with h5py.File(folder / "out.h5") as file:
        return float(file["x"][-1]), float(file["v"][-1])


def scipy_end(stiffness, force, amplitude: float, time: float) -> np.ndarray:
    """Position and velocity after `time`, the elements switching at events of DOP853."""
    k, limit = np.atleast_1d(stiffness), np.atleast_1d(force)
    slides = np.zeros(len(k))
    state = np.array([0.2, 0, *np.zeros(len(k))])

    def rate(t, y):
        pulls = np.where(slides != 0, slides * limit, y[2:]).sum()
        acceleration = (amplitude * np.cos(OMEGA * t) - 30 * (y[0] - 0.05) - pulls) / 1.2
        return [y[1], acceleration, *np.where(slides != 0, 0, k * (y[1] - 0.1))]

    def event(i):
        def stops(_, y):
            return slides[i] * (y[1] - 0.1)

        def yields(_, y):
            return limit[i] - abs(y[2 + i])

        function = stops if slides[i] else yields
        function.terminal, function.direction = True, -1
        return function

    t = 0.0
    while t < time:
        found = solve_ivp(
            rate,
            (t, time),
            state,
            "DOP853",
            rtol=1e-12,
            atol=1e-13,
            max_step=0.02,
            events=[event(i) for i in range(len(k))],
        )
        t, state = found.t[-1], found.y[:, -1].copy()
        hit = [i for i, times in enumerate(found.t_events) if len(times)]
        # All that slide stop together.
        if any(slides[i] for i in hit):
            slides[:] = 0
            continue
        for i in hit:
            slides[i] = np.sign(state[2 + i])
            state[2 + i] = slides[i] * limit[i]
    return state[:2]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("drive", DRIVES)
def test_one_body_moves_as_in_scipy(separatrix, tmp_path, law, drive):
    """On a belt, with a force, a moving foot of the spring or a shaken ground."""
    stiffness, force = LAWS[law]
    amplitude = 1.2 * 0.3 * OMEGA**2 if drive == "base" else 9
    case = ONE.format(drive=drive, more=DRIVES[drive])
    case += FRICTION.format(law=law, stiffness=stiffness, force=force)
    expected = scipy_end(stiffness, force, amplitude, 5.1)
    assert last(separatrix, tmp_path, case) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("law", LAWS)
def test_one_body_has_the_bits_of_a_part(separatrix, tmp_path, law):
    """An override keeps the key of the short form."""
    stiffness, force = LAWS[law]
    friction = FRICTION.format(law=law, stiffness=stiffness, force=force)
    one = ONE.format(drive="force", more=DRIVES["force"]) + friction
    ended = last(separatrix, tmp_path, one)
    assert ended == last(separatrix, tmp_path, PARTS + friction)
    assert ended != last(separatrix, tmp_path, one, "--set", "friction.velocity=0.2")


def test_sweeps_and_maps_take_the_keys_of_one_body(separatrix, tmp_path):
    """Their results are verified."""
    text = ONE.format(drive="force", more=DRIVES["force"])
    text += FRICTION.format(law="maxwell_slip", stiffness=[400, 150], force=[1, 1.2])
    text += '[sweep]\nparameter = "drive.amplitude"\nfrom = 7\nto = 9\ncount = 2\n'
    text += "starts = [1, 1]\nx0 = [0, 0]\nv0 = [0, 0]\n"
    text += '[[axis]]\nname = "friction.velocity"\nfrom = 0\nto = 0.1\ncount = 2\n'
    text += '[[axis]]\nname = "x0"\nfrom = -0.1\nto = 0.1\ncount = 2\n'
    (tmp_path / "case.toml").write_text(text)
    for command in ("basin", "sweep"):
        more = ("--set", "attractors.sample=4")
        succeed(separatrix, command, "case.toml", *more, "-o", f"{command}.h5", folder=tmp_path)
        found = succeed(separatrix, "verify", f"{command}.h5", folder=tmp_path)
        assert "0 differ from the file" in found.out + found.err


@pytest.mark.parametrize(
    "more",
    [
        '[contact]\nlaw = "newton"\nrestitution = 0.5\nupper = 1\n',
        "[effect.cubic_damping]\ncoefficient = 1\n",
    ],
)
def test_what_needs_parts_is_refused(separatrix, tmp_path, more):
    """Stops and effects, with the way to write them."""
    text = ONE.format(drive="force", more=DRIVES["force"])
    text += FRICTION.format(law="maxwell_slip", stiffness=[400, 150], force=[1, 1.2])
    (tmp_path / "case.toml").write_text(text + more)
    found = run(separatrix, "trajectory", "case.toml", "-o", "out.h5", folder=tmp_path)
    assert found.code == 65
    assert "maxwell_slip in [friction.NAME] beside [body.NAME]" in found.err


@pytest.mark.parametrize("table", ["drive", "restoring"])
def test_a_key_beside_no_law_is_refused(separatrix, tmp_path, table):
    """It would have no effect."""
    text = ONE.format(drive="force", more=DRIVES["force"])
    text += FRICTION.format(law="maxwell_slip", stiffness=[400, 150], force=[1, 1.2])
    (tmp_path / "case.toml").write_text(text)
    more = ("--set", f'{table}.law="none"')
    assert run(separatrix, "trajectory", "case.toml", "-o", "out.h5", *more, folder=tmp_path).code == 65
