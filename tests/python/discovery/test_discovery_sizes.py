# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Verdicts go by the size of a gap: the rate of sampling changes none, and what is closed is named."""

from types import SimpleNamespace

import numpy as np
import pytest
from program import CASE
from scipy.signal import lfilter
from scipy.stats import chi2
from separatrix.discovery import Options, discover
from separatrix.discovery.decision.remains import Remains, share_text
from separatrix.discovery.decision.scoring import (
    LARGER_NOISE,
    LITTLE,
    NOISE,
    ScoredCandidate,
    adequate,
    sizeable,
)
from separatrix.discovery.decision.verdict import _hump, _of_accepted
from separatrix.discovery.fitting.ceiling import Ceiling, Family
from separatrix.discovery.fitting.function_part import Part
from separatrix.discovery.fitting.machine import drive_nuisances
from separatrix.discovery.fitting.members import MEMBERS
from separatrix.discovery.fitting.one_body import BodyInMotion
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.measured.segments import padded
from separatrix.library import Model

SIGMA = 2e-4
RATIOS = (0.8, 1.25, 0.95)


def record_of(model: Model, rate: float, number: int, seconds: float = 8.0, phi_noise: float | None = None):
    """The motion of a machine as a sensor of some rate sees it."""
    t = np.arange(int(seconds * rate)) / rate
    ratio = RATIOS[number]
    start = np.array([(0.6, 0.5, 0.4)])
    motion = model.segments(["drive.ratio"], np.array([ratio]), start, [0, t.size], t, derivatives=False)
    random = np.random.default_rng([number, int(rate)])
    columns = {"t": t, "x": motion.x + SIGMA * random.standard_normal(t.size)}
    header = {"units": "s, m", "drive_ratio": ratio, "phase": 0.4, "sensor_noise_sigma_m": SIGMA}
    if phi_noise is not None:
        frequency = model.drive_frequency({"drive.ratio": ratio})
        columns["phi"] = 0.4 + frequency * t + phi_noise * random.standard_normal(t.size)
        header["phi_noise_sigma_rad"] = phi_noise
    return make_record(f"r{number}", columns, header)


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(
    "effect", [pytest.param({"quadratic_drag": {"coefficient": 0.1}}, marks=pytest.mark.long), {}]
)
def test_one_motion_has_one_verdict_at_every_rate_of_sampling(effect):
    base = Model.from_text(CASE)
    true = base
    for name, values in effect.items():
        true = true.with_effect(name, values)
    options = Options(
        quick=True, most_effects=1, candidates=("quadratic_drag", "cubic_spring", "offset_force")
    )
    for rate in (125, 500, 2000, 8000):
        records = [record_of(true, rate, number) for number in range(3)]
        verdict = discover(base, records[:2], records[2:], options)
        assert verdict["outcome"] == ("named" if effect else "none"), rate
        assert verdict["effects"] == list(effect), rate
        assert verdict["gap"]["held_out"]["after"] == pytest.approx(1, abs=0.15)
        if effect:
            assert min(one["closed"] for one in verdict["remains"]) > 0.9
            found = verdict["parameters"]["effect.quadratic_drag.coefficient"]
            assert abs(found["value"] - 0.1) < 5 * found["standard_error"]


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize("rate", [200, 8000])
def test_noise_with_memory_is_no_gap_at_any_rate(rate):
    """Its memory and size are found though nobody states them, and nothing else."""
    base = Model.from_text(CASE)
    memory, sigma = 0.5, 2e-3
    records = []
    for number in range(3):
        one = record_of(base, rate, number)
        clean = one.x - SIGMA * np.random.default_rng([number, rate]).standard_normal(one.t.size)
        white = np.random.default_rng([number, rate, 5]).standard_normal(one.t.size)
        noise = lfilter([sigma * np.sqrt(1 - memory**2)], [1, -memory], white)
        header = {key: value for key, value in one.header.items() if "sigma" not in key}
        records.append(make_record(one.name, {"t": one.t, "x": clean + noise}, header | {"units": "s, m"}))
    verdict = discover(base, records[:2], records[2:], Options(quick=True, candidates=("quadratic_drag",)))
    assert verdict["outcome"] == "none", verdict["reasons"]
    for one in verdict["records"]:
        assert one["memory"] == pytest.approx(memory, abs=0.08)
        assert one["sigma"] == pytest.approx(sigma, rel=0.1)
    for one in verdict["gap"].values():
        assert one["after"] == pytest.approx(1, abs=0.1)


def candidate(training: float, left: float, samples: float, p: float = 0.0) -> ScoredCandidate:
    """An effect that gained so much and leaves so much in chi^2, by chance with a probability of `p`."""
    fit = SimpleNamespace(samples=samples, excess=left, sample_chi2=1 + left / samples)
    prediction = SimpleNamespace(excess=left)
    problem = SimpleNamespace(prepared=[])
    one = ScoredCandidate(
        SimpleNamespace(fit=fit, problem=problem), prediction, training, training, np.zeros(0), 1
    )
    one.ceiling = SimpleNamespace(p=p, closable=left if p < 0.01 else 0.0, fit=fit)
    return one


def test_a_gap_that_is_closed_but_for_a_hundredth_is_adequate_whatever_the_rest_is():
    """As 23854 to 1.14 at 20 000 samples; what leaves a tenth does not."""
    assert adequate(candidate(training=1e8, left=2800, samples=20_000), Options())
    assert not adequate(candidate(training=1e5, left=28_000, samples=20_000), Options())


def test_noise_larger_than_stated_is_no_gap():
    """As velocities of a slightly nonlinear sensor: no force explains the remainder."""
    assert adequate(candidate(training=512, left=400, samples=2400, p=0.02), Options())
    assert not adequate(candidate(training=512, left=400, samples=2400, p=1e-3), Options())
    assert not adequate(candidate(training=512, left=3000, samples=2400, p=0.02), Options())


def test_what_is_left_over_is_no_trifle_beside_an_effect_that_explains_less():
    """As a second mode of 0.05 of the noise, of which further harmonics of the drive explain a little."""
    assert not adequate(candidate(training=26, left=159, samples=64_402), Options())
    assert adequate(candidate(training=100, left=159, samples=64_402), Options())
    # what chance leaves is nothing, however little the effect explains
    assert adequate(candidate(training=26, left=159, samples=64_402, p=0.1), Options())


def test_what_is_far_below_the_noise_of_a_sample_is_no_gap():
    options = Options()
    fit = SimpleNamespace(samples=1e6)
    assert not sizeable(2000, fit, options)
    assert sizeable(3000, fit, options)
    # with as few samples as were always enough
    assert sizeable(7, SimpleNamespace(samples=2400), options)


@pytest.mark.parametrize(
    ("speed", "position", "pieces", "mostly"),
    # p of gains as large is 0 for all of them
    [(2e3, 1.5e5, 1.6e5, "position"), (2e3, 1.5e3, 1.6e5, ""), (90, 30, 60, "speed")],
)
def test_what_a_force_depends_on_is_what_explains_most(speed, position, pieces, mostly):
    gains = {"speed": speed, "position": position, "pieces": pieces}
    families = [Family(name, gain, 5, float(chi2.sf(gain, 5))) for name, gain in gains.items()]
    assert Ceiling(families, None).mostly == mostly


def test_a_note_states_that_errors_count_noise_alone_where_a_law_leaves_more(monkeypatch):
    monkeypatch.setattr("separatrix.discovery.decision.verdict.within_tables", lambda _: np.ones(1, bool))

    def notes(leaves: str, beside: bool) -> list[str]:
        left = SimpleNamespace(fit=SimpleNamespace(sample_chi2=1.44))
        ahead = SimpleNamespace(with_imperfections=beside)
        return _of_accepted(SimpleNamespace(leaves=leaves, name="viscous", ceiling=left, prediction=ahead))

    assert notes(NOISE, False) == []
    assert "errors of parameters count noise alone" in notes(LITTLE, False)[0]
    assert "1.2 times as large" in notes(LARGER_NOISE, False)[0]
    (note,) = notes(NOISE, True)
    assert "beside small imperfections of the rig" in note


def test_a_function_is_reported_with_its_hump():
    none = np.zeros((5, 5))
    member = next(one for one in MEMBERS if one.effect == "friction_position_curve")
    at = np.linspace(-0.02, 0.02, 5)

    def hump(value: list[float], error: float) -> str:
        part = Part("", at, np.array(value), error**2 * np.eye(5), none, none[0], none[0])
        return _hump(part, member.unit)

    assert hump([0.06, 0.07, 0.096, 0.07, 0.059], 0.001) == " through 0.096 at 0 m"
    assert hump([0.06, 0.05, 0.02, 0.05, 0.059], 0.001) == " through 0.02 at 0 m"
    assert hump([0.06, 0.07, 0.08, 0.09, 0.10], 0.001) == ""
    assert hump([0.06, 0.07, 0.096, 0.07, 0.059], 0.02) == ""


def test_the_remainder_is_reported_in_words():
    text = Remains("training", 0.99994, 0.37, "velocity").text()
    assert text == (
        "in training, 99.994 % of the gap is closed; what remains is 0.37 times the noise of a sample, "
        "mostly a force that depends on velocity"
    )
    assert share_text(1.0) == "100 %"
    assert share_text(0.5) == "50 %"
    assert "below the noise" in Remains("held_out", 0.999, 0.01, "").text()


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize("noise", [1e-4, 0.0])
def test_a_noisy_crank_angle_is_fitted_within_its_error(noise):
    model = Model.from_text(CASE)
    prepared = [prepare(record_of(model, 400, 0, phi_noise=noise), model)]
    one = prepared[0]
    count = one.record.t.size
    assert one.phase_known
    free = drive_nuisances(model, prepared)
    assert ("nuisance:phase" in [each.path for each in free]) == bool(noise)
    if not noise:
        return
    assert one.phase_error == pytest.approx(1e-4 / np.sqrt(count), rel=0.1)
    assert one.clock_error == pytest.approx(
        1e-4 * np.sqrt(12 / count) / one.record.duration / one.frequency, rel=0.1
    )
    first = np.arange(0, count - 100, 100)
    problem = BodyInMotion(model, prepared, padded(0 * first, first, first + 100), free)
    values = problem.values
    starts = np.column_stack([one.record.x[first], np.zeros(first.size)])
    off = values.copy()
    index = [each.path for each in free].index("nuisance:phase")
    off[index] = 3 * one.phase_error
    # three errors cost 9 of chi^2, shared among the segments
    column = problem.channels * 100 + [k for k, each in enumerate(free) if each.error].index(index)
    found = problem.evaluate(off, starts)
    assert np.sum(found.used * found.residual**2, axis=0)[column] == pytest.approx(9)
    assert found.used[:, column].sum() == pytest.approx(1)
    assert np.all(found.by_parameter[:, column, index] == 1 / one.phase_error)
