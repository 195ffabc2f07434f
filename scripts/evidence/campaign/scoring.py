# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares a verdict with the truth."""

import math
import re
from dataclasses import dataclass

EQUIVALENT = frozenset({"offset_force", "asymmetric_friction", "sensor_bias", "sensor_gain"})
"""One motion while the body slides and scale, friction and barrier are free: only a set is right."""
HAVE_A_TERM = EQUIVALENT | {
    "viscous",
    "coulomb",
    "quadratic_drag",
    "stribeck",
    "position_dependent_friction",
    "cubic_spring",
    "drive_ripple",
}
"""Effects that the baselines can name: they have the force as a term, or a constant for the set."""
FUNCTIONS = ("_curve", "_harmonics")
STRONG = 5.0
"""d' from which on the bars count."""
SEPARABLE = 3.0
"""d' that has to be left beside any one other effect for a name to be possible."""
PRECISE = 10.0
UNNAMED = ("not-in-catalogue", "characterised")
"""A gap that no effect closes; if the dependence of the force is known, it is reported."""
ANSWERS = ("named", "ambiguous", "none", *UNNAMED)
DEPENDS_ON = {
    "parametric_stiffness": {"oscillating time", "position"},
    "drifting_friction": {"slow time", "direction of motion"},
    "second_mode": {"memory"},
    "delayed_force": {"memory"},
    "maxwell_element": {"memory"},
    "drifting_restitution": {"oscillating time", "impacts"},
}
"""On what an effect outside of the catalogue depends."""


SPEED, REVERSAL, POSITION = "velocity", "low speed", "position"
PLANE, PHASE, IMPACT = "position and velocity", "drive phase", "time since the last impact"
IMPACT_SPEED = "impact speed"
FAMILIES = {
    "friction over speed": {
        "viscous",
        "coulomb",
        "quadratic_drag",
        "cubic_damping",
        "stribeck",
        "static_excess",
        "friction_curve",
    },
    "friction over position": {"position_dependent_friction", "friction_position_curve"},
    "spring over extension": {"cubic_spring", "backlash", "spring_curve"},
    "restitution over impact speed": {"restitution_slope", "restitution_curve"},
    "contact over penetration": {
        "compliant_contact",
        "kelvin_voigt_contact",
        "contact_curve",
        "contact_hardening",
    },
    "drive over phase": {"drive_ripple", "drive_harmonics"},
}
"""Closed forms and the function of a family. A function names the family of any of its laws."""
TRENDS = ({"viscous", "quadratic_drag", "cubic_damping"}, {"stribeck"}, {"coulomb"})
"""Closed forms over speed that rise, fall, and stay. If the hidden law has another shape than that of the
catalogue, a form of its trend names it too."""
REGIONS = {
    "viscous": {SPEED, PLANE},
    "coulomb": {SPEED, REVERSAL, PLANE},
    "quadratic_drag": {SPEED, PLANE},
    "stribeck": {SPEED, REVERSAL, PLANE},
    "static_excess": {REVERSAL},
    "dahl": {REVERSAL, PLANE},
    "position_dependent_friction": {PLANE},
    "cubic_spring": {POSITION, PLANE},
    "restitution_slope": {IMPACT, IMPACT_SPEED},
    "compliant_contact": {IMPACT, IMPACT_SPEED},
    "second_barrier": {POSITION, PLANE},
    "drive_ripple": {PHASE},
}
"""Maps in which an effect appears; effects on the whole motion or on the sensor have none."""


@dataclass(frozen=True)
class Score:
    """One case, scored."""

    number: int
    kind: str
    truth: str
    noise: float
    colour: str
    regime: str
    samples: int
    velocity: bool
    crank_angle: bool
    d_prime: float
    beyond: float
    answer: str
    """named, ambiguous, none, characterised, not-in-catalogue, or failed."""
    column: str
    """Where it stands in the confusion matrix."""
    decided: bool
    right: bool
    contains: bool
    """The set that was reported has the truth."""
    in_family: bool
    """Decided because all that was reported is of the family, though its form is in doubt."""
    wrong_name: bool
    errors: tuple[float, ...]
    """Relative errors of the parameters of the effect, where it was named rightly."""
    covered: tuple[bool, ...]
    removed: float
    """Share of the held-out excess that the verdict removed; NaN without excess or name."""
    negative_control: bool
    """A negative control could have been named."""
    region: bool | None
    """The clearest region is one where the effect acts; None without region or rule."""
    depends_rightly: bool | None
    """The reported dependence of an unnamed force is right; None without one."""
    character_closes: float
    """Share of the held-out gap that it would close; NaN without one."""
    shaped: bool
    """The law that was hidden has another shape than that of the catalogue."""
    by_family: bool
    """Right by the function of its family or a form of its trend, not by its own name."""
    rig: bool
    """The records have the small imperfections of a rig."""
    whole: int
    """Samples of all records together."""
    leaves: str
    """Remainder of the machine of the verdict, if it is adequate."""
    seconds: float
    baselines: dict[str, str]
    baselines_right: dict[str, bool]

    @property
    def in_catalogue(self) -> bool:
        """Whether it has a name."""
        return self.kind in ("single", "pair")

    @property
    def alarm(self) -> bool:
        """Whether the verdict reports anything missing."""
        return self.answer in ("named", "ambiguous", *UNNAMED)

    @property
    def strong(self) -> bool:
        """Whether the bars on names count for it."""
        return self.in_catalogue and self.d_prime >= STRONG

    @property
    def comparable(self) -> bool:
        """Whether the baselines could have named it."""
        return self.kind == "single" and self.truth in HAVE_A_TERM

    @property
    def separable(self) -> bool:
        """Whether something is left of it beside any one other effect."""
        return self.in_catalogue and self.beyond >= SEPARABLE


def reported(verdict: dict) -> set[frozenset[str]]:
    """All that a verdict considers possible, each as a set of effects."""
    if verdict["outcome"] not in ("named", "ambiguous"):
        return set()
    words = ["+".join(verdict["effects"]), *verdict.get("alternatives", [])]
    return {frozenset(word.split("+")) for word in words if word}


def as_hidden(names: frozenset[str], truth: dict) -> frozenset[str]:
    """A set of effects in which the name of the family of a hidden one is replaced by its own name."""
    found = set(names)
    for hidden in truth["names"]:
        members = next((one for one in FAMILIES.values() if hidden in one), {hidden})
        alike = next((one for one in TRENDS if hidden in one and hidden in truth.get("shapes", {})), set())
        equal = {name for name in members if name in alike or name.endswith(FUNCTIONS)}
        if hidden not in found and len(found & equal) == 1:
            found = (found - equal) | {hidden}
    return frozenset(found)


def only_equivalent(sets: set[frozenset[str]]) -> bool:
    """Whether sets of effects differ only by effects that are indistinguishable here."""
    common = frozenset.intersection(*sets)
    rest = [one - common for one in sets]
    return len(sets) > 1 and all(len(one) == 1 and one <= EQUIVALENT for one in rest)


def one_family(sets: set[frozenset[str]]) -> bool:
    """Whether sets of effects differ by the forms of their families only."""
    found = {
        tuple(
            sorted(
                next((family for family, members in FAMILIES.items() if name in members), name)
                for name in one
            )
        )
        for one in sets
    }
    return len(sets) > 1 and len(found) == 1


def score(truth: dict, result: dict) -> Score:
    """Score one case."""
    verdict, names = in_todays_words(result["verdict"]), frozenset(truth["names"])
    sets = {as_hidden(one, truth) for one in reported(verdict)}
    answer = verdict["outcome"] if verdict["outcome"] in ANSWERS else "failed"
    in_family = answer == "ambiguous" and bool(verdict.get("in_families")) and one_family(reported(verdict))
    alike = answer == "ambiguous" and bool(sets) and only_equivalent(sets)
    one_answer = answer == "named" or alike or in_family
    contains = names in sets
    right = {
        "none": answer == "none",
        "outside": answer in UNNAMED,
    }.get(truth["kind"], one_answer and contains)
    in_catalogue = truth["kind"] in ("single", "pair")
    # one name only is a name, also where the verdict doubts it
    alone = len(sets) == 1
    part = truth["kind"] == "pair" and (alone or in_family) and any(one < names for one in sets)
    errors, covered = precision(truth, verdict) if right and in_catalogue else ((), ())
    held_out = verdict.get("gap", {}).get("held_out")
    return Score(
        number=truth["number"],
        kind=truth["kind"],
        truth="+".join(truth["names"]) or "none",
        noise=truth["noise"],
        colour=truth["colour"],
        regime=truth["regime"],
        samples=truth["samples_per_period"],
        velocity=truth["velocity"],
        crank_angle=truth["crank_angle"],
        d_prime=min(truth["d_prime"].values(), default=0.0),
        beyond=min((value["d_prime"] or 0.0 for value in truth["beyond"].values()), default=0.0),
        answer=answer,
        column=column(answer, sets, one_answer, contains, part),
        decided=one_answer,
        right=right,
        contains=contains,
        in_family=in_family and not alike,
        wrong_name=(one_answer or alone) and not contains and not part,
        errors=errors,
        covered=covered,
        removed=removed(held_out) if one_answer else math.nan,
        negative_control=bool(verdict.get("negative_controls", {}).get("accepted")),
        region=region(truth["names"], verdict.get("where", [])) if one_answer and right else None,
        depends_rightly=depends_rightly(truth, verdict),
        character_closes=verdict["character"][0]["closed"]["held_out"]
        if verdict.get("character")
        else math.nan,
        shaped=bool(truth.get("shapes")),
        by_family=in_catalogue and right and names not in reported(verdict),
        rig=bool(truth.get("rig")),
        whole=truth.get("samples", 0),
        leaves=verdict.get("leaves", "") if answer in ("named", "ambiguous") else "",
        seconds=result["seconds"],
        baselines=result.get("baselines", {}),
        baselines_right={
            method: named in names or (named in EQUIVALENT and bool(names & EQUIVALENT))
            if in_catalogue
            else named == "none"
            for method, named in result.get("baselines", {}).items()
        },
    )


# Words of verdicts before version 2.
_RENAMED = {
    "decoys": "negative_controls",
    "faults": "imperfections",
    "places": "locations",
    "foretold": "predicted",
    "place": "position",
    "stretch": "extension",
    "friction_place_curve": "friction_position_curve",
    "friction over place": "friction over position",
    "spring over stretch": "spring over extension",
    "force over place": "force over position",
    "contact over place": "contact over position",
}


def in_todays_words(part: object) -> object:
    """Return a verdict with the keys, effects and dependences of an older one under their names of today."""
    if isinstance(part, dict):
        return {in_todays_words(key): in_todays_words(value) for key, value in part.items()}
    if isinstance(part, list):
        return [in_todays_words(one) for one in part]
    if isinstance(part, str) and part.startswith("effect."):
        return re.sub(r"\w+", lambda word: _RENAMED.get(word[0], word[0]), part)
    return _RENAMED.get(part, part) if isinstance(part, str) else part


def depends_rightly(truth: dict, verdict: dict) -> bool | None:
    """Whether the likeliest reported dependence of a missing force is right."""
    if not verdict.get("character"):
        return None
    wanted = [DEPENDS_ON[name] for name in truth["names"] if name in DEPENDS_ON]
    return any(set(verdict["character"][0]["depends_on"]) == one for one in wanted)


def region(names: list[str], where: list[dict]) -> bool | None:
    """Whether the clearest flagged region lies in a map in which one of the effects appears."""
    if not where or not any(name in REGIONS for name in names):
        return None
    clearest = max(where, key=lambda one: abs(one["force"] / one["error"]))
    return any(clearest["map"] in REGIONS.get(name, ()) for name in names)


def column(answer: str, sets: set[frozenset[str]], one_answer: bool, contains: bool, part: bool) -> str:
    """Column of the confusion matrix."""
    if answer == "failed":
        return "no verdict"
    if answer in ("none", *UNNAMED):
        return "not-in-catalogue" if answer in UNNAMED else answer
    if contains:
        return "right name" if answer == "named" else "equivalent set" if one_answer else "set with the truth"
    if len(sets) != 1:
        return "set without the truth"
    return "one of the pair" if part else "+".join(sorted(next(iter(sets))))


def precision(truth: dict, verdict: dict) -> tuple[tuple[float, ...], tuple[bool, ...]]:
    """Relative errors of the size of each effect, and whether its interval has the truth.

    A parameter whose truth is 0, and one that was not fitted, has no relative error. One that ended at its
    bound has no interval, which cannot have the truth.
    """
    errors, covered = [], []
    for path, value in truth["parameters"].items():
        found = verdict.get("parameters", {}).get(path)
        if found is None or value == 0:
            continue
        errors.append(abs(found["value"] / value - 1))
        ends = found["interval_95"]
        covered.append(ends is not None and ends[0] <= value <= ends[1])
    return tuple(errors), tuple(covered)


def removed(held_out: dict | None) -> float:
    """Share of reduced chi^2 above 1 that is gone on the held-out record; NaN where there was none."""
    if not held_out or held_out["before"] is None or held_out["before"] <= 1.1:
        return math.nan
    return (held_out["before"] - max(1.0, held_out["after"])) / (held_out["before"] - 1)
