# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A machine that contains the base fits no worse, or its fit is not taken for converged."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.fitting import data as data_module
from separatrix.discovery.fitting import refit
from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.machine import IMPERFECTION, Free
from separatrix.discovery.policy import FIT

FREE = [Free("restoring.stiffness", 9.0), Free("effect.viscous.damping", 0.5, lower=0.0)]


def fit(values: list[float], chi2: float) -> Fit:
    """A fit of four segments that seems converged."""
    ones = np.ones(4)
    flown = SimpleNamespace(steady=ones > 0, failed=ones < 0)
    starts, open_ = np.zeros((4, 2)), np.zeros(len(values), bool)
    return Fit(np.array(values), starts, flown, None, chi2 * ones, 50 * ones, 0.0, 1, open_, ~open_)


@pytest.mark.parametrize(("linear", "lowest", "wanted", "converged"), [
    (True, 100.0, [8.0, 0.0], True),
    (True, 120.0, [8.0, 0.0], False),
    (False, 100.0, [9.0, 0.5], True),
])  # fmt: skip
def test_a_candidate_is_fitted_from_the_base_before_it_is_worse(
    monkeypatch, linear, lowest, wanted, converged
):
    monkeypatch.setattr(refit, "minimise", lambda problem, values, starts: fit(values, lowest))
    data = SimpleNamespace(last=0, problem=lambda *_: None)
    base = Fitted((), None, SimpleNamespace(free=FREE[:1]), fit([8.0], 100.0), ())
    candidate = SimpleNamespace(
        names=("viscous",), model=None, free=FREE, added=(1,), linear=np.array([linear])
    )
    poor = Fitted(("viscous",), None, SimpleNamespace(free=FREE), fit([9.0, 0.5], 900.0), (1,))
    assert poor.fit.converged
    found = refit._above_base(data, poor, base, candidate)
    assert found.fit.values.tolist() == wanted
    assert found.fit.converged == converged


def test_a_motion_is_imitated_without_imperfections_of_the_rig_and_followed_with_them(monkeypatch):
    """The motion of the other name is that of its machine, without fitted imperfections."""
    imperfection = Free(f"{IMPERFECTION}curve_2", 0.0, -3.0, 3.0, record=0)
    free = [FREE[0], imperfection, FREE[1]]
    problem = SimpleNamespace(free=free, evaluate=lambda *_, **__: None, imitating=lambda _: "imitated")
    other = Fitted(("coulomb",), None, problem, fit([8.0, 1.5, 0.4], 100.0), (2,))
    one = Fitted(("viscous",), None, problem, fit([9.0, 0.0, 0.5], 300.0), (2,))
    candidate = SimpleNamespace(names=("viscous",), free=free, added=(2,), linear=np.array([True]))
    begun = []

    def minimise(problem, values, starts, most, fixed=None):
        begun.append((problem, values.tolist(), None if fixed is None else fixed.tolist()))
        # a tenth of the size of the other moves the machine by so much
        return fit([8.1, *values[1:2], 0.02] if problem == "imitated" else values, 90.0)

    monkeypatch.setattr(refit, "minimise", minimise)
    monkeypatch.setattr(refit, "polished", lambda data, problem, fit, *_, **__: fit)
    refit._imitated(SimpleNamespace(last=0), one, other, candidate)
    assert begun[0] == ("imitated", [8.0, 0.0, 0.0], [False, True, False])
    assert begun[1][1] == pytest.approx([9.0, 1.5, 0.2])


@pytest.mark.parametrize(("linear", "added", "chi2", "far", "enough"), [
    (True, (), 90.0, 100.0, True),
    # worse than the machine that it contains: thrown out of its minimum
    (True, (), 101.0, 100.0, False),
    (False, (), 90.0, 100.0, False),
    (False, (), 101.0, 100.0, True),
    # on top of an effect one start suffices, whatever its result
    (False, (1,), 101.0, 100.0, True),
    # a base that is far off does not show where the minimum is
    (True, (), 90.0, 2000.0, False),
])  # fmt: skip
def test_a_start_from_afar_is_spared_where_the_base_leads(linear, added, chi2, far, enough):
    base = Fitted((), None, SimpleNamespace(free=FREE[:1]), fit([8.0], far), added)
    found = Fitted(("viscous",), None, SimpleNamespace(free=FREE), fit([9.0, 0.5], chi2), (1,))
    candidate = SimpleNamespace(linear=np.array([linear]))
    assert refit._enough(found, base, candidate, None) == enough


@pytest.mark.parametrize(("both", "agreed"), [
    ((300.0, 310.0), True),
    ((102.0, 103.0), False),
    ((300.0, 400.0), False),
])  # fmt: skip
def test_two_starts_that_end_alike_far_behind_the_base_are_enough(both, agreed):
    """Though no other effect has converged yet."""
    known = Fitted((), None, SimpleNamespace(free=FREE[:1]), fit([8.0], 100.0), ())
    one, other = (
        Fitted(("viscous",), None, SimpleNamespace(free=FREE), fit([9.0, 0.5], chi2), (1,)) for chi2 in both
    )
    assert refit._agree({"near"}, one, other, known, None) == agreed


@pytest.mark.parametrize(("others", "tried"), [(400.0, False), (101.0, True)])
def test_segments_are_not_rescued_where_all_others_are_far_behind_a_rival(monkeypatch, others, tried):
    asked = []

    def rescued(problem, fit_, suspects, guesses, spread):
        asked.append(len(guesses))
        return fit_.starts, np.zeros(4, bool)

    poor = fit([9.0, 0.5], 1.0)
    poor.chi2[:] = [others, others, others, 9000.0]
    monkeypatch.setattr(data_module, "rescued", rescued)
    monkeypatch.setattr(data_module, "_without", lambda *_: poor)
    records = SimpleNamespace(
        smoothed_starts=lambda _: poor.starts,
        smoothed_errors=lambda _: poor.starts,
        last=0,
        base_starts=poor.starts.copy(),
    )
    found = data_module.polished(records, None, poor, 0, 8, rival=fit([8.0], 100.0))
    assert found is poor
    # of the fit, and of the machine of the others; from the smoother, the rival, and the base machine
    assert asked == ([3, 3] if tried else [])


@pytest.mark.parametrize(("chi2", "gained"), [(60.0, 20.0), (140.0, 0.0)])
def test_a_segment_with_unsteady_impacts_counts_for_what_its_squares_prove(chi2, gained):
    """Its start could not be fitted, so that it may be followed better still: never worse."""
    base = Fitted((), None, SimpleNamespace(free=FREE[:1]), fit([8.0], 100.0), ())
    one = Fitted((), None, SimpleNamespace(free=FREE[:1]), fit([8.0], 100.0), ())
    one.fit.evaluation.steady = np.array([True, False, True, False])
    one.fit.evaluation.failed = np.array([False, False, False, True])
    one.fit.chi2[1], one.fit.chi2[3] = chi2, 0.0
    assert refit.gain_over(one, base)[0] == pytest.approx(gained)
    assert refit.gain_over(base, one)[0] == pytest.approx(-gained)


@pytest.mark.parametrize(
    ("chi2", "of_base", "wanted"),
    [(55.0, 100.0, True), (60.0, 100.0, False), (60.0, 1e6, True), (75.0, 1e6, False)],
)
def test_a_machine_that_nearly_leaves_noise_of_a_large_gap_settles_it(chi2, of_base, wanted):
    """Of 192 degrees of freedom: 1.15 and 1.25 are within two and four standard deviations, 1.56 is not."""
    one, base = (Fitted((), None, None, fit([8.0], size), ()) for size in (chi2, of_base))
    assert refit.leaves_noise(one, base) == wanted


@pytest.mark.parametrize(("ended_at", "carried"), [(80.0, True), (300.0, False)])
def test_a_fit_that_ends_on_its_way_is_carried_on_before_others_are_begun(monkeypatch, ended_at, carried):
    unfinished = replace(fit([8.0, 0.3], ended_at), decrement=270.0)
    begun = []

    def minimise(problem, values, starts, most=25, **_):
        begun.append(most)
        return fit(values.tolist(), 50.0)

    monkeypatch.setattr(refit, "minimise", minimise)
    monkeypatch.setattr(refit, "_try", lambda *_: (None, unfinished))
    monkeypatch.setattr(refit, "polished", lambda data, problem, found, *_, **__: found)
    base = Fitted((), None, SimpleNamespace(free=FREE[:1]), fit([8.0], 400.0), ())
    candidate = SimpleNamespace(
        names=("viscous",), model=None, free=FREE, added=(1,), linear=np.array([True]), starts=[]
    )
    screened = SimpleNamespace(
        step={"viscous": np.ones(1)}, origin={"viscous": np.zeros(1)}, live={"viscous": np.ones(1) > 0},
        gain={"viscous": 700.0},
    )  # fmt: skip
    found = refit.refit(SimpleNamespace(last=0), base, candidate, screened)
    assert (FIT.fit_on in begun) == carried
    assert found.fit.converged == carried


def test_the_order_far_from_the_base_is_that_of_a_few_steps_from_it(monkeypatch):
    """A linearised estimate may be far out; a segment that only the base follows counts as it leaves it."""
    begun = []

    def minimise(problem, values, starts, most, rough):
        begun.append((values.tolist(), most))
        found = fit(values.tolist(), 50.0)
        found.evaluation.failed[0] = True
        return found

    monkeypatch.setattr(refit, "minimise", minimise)
    base = Fitted((), None, SimpleNamespace(free=FREE[:1]), fit([8.0], 400.0), ())
    candidate = SimpleNamespace(
        names=("viscous",), model=None, free=FREE, added=(1,), linear=np.ones(1) > 0, starts=[]
    )
    screened = SimpleNamespace(
        step={"viscous": np.array([9.0])}, origin={"viscous": np.zeros(1)}, live={"viscous": np.ones(1) > 0}
    )
    data = SimpleNamespace(last=0, problem=lambda *_: None)
    assert refit.rough_total(data, base, candidate, screened) == 3 * 50.0 + 400.0
    assert begun == [([8.0, 0.0], FIT.fit_fewest)]
    # without a linear estimate it begins at its usual size
    begun.clear()
    screened.origin["viscous"], screened.live["viscous"] = np.array([7.0]), np.zeros(1) > 0
    assert refit.rough_total(data, base, candidate, screened) == 3 * 50.0 + 400.0
    assert begun == [([8.0, 7.0], FIT.fit_fewest)]
    curved = SimpleNamespace(step={}, origin={}, live={})
    assert refit.rough_total(data, base, candidate, curved) == np.inf


@pytest.mark.parametrize(
    ("of_base", "left", "spared"), [(2000.0, 1900.0, True), (2000.0, 1500.0, False), (250.0, 245.0, False)]
)
def test_a_start_that_closes_nothing_in_short_segments_is_not_followed(monkeypatch, of_base, left, spared):
    """Only where the base is far from the records: near it a start from afar may find another minimum."""
    asked = []

    def minimise(problem, values, starts, **how):
        asked.append(problem)
        return fit(list(values), left if problem == "candidate" else of_base)

    monkeypatch.setattr(refit, "minimise", minimise)
    base = Fitted((), "base", SimpleNamespace(free=FREE[:1]), fit([8.0], of_base), ())
    candidate = SimpleNamespace(names=("stribeck",), model="candidate", free=FREE, added=(1,))
    data = SimpleNamespace(
        last=2,
        problem=lambda model, *_: model,
        carried_starts=lambda *_: None,
        smoothed_starts=lambda *_: None,
    )
    for _ in range(2):
        assert refit._closes_nothing(data, base, candidate, "far", np.array([8.0, 1.0])) == spared
    # the base in short segments is fitted once
    assert asked == ([] if base.fit.reduced_chi2 < FIT.near_base else ["base", "candidate", "candidate"])


def test_far_from_the_base_one_start_from_afar_settles_that_an_effect_closes_nothing(monkeypatch):
    """Without a linear estimate, too, the first start is that of the base at full length."""
    tried, checked = [], []

    def closes_nothing(data, base, candidate, kind, values):
        checked.append(kind)
        return True

    monkeypatch.setattr(refit, "_try", lambda *given: (tried.append(given[3]), fit([8.0, 0.1], 1990.0)))
    monkeypatch.setattr(refit, "_closes_nothing", closes_nothing)
    monkeypatch.setattr(refit, "polished", lambda *_, **__: pytest.fail("the base left the same segments"))
    base = Fitted((), None, SimpleNamespace(free=FREE[:1]), fit([8.0], 2000.0), ())
    starts = [np.array([0.5]), np.array([2.0])]
    candidate = SimpleNamespace(
        names=("backlash",), model=None, free=FREE, added=(1,), linear=np.zeros(1) > 0, starts=starts
    )
    screened = SimpleNamespace(
        step={"backlash": np.ones(1)}, origin={"backlash": np.ones(1)}, live={"backlash": np.zeros(1) > 0},
        gain={},
    )  # fmt: skip
    refit.refit(SimpleNamespace(last=2), base, candidate, screened)
    assert tried == ["linear"]
    assert checked == ["far"]
