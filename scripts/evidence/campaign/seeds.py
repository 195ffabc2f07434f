# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeds whose truths were looked at. Add one as soon as the method is changed after a look at its page."""

DEVELOPED_ON = (
    1,
    3,
    31,
    41,
    99,
    1009,
    2026,
    2027,
    2028,
    3017,
    4211,
    4313,
    5101,
    5202,
    5303,
    5404,
    6007,
    9241,
    51239,
    60001,
    70481,
    83477,
    90127,
)
BLIND_UP_TO = {83477: "cf4c090"}
"""Of seeds that were looked at with verdicts on a page: the last commit that was scored before."""


def developed_on() -> str:
    """The seeds that the method was developed on, in words."""
    *first, last = map(str, DEVELOPED_ON)
    return f"{', '.join(first)} and {last}"


def of_page(seed: int) -> str:
    """The remark on the seed of a page."""
    if seed in BLIND_UP_TO:
        last = BLIND_UP_TO[seed]
        return f"Verdicts on {seed} up to commit {last} preceded any look at the truths, later ones did not."
    if seed in DEVELOPED_ON:
        return f"**The seed of this page, {seed}, is one of them.**"
    return "The seed of this page is not among them."
