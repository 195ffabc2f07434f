# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaps without a name: records of an independent simulator with effects that the catalogue lacks."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery import Options, discover
from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.stages import hidden_state as hidden_state_module
from separatrix.discovery.decision.state import Decision, SearchState
from separatrix.discovery.fitting import motions

SEED = 31
# numbers of cases of the campaign's generator with one effect each, on what it depends, and its constant
CASES = {
    187: ("maxwell_element", ["memory"], "maxwell_time"),
    122: ("drifting_restitution", ["oscillating time", "impacts"], "restitution_wave_frequency"),
    229: ("parametric_stiffness", ["oscillating time", "position"], "stiffness_wave_frequency"),
    204: ("drifting_friction", ["slow time", "direction of motion"], None),
}
# one with an effect of the catalogue
SINGLE = 50

pytestmark = pytest.mark.usefixtures("library")


@pytest.fixture(scope="module")
def hide(source_dir, tmp_path_factory):
    """Records and the sealed truth of a case without imperfections of the rig."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(source_dir / "tests" / "generator"))
        patch.syspath_prepend(str(source_dir / "scripts" / "evidence"))
        import records
        from design import draw

        def hidden(number: int) -> tuple[Path, dict]:
            folder = tmp_path_factory.mktemp(f"case{number}")
            records.write_case(folder / "case", folder / "truth.json", draw(SEED, number, plain=True))
            return folder / "case", json.loads((folder / "truth.json").read_text())

        yield hidden


def ask(case: Path, **options) -> dict:
    training = [case / "first.csv", case / "second.csv"]
    return discover(case / "base.toml", training, [case / "held_out.csv"], Options(quick=True, **options))


@pytest.mark.parametrize(("evidence", "beside", "imperfections", "likeliest", "outcome"), [
    (106.5, 6.5, 0.0, "memory", "characterised"),
    # as far ahead as one of several names has to be
    (105.5, 6.5, 0.0, "memory", "named"),
    # a right name leaves nothing to it
    (106.5, 5.5, 0.0, "memory", "named"),
    # or imperfections of the rig, of which it would explain a part
    (200.0, 16.5, 12.0, "memory", "named"),
    (200.0, 18.5, 12.0, "memory", "characterised"),
    # a function of the catalogue would do it as well, linearised as the hidden state is
    (106.5, 6.5, 0.0, "speed", "named"),
])  # fmt: skip
def test_a_name_has_to_hold_against_a_hidden_state(
    monkeypatch, evidence, beside, imperfections, likeliest, outcome
):
    def one(variable: str, evidence: float = evidence) -> SimpleNamespace:
        return SimpleNamespace(hypothesis=SimpleNamespace(depends_on=(variable,)), evidence=evidence)

    fit = SimpleNamespace(reduced_chi2=1.0, excess=300.0)
    fitted = SimpleNamespace(names=("friction_curve",), fit=fit)
    name = SimpleNamespace(fitted=fitted, own_evidence=100.0, prediction=SimpleNamespace())
    first = SimpleNamespace(base=SimpleNamespace(problem=SimpleNamespace(has_memories=True)))
    decision = Decision("named", [name], [], [], [first], None, SimpleNamespace(fit=fit))
    monkeypatch.setattr(
        hidden_state_module, "motions", lambda _, machine, prediction: (machine is fitted, None)
    )
    monkeypatch.setattr(hidden_state_module, "memories", lambda _: ["memory"])
    monkeypatch.setattr(hidden_state_module, "evidence_of_imperfections", lambda *_: imperfections)
    monkeypatch.setattr(
        hidden_state_module,
        "best_of_hypothesis",
        lambda named, held_out, variable: one("memory", beside if named else evidence),
    )

    def characterised(context, gap):
        assert (gap.outcome, gap.accepted) == ("not-in-catalogue", [])
        return Decision("characterised", [], [], [], [first], None, None, characters=[one(likeliest)])

    monkeypatch.setattr(hidden_state_module, "characterised", characterised)
    state = SearchState(
        SearchContext(None, None, None, Options()), first.base, round=first, decision=decision
    )
    assert hidden_state_module.can_be_hidden(state)
    found = hidden_state_module.hidden_state(state).decision
    assert found.outcome == outcome
    assert bool(found.accepted) == (outcome == "named")


@pytest.mark.parametrize(
    "number", [pytest.param(one, marks=[pytest.mark.long] if one in (187, 229) else []) for one in CASES]
)
def test_the_dependence_of_an_unnamed_force_is_reported(hide, number):
    name, depends_on, constant = CASES[number]
    case, truth = hide(number)
    assert truth["names"] == [name]
    verdict = ask(case, candidates=("cubic_spring",))
    assert verdict["outcome"] == "characterised"
    assert verdict["effects"] == []
    best = verdict["character"][0]
    assert best["depends_on"] == depends_on
    assert min(best["closed"].values()) > 0.8
    # no law of one body has a hidden state or a time of its own, and that is reported
    assert verdict["added"] == []
    assert f"no law of a force that depends on {' and '.join(depends_on)}" in verdict["not_added"]
    assert verdict["gap"]["training"]["after"] == verdict["gap"]["training"]["before"]
    if constant:
        assert best["constant"]["value"] == pytest.approx(truth["parameters"][constant], rel=0.12)
    if name == "maxwell_element":
        size = best["size"]
        off = size["value"] - truth["parameters"]["maxwell_stiffness"]
        assert abs(off) < 3 * size["standard_error"] + 0.03 * truth["parameters"]["maxwell_stiffness"]


def test_an_effect_that_is_not_asked_for_is_characterised_by_what_it_depends_on(hide):
    """The catalogue has it, but the search is restricted to another: a force that depends on speed."""
    case, truth = hide(SINGLE)
    assert truth["names"] == ["quadratic_drag"]
    verdict = ask(case, candidates=("drive_ripple",))
    assert verdict["outcome"] == "characterised"
    assert verdict["character"][0]["depends_on"] == ["speed"]
    assert verdict["character"][0]["formula"] == "-a v |v|"
    # a function of the speed is a law of the simulator: the gap is closed by a table, without a name
    assert (verdict["effects"], verdict["added"]) == ([], ["friction_curve"])
    assert all(one["after"] - 1 < 0.3 * (one["before"] - 1) for one in verdict["gap"].values())
    found, hidden = (
        verdict["character"][0]["size"]["value"],
        truth["parameters"]["effect.quadratic_drag.coefficient"],
    )
    assert found == pytest.approx(hidden, rel=0.15)


def test_a_machine_without_a_gap_has_no_character(hide):
    from design import plan

    number = next(n for n in range(60) if plan(SEED, n)[0] == "none")
    verdict = ask(hide(number)[0], candidates=("cubic_spring",))
    assert verdict["outcome"] == "none"
    assert verdict["character"] == []
    assert np.isfinite(verdict["gap"]["training"]["before"])


@pytest.mark.parametrize("seen", [True, False])
def test_a_spring_of_a_machine_that_cannot_be_simulated_is_no_variable(monkeypatch, seen):
    slack = np.full(motions._ANGLES.size, 0.3)
    slack[1] = 0.3 if seen else np.nan
    monkeypatch.setattr(motions, "_slack_positions", lambda *_: slack)
    index = np.arange(8)[None, :]
    segments = SimpleNamespace(inside=np.ones((1, 8), bool), record=np.zeros(1, int), index=index)
    problem = SimpleNamespace(
        model=SimpleNamespace(parameters={"restoring.stiffness": None}),
        segments=segments,
        prepared=[SimpleNamespace(samples=SimpleNamespace(t=np.arange(8.0)))],
        crank_angle=lambda number, values, t: t,
    )
    fit = SimpleNamespace(values=None, evaluation=SimpleNamespace(x=np.full((1, 8), 0.1)))
    found = motions.extensions(problem, fit)
    assert np.allclose(found, 0.2) if seen else found is None
