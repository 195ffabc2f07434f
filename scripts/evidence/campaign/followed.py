# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What came of the records that verdicts asked for, where effects were left that differ in what they do."""

import json
import statistics
from collections.abc import Callable

from rates import rate
from scoring import STRONG, Score, score

GROUPS: dict[str, Callable[[Score], bool]] = {
    "effects of the catalogue": lambda one: one.in_catalogue,
    f"of these, d' of at least {STRONG:g}": lambda one: one.strong,
    "of these, below": lambda one: one.in_catalogue and not one.strong,
    "effects outside of the catalogue": lambda one: one.kind == "outside",
    "nothing hidden": lambda one: one.kind == "none",
}


def followed(folders: object, found: list[Score]) -> list[tuple[Score, Score]]:
    """Cases that asked for a record, as they were scored before and with it.

    One whose records could not be made is as it was.
    """
    pairs = []
    for before in found:
        path = folders.follow_up(before.number)
        if not path.is_file():
            continue
        result = json.loads(path.read_text())
        if "verdict" not in result:
            pairs.append((before, before))
            continue
        truth = json.loads((folders.sealed / f"{before.number:04}.json").read_text())
        pairs.append((before, score(truth, result)))
    return pairs


def rows(pairs: list[tuple[Score, Score]]) -> list[list[str]]:
    """Rows of the table: which cases, how many, rightly answered with the record, wrongly named, in doubt."""
    table = []
    for name, of in GROUPS.items():
        group = [after for before, after in pairs if of(before)]
        doubted = [one.answer == "ambiguous" and not one.decided and not one.wrong_name for one in group]
        right, wrong = [one.right for one in group], [one.wrong_name for one in group]
        table.append([name, str(len(group)), str(rate(right)), str(rate(wrong)), str(rate(doubted))])
    return table


def rightly(pairs: list[tuple[Score, Score]]) -> list[bool]:
    """For each effect of the catalogue whether the record that was asked for led to its name."""
    return [after.right for before, after in pairs if before.in_catalogue]


def seconds(pairs: list[tuple[Score, Score]]) -> str:
    """Median processor time of the verdicts with the records that were asked for."""
    return f"{statistics.median(after.seconds for _, after in pairs):.0f}" if pairs else "-"
