# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A named closed form compared with the function of its family that the records determine."""

from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.scoring import ScoredCandidate
from separatrix.discovery.decision.stages import function_of_name as functions
from separatrix.discovery.decision.state import Decision, SearchState
from separatrix.discovery.fitting.shapes import closed_forms
from separatrix.discovery.options import Options


@pytest.mark.parametrize(("ahead", "passes", "first"), [
    (44.0, True, "restitution_curve"),
    (-44.0, True, "restitution_slope"),
    (44.0, False, "restitution_slope"),
])  # fmt: skip
def test_a_form_that_its_function_refutes_leads_only_where_it_predicts_better(
    monkeypatch, ahead, passes, first
):
    """The table is not clearly ahead: fitted and held-out records contradict each other."""
    form, table = (
        ScoredCandidate(SimpleNamespace(names=(name,)), None, 0.0, 0.0, np.zeros(0), 1)
        for name in ("restitution_slope", "restitution_curve")
    )
    member = SimpleNamespace(family="restitution over impact speed")
    refuted = {"linear": {"fits": False, "p": 1e-9}}
    function = SimpleNamespace(forms=refuted, member=member, gain=50.0)
    monkeypatch.setattr(functions, "best_table", lambda *_: iter([table]))
    monkeypatch.setattr(functions, "pass_gates", lambda _, one, *__: one.gates.update(detect=passes))
    monkeypatch.setattr(functions, "score_ceiling", lambda *_: None)
    monkeypatch.setattr(functions, "clear_of", lambda *_: False)
    monkeypatch.setattr(functions, "lead", lambda *_: ahead)
    monkeypatch.setattr(functions, "share_with_imperfections", lambda *_: 1.0)
    found = SimpleNamespace(base=form.fitted, screened=SimpleNamespace(tests=1.0))
    decision = Decision("named", [form], [], [], [found], None, None, function=function)
    state = SearchState(SearchContext(None, None, None, Options()), form.fitted, decision=decision)
    assert functions.form_refuted(state)
    given = functions.table_or_form(state).decision
    assert (given.outcome, [one.name for one in given.accepted]) == ("ambiguous", [first])
    assert [one.name for one in given.rivals] == [{form.name: table, table.name: form}[first].name]
    assert "has another form than restitution_slope" in given.reasons[-1]


@pytest.mark.parametrize(("falloff", "size", "alike"), [
    # of a power, of a line; then as precise that the bend decides
    (0.2, 30.0, ["power", "exponential", "viscoelastic"]),
    (None, 30.0, ["power", "exponential", "viscoelastic"]),
    (0.2, 1e4, []),
    (None, 1e4, []),
])  # fmt: skip
def test_a_line_that_a_power_follows_as_well_is_not_named_without_a_word(falloff, size, alike):
    """Of both truths: where the values do not distinguish them, the other form is in the reasons."""
    at = np.linspace(0.5, 4, 8)
    value = 0.7 - 0.03 * at if falloff is None else 0.7 * at**-falloff
    best = ScoredCandidate(SimpleNamespace(names=("restitution_slope",)), None, 0.0, 0.0, np.zeros(0), 1)
    rows = size * np.eye(8)
    forms = closed_forms("restitution_curve", at, value, rows, rows @ value)
    member = SimpleNamespace(family="restitution over impact speed")
    function = SimpleNamespace(forms=forms, member=member)
    decision = Decision("named", [best], [], [], [], None, None, function=function)
    state = SearchState(SearchContext(None, None, None, Options()), best.fitted, decision=decision)
    assert functions.forms_alike(state) == alike
    if alike:
        given = functions.form_in_doubt(state).decision
        assert (given.outcome, given.accepted) == ("named", [best])
        assert "from the power or exponential or viscoelastic form" in given.reasons[-1]
