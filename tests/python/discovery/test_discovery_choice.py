# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidates are compared with small imperfections of the rig fitted beside each of them."""

from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.decision import gates, scoring, several
from separatrix.discovery.decision.gates import best_of, choice
from test_discovery_scoring import COUNT, OPTIONS, contender


@pytest.mark.parametrize(("explained", "first"), [(15.0, "viscous"), (25.0, "stribeck")])
def test_the_better_of_two_is_better_beside_imperfections_of_a_rig(monkeypatch, explained, first):
    """Of two effects that leave more than noise, imperfections explain more of it beside the second."""
    pool = [contender("viscous", 50.0), contender("stribeck", 40.0)]
    for one in pool:
        one.fitted.fit.chi2 = np.full(COUNT, 60.0)
    weights = {"viscous": 10.0, "stribeck": explained}
    monkeypatch.setattr(gates, "weight_of_imperfections", lambda fitted, _: (weights[fitted.names[-1]], 0.0))
    monkeypatch.setattr(scoring, "share_with_imperfections", lambda *_: 1.0)
    best, rivals = choice(SimpleNamespace(options=OPTIONS), None, None, pool, best_of)
    assert best.name == first
    assert rivals == []


def test_one_that_joins_a_pool_late_is_weighed_as_the_others_are(monkeypatch):
    """Else it would be compared without imperfections with those that have them."""
    pool = [contender("viscous", 50.0), contender("stribeck", 45.0)]
    pool[0].imperfections = (20.0, 0.0)
    monkeypatch.setattr(gates, "weight_of_imperfections", lambda *_: (40.0, 0.0))
    monkeypatch.setattr(scoring, "share_with_imperfections", lambda *_: 1.0)
    best, _ = choice(SimpleNamespace(options=OPTIONS), None, None, pool, best_of)
    assert best.name == "stribeck"
    assert best.imperfections == (40.0, 0.0)


@pytest.mark.parametrize(("better", "imperfections"), [(True, 7.0), (False, 5.0)])
def test_held_out_records_are_predicted_beside_imperfections_if_that_is_better(
    monkeypatch, better, imperfections
):
    one = contender("viscous", 50.0)
    plain, beside = SimpleNamespace(), SimpleNamespace()
    one.prediction, one.held_out, one.held_out_parts = plain, 3.0, np.full(3, 1.0)
    monkeypatch.setattr(gates, "gained_together", lambda *_: np.full(3, 2.0 if better else 0.5))
    monkeypatch.setattr(
        gates, "weight_of_imperfections", lambda _, prediction: (9.0, 7.0 if prediction is beside else 5.0)
    )
    context = SimpleNamespace(predict_with_imperfections=lambda *_: beside)
    gates.weigh_imperfections(context, one)
    assert one.prediction is (beside if better else plain)
    assert one.held_out == (6.0 if better else 3.0)
    assert one.imperfections == (9.0, imperfections)
    assert one.evidence == pytest.approx(50.0 + one.held_out + 9.0 + imperfections)
    assert one.own_evidence == pytest.approx(50.0 + one.held_out)


@pytest.mark.parametrize(
    ("weights", "clear"), [((0.0, 0.0), False), ((400.0, 0.0), False), ((2000.0, 0.0), True)]
)
def test_held_out_records_may_contradict_within_the_error_of_imperfections(monkeypatch, weights, clear):
    """A name that is 1150 ahead where it was fitted and 150 behind where it was predicted."""
    monkeypatch.setattr(scoring, "ahead", lambda one, other: -150.0)
    monkeypatch.setattr(scoring, "share_with_imperfections", lambda *_: 1.0)
    best, other = contender("viscous", 1250.0), contender("stribeck", 100.0)
    for one in (best, other):
        one.prediction, one.imperfections = SimpleNamespace(), weights
    assert scoring.clear_of(best, other, OPTIONS) == clear


def test_a_part_that_follows_a_set_is_weighed_where_the_part_was(monkeypatch):
    """Imperfections imitate the misfit of a wrong minimum: the better fit would lose without its own."""
    one, better = contender("viscous", 100.0), contender("viscous", 200.0)
    one.imperfections = (150.0, 0.0)
    monkeypatch.setattr(several, "warm_started_by", lambda *_: better.fitted)
    monkeypatch.setattr(several, "scored", lambda *_: better)
    monkeypatch.setattr(gates, "weight_of_imperfections", lambda *_: (80.0, 0.0))
    context = SimpleNamespace(training=None, predict=lambda *_: None)
    first = SimpleNamespace(base=None, predicted=None)
    assert several._followed(context, first, SimpleNamespace(fitted=None, prediction=None), one) is better


@pytest.mark.parametrize(("own", "within"), [(0.05, True), (0.2, False)])
def test_the_rest_of_a_gain_beside_imperfections_exceeds_their_errors(own, within):
    """An imperfection is known within the linearisation of the motion, a tenth."""
    one = contender("viscous", 200.0)
    one.own = own
    assert gates._within_imperfections(one) == within
