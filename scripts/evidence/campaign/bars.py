# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What has to be shown, and what was found.

A bar is met, or not, if all of Wilson's 95 % interval is on one side of it; else the cases are too few to
decide. A median is on one side of its bar if more than half of the values are, which is a rate.
"""

import math
import statistics

from rates import Rate, difference, rate
from scoring import PRECISE, Score

# samples from which on a case is a long one
LONG = 50_000


def bars(found: list[Score], with_asked: list[bool]) -> list[list[str]]:
    """Rows of the table of bars: figure, bar, found, met.

    `with_asked`: for each set of effects whether the record that its verdict asked for led to the right name.
    """
    strong = [one for one in found if one.strong]
    decided = [one for one in strong if one.decided]
    outside = [one for one in found if one.kind == "outside"]
    asked = [one for one in strong if one.answer in ("named", "ambiguous")]
    rows = [
        at_least(
            "right among decided, d' >= 5, noise <= 1 %", 0.95, [o.right for o in decided if o.noise <= 0.01]
        ),
        at_least(
            "right among decided, d' >= 5, noise 3 %", 0.90, [o.right for o in decided if o.noise == 0.03]
        ),
        at_least(
            "right among decided, d' >= 5, noise 5 %", 0.80, [o.right for o in decided if o.noise == 0.05]
        ),
        at_least("decided, d' >= 5", 0.85, [o.decided for o in strong]),
        at_least("truth in the reported set, d' >= 5", 0.98, [o.contains for o in asked]),
        at_most("wrong name, all cases", 0.03, [o.wrong_name for o in found]),
        at_most(
            "anything reported where nothing is hidden", 0.05, [o.alarm for o in found if o.kind == "none"]
        ),
        at_least("outside the catalogue, recognised", 0.80, [o.right for o in outside]),
        at_most("outside the catalogue, wrongly named", 0.10, [o.wrong_name for o in outside]),
    ]
    dependence = [one.depends_rightly is True for one in outside]
    closes = [one.character_closes for one in outside if one.depends_rightly]
    share = statistics.median(closes) if closes else math.nan
    rows += [
        at_least("outside the catalogue, dependence right", 0.60, dependence),
        [
            "held-out gap that these forces would close",
            ">= 80 %",
            f"{100 * share:.1f} % (median of {len(closes)})",
            met(rate([one >= 0.8 for one in closes]), 0.5, 1),
        ],
        at_most("a negative control could be named, all cases", 0.02, [o.negative_control for o in found]),
        at_least(
            "region of rightly named effects, d' >= 5",
            0.90,
            [o.region for o in strong if o.region is not None],
        ),
    ]
    rows.append(at_least("set resolved to the right name by the proposed record", 0.80, with_asked))
    quick = [one.seconds for one in found if one.whole < LONG]
    mean = statistics.fmean(quick) if quick else math.nan
    rows.append(
        ["processor time of a short case, mean", "<= 10 s", f"{mean:.1f} s of {len(quick)}",
         "yes" if mean <= 10 else "**no**" if quick else "undecided"]
    )  # fmt: skip
    precise = [one for one in found if one.right and one.in_catalogue and one.d_prime >= PRECISE]
    errors = [error for one in precise for error in one.errors]
    median = statistics.median(errors) if errors else math.nan
    rows.append(
        [
            "parameter error, median, d' >= 10",
            "<= 5 %",
            f"{100 * median:.1f} % of {len(errors)}",
            met(rate([error <= 0.05 for error in errors]), 0.5, 1),
        ]
    )
    covered = rate([inside for one in found if one.right for inside in one.covered])
    rows.append(["95 % intervals with the truth", "90 to 98 %", str(covered), met(covered, 0.90, 0.98)])
    removed = [one.removed for one in found if one.right and one.in_catalogue and not math.isnan(one.removed)]
    share = statistics.median(removed) if removed else math.nan
    text = f"{100 * share:.1f} % (median of {len(removed)})"
    enough = rate([part >= 0.8 for part in removed])
    rows.append(["held-out excess removed", ">= 80 %", text, met(enough, 0.5, 1)])
    return rows + [lead(strong, method) for method in ("STLSQ", "ensemble SINDy")]


def lead(strong: list[Score], method: str) -> list[str]:
    """Points by which more effects are named rightly than by a baseline, of all that it has a term for."""
    single = [one for one in strong if one.comparable and method in one.baselines_right]
    ours, theirs = rate([one.right for one in single]), rate([one.baselines_right[method] for one in single])
    points = 100 * (ours.share - theirs.share)
    low, high = (100 * end for end in difference(ours, theirs))
    text = f"{points:.1f} points ({low:.1f} to {high:.1f})" if single else "no case"
    return [f"lead over {method}, d' >= 5", ">= 20 points", text, side(low, high, 20, math.inf)]


def at_least(name: str, bar: float, flags: list[bool]) -> list[str]:
    """A row of a rate that should be high."""
    found = rate(flags)
    return [name, f">= {bar:.0%}".replace("%", " %"), str(found), met(found, bar, 1)]


def at_most(name: str, bar: float, flags: list[bool]) -> list[str]:
    """A row of a rate that should be low."""
    found = rate(flags)
    return [name, f"<= {bar:.0%}".replace("%", " %"), str(found), met(found, 0, bar)]


def met(found: Rate, lowest: float, highest: float) -> str:
    """Entry of the table: whether a rate lies between bars."""
    return side(*found.interval, lowest, highest)


def side(low: float, high: float, lowest: float, highest: float) -> str:
    """Whether an interval lies between two bars, beyond them, or across one."""
    if lowest <= low and high <= highest:
        return "yes"
    return "**no**" if high < lowest or low > highest else "undecided"
