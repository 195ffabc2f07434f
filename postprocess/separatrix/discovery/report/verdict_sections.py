# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sections of the report of a verdict in words and tables; every number is one of verdict.json."""

from separatrix.discovery.decision.stages.in_part import NEAREST
from separatrix.discovery.fitting.low_pass import LOW_PASS
from separatrix.discovery.options import Options
from separatrix.discovery.report.memory_section import memory_section
from separatrix.discovery.report.next_experiment import next_experiment
from separatrix.discovery.report.pages import Section, Table
from separatrix.discovery.report.phrases import explained
from separatrix.discovery.wording import (
    at_knot,
    digits_of,
    interval,
    misfit,
    number,
    of_effects,
    probability,
    searched,
    with_unit,
    words,
)

_FIRST_NOTES = 3
"""Notes on the first page."""

GATES = {
    "converged": "the fit converged",
    "detect": "the gain is larger than chance gives the best of all candidates",
    "hold-out": "records that the fit never saw are predicted better",
    "separate": "no other effect does about as well",
    "admissible": "sign and size make sense, and differ from zero",
    "stable": "the effect pays in nearly every resampling of the record",
    "adequate": "what is left is noise",
    "predicted": "held-out records are followed as well",
    "drop": "each of the effects is needed beside the other",
}


_HOW = {
    "motion": "The records are cut into short segments. The start of each segment and all uncertain numbers "
    "of the base machine are fitted, so that neither chaos nor a wrong parameter counts as missing physics.",
    "force": "The force that drives the body along its measured motion is compared. All uncertain numbers of "
    "the base machine are fitted, so that no wrong parameter counts as missing physics.",
}


def sections(verdict: dict) -> list[Section]:
    """All sections, without figures."""
    return [
        _summary(verdict),
        _compared(verdict),
        _gap(verdict),
        *memory_section(verdict),
        _where(verdict),
        _missing(verdict),
        Section("confusable", "What can be mistaken for what", [_confusable(verdict)]),
        Section("residuals", "What is left over, before and after", []),
        Section("impacts", "Impacts", []),
        Section("held-out", "On records that the fit never saw", [_held_out(verdict)]),
        _parameters(verdict),
        _detectable(verdict),
        next_experiment(verdict),
        Section("motion", "What it means for the motion", []),
    ]


def names(verdict: dict) -> str:
    """The effects of the verdict as words."""
    return " and ".join(words(name) for name in verdict["effects"]) or "none"


def depends_on(verdict: dict) -> str:
    """What a missing force without a name depends on, as words."""
    return ", or ".join(" and ".join(one["depends_on"]) for one in verdict["character"])


def cause(verdict: dict) -> str:
    """What makes a gap without a name, as words."""
    found = depends_on(verdict)
    return f"a {found}" if found == LOW_PASS else f"a force that depends on {found}"


def _summary(verdict: dict) -> Section:
    text = {
        "named": f"The base machine lacks: {_what(verdict)}. "
        + (
            "All gates are passed."
            if verdict["complete"]
            else "All gates but the adequacy are passed: a gap remains that the catalogue does not name."
        ),
        "ambiguous": f"Something is missing that looks like {_what(verdict)}, but {_doubt(verdict)}.",
        "none": "No effect is missing that these records could show.",
        "not-in-catalogue": f"Something is missing, and no effect of {searched(verdict)} explains it.",
        "characterised": f"Something is missing, and no effect of {searched(verdict)} explains it; "
        f"it looks like {cause(verdict)}.",
    }[verdict["outcome"]]
    lines = [f"Verdict: {verdict['outcome']}. {text}"]
    if verdict["p_value"] is not None:
        chance = "Chance alone would make the best of all effects gain so much with a probability"
        lines.append(f"{chance} {_chance(verdict)}.")
    for index, one in enumerate(verdict["character"]):
        lines.append(f"{'Or ' if index else 'Most likely '}{one['text']}.")
    if verdict["added"]:
        table = f"effect.{verdict['added'][-1]}"
        closing = "no name, but the function that closes the gap"
        lines.append(f"It is added to the case as a table, {table}: {closing}.")
    memory = (verdict.get("memory") or {}).get("text")
    lines += [f"{one[0].upper()}{one[1:]}." for one in (verdict["not_added"], memory) if one]
    if verdict["in_families"]:
        lines.append(
            f"In any case it is {' and '.join(verdict['in_families'])}: the form is in doubt, not the family."
        )
    lines += [f"{words(name)} acts {location}." for name, location in verdict["locations"].items()]
    for path in of_effects(verdict):
        one = verdict["parameters"][path]
        digits = digits_of(one["value"], one["standard_error"])
        known = "" if one["interval_95"] is None else "95 % interval "
        size = with_unit(one["value"], one["unit"], digits)
        lines.append(f"{path}{at_knot(one)} = {size}, {known}{interval(one, digits)}.")
    if verdict["function"]:
        lines.append(f"{verdict['families'][-1].capitalize()}: {verdict['function']['text']}.")
    left = {one["use"]: one["text"].partition(", ")[2] for one in verdict["remains"]}
    lines += [_gap_of(use, one, left.get(use, "")) for use, one in verdict["gap"].items()]
    advice = verdict["separating_experiment"] or next_experiment(verdict).body[0].rstrip(".")
    lines.append(f"To measure next: {advice[0].lower()}{advice[1:]}.")
    body: list = [lines[0], lines[1:]]
    if verdict["reasons"]:
        body += ["What kept the verdict from being firmer:", list(verdict["reasons"])]
    notes = verdict["notes"]
    if notes:
        more = f"({len(notes) - _FIRST_NOTES} more below.)" if len(notes) > _FIRST_NOTES else ""
        body += ["Notes, the most important first:", notes[:_FIRST_NOTES], *([more] if more else [])]
    return Section("verdict", "Verdict", body)


def _doubt(verdict: dict) -> str:
    """What keeps an effect from being named, as words."""
    if verdict["alternatives"]:
        return f"{', '.join(_pair(name) for name in verdict['alternatives'])} would do about as well"
    failed = [name for name, passed in verdict["gates"].items() if not passed]
    if failed:
        return f"not every gate is passed: {', '.join(failed)}"
    if verdict.get("stopped_before"):
        return f"the search was ended before '{verdict['stopped_before']}'"
    return "it is in doubt for the reason below"


def _chance(verdict: dict) -> str:
    """The p value of the verdict after 'a probability'."""
    found = probability(verdict["p_value"])
    return found if found.startswith("below") else f"of {found}"


def _what(verdict: dict) -> str:
    """The effects of the verdict with what they are."""
    return " and ".join(explained(name) for name in verdict["effects"]) or "none"


def _missed(one: dict, when: str) -> str:
    """What a machine misses, before or after, as words."""
    return f"{misfit(one, when)} of the signal" if one["misfit"][when] > 0 else "nothing"


def _gap_of(use: str, one: dict, left: str) -> str:
    """What a machine misses on the records of one use, before and after, and what is `left` of it."""
    if one["before"] == one["after"]:
        change = f"misses {_missed(one, 'before')} beyond the noise (reduced chi^2 {number(one['before'])}"
    else:
        change = (
            f"missed {_missed(one, 'before')} beyond the noise, the extended machine misses "
            f"{_missed(one, 'after')} (reduced chi^2 {number(one['before'])} and {number(one['after'])}"
        )
    closed = _removed(one)
    share = f"; {left}" if left else "" if closed == "-" else f"; {closed} of the excess is removed"
    floor = number(one["noise_floor"])
    return f"On {_records_of(use)} the base machine {change}, {floor} of noise alone){share}."


def _records_of(use: str) -> str:
    return "the records that were fitted" if use == "training" else "the held-out records"


def _pair(name: str) -> str:
    return " with ".join(words(part) for part in name.split("+"))


def _drive(record: dict) -> list[str]:
    if record["drive_frequency"] is None:
        return ["none", "none"]
    return [number(record["drive_frequency"], 5), "known" if record["phase_known"] else "fitted"]


def _compared(verdict: dict) -> Section:
    rows = [
        [
            one["name"],
            one["use"],
            str(one["samples"]),
            number(one["sigma"], 3),
            *([number(one["deviation"], 3)] if "deviation" in one else []),
            number(one["resolution"], 3),
            *_drive(one),
        ]
        for one in verdict["records"]
    ]
    unit = verdict["units"]["force" if verdict["compared"] == "force" else "position"]
    noises = [f"noise ({unit})"]
    if any("deviation" in one for one in verdict["records"]):
        noises = [f"noise of the sensor ({unit})", f"with that of mass times acceleration ({unit})"]
    head = ["record", "use", "samples", *noises, f"resolution ({unit})", "drive (rad/s)", "crank angle"]
    table = Table(head, rows)
    return Section(
        "compared",
        "What was compared",
        [
            _HOW[verdict["compared"]],
            table,
            f"Held out: {verdict['held_out_chosen']}. Random choices follow from seed {verdict['seed']}; "
            f"separatrix {verdict['version']}, {number(verdict['runtime_s'], 3)} s.",
            *(["Further notes:", rest] if (rest := verdict["notes"][_FIRST_NOTES:]) else []),
        ],
    )


def _gap(verdict: dict) -> Section:
    rows = [
        [
            use.replace("_", " "),
            number(one["before"]),
            number(one["after"]),
            number(one["noise_floor"]),
            _removed(one),
        ]
        for use, one in verdict["gap"].items()
    ]
    explained = [
        [name, number(one["gain"]), str(one["rank"]), probability(one["p"])]
        for name, one in verdict["ceiling"].items()
    ]
    return Section(
        "gap",
        "Is there a gap?",
        [
            "Reduced chi^2: mean square of the residuals over that of the noise.",
            Table(["records", "base machine", "extended machine", "noise", "excess removed"], rows),
            "Gain of a free force of one variable over the base machine; a small p indicates that some law "
            "of this variable is missing:",
            Table(["a force that depends on", "chi^2", "free numbers", "p"], explained),
        ],
    )


def _removed(one: dict) -> str:
    excess = one["before"] - one["noise_floor"]
    if excess <= 0 or one["before"] == one["after"]:
        return "-"
    return f"{min(100.0, 100 * (one['before'] - one['after']) / excess):.1f} %"


def _where(verdict: dict) -> Section:
    if not verdict["where"]:
        body: list = ["No bin of any map differs from zero by more than chance."]
    else:
        no_gap = ["There is no gap: what follows is what noise and small imperfections of a rig leave."]
        body = [
            *(no_gap if verdict["outcome"] == "none" else []),
            "In each bin a constant force is fitted to what the base machine leaves over. These bins "
            "differ from zero by "
            "more than chance, given how many bins there are:",
            [one["text"] + "." for one in verdict["where"]],
        ]
    return Section("where", "Where is it?", body)


def _missing(verdict: dict) -> Section:
    body: list = []
    if verdict["gates"]:
        rows = [
            [gate, GATES.get(gate, ""), "passed" if passed else "failed"]
            for gate, passed in verdict["gates"].items()
        ]
        body += [
            f"Gates of {names(verdict)}; chance would give the best of all effects this gain with a "
            f"probability {_chance(verdict)}:"
            if verdict["p_value"] is not None
            else f"Gates of {names(verdict)}:",
            Table(["gate", "meaning", ""], rows),
        ]
    else:
        nearest = [one for one in verdict["reasons"] if NEAREST in one]
        body.append(
            f"No effect passed every gate: {nearest[0]}."
            if nearest
            else "No effect gained enough to be put to the gates, or none passed them."
        )
    if verdict["alternatives"]:
        body.append(
            "Not distinguished from: " + ", ".join(_pair(name) for name in verdict["alternatives"]) + "."
        )
    if verdict["equivalences"]:
        body += ["These are the same motion:", [f"{text}." for text in verdict["equivalences"]]]
    if verdict["candidates"]:
        body += [
            "Candidates that were fitted together with all uncertain numbers of the machine, best first:",
            Table(
                ["effect", "d'", "training", "held out", "evidence", "chi^2", "converged", "values"],
                [_candidate(one, verdict) for one in verdict["candidates"]],
            ),
            "d' is the linearised size of the effect over its standard error; training and held out are "
            "log-likelihoods "
            "gained over the base machine; the evidence counts their sum less one per parameter, and what "
            "imperfections of a rig beside the effect add, where those were weighed.",
        ]
    # the base alone may not allow an effect that it allows beside another
    skipped = {name: why for name, why in verdict["not_tested"].items() if name not in verdict["effects"]}
    if skipped:
        body += ["Not tested:", [f"{words(name)}: {why}." for name, why in skipped.items()]]
    return Section("missing", "What is missing?", body)


def _candidate(one: dict, verdict: dict) -> list[str]:
    values = ", ".join(f"{path.split('.')[-1]} {number(value, 3)}" for path, value in one["values"].items())
    return [
        words(one["effect"]),
        number(verdict["d_prime"].get(one["effect"]), 3),
        number(one["training"]),
        number(one["held_out"]),
        number(one["evidence"]),
        number(one["reduced_chi2"]),
        "yes" if one["converged"] else "no",
        values,
    ]


def _confusable(verdict: dict) -> str:
    table = verdict["confusability"]
    pairs = sorted(
        (
            (abs(table["matrix"][i][j]), one, other)
            for i, one in enumerate(table["names"])
            for j, other in enumerate(table["names"][:i])
        ),
        reverse=True,
    )
    close = [
        f"{words(one)} and {words(other)} ({number(size, 3)})" for size, one, other in pairs if size > 0.9
    ]
    if not close:
        return "No two signatures have a cosine above 0.9 once the base machine is refitted."
    return (
        "Cosine of the signatures of two effects, the base machine refitted: at 1 these records do not "
        "distinguish them. "
        "Above 0.9: " + ", ".join(close[:12]) + (f" and {len(close) - 12} more." if len(close) > 12 else ".")
    )


def _held_out(verdict: dict) -> str:
    if "held_out" not in verdict["gap"]:
        return "No record was held out."
    one = verdict["gap"]["held_out"]
    driven = any(record["drive_frequency"] is not None for record in verdict["records"])
    own = ["the starts of its segments", *(["phase and clock of its drive"] if driven else [])]
    if any(record["sensor_bias"] is not None for record in verdict["records"]):
        own.append("the zero of its sensor")
    return (
        f"Of a held-out record only these are fitted: {', '.join(own)}. "
        "Reduced chi^2: "
        f"{number(one['before'])} for the base machine, {number(one['after'])} for "
        + (
            "the machine of the verdict."
            if verdict["effects"] or verdict["added"]
            else "the machine of the verdict, which is the base machine."
        )
    )


def _of_the_rig(path: str) -> str:
    """A parameter's path; what the case has no key for, in words."""
    kind, _, name = path.partition(":")
    return f"{words(name)} (of the rig, no key of the case)" if kind == "nuisance" else path


def _parameters(verdict: dict) -> Section:
    rows = []
    for path, one in verdict["parameters"].items():
        digits = digits_of(one["value"], one["standard_error"])
        rows.append(
            [
                _of_the_rig(path) + at_knot(one),
                number(one["value"], digits),
                "-" if one["standard_error"] is None else number(one["standard_error"], 2),
                interval(one, digits),
                "" if one["unit"] == "1" else one["unit"],
            ]
        )
    body: list = [Table(["parameter", "value", "standard error", "95 % interval", "unit"], rows)]
    if not rows:
        body = ["No parameter was fitted."]
    return Section("parameters", "Parameters and their intervals", body)


def _detectable(verdict: dict) -> Section:
    rows = [
        [words(name), one["path"] or "-", with_unit(one["size"], one["unit"], 3), one["reason"]]
        for name, one in verdict["detectable"].items()
        if one["size"] is not None or name not in verdict["effects"]
    ]
    text = (
        f"The size that each effect would need to stand out by {Options().visible:g} standard errors in "
        "these records. "
        "What is smaller may be there and could not have been seen."
    )
    return Section(
        "detectable",
        "What could not have been seen",
        [text, Table(["effect", "parameter", "smallest size", "why not known"], rows)],
    )
