# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The walk along the plan of the search."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.decision import plan
from separatrix.discovery.decision.plan import Stage, search
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.state import Choice, Decision, SearchState
from separatrix.discovery.options import Options
from separatrix.discovery.policy import FIT, RECORDS, SEARCH
from separatrix.discovery.policy.row import SOURCES, rows_of
from separatrix.errors import SeparatrixError

NONE = Decision("none", [], [], [], [], None, None)


def walked(monkeypatch, *stages: Stage, progress=lambda stage, done: None) -> SearchState:
    """The end of a walk along these stages."""
    monkeypatch.setattr(plan, "PLAN", stages)
    return search(SearchState(SearchContext(None, None, None, Options(progress=progress)), None))


def decides(state: SearchState) -> SearchState:
    return state.decided(NONE)


def test_stages_have_names_of_their_own_and_a_reason() -> None:
    names = [one.name for one in plan.PLAN]
    assert len(set(names)) == len(names)
    assert all(one.reason and one.work > 0 for one in plan.PLAN)


def test_a_stage_runs_where_it_applies_and_leaves_a_step(monkeypatch) -> None:
    found = walked(
        monkeypatch,
        Stage("first", lambda state: state.open, decides, "nothing is decided"),
        Stage("second", lambda state: state.open, lambda state: pytest.fail("decided"), "nothing is decided"),
        Stage("third", lambda state: not state.open, lambda state: state, "it is decided"),
    )
    assert [tuple(one) for one in found.steps] == [
        ("first", "nothing is decided", "none"),
        ("third", "it is decided", "none"),
    ]


def test_a_search_that_begins_again_forgets_all_but_its_steps_and_changes(monkeypatch) -> None:
    def first(state: SearchState) -> SearchState:
        assert state.round is None
        return replace(state, round=object(), closed=True)

    stages = (
        Stage("first", lambda state: state.open, first, "it is open"),
        Stage("decided", lambda state: state.open, lambda state: state.decided(NONE), "it is open"),
        Stage(
            "again",
            lambda state: not state.noise_measured,
            lambda state: state.again(noise_measured=True),
            "the noise is not measured",
        ),
        Stage("last", lambda state: True, lambda state: state, "always"),
    )
    monkeypatch.setattr(SearchState, "in_words", lambda _: "")
    found = walked(monkeypatch, *stages)
    assert [one.stage for one in found.steps] == ["first", "decided", "again", "first", "decided", "last"]
    assert found.noise_measured
    assert not found.begins_again


def test_progress_grows_also_where_a_search_begins_again(monkeypatch) -> None:
    reported = []

    def run(state: SearchState) -> SearchState:
        for part in (0.0, 0.5, 0.9):
            state.context.report("part", part)
        return state

    stages = (
        Stage("first", lambda state: True, run, "always", work=3),
        Stage("seldom", lambda state: False, run, "never"),
        Stage(
            "again",
            lambda state: not state.noise_measured,
            lambda state: run(state).again(noise_measured=True),
            "once",
        ),
        Stage("last", lambda state: True, run, "always"),
    )
    monkeypatch.setattr(SearchState, "in_words", lambda _: "")
    walked(monkeypatch, *stages, progress=lambda stage, done: reported.append(done))
    assert reported == sorted(reported)
    assert 0.1 <= reported[0]
    assert reported[-1] < 0.9


@pytest.mark.parametrize("policy", [Options(), SEARCH, FIT, RECORDS])
def test_a_threshold_has_unit_meaning_and_a_known_source(policy: object) -> None:
    rows = list(rows_of(policy))
    assert len(rows) > 15
    assert all(unit and meaning and source in SOURCES for _, _, unit, meaning, source in rows)


def test_the_pages_show_stages_gates_and_thresholds_as_they_are(
    source_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(source_dir / "scripts"))
    from docs_pages import discovery

    docs = source_dir / "docs"
    assert (docs / "reference" / "discovery.md").read_text().endswith(discovery.page())
    guide = (docs / discovery.GUIDE).read_text()
    assert discovery.with_gates(guide) == guide


def limited(monkeypatch, *stages: Stage) -> SearchState:
    """The end of a walk along some stages."""
    monkeypatch.setattr(plan, "PLAN", stages)
    monkeypatch.setattr(SearchState, "in_words", lambda _: "")
    context = SearchContext(None, None, None, Options(time_limit=60.0))
    return search(SearchState(context, None))


def knows(outcome: str, end: float = 0.0):
    """A stage that knows a best effect and decides, while the time limit passes."""
    gates = dict.fromkeys(("detect", "stable", "admissible", "converged", "adequate"), True)
    best = SimpleNamespace(gates=gates, evidence=100.0)
    decision = replace(NONE, outcome=outcome) if outcome else None

    def stage(state: SearchState) -> SearchState:
        state.context.limit.end = end
        return replace(state, one=Choice(best, []), decision=decision)

    return stage


def test_a_name_that_the_time_limit_keeps_from_its_tests_is_in_doubt(monkeypatch) -> None:
    stages = (
        Stage("one effect", lambda state: state.open, knows("named"), "always"),
        Stage("tests", lambda state: True, lambda state: pytest.fail("late"), "names are tested"),
    )
    found = limited(monkeypatch, *stages)
    assert (found.decision.outcome, found.stopped) == ("ambiguous", "tests")
    assert "time limit of 60 s, before 'tests'" in found.decision.reasons[-1]
    stages = (stages[0],)
    assert limited(monkeypatch, *stages).decision.outcome == "named"


def test_a_stage_is_ended_in_its_middle(monkeypatch) -> None:
    def slow(state: SearchState) -> SearchState:
        state.context.limit.end = 0.0
        state.context.report("fitting the next one")
        pytest.fail("went on after the time limit")

    stages = (
        Stage("one effect", lambda state: state.open, knows("not-in-catalogue", np.inf), "always"),
        Stage("tests", lambda state: True, slow, "always"),
    )
    found = limited(monkeypatch, *stages)
    assert (found.decision.outcome, found.stopped) == ("not-in-catalogue", "tests")


def test_a_search_that_may_name_nothing_at_its_time_limit_has_no_verdict(monkeypatch) -> None:
    def nothing(state: SearchState) -> SearchState:
        state = knows("")(state)
        state.one.best.gates["detect"] = False
        return state

    stages = (
        Stage("one effect", lambda state: state.one is None, nothing, "always"),
        Stage("no effect", lambda state: True, lambda state: pytest.fail("late"), "always"),
    )
    with pytest.raises(SeparatrixError, match=r"time limit of 60 s, before 'no effect': no verdict"):
        limited(monkeypatch, *stages)
