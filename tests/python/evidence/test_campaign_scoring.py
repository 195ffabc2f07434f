# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the discovery campaign counts: its intervals, how verdicts are scored, the confusion matrix."""

import math

import pytest


# R. G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3
@pytest.mark.parametrize(
    ("hits", "cases", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_intervals_as_published(campaign, hits, cases, low, high):
    found = campaign.rates.Rate(hits, cases).interval
    assert found == pytest.approx((low, high), abs=5e-5)


# R. G. Newcombe, Statistics in Medicine 17 (1998) 873, table II, method 10
@pytest.mark.parametrize(
    ("one", "other", "low", "high"),
    [
        ((56, 70), (48, 80), 0.0524, 0.3339),
        ((9, 10), (3, 10), 0.1705, 0.8090),
        ((10, 10), (0, 20), 0.6791, 1),
    ],
)
def test_intervals_of_differences_as_published(campaign, one, other, low, high):
    rates = campaign.rates
    assert rates.difference(rates.Rate(*one), rates.Rate(*other)) == pytest.approx((low, high), abs=5e-5)


@pytest.mark.parametrize(
    ("hits", "cases", "lowest", "highest", "given"),
    [
        (0, 0, 0.9, 1, "undecided"),
        (96, 100, 0.95, 1, "undecided"),
        (990, 1000, 0.95, 1, "yes"),
        (80, 100, 0.95, 1, "**no**"),
        (0, 10, 0, 0.03, "undecided"),
        (0, 500, 0, 0.03, "yes"),
        (20, 100, 0, 0.03, "**no**"),
        (950, 1000, 0.9, 0.98, "yes"),
        (999, 1000, 0.9, 0.98, "**no**"),
    ],
)
def test_a_bar_is_met_where_the_whole_interval_is(campaign, hits, cases, lowest, highest, given):
    assert campaign.bars.met(campaign.rates.Rate(hits, cases), lowest, highest) == given


def truth(names: list[str], kind: str = "single", number: int = 0, **more) -> dict:
    """A truth as the generator seals it."""
    return {
        "number": number,
        "kind": kind,
        "names": names,
        "parameters": {},
        "d_prime": {name: 12.0 for name in names},
        "beyond": {name: {"d_prime": 6.0, "besides": "viscous"} for name in names},
        "regime": "published",
        "noise": 0.01,
        "colour": "white",
        "samples_per_period": 50,
        "velocity": False,
        "crank_angle": False,
    } | more


def verdict(outcome: str, effects: list[str] = (), alternatives: list[str] = (), **more) -> dict:
    """A verdict as the workflow gives it, with its time."""
    given = {"outcome": outcome, "effects": list(effects), "alternatives": list(alternatives)}
    return {"verdict": given | more, "seconds": 1.0}


# truth, verdict, (decided, right, contains, wrong name), column
SCORED = [
    (truth(["viscous"]), verdict("named", ["viscous"]), (True, True, True, False), "right name"),
    (truth(["viscous"]), verdict("named", ["stribeck"]), (True, False, False, True), "stribeck"),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["stribeck"], ["viscous"]),
        (False, False, True, False),
        "set with the truth",
    ),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["stribeck"], ["dahl"]),
        (False, False, False, False),
        "set without the truth",
    ),
    (
        truth(["sensor_bias"]),
        verdict("ambiguous", ["offset_force"], ["sensor_bias"]),
        (True, True, True, False),
        "equivalent set",
    ),
    (truth(["sensor_bias"]), verdict("named", ["offset_force"]), (True, False, False, True), "offset_force"),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["offset_force"], ["sensor_bias"]),
        (True, False, False, True),
        "set without the truth",
    ),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["quadratic_drag"], ["viscous"], in_families=["friction over speed"]),
        (True, True, True, False),
        "equivalent set",
    ),
    (
        truth(["dahl"]),
        verdict("ambiguous", ["quadratic_drag"], ["viscous"], in_families=["friction over speed"]),
        (True, False, False, True),
        "set without the truth",
    ),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("ambiguous", ["quadratic_drag"], ["viscous"], in_families=["friction over speed"]),
        (True, False, False, False),
        "set without the truth",
    ),
    # that the verdict calls them one family is not enough
    (
        truth(["viscous"]),
        verdict("ambiguous", ["viscous"], ["dahl"], in_families=["friction"]),
        (False, False, True, False),
        "set with the truth",
    ),
    (truth(["viscous"]), verdict("none"), (False, False, False, False), "none"),
    (truth(["viscous"]), verdict("failed"), (False, False, False, False), "no verdict"),
    (truth([], "none"), verdict("none"), (False, True, False, False), "none"),
    (truth([], "none"), verdict("named", ["dahl"]), (True, False, False, True), "dahl"),
    (
        truth(["second_mode"], "outside"),
        verdict("not-in-catalogue"),
        (False, True, False, False),
        "not-in-catalogue",
    ),
    (
        truth(["second_mode"], "outside"),
        verdict("characterised"),
        (False, True, False, False),
        "not-in-catalogue",
    ),
    (truth(["second_mode"], "outside"), verdict("named", ["dahl"]), (True, False, False, True), "dahl"),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("named", ["offset_force", "viscous"]),
        (True, True, True, False),
        "right name",
    ),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("ambiguous", ["viscous", "offset_force"], ["viscous+sensor_bias"]),
        (True, True, True, False),
        "equivalent set",
    ),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("named", ["viscous"]),
        (True, False, False, False),
        "one of the pair",
    ),
    (truth([], "none"), verdict("ambiguous", ["dahl"]), (False, False, False, True), "dahl"),
    (truth([], "none"), verdict("not-in-catalogue"), (False, False, False, False), "not-in-catalogue"),
    (truth(["viscous"]), verdict("ambiguous", ["dahl"]), (False, False, False, True), "dahl"),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["viscous"]),
        (False, False, True, False),
        "set with the truth",
    ),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("ambiguous", ["viscous"]),
        (False, False, False, False),
        "one of the pair",
    ),
    (truth(["stribeck"]), verdict("named", ["friction_curve"]), (True, True, True, False), "right name"),
    (truth(["stribeck"]), verdict("named", ["quadratic_drag"]), (True, False, False, True), "quadratic_drag"),
    (
        truth(["quadratic_drag"], shapes={"quadratic_drag": {"exponent": 1.5}}),
        verdict("named", ["viscous"]),
        (True, True, True, False),
        "right name",
    ),
    (
        truth(["stribeck"], shapes={"stribeck": {"stribeck_exponent": 0.7}}),
        verdict("named", ["stribeck"]),
        (True, True, True, False),
        "right name",
    ),
    (
        truth(["stribeck"], shapes={"stribeck": {"stribeck_exponent": 0.7}}),
        verdict("named", ["friction_curve"]),
        (True, True, True, False),
        "right name",
    ),
    *(
        (
            truth(["stribeck"], shapes={"stribeck": {"stribeck_exponent": 0.7}}),
            verdict("named", [name]),
            (True, False, False, True),
            name,
        )
        for name in ("coulomb", "viscous", "quadratic_drag")
    ),
    (
        truth(["compliant_contact"], shapes={"compliant_contact": {"exponent": 2.0}}),
        verdict("named", ["kelvin_voigt_contact"]),
        (True, False, False, True),
        "kelvin_voigt_contact",
    ),
    (
        truth(["cubic_spring"], shapes={"cubic_spring": {"cubic_exponent": 2.0}}),
        verdict("named", ["friction_curve"]),
        (True, False, False, True),
        "friction_curve",
    ),
    (
        truth(["stribeck"], shapes={"stribeck": {"stribeck_exponent": 0.7}}),
        verdict("ambiguous", ["stribeck"], ["friction_curve"]),
        (False, False, True, False),
        "set with the truth",
    ),
    (
        truth(["viscous"]),
        verdict("named", ["viscous", "dahl"]),
        (True, False, False, True),
        "dahl+viscous",
    ),
]


@pytest.mark.parametrize(("hidden", "given", "flags", "column"), SCORED)
def test_verdicts_are_scored(campaign, hidden, given, flags, column):
    found = campaign.scoring.score(hidden, given)
    assert (found.decided, found.right, found.contains, found.wrong_name) == flags
    assert found.column == column
    assert found.by_family == (
        found.right
        and given["verdict"]["effects"] in (["friction_curve"], ["viscous"])
        and hidden["names"] != ["viscous"]
    )


def test_parameters_are_scored_by_their_intervals(campaign):
    hidden = truth(["viscous"], parameters={"effect.viscous.damping": 2.0})
    for value, inside in ((2.1, True), (2.5, False)):
        found = {"value": value, "standard_error": 0.1, "interval_95": [value - 0.2, value + 0.2]}
        given = verdict("named", ["viscous"], parameters={"effect.viscous.damping": found})
        one = campaign.scoring.score(hidden, given)
        assert one.errors == pytest.approx((value / 2 - 1,))
        assert one.covered == (inside,)


def test_a_parameter_at_its_bound_is_not_covered(campaign):
    hidden = truth(["stribeck"], parameters={"effect.stribeck.excess": 2.0, "effect.stribeck.velocity": 0.1})
    found = {
        "effect.stribeck.excess": {"value": 2.0, "standard_error": 0.1, "interval_95": [1.8, 2.2]},
        "effect.stribeck.velocity": {"value": 0.2, "standard_error": None, "interval_95": None},
    }
    one = campaign.scoring.score(hidden, verdict("named", ["stribeck"], parameters=found))
    assert one.covered == (True, False)
    assert one.errors == pytest.approx((0, 1))


def test_the_clearest_region_is_scored(campaign):
    where = [
        {"map": "drive phase", "force": 0.5, "error": 0.2},
        {"map": "time since the last impact", "force": -3.0, "error": 0.1},
    ]
    region = campaign.scoring.region
    assert region(["restitution_slope"], where) is True
    assert region(["drive_ripple"], where) is False
    assert region(["sensor_bias"], where) is None
    assert region(["restitution_slope"], []) is None


def test_a_negative_control_that_could_be_named_counts(campaign):
    given = verdict("none", negative_controls={"tested": 9, "accepted": True})
    assert campaign.scoring.score(truth([], "none"), given).negative_control
    assert not campaign.scoring.score(truth([], "none"), verdict("none")).negative_control


def test_removed_excess(campaign):
    assert campaign.scoring.removed({"before": 3.0, "after": 1.5}) == pytest.approx(0.75)
    assert campaign.scoring.removed({"before": 3.0, "after": 0.9}) == 1
    assert math.isnan(campaign.scoring.removed({"before": 1.05, "after": 1.0}))


def test_the_confusion_matrix_has_every_case_once(campaign):
    found = [
        campaign.scoring.score({**hidden, "number": i}, given)
        for i, (hidden, given, _, _) in enumerate(SCORED)
    ]
    rows = sorted({one.truth for one in found})
    counts, columns = campaign.figure.confusion_counts(found, rows)
    assert counts.sum() == len(SCORED)
    assert counts[:, columns.index("right")].sum() == sum(flags[1] for _, _, flags, _ in SCORED)
    assert sum(one.alarm for one in found if one.kind == "none") == 3
    wrong = {row[0]: row[2] for row in campaign.bars.bars(found, [])}["wrong name, all cases"]
    assert f"({sum(flags[3] for _, _, flags, _ in SCORED)} of {len(SCORED)};" in wrong


def test_verdicts_of_an_older_version_are_scored_alike(campaign):
    """The archive of the campaign keeps the words that it was written with."""
    old = verdict(
        "named", ["friction_place_curve"], decoys={"accepted": True}, character=[{"depends_on": ["place"]}],
        parameters={"effect.friction_place_curve.place[2]": {}},
    )  # fmt: skip
    assert campaign.scoring.in_todays_words(old["verdict"]) == {
        **verdict("named", ["friction_position_curve"])["verdict"],
        "negative_controls": {"accepted": True},
        "character": [{"depends_on": ["position"]}],
        "parameters": {"effect.friction_position_curve.position[2]": {}},
    }
