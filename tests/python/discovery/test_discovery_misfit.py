# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A record that the machine misses is never ignored, and noise is doubted where the samples contradict it."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from separatrix.discovery.decision import misfit
from separatrix.discovery.decision.misfit import doubted_noise, missed, too_quiet, unused
from separatrix.discovery.decision.remains import noise_and_signal
from separatrix.discovery.decision.stages import conclusions
from separatrix.discovery.decision.state import Decision
from separatrix.discovery.fitting.base import limit_noise
from separatrix.discovery.fitting.noise import Noise, white_share
from separatrix.discovery.measured.in_force import DrivenPrepared
from separatrix.discovery.measured.signals import white_noise
from separatrix.discovery.options import Options

SAMPLES, SEGMENTS = 50, 20
BODY = SimpleNamespace(
    model=SimpleNamespace(parameters={"restoring.stiffness"}), unit=lambda units: units.position
)


def data(sigma: float, scatter: float) -> SimpleNamespace:
    """Two records of a smooth motion whose samples scatter by `scatter`, the noise stated as `sigma`."""
    t = np.arange(SAMPLES * SEGMENTS) / 500
    noise = np.random.default_rng(4).standard_normal((2, t.size))
    prepared = [
        SimpleNamespace(
            record=SimpleNamespace(name=name),
            signal=np.sin(9 * t) + scatter * one,
            noise_key="sensor_noise_sigma_m",
            sensor_noise={},
            sigma=sigma,
            sigma_stated=True,
            resolution=0.0,
            doubt=1.0,
        )
        for name, one in zip(("first", "second"), noise, strict=True)
    ]
    stages = [SimpleNamespace(record=np.repeat([0, 1], SEGMENTS))]
    return SimpleNamespace(prepared=prepared, stages=stages, last=0)


def fit(first: float, second: float) -> SimpleNamespace:
    """A fit that leaves these reduced chi^2 of the two records."""
    size = np.repeat([first, second], SEGMENTS)
    return SimpleNamespace(
        chi2=size * (SAMPLES - 2),
        unknowns=2,
        counts=np.full(2 * SEGMENTS, SAMPLES),
        good=np.ones(2 * SEGMENTS, bool),
        reduced_chi2=0.5 * (first + second),
        sample_chi2=0.5 * (first + second),
        condensed=lambda rows: (0.0, 0.0),
        evaluation=SimpleNamespace(failed=np.zeros(2 * SEGMENTS, bool)),
    )


def test_the_records_that_are_missed_are_named():
    assert missed(data(1, 1), fit(1.05, 1.0), Options()) == []
    assert missed(data(1, 1), fit(1.0, 1.4), Options()) == ["second (reduced chi^2 1.4)"]


def test_a_record_that_cannot_be_simulated_is_missed_and_reported():
    found = fit(1.05, 1.0)
    found.evaluation.failed[SEGMENTS:] = True
    found.good[SEGMENTS:] = found.good[0] = False
    assert missed(data(1, 1), found, Options()) == ["second (no segment of it can be flown)"]
    assert unused(data(1, 1), found, contacts=True) == [
        f"first: 1 of {SEGMENTS} segments are not used: the impacts of 1 are not steady",
        f"second: {SEGMENTS} of {SEGMENTS} segments are not used: {SEGMENTS} cannot be flown",
    ]


def test_a_machine_without_contacts_has_no_impacts_that_are_not_steady():
    found = fit(1.0, 1.0)
    found.good[:2] = False
    found.counts[0] = 0
    assert unused(data(1, 1), found, contacts=False) == [
        f"first: 2 of {SEGMENTS} segments are not used: 1 have no sample that counts and "
        "1 have no derivatives at some samples"
    ]


@pytest.mark.parametrize(("training", "held_out", "outcome"), [(1, 1, "none"), (9, 1, ""), (1, 9, "")])
def test_nothing_is_missing_only_if_all_records_are_explained(monkeypatch, training, held_out, outcome):
    # without imperfections of a rig
    monkeypatch.setattr(conclusions, "cleaned_prediction", lambda base, prediction: prediction.fit)
    context = SimpleNamespace(training=data(1, 1), held_out=data(1, 1), options=Options())
    problem = SimpleNamespace(locates=False)
    first = SimpleNamespace(base=SimpleNamespace(problem=problem, fit=fit(training, 1)))
    predicted = SimpleNamespace(problem=None, fit=fit(1, held_out))
    gap = SimpleNamespace(p=0.5, fit=first.base.fit)
    decision = Decision("none", [], [], [], [first], gap, predicted)
    found = conclusions.without_name(context, decision)
    assert found.outcome == (outcome or "not-in-catalogue")
    assert bool(found.reasons) == (not outcome)


def test_stated_noise_is_doubted_where_the_samples_show_another(monkeypatch):
    """Scatter that only the fit shows is what the machine lacks."""
    monkeypatch.setattr(misfit, "noise_of", lambda *_: Noise({0: 30.0, 1: 30.0}, 0.0))
    assert doubted_noise(data(1e-3, 1e-3), BODY, fit(900, 900), 1) == []
    notes = doubted_noise(data(1e-4, 1e-3), BODY, fit(900, 900), 1)
    assert [text.split(":")[0] for text in notes] == ["first", "second"]
    assert "stated as 0.0001 m" in notes[0]


def test_noise_that_is_stated_too_large_is_doubted(monkeypatch):
    monkeypatch.setattr(misfit, "noise_of", lambda *_: Noise({0: 0.01, 1: 0.01}, 0.0))
    notes = doubted_noise(data(0.1, 1e-3), BODY, fit(1e-4, 1e-4), 1)
    assert all("scatter by only 0.001 m" in text for text in notes)
    assert len(notes) == 2
    assert too_quiet(data(0.1, 1e-3), fit(1e-4, 1))
    assert not too_quiet(data(0.1, 0.1), fit(1, 1))


def test_unstated_noise_far_above_the_scatter_of_the_samples_is_reported(monkeypatch):
    monkeypatch.setattr(misfit, "noise_of", lambda *_: Noise({0: 1.0, 1: 1.0}, 0.0))
    taken = data(1e-2, 1e-3)
    for one in taken.prepared:
        one.sigma_stated, one.memory = False, 0.0
    # the memory of the noise explains that neighbours scatter little
    taken.prepared[1].sigma, taken.prepared[1].memory = 3e-3, 0.9
    (note,) = doubted_noise(taken, BODY, fit(1, 1), 1)
    assert note.startswith("first: noise of 0.01 m is taken, neighbouring samples scatter by 0.00103 m")


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_fourth_differences_show_the_share_of_noise_that_its_memory_leaves(memory):
    random = np.random.default_rng(8).standard_normal(200_000)
    noise = lfilter([np.sqrt(1 - memory**2)], [1, -memory], random)
    assert white_noise(noise) ** 2 == pytest.approx(white_share(memory), rel=0.05)


@pytest.mark.parametrize(
    ("taken", "stated", "left"), [(3e-2, False, 1e-3), (3e-2, True, 3e-2), (1.2e-3, False, 1.2e-3)]
)
def test_noise_far_above_that_of_the_same_sensor_is_limited(taken, stated, left):
    training, held_out = data(1e-5, 1e-3), data(taken, 1e-3)
    for one in held_out.prepared:
        one.sigma_stated = stated
    # a stated size below the scatter of the samples is not that of the sensor
    assert limit_noise(training, held_out) == (left != taken)
    assert [one.sigma for one in held_out.prepared] == pytest.approx([left, left], rel=0.1)


def test_what_is_missed_of_a_force_counts_the_error_of_the_acceleration():
    """Only the noise of the sensor counted, which may be a hundredth of it."""
    random, sigma, missed_force = np.random.default_rng(5), 3.6e-4, 0.4
    t = np.arange(4000.0)
    record = SimpleNamespace(t=t, x=t, v=None, force=random.standard_normal(4000), pieces=[(0, 4000)])
    error = np.geomspace(0.02, 0.08, 4000)
    driven = SimpleNamespace(inertia_error=error)
    one = DrivenPrepared(record, sigma, 0.0, 0.0, driven=driven)
    noise, signal = noise_and_signal(SimpleNamespace(prepared=[one]))
    assert signal == pytest.approx(np.std(record.force))
    chi2 = np.mean((missed_force / one.deviation(slice(None))) ** 2)
    assert noise * np.sqrt(chi2) == pytest.approx(missed_force, rel=1e-12)
    plain = SimpleNamespace(signal=record.force, sigma=sigma)
    assert noise_and_signal(SimpleNamespace(prepared=[plain]))[0] == pytest.approx(sigma, rel=1e-15)
