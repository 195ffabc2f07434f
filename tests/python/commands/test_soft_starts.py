# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A start inside a soft wall is ordinary state space; behind a rigid one there is none."""

import h5py
import numpy as np
import pytest
import separatrix as sx
from program import run, succeed
from scipy.integrate import solve_ivp
from separatrix import simulate
from separatrix.library import CaseError, Model

pytestmark = pytest.mark.usefixtures("library")

# m, k, c, gap, amplitude and angular frequency of the drive
M, K1, C, GAP, A, W = 1.0, 100.0, 0.5, 0.01, 0.02, 8.0
DURATION = 1.5
ONE = f"""
[body]
mass = {M}
[restoring]
law = "linear"
stiffness = {K1}
[friction]
law = "viscous"
damping = {C}
[drive]
law = "harmonic"
amplitude = {A}
ratio = {W / np.sqrt(K1 / M)}
[run]
duration = {DURATION}
window = 1
"""
PARTS = f"""
[body.block]
mass = {M}
[spring.foot]
between = ["block"]
stiffness = {K1}
damping = {C}
[drive.foot]
law = "force"
body = "block"
amplitude = {K1 * A}
frequency = {W}
[run]
duration = {DURATION}
window = 1
"""
# the law of the wall, and its force at a penetration and a rate, for a start at the speed u
LAWS = {
    "pulls": ('law = "kelvin_voigt"\nstiffness = 2000\ndamping = 3', lambda p, r, u: 2000 * p + 3 * r),
    "cut": (
        'law = "kelvin_voigt"\nstiffness = 2000\ndamping = 3\ntension = 0',
        lambda p, r, u: max(0.0, 2000 * p + 3 * r),
    ),
    "hertz": (
        'law = "hunt_crossley"\nstiffness = 2e4\ndamping = 0',
        lambda p, r, u: 2e4 * p**1.5,
    ),
    "hunt_crossley": (
        'law = "hunt_crossley"\nstiffness = 2e4\ndamping = 0.4\nexponent = 1.5',
        lambda p, r, u: max(0.0, 2e4 * p**1.5 * (1 + 0.4 * r)),
    ),
    "by_impact": (
        'law = "flores"\nstiffness = 2e4\nrestitution = 0.8',
        lambda p, r, u: max(0.0, 2e4 * p**1.5 * (1 + (0.4 * r / u if u > 0 else 0.0))),
    ),
}
STARTS = [(0.013, 0.05), (0.016, -0.12), (0.012, 0.0)]


def one_body(law: str, side: int) -> str:
    """The machine as one body with a wall above or below."""
    return ONE + f"[contact]\n{law}\n{'upper' if side > 0 else 'lower'} = {side * GAP}\n"


def in_parts(law: str, side: int) -> str:
    """The same as a machine in parts: the foot of the spring is a force."""
    return (
        PARTS
        + f'[contact.wall]\nbetween = ["block"]\n{law}\n{"upper" if side > 0 else "lower"} = {side * GAP}\n'
    )


def referee(force, side: int, x0: float, v0: float) -> tuple[float, float]:
    """The end of the motion by SciPy, from one crossing of the surface to the next."""

    def slope(t: float, y: np.ndarray) -> list[float]:
        p = side * y[0] - GAP
        wall = side * force(p, side * y[1], speed[0]) if p > 0 and pressed[0] else 0.0
        return [y[1], (K1 * (A * np.cos(W * t) - y[0]) - C * y[1] - wall) / M]

    def surface(t: float, y: np.ndarray) -> float:
        return side * y[0] - GAP

    surface.terminal = True
    pressed, speed, t, y = [True], [abs(v0)], 0.0, [side * x0, side * v0]
    while t < DURATION:
        surface.direction = -1 if pressed[0] else 1
        done = solve_ivp(
            slope, (t, DURATION), y, "DOP853", events=surface, rtol=1e-11, atol=1e-14, max_step=2e-3
        )
        t, y = done.t[-1], np.array([side * GAP if done.t_events[0].size else done.y[0, -1], done.y[1, -1]])
        pressed[0], speed[0] = side * y[1] > 0, abs(y[1])
    return y[0], y[1]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", LAWS)
def test_a_motion_from_inside_a_soft_wall(name: str, side: int) -> None:
    """Event loop, lanes and the same machine in parts agree with an independent integration."""
    law, force = LAWS[name]
    one, parts = Model.from_text(one_body(law, side)), Model.from_text(in_parts(law, side))
    for x0, v0 in STARTS:
        start = (side * x0, side * v0, 0.0)
        motion = simulate.trajectory(one, start)
        found = {"loop": (motion.samples["x"][-1], motion.samples["v"][-1])}
        found["lanes"] = (motion.summary["x"], motion.summary["v"])
        # walls of parts do not pull
        if name != "pulls":
            motion = simulate.trajectory(parts, start)
            found["parts"] = (motion.samples["x"][-1], motion.samples["v"][-1])
        right = referee(force, side, x0, v0)
        for way, end in found.items():
            np.testing.assert_allclose(end, right, rtol=0, atol=2e-9, err_msg=f"{name} {side} {start} {way}")


@pytest.mark.parametrize("effect", ["compliant_contact", "kelvin_voigt_contact", "contact_curve"])
def test_a_wall_made_soft_by_an_effect(effect: str) -> None:
    """What makes a rigid wall soft opens it to starts; its motion is that of the law of the same force."""
    law = {
        "compliant_contact": "stiffness = 2000\nexponent = 1",
        "kelvin_voigt_contact": "stiffness = 2000",
        "contact_curve": "penetration = [0.01, 0.02]\nforce = [20, 40]",
    }[effect]
    rigid = one_body('law = "newton"\nrestitution = 0.5', 1)
    start = (0.013, 0.05, 0.0)
    with pytest.raises(CaseError, match=r"found x0 = 0.013 m, allowed at most the barrier contact.upper"):
        simulate.trajectory(Model.from_text(rigid), start)
    end = simulate.trajectory(Model.from_text(f"{rigid}[effect.{effect}]\n{law}\n"), start).samples
    right = referee(lambda p, r, u: 2000 * p, 1, *start[:2])
    np.testing.assert_allclose((end["x"][-1], end["v"][-1]), right, rtol=0, atol=2e-9)


def test_two_bodies_start_inside_a_soft_stop() -> None:
    """The stop of a driven body: refused where it is rigid."""
    case = """
[body]
law = "friction_pair"
mass = 1
driven_mass = 0.7
friction = 0.1
[start]
x0 = 0.11
[run]
duration = 0.5
window = 0.1
[contact]
upper = 0.1
"""
    soft = Model.from_text(case + 'law = "kelvin_voigt"\nstiffness = 1000\ndamping = 0\ntension = 0')
    first = simulate.trajectory(soft, (0.11, 0.0, 0.0)).samples
    assert first["contact_force"][0] == pytest.approx(-10, rel=1e-12)
    assert first["x"][-1] < 0.1
    with pytest.raises(CaseError, match="x0 = 0.11 m, allowed at most the barrier"):
        Model.from_text(case + 'law = "newton"\nrestitution = 0.5')


@pytest.mark.parametrize("name", ["pulls", "hunt_crossley"])
def test_a_map_goes_on_into_a_soft_wall(name: str, separatrix, tmp_path, monkeypatch) -> None:
    """Starts on both sides of the surface: lanes of any width have the same bits, no lanes the same ends."""
    axes = "".join(
        f'[[axis]]\nname = "{axis}"\nfrom = {-end}\nto = {end}\ncount = 4\n'
        for axis, end in (("x0", 0.02), ("v0", 0.2))
    )
    (tmp_path / "case.toml").write_text(one_body(LAWS[name][0], 1) + axes + "[attractors]\nsample = 8\n")
    maps = []
    for run_with in ("auto", "narrow", "off"):
        settings = ["--set", 'integrator.lanes="off"'] if run_with == "off" else []
        monkeypatch.setenv("SEPARATRIX_LANE_WIDTH", "2" if run_with == "narrow" else "8")
        settings += ["--set", "run.duration=15"]
        succeed(separatrix, "basin", "case.toml", *settings, "-o", f"{run_with}.h5", folder=tmp_path)
        with h5py.File(tmp_path / f"{run_with}.h5") as file:
            maps.append(
                {
                    key: file[key][()]
                    for key in ("attractor", "reason", "amplitude", "v_max", "impacts_per_period")
                }
            )
    assert (maps[0]["reason"] <= 2).all()
    for key, values in maps[0].items():
        np.testing.assert_array_equal(values, maps[1][key], err_msg=key)
        np.testing.assert_allclose(values, maps[2][key], rtol=1e-6, err_msg=key)
    (tmp_path / "list.csv").write_text("x0,v0\n0.015,0.1\n")
    succeed(separatrix, "points", "case.toml", "--list", "list.csv", "-o", "points.h5", folder=tmp_path)
    rigid = ["--set", 'contact={law="newton", restitution=0.5, upper=0.01}']
    refused = run(separatrix, "points", "case.toml", "--list", "list.csv", *rigid, folder=tmp_path)
    assert refused.code == 65


def test_all_points_of_a_motion_are_marked_in_its_map() -> None:
    """One of two section points is inside the wall: marked where the map goes so far, else reported."""
    case = sx.Case.from_text(
        """
[body]
mass = 1.325
[restoring]
law = "linear"
stiffness = 4331
[friction]
law = "viscous"
damping = 1.5
[contact]
law = "kelvin_voigt"
stiffness = 87125
damping = 0
tension = 0
upper = 0.00126
[drive]
law = "harmonic"
amplitude = 0.0007
ratio = 0.85
[run]
duration = 60
[attractors]
sample = 4
"""
    )
    marks, captions = [], []
    for end in (0.00126, 0.003):
        result = sx.basin(case, x0=(-0.002, end, 3), v0=(-0.1, 0.1, 3), progress=False)
        figure = result.separatrix.plot("attractor", caption="full")
        lines = [line for line in figure.axes[0].lines if line.get_markerfacecolor() == "white"]
        marks.append(sorted(x for line in lines for x in line.get_xdata()))
        captions.append(figure.separatrix_caption)
    assert marks[0] == pytest.approx(marks[1], abs=1e-12)
    assert marks[0][-1] > 0.00126 > marks[0][0]
    assert "1 of 2 points outside the map" in captions[0]
    assert "outside" not in captions[1]
