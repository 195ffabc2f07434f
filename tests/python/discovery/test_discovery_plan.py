# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The walk along the plan of the search."""

from dataclasses import replace
from pathlib import Path

import pytest
from separatrix.discovery.decision import plan
from separatrix.discovery.decision.plan import Stage, search
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.state import Decision, SearchState
from separatrix.discovery.options import Options
from separatrix.discovery.policy import FIT, RECORDS, SEARCH
from separatrix.discovery.policy.row import SOURCES, rows_of

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
