# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small imperfections of a rig explain their own effects and nothing larger."""

from dataclasses import replace

import numpy as np
import pytest
from program import CASE
from separatrix.discovery.decision import plan as plan_module
from separatrix.discovery.decision.plan import search
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.stages import rig_imperfections
from separatrix.discovery.decision.stages.rig_imperfections import in_words
from separatrix.discovery.decision.state import SearchState
from separatrix.discovery.fitting.base import fit_base
from separatrix.discovery.fitting.catalogue import candidate
from separatrix.discovery.fitting.ceiling import ceiling
from separatrix.discovery.fitting.data import gather, scales_of
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.fitted import Fitted, values_of
from separatrix.discovery.fitting.heldout import Known, predict
from separatrix.discovery.fitting.one_body import BodyInMotion
from separatrix.discovery.fitting.rig import (
    Contest,
    cleaned,
    cleaned_prediction,
    evidence_of_imperfections,
    imperfections_of,
    share_with_imperfections,
    shares_with_imperfections,
    with_imperfections,
)
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.options import Options
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")

NOISE = 4e-4


def fitted_base(drag: float, curved: float) -> tuple[Fitted, Model]:
    """The machine of the case fitted to a record with drag and a sensor that is not quite linear."""
    base = Model.from_text(CASE)
    true = base.with_effect("quadratic_drag", {"coefficient": drag})
    t = np.arange(1200) / 125
    start = np.array([[0.6, 0.0, 0.4]])
    paths, values = ["drive.ratio"], np.array([1.1])
    x = true.segments(paths, values, start, np.array([0, t.size]), t, derivatives=False).x
    u = (x - x.mean()) / x.std()
    x = x + curved * x.std() * u**2 + NOISE * np.random.default_rng(5).standard_normal(t.size)
    head = {"units": "s, m", "drive_ratio": 1.1, "phase": 0.4, "sensor_noise_sigma_m": NOISE}
    prepared = [prepare(make_record("record", {"t": t, "x": x}, head), base)]
    return fit_base(gather(prepared, 1.0, None), base, 1.0), true


def with_drag(base: Fitted, true: Model) -> Fitted:
    """The same with the drag that it lacks, which is known."""
    old = base.problem
    problem = BodyInMotion(true, old.prepared, old.segments, old.free)
    return Fitted(("quadratic_drag",), true, problem, minimise(problem, base.fit.values, base.fit.starts), ())


def test_a_curved_sensor_is_no_gap():
    base, _ = fitted_base(drag=0.0, curved=1e-3)
    gap = ceiling(base.problem, base.fit, 1.0)
    assert base.fit.sample_chi2 > 1.2
    assert gap.fit.sample_chi2 < 1.1
    assert gap.p > 0.01
    # an exact step of the quadratic model: the stated remainder is the real one
    again = cleaned(base.problem, gap.fit)
    assert again.total == pytest.approx(gap.fit.total, abs=0.2 * (base.fit.total - gap.fit.total))


@pytest.mark.parametrize("curved", [0.0, 2e-3])
def test_a_bent_sensor_is_no_memory_of_the_noise(curved):
    """It leaves kinks where the speed jumps, smooth otherwise: the noise is white all the same."""
    base, _ = fitted_base(drag=0.0, curved=curved)
    assert base.problem.prepared[0].memory == 0


def test_a_sensor_that_is_more_curved_than_rigs_are_is_a_gap():
    base, _ = fitted_base(drag=0.0, curved=3e-3)
    gap = ceiling(base.problem, base.fit, 1.0)
    assert gap.p < 1e-6
    assert gap.fit.sample_chi2 > 1.2


def test_an_effect_is_its_own_as_far_as_it_is_larger_than_faults_of_a_rig():
    shares = []
    for drag in (0.02, 0.05, 0.3):
        base, true = fitted_base(drag=drag, curved=0.0)
        shares.append(share_with_imperfections(with_drag(base, true), base))
        assert ceiling(base.problem, base.fit, 1.0).p < 1e-6 or drag < 0.05
    assert shares == sorted(shares)
    assert shares[-1] > 0.8


@pytest.mark.parametrize(("gain", "imperfections", "beside", "lead"), [
    # without evidence of imperfections all of the gain is evidence
    (20.0, (-12.0, -5.0, -2.0), (1.0, 2.0, 5.0), 20.0),
    # one effect explains with fewer parameters what sixteen imperfections explain too
    (150.0, (124.0, 120.0, 97.0), (9.0, 20.0, 47.0), 26.0),
    # the imperfections of the rig explain nearly all that the effect explains
    (11.0, (33.0, 30.0, 21.0), (0.3, 0.8, 2.8), 0.3),
])  # fmt: skip
def test_a_rig_has_imperfections_or_it_has_none(gain, imperfections, beside, lead):
    """An effect has to beat the better of the two, and may have imperfections beside it itself."""
    contest = Contest(gain, np.array(imperfections), np.array(beside))
    assert contest.lead == pytest.approx(lead)
    # that a rig has imperfections is known from all of its records
    clean = Contest(5.0, np.full(3, -4.0), np.full(3, 0.1))
    more = (contest + clean).lead - contest.lead
    assert more < 0.2 if lead < 1 else more >= 5.0


def test_an_imperfection_of_the_rig_is_no_effect():
    base, _ = fitted_base(drag=0.0, curved=1e-3)
    assert share_with_imperfections(replace(base, fit=cleaned(base.problem, base.fit)), base) < 0.3


def three_records(curved: tuple[float, float, float], drag: float = 0.0) -> tuple[Model, list]:
    """Two records and one held out of the machine of a machine with drag; each sensor has its own curve."""
    base = Model.from_text(CASE)
    true = base.with_effect("quadratic_drag", {"coefficient": drag}) if drag else base
    t = np.arange(1200) / 125
    prepared = []
    for number, (ratio, square) in enumerate(zip((1.1, 0.8, 1.3), curved, strict=True)):
        start = np.array([[0.6, 0.0, 0.4]])
        paths, values = ["drive.ratio"], np.array([ratio])
        x = true.segments(paths, values, start, np.array([0, t.size]), t, derivatives=False).x
        noise = np.random.default_rng([5, number]).standard_normal(t.size)
        x = x + square * x.std() * ((x - x.mean()) / x.std()) ** 2 + NOISE / 2 * noise
        head = {"units": "s, m", "drive_ratio": ratio, "phase": 0.4, "sensor_noise_sigma_m": NOISE / 2}
        prepared.append(prepare(make_record(f"r{number}", {"t": t, "x": x}, head), base))
    return base, prepared


def test_a_sensor_that_is_curved_unlike_in_each_record_is_no_gap_and_no_wrong_number():
    """Neither where it was fitted nor predicted; the intervals include the shift by imperfections."""
    base, prepared = three_records((1e-3, -1e-3, 8e-4))
    fitted = fit_base(gather(prepared[:2], 1.0, None), base, 1.0)
    assert fitted.fit.sample_chi2 > 1.5
    assert ceiling(fitted.problem, fitted.fit, 1.0).fit.sample_chi2 < 1.1
    held_out = gather(prepared[2:], 1.0, None)
    known = Known(fitted.fit.values, fitted.covariance, fitted.unseen)
    prediction = predict(held_out, base, fitted.problem.free, known)
    assert prediction.sample_chi2 > 1.5
    assert (
        cleaned(prediction.problem, prediction.fit).reduced_chi2
        > cleaned_prediction(fitted, prediction).reduced_chi2
    )
    assert cleaned_prediction(fitted, prediction).sample_chi2 < 1.15
    beside = with_imperfections(fitted.problem, fitted.fit)
    off, narrow = [], []
    for i, one in enumerate(fitted.problem.free):
        if one.record is None:
            true = 1.0 if one.is_nuisance else base.parameters[one.path].value
            off.append(abs(one.physical(fitted.fit.values[i]) - true) / beside.errors[i])
            narrow.append(off[-1] * beside.errors[i] / np.sqrt(fitted.covariance[i, i]))
    assert max(off) < 3
    assert max(narrow) > 5


@pytest.mark.parametrize(("curved", "drag"), [(1e-3, 0.0), (0.0, 0.1)])
def test_a_better_prediction_counts_only_as_far_as_imperfections_do_not_explain_it(curved, drag):
    base, prepared = three_records((curved, -curved, curved), drag)
    training, held_out = gather(prepared[:2], 1.0, None), gather(prepared[2:], 1.0, None)
    without = fit_base(training, base, 1.0)
    found = candidate(base, without.problem.free, (), "quadratic_drag", scales_of(training, base))
    problem = training.problem(found.model, training.last, found.free)
    fit = minimise(problem, values_of(without, found.free), without.fit.starts)
    effect = Fitted(found.names, found.model, problem, fit, found.added)
    predictions = [
        predict(held_out, one.model, one.problem.free, Known(one.fit.values, one.covariance, one.unseen))
        for one in (effect, without)
    ]
    _, share = shares_with_imperfections((effect, without), tuple(predictions))
    assert share > 0.6 if drag else share < 0.2


@pytest.mark.parametrize("curved", [1e-3, 0.0])
def test_the_evidence_of_faults_of_a_rig_is_that_of_all_records(curved):
    base, prepared = three_records((curved, -curved, curved))
    fitted = fit_base(gather(prepared[:2], 1.0, None), base, 1.0)
    known = Known(fitted.fit.values, fitted.covariance, fitted.unseen)
    prediction = predict(gather(prepared[2:], 1.0, None), base, fitted.problem.free, known)
    evidence = evidence_of_imperfections(fitted, prediction)
    assert evidence > 100 if curved else evidence < 3


@pytest.mark.parametrize("memory", [0.0, 0.6])
def test_whitened_columns_come_back_in_their_units(memory):
    base, _ = fitted_base(drag=0.0, curved=0.0)
    problem = base.problem
    problem.prepared[0].memory = memory
    inside = problem.segments.inside
    table = np.random.default_rng(7).standard_normal((*inside.shape, 3)) * inside[:, :, None]
    found = problem.in_units(problem.whitened(table / NOISE))
    assert found.shape == (inside.shape[0], 1, inside.shape[1], 3)
    assert found[:, 0] == pytest.approx(table, abs=1e-12)


def test_imperfections_that_are_fitted_are_those_that_are_weighed():
    """The curve of a sensor about the mean of its record, over its standard deviation, in units of 5e-4."""
    base, _ = fitted_base(drag=0.0, curved=1e-3)
    tables = imperfections_of(base.problem, base.fit, 10.0)
    assert len(tables) == 14
    followed = base.problem.segments.inside & base.fit.good[:, None]
    x = base.problem.prepared[0].record.x
    u = (base.fit.evaluation.x - x.mean()) / x.std()
    square = tables["nuisance:imperfection_of_rig:curve_2", 0][:, 0]
    assert square[followed] == pytest.approx((5e-4 * x.std() * u**2)[followed], rel=1e-9)
    # harmonics have one size for all records, whatever their motion
    twice = imperfections_of(base.problem, base.fit, 20.0)["nuisance:imperfection_of_rig:sine_2", None]
    assert twice == pytest.approx(2 * tables["nuisance:imperfection_of_rig:sine_2", None], rel=1e-12)
    assert np.abs(twice).max() > 0


def context_of(curved: tuple[float, float, float], drag: float) -> tuple[SearchContext, Fitted]:
    """What a search needs, on the machine without drag fitted to two records."""
    base, prepared = three_records(curved, drag)
    training, held_out = gather(prepared[:2], 1.0, None), gather(prepared[2:], 1.0, None)
    options = Options(candidates=("quadratic_drag", "cubic_spring", "offset_force"), most_effects=1)
    return SearchContext(training, held_out, scales_of(training, base), options), fit_base(
        training, base, 1.0
    )


@pytest.mark.parametrize("drag", [0.0, 0.008])
def test_an_effect_that_faults_hide_is_named_beside_them(monkeypatch, drag):
    """They explain many times as much as it does; without it they are all there is."""
    context, fitted = context_of((1.2e-3, -1.2e-3, 1.2e-3), drag)
    noise = []
    beside = rig_imperfections.beside_imperfections

    def kept(state: SearchState) -> SearchState:
        assert state.decision.outcome != "named"
        noise.append([(one.sigma, one.memory) for one in context.training.prepared])
        return beside(state)

    plan = tuple(replace(one, run=kept) if one.run is beside else one for one in plan_module.PLAN)
    monkeypatch.setattr(plan_module, "PLAN", plan)
    found = search(SearchState(context, fitted))
    decision = found.decision
    assert noise == [[(one.sigma, one.memory) for one in context.training.prepared]]
    assert (found.context.training is context.training) == (not drag)
    assert decision.outcome == ("named" if drag else "none")
    if drag:
        (one,) = decision.accepted
        assert one.name == "quadratic_drag"
        free, values = one.fitted.problem.free, one.fitted.fit.values
        index = one.fitted.added[0]
        error = np.sqrt(one.fitted.covariance[index, index])
        assert abs(values[index] - drag) < 4 * error
        sizes = {(known.path, known.record): value for known, value in zip(free, values, strict=True)}
        squares = [sizes["nuisance:imperfection_of_rig:curve_2", record] for record in (0, 1)]
        assert squares == pytest.approx([2.4, -2.4], abs=0.6)
        # its own of the held-out record; those of the drive are known from training
        ahead = one.prediction.problem.free
        own = [known for known in ahead if known.is_imperfection and known.record is not None]
        assert [known.error for known in own] == [1.0, 1.0]
        shared = [known for known in ahead if known.is_imperfection and known.record is None]
        assert [known.error for known in shared] == [None] * 12
        (words,) = in_words(one.fitted)
        assert "curved by up to 0.0012 of the signal" in words or "curved by up to 0.001" in words
        assert in_words(fitted) == []


def test_an_imperfection_beyond_its_largest_size_gives_no_name():
    """A sensor that is curved by four standard deviations: what three leave over is no friction."""
    context, fitted = context_of((2e-3, 2e-3, 2e-3), 0.0)
    found = search(SearchState(context, fitted))
    assert found.context.training is context.training
    assert found.decision.outcome != "named"
    assert "rig imperfections" in [one.stage for one in found.steps]
