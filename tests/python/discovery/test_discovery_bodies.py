# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of several bodies as base: hidden effects are named with their location, from any sensors."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hidden_bodies import SPRINGS, Sprung, record
from separatrix.discovery import Options, discover
from separatrix.errors import SeparatrixError
from structures import Friction, Rigid, Soft, Structure

TWO = f"""{SPRINGS}
[friction.rail]
between = ["first"]
force = 0.16
[contact.stop]
between = ["second"]
law = "newton"
restitution = 0.73
upper = 0.123
"""
RAIL = f"""{SPRINGS.replace("amplitude = 4.1, frequency = 7", "amplitude = 6.1, frequency = 5")}
[friction.rail]
between = ["first"]
force = 0.85
"""
PAIR = """
body = {law = "backlash_pair", mass = 1, driven_mass = 0.52, friction = 0.41}
restoring = {law = "linear", stiffness = 21}
friction = {law = "viscous", damping = 0.9}
contact = {law = "newton", restitution = 0.82, upper = 0.102, lower = -0.099}
drive = {law = "force", amplitude = 4.1, frequency = 10}
start = {x0 = 0, v0 = 0}
run.duration = 5
"""
CHAIN = """
body.a.mass = 1
body.b.mass = 0.7
body.c.mass = 0.52
drive.force = {law = "force", body = "a", amplitude = 5.1, frequency = 7}
run.duration = 20
[spring.ground]
between = ["a"]
stiffness = 51
damping = 0.4
[spring.ab]
between = ["a", "b"]
stiffness = 78
damping = 0.22
[spring.bc]
between = ["b", "c"]
stiffness = 39
damping = 0.2
"""
ONE = """
body.slide.mass = 1.02
drive.force = {law = "force", body = "slide", amplitude = 5, frequency = 7}
run.duration = 20
[spring.frame]
between = ["slide"]
stiffness = 41
damping = 0.5
[contact.buffer]
between = ["slide"]
law = "kelvin_voigt"
stiffness = 900
damping = 2
upper = 0.08
"""


def two(w: float, extra=lambda q, v: np.zeros(2), restitution=lambda u: 0.7) -> Structure:
    def force(t, q, v):
        frame = -40 * q[0] - 0.3 * v[0]
        coupling = 60 * (q[1] - q[0]) + 0.2 * (v[1] - v[0])
        return np.array([frame + coupling + 4 * np.cos(w * t), -coupling]) + extra(q, v)

    rail = Friction([1, 0], lambda u: 0.15, 0.15)
    return Structure([1, 0.8], force, [rail], rigid=[Rigid([0, 1], 0.12, 1, restitution)], tolerance=1e-10)


def played(w: float, half: float = 0.002) -> Structure:
    """Two masses whose coupling has a free play: within it there is its damper alone."""

    def force(t, q, v):
        damper = 0.2 * (v[1] - v[0])
        return np.array([-40 * q[0] - 0.3 * v[0] + damper + 4 * np.cos(w * t), -damper])

    def spring(p, rate):
        return 60 * p

    soft = [Soft([-1, 1], half, 1, spring), Soft([-1, 1], -half, -1, spring)]
    rail, stop = Friction([1, 0], lambda u: 0.15, 0.15), Rigid([0, 1], 0.12, 1, lambda u: 0.7)
    return Structure([1, 0.8], force, [rail], soft, [stop], tolerance=1e-10)


def sprung(w: float) -> Sprung:
    """Two masses, the first on a rail whose friction has a spring."""

    def force(t, q, v):
        frame = -40 * q[0] - 0.3 * v[0]
        coupling = 60 * (q[1] - q[0]) + 0.2 * (v[1] - v[0])
        return np.array([frame + coupling + 6 * np.cos(w * t), -coupling])

    return Sprung([1, 0.8], force, [1, 0], 100.0, 0.9)


def pair(w: float, level=lambda u: 0.4, static=0.4) -> Structure:
    def force(t, q, v):
        return np.array([4 * np.cos(w * t) - 20 * q[0] - 0.9 * v[0], 0.0])

    row = [-1, 1]
    stops = [Rigid(row, 0.1, 1, lambda u: 0.85), Rigid(row, -0.1, -1, lambda u: 0.85)]
    return Structure([1, 0.5], force, [Friction(row, level, static)], rigid=stops, tolerance=1e-10)


def chain(w: float, extra=lambda q, v: np.zeros(3)) -> Structure:
    def force(t, q, v):
        ground = -50 * q[0] - 0.4 * v[0]
        ab = 80 * (q[1] - q[0]) + 0.2 * (v[1] - v[0])
        bc = 40 * (q[2] - q[1]) + 0.2 * (v[2] - v[1])
        return np.array([ground + ab + 5 * np.cos(w * t), bc - ab, -bc]) + extra(q, v)

    return Structure([1, 0.7, 0.5], force, tolerance=1e-10)


def one(w: float, extra=lambda q, v: np.zeros(1)) -> Structure:
    def force(t, q, v):
        return np.array([5 * np.cos(w * t) - 40 * q[0] - 0.5 * v[0]]) + extra(q, v)

    buffer = Soft([1], 0.08, 1, lambda p, rate: max(0.0, 900 * p + 2 * rate))
    return Structure([1], force, soft=[buffer], tolerance=1e-10)


def positions(*names: str) -> Callable[[np.ndarray], Mapping[str, np.ndarray]]:
    return lambda motion: {f"x.{name}": motion[:, i] for i, name in enumerate(names) if name}


def position_and_forces(motion: np.ndarray) -> dict[str, np.ndarray]:
    """Of the slide: position, force of its spring and of its buffer."""
    x, v = motion.T
    push = np.maximum(0.0, 900 * (x - 0.08) + 2 * v) * (x > 0.08)
    return {"x.slide": x, "F.frame": 40 * x + 0.5 * v, "F.buffer": push}


def position_and_speed(motion: np.ndarray) -> dict[str, np.ndarray]:
    return {"x.second": motion[:, 1], "v.first": motion[:, 2]}


def speed(motion: np.ndarray) -> dict[str, np.ndarray]:
    return {"v.slide": motion[:, 1]}


def drag_of_chain(v: np.ndarray) -> np.ndarray:
    """Between b and c; the last axis is that of the bodies."""
    u = v[..., 2] - v[..., 1]
    return 0.3 * np.abs(u) * u


def three_kinds(motion: np.ndarray) -> dict[str, np.ndarray]:
    q, v = motion[:, :3], motion[:, 3:]
    spring = 40 * (q[:, 2] - q[:, 1]) + 0.2 * (v[:, 2] - v[:, 1])
    return {"x.a": q[:, 0], "v.b": v[:, 1], "a.c": -(spring + drag_of_chain(v)) / 0.5}


@dataclass(frozen=True)
class Hidden:
    """One machine and what it hides: the effect, its parameters and how well they must be found."""

    case: str
    machine: Callable[[float], Structure]
    shown: Callable[[np.ndarray], Mapping[str, np.ndarray]]
    effect: str
    found: Mapping[str, float]
    asked: tuple[str, ...] = ("viscous", "quadratic_drag", "cubic_spring")
    noise: float = 2e-3
    frequencies: tuple[float, float, float] = (6.0, 7.5, 9.0)
    others: Mapping[str, float] = ()
    not_tested: tuple[str, ...] = ()


CASES = {
    "one position and another speed": Hidden(
        TWO, lambda w: two(w, lambda q, v: np.array([0, -0.6 * v[1] * abs(v[1])])), position_and_speed,
        "quadratic_drag@second", {"drag": 0.6}, noise=5e-3,
    ),
    "a stop": Hidden(
        TWO, lambda w: two(w, restitution=lambda u: 0.75 * max(u, 0.1) ** -0.2), positions("first", "second"),
        "restitution_falloff@contact.stop", {"falloff": 0.2}, ("restitution_falloff", "viscous"),
        others={"body.second.mass": 0.8, "spring.coupling.stiffness": 60, "contact.stop.upper": 0.12},
    ),
    "a play": Hidden(
        TWO, played, positions("first", "second"), "backlash@spring.coupling",
        {"upper": 0.002, "lower": -0.002}, ("backlash", "cubic_spring", "viscous"), noise=5e-3,
        others={"contact.added_2.stiffness": 60, "spring.coupling.damping": 0.2},
    ),
    "friction with a spring": Hidden(
        RAIL, sprung, positions("first", "second"), "dahl@friction.rail",
        {"stiffness": 100, "force": 0.9}, ("dahl", "stribeck", "viscous", "linear_spring"),
        noise=5e-4, frequencies=(5.0, 5.5, 6.0), others={"spring.frame.stiffness": 40},
    ),
    "a pair": Hidden(
        PAIR, lambda w: pair(w, lambda u: 0.4 + 0.2 * np.exp(-((u / 0.3) ** 2)), 0.6),
        positions("driving", "driven"), "stribeck@driving-driven",
        {"static_force": 0.2, "stribeck_velocity": 0.3}, ("stribeck", "viscous"),
        frequencies=(7.0, 9.0, 10.5),
    ),
    "a chain with three kinds of sensors": Hidden(
        CHAIN, lambda w: chain(w, lambda q, v: drag_of_chain(v) * np.array([0, 1, -1])), three_kinds,
        "quadratic_drag@b-c", {"drag": 0.3}, noise=5e-3, frequencies=(4.0, 6.5, 8.0),
    ),
    # only the ratio of masses and forces is determined
    "a speed alone": Hidden(
        ONE, lambda w: one(w, lambda q, v: -0.4 * v * np.abs(v)), speed, "quadratic_drag@slide",
        {"drag": 0.408}, noise=1e-3,
        others={"spring.frame.stiffness": 40.8, "contact.buffer.upper": 0.08},
    ),
    "position and forces": Hidden(
        ONE, lambda w: one(w, lambda q, v: -0.4 * v * np.abs(v)), position_and_forces,
        "quadratic_drag@slide", {"drag": 0.4}, ("backlash", "quadratic_drag", "cubic_spring"),
        not_tested=("backlash@spring.frame",), others={"body.slide.mass": 1, "spring.frame.stiffness": 40},
    ),
}  # fmt: skip

REPEATED = {
    "a speed alone",
    "position and forces",
    "a stop",
    "a pair",
    "friction with a spring",
    "one position and another speed",
    "a chain with three kinds of sensors",
}
"""The longest, each of parts that the others have too."""


def records(hidden: Hidden, folder: Path) -> tuple[Path, list[Path]]:
    base = folder / "base.toml"
    base.write_text(hidden.case)
    return base, [
        record(
            folder / f"record_{w:g}.csv", hidden.machine(w), w, hidden.shown, periods=8, samples=50,
            noise=hidden.noise, seed=number,
        )
        for number, w in enumerate(hidden.frequencies)
    ]  # fmt: skip


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] if name in REPEATED else []) for name in CASES]
)
def test_a_hidden_effect_is_named_with_its_location(name: str, tmp_path: Path) -> None:
    hidden = CASES[name]
    base, made = records(hidden, tmp_path)
    verdict = discover(base, made[:2], made[2:], Options(seed=1, quick=True, candidates=hidden.asked))
    assert (verdict["outcome"], verdict["effects"]) == ("named", [hidden.effect])
    assert set(hidden.not_tested) <= set(verdict["not_tested"])
    location = hidden.effect.partition("@")[2].split(".")[-1]
    assert location.split("-")[-1] in verdict["locations"][hidden.effect]
    gap = verdict["gap"]
    assert gap["training"]["after"] < 1.2 < gap["training"]["before"]
    # at another frequency errors of the parameters show as well
    assert gap["held_out"]["after"] < min(3, gap["held_out"]["before"])
    added = {
        path.rpartition(".")[2]: one
        for path, one in verdict["parameters"].items()
        if path not in verdict["base_parameters"]
    }
    wanted = {key: (added[key], value) for key, value in hidden.found.items()}
    wanted |= {path: (verdict["parameters"][path], value) for path, value in dict(hidden.others).items()}
    for key, (one_found, value) in wanted.items():
        assert one_found["value"] == pytest.approx(value, rel=0.05), key
        assert abs(one_found["value"] - value) < 4 * one_found["standard_error"], key


ELASTIC = RAIL.replace("force = 0.85", 'law = "elastic_coulomb"\nforce = 0.85\nstiffness = 105')


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(("case", "machine", "frequencies"), [
    (TWO, two, (6.0, 7.5, 9.0)),
    (ELASTIC, sprung, (5.0, 5.5, 6.0)),
])  # fmt: skip
def test_where_nothing_is_hidden_nothing_is_found(case, machine, frequencies, tmp_path: Path) -> None:
    asked = ("viscous", "quadratic_drag", "offset_force", "backlash", "dahl")
    shown = positions("", "second") if case == TWO else positions("first", "second")
    hidden = Hidden(case, machine, shown, "", {}, noise=5e-3, frequencies=frequencies)
    base, made = records(hidden, tmp_path)
    verdict = discover(base, made[:2], made[2:], Options(seed=1, quick=True, candidates=asked))
    assert (verdict["outcome"], verdict["effects"]) == ("none", [])


@pytest.mark.usefixtures("library")
def test_a_gap_that_no_effect_asked_for_closes_gets_no_name(tmp_path: Path) -> None:
    hidden = Hidden(TWO, lambda w: played(w, 0.01), positions("first", "second"), "", {}, noise=5e-3)
    base, made = records(hidden, tmp_path)
    asked = Options(seed=1, quick=True, candidates=("linear_spring", "viscous"))
    verdict = discover(base, made[:2], made[2:], asked)
    assert verdict["effects"] == []
    assert verdict["outcome"] in ("characterised", "not-in-catalogue")


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(("row", "size", "depends_on"), [
    # the machine of the case moves quite otherwise
    pytest.param([0, -1, 1], 0.6, [["extension at b-c"]], marks=pytest.mark.long),
    # no joint, and so no location
    ([-1, 0, 1], 0.05, []),
])  # fmt: skip
def test_an_unnamed_gap_is_reported_with_its_location_or_not_at_all(row, size, depends_on, tmp_path) -> None:
    row = np.array(row)

    def waved(q: np.ndarray) -> np.ndarray:
        return -row * size * np.sin(40 * (row @ q))

    hidden = Hidden(
        CHAIN, lambda w: chain(w, lambda q, v: waved(q)), positions("a", "b", "c"), "", {},
        frequencies=(4.0, 6.5, 8.0),
    )  # fmt: skip
    base, made = records(hidden, tmp_path)
    asked = Options(seed=1, quick=True, candidates=("viscous",), most_effects=1)
    verdict = discover(base, made[:2], made[2:], asked)
    assert verdict["effects"] == []
    assert [one["depends_on"] for one in verdict["character"]] == depends_on


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(("columns", "why"), [
    ({"x.third": 1.0}, "column 'x.third': no coordinate of this name; allowed first, second"),
    ({"x.first": 1.0, "F.rail": 1.0}, "'F.rail': the force of a joint with law coulomb is no function"),
    ({"x.first": 1.0, "F.none": 1.0}, "'F.none': no joint of this name; allowed F.spring.frame"),
])  # fmt: skip
def test_columns_that_mean_nothing_are_refused(columns, why, tmp_path: Path) -> None:
    base = tmp_path / "base.toml"
    base.write_text(TWO)
    t = np.linspace(0, 20, 1001)
    rows = np.column_stack([t, *(size * np.sin(7 * t + i) for i, size in enumerate(columns.values()))])
    path = tmp_path / "record.csv"
    head = ",".join(["t", *columns])
    np.savetxt(path, rows, delimiter=",", header=f"# units: t s, x m\n{head}", comments="")
    with pytest.raises(SeparatrixError, match=why):
        discover(base, [path])


@pytest.mark.usefixtures("library")
def test_a_speed_alone_determines_the_machine(tmp_path: Path) -> None:
    """x'' + c x' + k x = f cos(w t) from x = 0 in closed form, of which the case is off."""
    base, made, random = tmp_path / "base.toml", [], np.random.default_rng(5)
    base.write_text(ONE.partition("[contact")[0].replace("mass = 1.02", "mass = 1"))
    for w in (5.5, 7.0, 8.0):
        t = np.arange(500) * 2 * np.pi / w / 50
        steady = 4.9 / (40 - w**2 + 0.6j * w)
        free = -0.3 + 1j * np.sqrt(40 - 0.3**2)
        # Re(begun) = -Re(steady), Re(free begun) = -Re(i w steady)
        x0, v0 = -np.real(steady), -np.real(1j * w * steady)
        begun = x0 + 1j * (free.real * x0 - v0) / free.imag
        v = np.real(1j * w * steady * np.exp(1j * w * t) + free * begun * np.exp(free * t))
        v += 2e-3 * np.std(v) * random.standard_normal(t.size)
        made.append(tmp_path / f"record_{w:g}.csv")
        head = f"# drive_frequency_rad_s: {w}\n# phase: 0\n# units: t s, v mm/s\nt,v"
        np.savetxt(made[-1], np.column_stack([t, 1e3 * v]), delimiter=",", header=head, comments="")
    verdict = discover(base, made[:2], made[2:], Options(seed=1, quick=True, candidates=("quadratic_drag",)))
    assert (verdict["outcome"], verdict["effects"]) == ("none", [])
    wanted = {"spring.frame.stiffness": 40, "spring.frame.damping": 0.6, "nuisance:drive_scale": 0.98}
    for path, value in wanted.items():
        found = verdict["parameters"][path]
        assert abs(found["value"] - value) < 4 * found["standard_error"] < 0.15 * value, path


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(("case", "name", "why"), [
    (TWO, "v.first", "no position for a machine with impacts \\(contact.stop\\), allowed"),
    (None, "v", "found a speed and no x, allowed where the machine is written joint by joint"),
])  # fmt: skip
def test_speeds_alone_are_refused_where_they_determine_too_little(case, name, why, tmp_path: Path) -> None:
    base = tmp_path / "base.toml"
    base.write_text(case or (Path(__file__).parents[3] / "examples/measured_pendulum.toml").read_text())
    t = np.linspace(0, 20, 1001)
    rows = np.column_stack([t, 0.1 * np.sin(7 * t)])
    path = tmp_path / "record.csv"
    np.savetxt(path, rows, delimiter=",", header=f"t,{name}", comments="")
    with pytest.raises(SeparatrixError, match=why):
        discover(base, [path])


@pytest.mark.usefixtures("library")
def test_effects_of_one_body_are_none_of_several(tmp_path: Path) -> None:
    base = tmp_path / "base.toml"
    base.write_text(TWO)
    why = "effects: found sensor_gain, allowed for this machine viscous, "
    with pytest.raises(SeparatrixError, match=why):
        discover(base, [tmp_path / "unread.csv"], options=Options(candidates=("sensor_gain",)))
