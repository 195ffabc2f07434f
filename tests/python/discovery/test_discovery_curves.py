# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects that are functions: laws of another shape than the built-in ones are found as tables."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery import Options, discover
from separatrix.discovery.fitting.base import _follows_better, fit_base
from separatrix.discovery.fitting.curves import begun_at, fit_member, knots_at, with_table
from separatrix.discovery.fitting.data import gather, scales_of
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.machine import Free
from separatrix.discovery.fitting.members import MEMBERS, friction_at
from separatrix.discovery.fitting.shapes import closed_forms, through
from separatrix.discovery.fitting.smooth import function_of, roughness, smoothed
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import make_record
from separatrix.errors import SeparatrixError
from separatrix.library import Model

CASE = """[body]
mass = 1.0

[restoring]
law = "linear"
stiffness = 88.8
free_length = 0.4

[friction]
law = "coulomb"
kinetic_coefficient = 0.05

[contact]
{contact}
upper = 0.71

[drive]
law = "fourier"
ratio = 0.85
mean = 0.31055
cosine = [0.09495, 0.01, -0.02003]
sine = [0.0, 0.02849, -0.02686]
angle = 3.335
"""
NEWTON = 'law = "newton"\nrestitution = 0.62'
# 0.5 v^(-1/4), from another law of the simulator
POWER = 'law = "newton_power"\nrestitution = 0.8891397\nyield_speed = 0.1\nfalloff = 0.25'
SIGMA = 2e-4

pytestmark = pytest.mark.usefixtures("library")


def curve(model: Model, speeds, changes) -> Model:
    values = {f"speed[{i}]": one for i, one in enumerate(speeds, start=1)}
    values |= {f"change[{i}]": one for i, one in enumerate(changes, start=1)}
    return model.with_effect("restitution_curve", values)


def bounces(model: Model, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Speeds before and after first impacts of many speeds."""
    start = np.column_stack([np.full(count, 0.70), np.linspace(0.1, 4, count), np.zeros(count)])
    times = np.tile(np.linspace(0, 0.2, 5), count)
    flown = model.segments([], np.zeros(0), start, 5 * np.arange(count + 1), times, derivatives=False)
    first = np.unique(flown.impact.segment, return_index=True)[1]
    return flown.impact.speed_before[first], flown.impact.speed_after[first]


def test_a_curve_restores_its_table_smoothly():
    base = Model.from_text(CASE.format(contact=NEWTON))
    speeds = np.array([0.3, 0.7, 1.5, 2.5, 3.5])
    wanted = 0.2 * np.exp(-speeds) - 0.1
    before, after = bounces(curve(base, speeds, wanted))
    inside = (before > 0.3) & (before < 3.5)
    # an exponential is followed to the fourth power of the distance of the knots
    assert np.allclose((after / before)[inside], 0.62 + 0.2 * np.exp(-before[inside]) - 0.1, atol=4e-3)
    slow = before < 0.3
    assert np.allclose((after / before)[slow], 0.62 + wanted[0], atol=1e-12)


def test_a_line_and_a_parabola_are_exact_and_nothing_changes_nothing():
    base = Model.from_text(CASE.format(contact=NEWTON))
    speeds = np.linspace(0.01, 5, 6)
    before, after = bounces(curve(base, speeds, -0.03 * speeds + 0.002 * speeds**2))
    assert np.allclose(after / before, 0.62 - 0.03 * before + 0.002 * before**2, atol=1e-12)
    slope = base.with_effect("restitution_slope", {"slope": 0.03})
    assert np.allclose(bounces(curve(base, speeds, -0.03 * speeds))[1], bounces(slope)[1], atol=1e-9)
    assert np.array_equal(bounces(curve(base, speeds, 0 * speeds))[1], bounces(base)[1])


@pytest.mark.parametrize(
    ("speeds", "changes"),
    [((1.0,), (0.1,)), ((1.0, 0.5), (0.0, 0.1)), ((0.5, 1.0), (0.1,)), ((1.0, 2.0), (0.0, 2.0))],
)
def test_a_table_that_is_none_is_refused(speeds, changes):
    with pytest.raises(SeparatrixError, match=r"effect\.restitution_curve"):
        curve(Model.from_text(CASE.format(contact=NEWTON)), speeds, changes)


def test_knots_follow_the_impacts_and_need_enough_of_them():
    member = MEMBERS[0]
    speeds = np.sort(np.random.default_rng(1).uniform(0.2, 3, 60))
    knots = knots_at(member, speeds, 5)
    assert knots[[0, -1]] == pytest.approx(speeds[[0, -1]])
    assert np.all(np.diff(knots) > 0.2)
    assert knots_at(member, speeds[:14], 5) is None
    assert knots_at(member, np.full(60, 1.0), 5) is None


def test_the_curve_that_is_drawn_is_that_of_the_law():
    base = Model.from_text(CASE.format(contact=NEWTON))
    speeds, wanted = np.array([0.3, 0.7, 1.5, 2.5, 3.5]), np.array([0.1, -0.1, 0.05, -0.2, -0.15])
    before, after = bounces(curve(base, speeds, wanted))
    inside = (before > 0.3) & (before < 3.5)
    assert np.allclose((after / before)[inside], 0.62 + through(speeds, wanted)(before[inside]), atol=1e-9)


SHAPES = {
    "straight": lambda v: 0.6 - 0.05 * v,
    "bent": lambda v: 0.5 * v**-0.25,
    "step": lambda v: 0.6 - 0.1 * np.tanh((v - 1.5) / 0.5),
    "wave": lambda v: 0.6 + 0.05 * np.sin(4 * v),
}


@pytest.mark.parametrize("error", [1e-3, 1e-2, 5e-2, 1e-1])
@pytest.mark.parametrize("name", SHAPES)
def test_the_band_of_a_smooth_function_has_its_nominal_coverage(name, error):
    """Measured at 60 speeds with noise; the mean share of the support over 60 draws is about 95 %."""
    knots, random = np.linspace(0.3, 4, 16), np.random.default_rng(7)
    speeds = np.sort(random.uniform(0.3, 4, 60))
    hats = np.array([through(knots, one)(speeds) for one in np.eye(16)]).T
    right, shares = SHAPES[name](knots), []
    for _ in range(60):
        seen = SHAPES[name](speeds) + error * random.standard_normal(60)
        gradient = hats.T @ (seen - hats @ np.full(16, 0.5)) / error**2
        mean, covariance = smoothed(hats.T @ hats / error**2, gradient, np.full(16, 0.5), roughness(knots))
        shares.append(np.mean(np.abs(mean - right) < 1.96 * np.sqrt(np.diag(covariance))))
    assert 0.88 < np.mean(shares) < 0.999


def test_a_straight_line_is_not_rough_and_a_cubic_is_by_its_bend():
    knots = np.sort(np.random.default_rng(3).uniform(0, 2, 9))
    penalty = roughness(knots)
    line = 3 - 2 * knots
    assert abs(line @ penalty @ line) < 1e-9
    # on many knots the natural spline's straight ends are next to nothing of a cubic
    fine = np.linspace(0, 1, 400)
    cubic = fine**3 - 1.5 * fine**2
    whole = np.trapezoid((6 * fine - 3) ** 2, fine)
    assert cubic @ roughness(fine) @ cubic == pytest.approx(whole, rel=0.05)


def test_a_function_without_information_is_none():
    penalty = roughness(np.linspace(0, 1, 6))
    assert smoothed(np.zeros((6, 6)), np.zeros(6), np.zeros(6), penalty) is None
    # one point does not determine the slope
    one = np.zeros((6, 6))
    one[2, 2] = 1e4
    assert smoothed(one, np.zeros(6), np.zeros(6), penalty) is None


def test_closed_forms_are_distinguished_by_the_values():
    at = np.linspace(0.3, 4, 8)
    rows = 1e4 * np.eye(8)

    def fitting(effect, value):
        return [
            name for name, one in closed_forms(effect, at, value, rows, rows @ value).items() if one["fits"]
        ]

    value = 0.5 * at**-0.25
    power = closed_forms("restitution_curve", at, value, rows, rows @ value)
    assert [name for name, one in power.items() if one["fits"]] == ["power"]
    assert power["power"]["parameters"] == pytest.approx([0.5, 0.25], rel=1e-3)
    assert fitting("restitution_curve", 0.6 - 0.03 * at) == ["linear"]
    assert fitting("restitution_curve", 0.5 + 0.1 * (at > 2)) == []
    assert "stribeck" in fitting("friction_curve", 1 + 0.5 * np.exp(-((at / 1.5) ** 2)))
    assert fitting("friction_curve", 1 + 0.2 * at) == ["linear", "quadratic", "power"]


def with_fading_friction(base: Model, excess: float) -> Model:
    """The machine with excess/(1 + (v/0.4)^2) N more friction, which no closed form is."""
    speeds = np.concatenate([np.linspace(0, 1.2, 12), [1.8, 2.5, 3.5, 5.0]])
    table = {f"speed[{i}]": one for i, one in enumerate(speeds, start=1)}
    for key in ("upwards", "downwards"):
        table |= {f"{key}[{i}]": excess / (1 + (v / 0.4) ** 2) for i, v in enumerate(speeds, start=1)}
    return base.with_effect("friction_curve", table)


def records_of(true: Model, seconds: float = 10.0, rate: float = 100.0) -> list:
    """Three records, the last to be held out."""
    records = []
    for seed, ratio in enumerate((0.82, 0.88, 0.85)):
        t = np.arange(int(seconds * rate)) / rate
        start = np.array([(0.4, 0.5, 0.4)])
        motion = true.segments(["drive.ratio"], np.array([ratio]), start, [0, t.size], t, derivatives=False)
        x = motion.x + SIGMA * np.random.default_rng(seed).standard_normal(t.size)
        header = {"units": "s, m", "drive_ratio": ratio, "phase": 0.4, "sensor_noise_sigma_m": SIGMA}
        records.append(make_record(f"r{seed}", {"t": t, "x": x}, header))
    return records


@pytest.mark.long
def test_a_restitution_that_is_a_power_of_the_speed_is_found_as_a_function():
    records = records_of(Model.from_text(CASE.format(contact=POWER)))
    options = Options(quick=True, most_effects=1, candidates=("restitution_slope",))
    verdict = discover(Model.from_text(CASE.format(contact=NEWTON)), records[:2], records[2:], options)
    assert verdict["effects"] == ["restitution_curve"]
    assert verdict["families"] == ["restitution over impact speed"]
    part = verdict["function"]["parts"][0]
    at, value, band = (np.array(part[key]) for key in ("at", "value", "band_95"))
    right = 0.5 * at**-0.25
    # 95 % in the mean over many records (docs/discovery_functions.md); neighbours err together
    assert np.mean((band[0] < right) & (right < band[1])) >= 0.75
    assert np.mean(np.maximum(band[0] - right, right - band[1]) < 0.01 * right) >= 0.9
    assert np.mean(np.abs(value - right) < 0.03 * right) >= 0.8
    assert verdict["function"]["closed_forms"]["power"]["fits"]
    assert not verdict["function"]["closed_forms"]["linear"]["fits"]
    assert min(one["closed"] for one in verdict["remains"]) > 0.98


def test_friction_of_a_shape_that_no_effect_has_is_fitted_as_a_function():
    """Friction 0.49 + 0.6/(1 + (v/0.4)^2) N: the fit leaves noise, and its values are right within errors."""
    base = Model.from_text(CASE.format(contact=NEWTON))
    record = records_of(with_fading_friction(base, 0.6), seconds=6.0)[0]
    data = gather([prepare(record, base)], 1.0, None)
    known = first = fit_base(data, base, scales_of(data, base).mass)
    assert first.fit.reduced_chi2 > 5
    for count in (3, 5, 8):
        knots = knots_at(MEMBERS[1], MEMBERS[1].seen(first), count)
        known = fit_member(data, first, MEMBERS[1], known, knots, alike=True)
    assert known.fit.converged
    assert known.fit.reduced_chi2 < 1.1
    part = function_of(data, first, known).parts[0]
    off = part.value - (0.4905 + 0.6 / (1 + (part.at / 0.4) ** 2))
    assert np.all(np.abs(off) < 4 * part.error)
    assert np.mean(np.abs(off) < 1.96 * part.error) >= 0.9
    assert np.all(np.abs(off[part.at < 1.4]) < 0.05)
    # both directions have one value, which the case has twice
    assert all(known.problem.free[i].also for i in known.added)


def test_the_curve_through_a_table_has_the_same_bits_each_time():
    knots = np.array([0.013, 0.11, 0.29, 0.61, 0.83, 1.27])
    values = np.sin(7 * knots)
    curves = {through(knots, values)(np.linspace(0.013, 1.27, 50)).tobytes() for _ in range(20)}
    assert len(curves) == 1


def test_a_table_on_more_knots_begins_from_the_one_on_fewer():
    base = Model.from_text(CASE.format(contact=NEWTON))
    data = gather([prepare(records_of(base)[0], base)], 1.0, None)
    first = fit_base(data, base, scales_of(data, base).mass)
    for effect in ("force_curve", "spring_curve"):
        member = next(one for one in MEMBERS if one.effect == effect)
        few, many = (knots_at(member, member.seen(first), count) for count in (3, 5))
        values = np.array([1.0, -2.0, 3.0])
        model, problem, begun = with_table(data, first, member, first, few, [values], alike=False)
        known = Fitted((effect,), model, problem, replace(first.fit, values=begun), ())
        assert begun_at(member, known, first, many)[0] == pytest.approx(through(few, values)(many))


def test_a_closed_form_that_the_function_refutes_is_not_named():
    """An excess 0.35/(1 + (v/0.4)^2) N is followed by Stribeck's form to the noise, and yet is none."""
    base = Model.from_text(CASE.format(contact=NEWTON))
    true = with_fading_friction(base, 0.35)
    stribeck = base.with_effect("stribeck", {"excess": 0.35, "velocity": 0.3})
    options = Options(quick=True, most_effects=1, candidates=("stribeck", "viscous", "quadratic_drag"))
    verdicts = []
    for machine in (true, stribeck):
        records = records_of(machine, seconds=8.0)
        verdicts.append(discover(base, records[:2], records[2:], options))
    assert [one["outcome"] for one in verdicts] == ["named", "named"]
    assert [one["effects"] for one in verdicts] == [["friction_curve"], ["stribeck"]]
    assert not verdicts[0]["function"]["closed_forms"]["stribeck"]["fits"]
    assert verdicts[1]["function"]["closed_forms"]["stribeck"]["fits"]
    assert verdicts[0]["function"]["text"].endswith("as no closed form that is known")


def test_friction_that_varies_with_position_as_a_sine_is_found_as_a_function():
    """Coefficient 0.08 (1 + 0.6 sin(9 x)): no effect has that shape, the family as a table has."""
    case = CASE.format(contact=NEWTON).replace("0.05", "0.08")
    positions = np.linspace(-0.2, 0.72, 16)
    table = {f"position[{i}]": one for i, one in enumerate(positions, start=1)}
    table |= {f"change[{i}]": 0.6 * np.sin(9 * one) for i, one in enumerate(positions, start=1)}
    base = Model.from_text(case)
    records = records_of(base.with_effect("friction_position_curve", table), seconds=8.0)
    options = Options(quick=True, most_effects=1, candidates=("position_dependent_friction",))
    verdict = discover(base, records[:2], records[2:], options)
    assert verdict["effects"] == ["friction_position_curve"]
    part = verdict["function"]["parts"][0]
    at, value, band = (np.array(part[key]) for key in ("at", "value", "band_95"))
    right = 0.08 * (1 + 0.6 * np.sin(9 * at))
    assert np.mean((band[0] < right) & (right < band[1])) >= 0.9
    assert min(one["closed"] for one in verdict["remains"]) > 0.98


def test_a_fit_that_follows_nothing_is_no_good_one():
    """It has no misfit either: its squares are those of the segments that it follows."""

    def fit(followed: int, total: float) -> SimpleNamespace:
        return SimpleNamespace(good=np.arange(25) < followed, total=total)

    assert _follows_better(fit(9, 900.0), fit(0, 0.0))
    assert not _follows_better(fit(0, 0.0), fit(9, 900.0))
    assert not _follows_better(fit(25, 9000.0), fit(12, 900.0))
    assert _follows_better(fit(25, 800.0), fit(25, 900.0))


def test_friction_beside_one_that_differs_by_direction_is_that_of_its_own_law() -> None:
    """0.05 of the weight at any speed; the asymmetry, which needs that friction, is not taken for its own."""
    model = Model.from_text(CASE.format(contact=NEWTON)).with_effect("asymmetric_friction", {"coulomb": 0.03})
    free = [
        Free("friction.kinetic_coefficient", 0.05, 0, 1),
        Free("effect.asymmetric_friction.coulomb", 0.03),
    ]
    known = SimpleNamespace(
        model=model,
        problem=SimpleNamespace(free=free, segments=SimpleNamespace(inside=np.ones((1, 3), bool))),
        fit=SimpleNamespace(
            values=np.array([0.05, 0.03]), good=np.array([True]),
            evaluation=SimpleNamespace(x=np.full((1, 3), 0.4)),
        ),
    )  # fmt: skip
    for direction in (1.0, -1.0):
        found = friction_at(known, np.array([0.1, 0.5, 1.0]), direction)
        assert found == pytest.approx(0.05 * 9.81, rel=1e-5)
