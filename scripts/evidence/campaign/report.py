# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens the truths and writes docs/discovery.md with the figure of the confusion matrix."""

import json
import math
import statistics
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path

import effects
import figure
import followed
import records
import seeds
from bars import LONG, bars
from evidence_rows import table
from rates import Rate, rate
from scoring import HAVE_A_TERM, PRECISE, SEPARABLE, STRONG, Score, score

TEMPLATE = Path(__file__).resolve().parent / "discovery.md.in"
METHODS = ("STLSQ", "ensemble SINDy")
NOTHING = "nothing was detected"
"""The reason where a verdict gives none."""
WIDTH = 120


class Broken(Exception):
    """A truth does not fit its seal."""


def scores_of(folders: object, numbers: Sequence[int]) -> tuple[list[Score], int]:
    """All cases with a result, scored, and the number of those whose effect could not have its size."""
    found, unreachable = [], 0
    for number in numbers:
        if not folders.result(number).is_file():
            continue
        result = json.loads(folders.result(number).read_text())
        if "verdict" not in result:
            unreachable += 1
            continue
        sealed = folders.sealed / f"{number:04}.json"
        if records.seal(sealed) != result["seal"]:
            raise Broken(f"{sealed} is not what was sealed")
        found.append(score(json.loads(sealed.read_text()), result))
    return found, unreachable


def versions(folders: object, found: list[Score]) -> str:
    """Commits whose workflow gave the verdicts, and the libraries that it computed with."""
    results = [json.loads(folders.result(one.number).read_text()) for one in found]
    made_by = [f"{one['commit']} with library {one.get('library', 'unknown')}" for one in results]
    return ", ".join(f"{name} ({made_by.count(name)})" for name in dict.fromkeys(made_by))


def percent(share: float) -> str:
    """A share, or a dash."""
    return "-" if math.isnan(share) else f"{100 * share:.1f} %"


def middle(values: list[float]) -> float:
    """The median, NaN of nothing."""
    return statistics.median(values) if values else math.nan


def classes(found: list[Score], of: Callable[[Score], str], order: list[str]) -> list[list[str]]:
    """Rates of effects in the catalogue, class by class."""
    rows = []
    for name in order:
        chosen = [one for one in found if one.in_catalogue and of(one) == name]
        decided = [one for one in chosen if one.decided]
        rows.append(
            [
                name,
                str(len(chosen)),
                str(rate([one.decided for one in chosen])),
                str(rate([one.right for one in decided])),
                str(rate([one.contains for one in chosen if one.answer in ("named", "ambiguous")])),
                str(rate([one.wrong_name for one in chosen])),
            ]
        )
    return rows


def size_class(one: Score) -> str:
    """By d'."""
    limits = ((4, "below 4"), (7, "4 to 7"), (20, "7 to 20"))
    return next((name for limit, name in limits if one.d_prime < limit), "above 20")


def truths(found: list[Score]) -> list[str]:
    """Hidden effects in the order of the figure and the table."""
    rank = {"none": 0, "single": 1, "pair": 2, "outside": 3}
    return list(
        dict.fromkeys(one.truth for one in sorted(found, key=lambda one: (rank[one.kind], one.truth)))
    )


def by_truth(found: list[Score]) -> list[list[str]]:
    """One row per hidden effect."""
    rows = []
    for name in truths(found):
        chosen = [one for one in found if one.truth == name]
        wrong = [one.column for one in chosen if one.wrong_name]
        rows.append(
            [
                name,
                str(len(chosen)),
                str(sum(one.right for one in chosen)),
                str(
                    sum(
                        one.column in ("set with the truth", "one of the pair") and not one.right
                        for one in chosen
                    )
                ),
                str(sum(not one.decided and not one.contains and not one.right for one in chosen)),
                ", ".join(f"{other} {wrong.count(other)}" for other in dict.fromkeys(wrong)) or "-",
            ]
        )
    return rows


def precision(found: list[Score]) -> list[list[str]]:
    """Errors and coverage by size."""
    rows = []
    for name in ("below 4", "4 to 7", "7 to 20", "above 20"):
        chosen = [one for one in found if one.right and one.in_catalogue and size_class(one) == name]
        errors = [error for one in chosen for error in one.errors]
        covered = [inside for one in chosen for inside in one.covered]
        rows.append([name, str(len(errors)), percent(middle(errors)), str(rate(covered))])
    return rows


def baselines(found: list[Score]) -> list[list[str]]:
    """Right names of all single effects that the baselines have a term for."""
    strong = [one for one in found if one.comparable and one.strong]
    quiet = [one for one in strong if one.noise <= 0.01]
    none = [one for one in found if one.kind == "none"]

    def row(name: str, right: Callable[[Score], bool], alarm: Callable[[Score], bool]) -> list[str]:
        groups = [rate([right(one) for one in group]) for group in (strong, quiet)]
        return [name, *map(str, groups), str(rate([alarm(one) for one in none]))]

    rows = [row("Separatrix", lambda one: one.right, lambda one: one.alarm)]
    for method in METHODS:
        rows.append(
            row(
                method,
                lambda one, method=method: one.baselines_right.get(method, False),
                lambda one, method=method: one.baselines.get(method) != "none",
            )
        )
    return rows


def undecided(folders: object, found: list[Score]) -> list[list[str]]:
    """Why strong effects of the catalogue got no single answer."""
    reasons: dict[tuple[str, str], int] = {}
    for one in found:
        if not one.strong or one.decided:
            continue
        verdict = folders.portable(folders.result(one.number))["verdict"]
        for text in verdict.get("reasons") or [NOTHING]:
            key = (one.column, text)
            reasons[key] = reasons.get(key, 0) + 1
    return [[*key, str(count)] for key, count in sorted(reasons.items(), key=lambda item: -item[1])]


def quoted(reason: str) -> str:
    """The message of a verdict as a page shows it."""
    return reason if reason == NOTHING else f"`{reason}`"


def page(folders: object, found: list[Score], unreachable: int, seed: int, asked: int) -> str:
    """The text of the page."""
    rate_head = "cases, decided, right among decided, truth in the reported set, wrong name".split(", ")
    noises = sorted({one.noise for one in found})
    strong = [one for one in found if one.strong]
    pairs = followed.followed(folders, found)
    fields = {
        "cases": len(found),
        "asked": asked,
        "unreachable": unreachable,
        "seed": seed,
        "developed_on": textwrap.fill(seeds.developed_on(), WIDTH),
        "of_this_seed": seeds.of_page(seed),
        "version": versions(folders, found),
        "none": sum(one.kind == "none" for one in found),
        "single": sum(one.kind == "single" for one in found),
        "pair": sum(one.kind == "pair" for one in found),
        "outside": sum(one.kind == "outside" for one in found),
        "strong": f"{STRONG:g}",
        "separable": f"{SEPARABLE:g}",
        "precise": f"{PRECISE:g}",
        "seconds": f"{middle([one.seconds for one in found]):.0f}",
        "mean_short": mean_seconds([one for one in found if one.whole < LONG]),
        "mean_long": mean_seconds([one for one in found if one.whole >= LONG]),
        "long": sum(one.whole >= LONG for one in found),
        "shaped": sum(one.shaped for one in found),
        "in_family": sum(one.in_family for one in found if one.strong),
        "by_family": sum(one.by_family for one in found),
        "right": sum(one.right for one in found if one.in_catalogue),
        "faulty": sum(one.rig for one in found),
        "rows": table(["hidden", "cases, d' >= 5", "decided"], rows_of_strong(found)),
        "bars": table(["figure", "bar", "found", "met"], bars(found, followed.rightly(pairs))),
        "followed": table(
            ["hidden", "sets with such a record", "right with it", "wrongly named", "still a set"],
            followed.rows(pairs),
        ),
        "followed_seconds": followed.seconds(pairs),
        "separable_bars": table(
            ["effects with d' of at least 5", "decided", "right among decided", "wrong name"],
            [
                [name, str(decided(group)), str(right(group)), str(rate([one.wrong_name for one in group]))]
                for name, group in (
                    ("distinguishable from any other", [one for one in strong if one.separable]),
                    ("imitated by another", [one for one in strong if not one.separable]),
                )
            ],
        ),
        "by_noise": table(
            ["noise", *rate_head],
            classes(
                [one for one in found if one.strong],
                lambda one: f"{one.noise:.1%}",
                [f"{n:.1%}" for n in noises],
            ),
        ),
        "by_size": table(
            ["d'", *rate_head], classes(found, size_class, ["below 4", "4 to 7", "7 to 20", "above 20"])
        ),
        "by_condition": table(["condition", *rate_head], conditions([one for one in found if one.strong])),
        "by_truth": table(
            ["hidden", "cases", "right", "set with it, or one of the pair", "abstained", "wrong names"],
            by_truth(found),
        ),
        "outside_by_size": table(
            ["d' beside any one effect", "cases", "recognised", "wrongly named", "a set", "none"],
            outside(found),
        ),
        "precision": table(
            ["d'", "parameters", "median error", "intervals with the truth"], precision(found)
        ),
        "baselines": table(
            ["method", "right, d' >= 5", "right, noise <= 1 %", "alarm where nothing is hidden"],
            baselines(found),
        ),
        "without_term": ", ".join(f"`{name}`" for name in effects.CATALOGUE if name not in HAVE_A_TERM),
        "leaves": table(["remainder", "names and sets", "truth contained", "wrong name"], leavings(found)),
        "undecided": table(
            ["answer", "reason", "cases"],
            [[answer, quoted(reason), count] for answer, reason, count in undecided(folders, found)],
        ),
        "failed": str(rate([one.answer == "failed" for one in found])),
    }
    return TEMPLATE.read_text().format(**fields)


def leavings(found: list[Score]) -> list[list[str]]:
    """Names and sets by what the machine with them leaves, which makes it an adequate one."""
    asked = [one for one in found if one.answer in ("named", "ambiguous")]
    rows = []
    for name in ("noise", "little of the gap", "larger noise", ""):
        group = [one for one in asked if one.leaves == name]
        cells = [rate([one.contains for one in group]), rate([one.wrong_name for one in group])]
        rows.append([name or "more: a name in doubt", str(len(group)), *map(str, cells)])
    return rows


def mean_seconds(group: list[Score]) -> str:
    """Mean processor time of cases."""
    return f"{statistics.fmean(one.seconds for one in group):.1f} s" if group else "-"


def rows_of_strong(found: list[Score]) -> list[list[str]]:
    """How many strong effects of each kind were decided."""
    rows = []
    for name in truths([one for one in found if one.strong]):
        group = [one for one in found if one.strong and one.truth == name]
        rows.append([name, str(len(group)), str(decided(group))])
    return rows


def decided(group: list[Score]) -> Rate:
    """How many got one answer."""
    return rate([one.decided for one in group])


def right(group: list[Score]) -> Rate:
    """How many of these are right."""
    return rate([one.right for one in group if one.decided])


def density(one: Score) -> str:
    """Samples per period; each number of many would be a class of its own."""
    return f"{one.samples if one.samples <= 400 else 'more'} samples per period"


def conditions(found: list[Score]) -> list[list[str]]:
    """Rates by what the records are like."""
    rows = []
    for of in (
        lambda one: one.colour + " noise",
        density,
        lambda one: "position and velocity" if one.velocity else "position only",
        lambda one: "crank angle measured" if one.crank_angle else "crank angle at the first sample",
        lambda one: f"regime `{one.regime}`",
        lambda one: "one effect" if one.kind == "single" else "two effects",
        lambda one: "law of another shape" if one.shaped else "law of the catalogue",
        lambda one: "small imperfections" if one.rig else "no imperfections",
        lambda one: "50 000 samples or more" if one.whole >= LONG else "fewer than 50 000 samples",
    ):
        rows += classes(
            found,
            of,
            sorted({of(one) for one in found if one.in_catalogue}, key=lambda name: (len(name), name)),
        )
    return rows


def outside(found: list[Score]) -> list[list[str]]:
    """Effects that have no name."""
    rows = []
    for low, high in ((0, 5), (5, 15), (15, math.inf)):
        chosen = [one for one in found if one.kind == "outside" and low <= one.beyond < high]
        answers = [
            [one.right for one in chosen],
            [one.wrong_name for one in chosen],
            [one.answer == "ambiguous" and not one.decided for one in chosen],
            [one.answer == "none" for one in chosen],
        ]
        name = f"{low} to {high:g}" if high < math.inf else f"above {low}"
        rows.append([name, str(len(chosen)), *(str(rate(flags)) for flags in answers)])
    return rows


def write(folders: object, seed: int, numbers: Sequence[int], output: Path) -> int:
    """Write page and figure; return the exit code."""
    found, unreachable = scores_of(folders, numbers)
    if not found:
        print("discovery_campaign: there is no result yet")
        return 1
    text = page(folders, found, unreachable, seed, len(numbers))
    (output.parent / "figures").mkdir(parents=True, exist_ok=True)
    figure.confusion(found, truths(found), output.parent / "figures" / "discovery_confusion.png")
    output.write_text(text)
    print(f"discovery_campaign: {len(found)} of {len(numbers)} cases; wrote {output}")
    return 0
