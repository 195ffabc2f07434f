# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A table is not known beyond its knots: held-out segments there count neither for nor against it."""

from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.decision.misfit import misses
from separatrix.discovery.decision.scoring import extrapolates
from separatrix.discovery.decision.table_range import scored_segments, within_tables
from separatrix.discovery.options import Options
from separatrix.discovery.policy import SEARCH

LENGTH, COUNT = 40, 12


def predicted(beyond: int, effect: str = "friction_position_curve", chi2: float = 400.0) -> SimpleNamespace:
    """Held-out segments, of which the first ones leave the knots from 0.2 to 0.4 and are missed there."""
    x = np.tile(np.linspace(0.25, 0.35, LENGTH), (COUNT, 1))
    x[:beyond, -1] = 0.45
    squares = np.full(COUNT, LENGTH - 2.0)
    squares[:beyond] = chi2
    fit = SimpleNamespace(
        chi2=squares, counts=np.full(COUNT, LENGTH), unknowns=2, good=np.ones(COUNT, bool),
        evaluation=SimpleNamespace(x=x, v=x - 0.3, failed=np.zeros(COUNT, bool)),
    )  # fmt: skip
    parameters = {
        f"effect.{effect}.position[{i}]": SimpleNamespace(value=at) for i, at in enumerate((0.2, 0.3, 0.4), 1)
    }
    problem = SimpleNamespace(
        model=SimpleNamespace(parameters=parameters),
        segments=SimpleNamespace(inside=np.ones((COUNT, LENGTH), bool)),
    )
    return SimpleNamespace(fit=fit, problem=problem, good=fit.good)


@pytest.mark.parametrize(
    ("beyond", "effect", "expected"),
    [
        (5, "friction_position_curve", COUNT - 5),
        (5, "force_curve", COUNT - 5),
        (5, "another_law", COUNT),
        (COUNT - SEARCH.few_segments, "force_curve", SEARCH.few_segments),
        (COUNT - SEARCH.few_segments + 1, "force_curve", COUNT),
    ],
)
def test_segments_beyond_the_knots_are_not_scored_unless_too_few_are_left(beyond, effect, expected):
    assert np.count_nonzero(scored_segments(predicted(beyond, effect))) == expected


def test_a_table_misses_a_record_only_within_its_knots():
    trained = SimpleNamespace(reduced_chi2=1.0)
    assert not misses(predicted(5), trained, Options())
    assert misses(predicted(5, "another_law"), trained, Options())
    bad = predicted(5)
    bad.fit.chi2[5:] = 400.0
    assert misses(bad, trained, Options())


@pytest.mark.parametrize(
    ("beyond", "left", "passes"), [(COUNT, 1e3, True), (COUNT, 1e6, False), (5, 1e3, False), (0, 1e3, False)]
)
def test_a_table_that_is_hardly_known_there_must_close_the_gap_all_the_same(beyond, left, passes):
    prediction = predicted(beyond)
    prediction.excess = left
    one = SimpleNamespace(prediction=prediction, held_out=1e6)
    assert extrapolates(one, Options()) == passes
    assert np.count_nonzero(~within_tables(prediction)) == beyond
