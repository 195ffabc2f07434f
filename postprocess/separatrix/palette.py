# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of the figures and of the viewer; colour-blind readers can distinguish them."""

from collections.abc import Mapping

# Colours of attractors in their order, mostly Paul Tol's. The first three differ by 20 and more in lightness,
# so that they differ in grey; all by 20 and more for colour-blind readers (CIE 76).
ATTRACTORS = (
    "#004488", "#DDAA33", "#BB5566", "#99DDFF", "#000000", "#44AA99", "#661100", "#EEDD88",
)  # fmt: skip
# Okabe and Ito (2008), for lines
OKABE_ITO = ("#D55E00", "#0072B2", "#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#F0E442", "#000000")
# Paul Tol, muted
TOL_MUTED = (
    "#CC6677", "#332288", "#DDCC77", "#117733", "#88CCEE",
    "#882255", "#44AA99", "#999933", "#AA4499", "#661100",
)  # fmt: skip
NOTHING = "#DDDDDD"
OTHER = "#777777"

# as in a catalogue, whose first attractor mostly meets no stop
REGIMES = {
    "unresolved": NOTHING,
    "non_impact": ATTRACTORS[0],
    "impact": ATTRACTORS[1],
    "sticking": ATTRACTORS[5],
    "mixed": ATTRACTORS[2],
    "chattering": ATTRACTORS[6],
    "at_rest": ATTRACTORS[3],
    "stuck": ATTRACTORS[7],
}
# outcomes of the run-up of a crank
CRANKS = {
    "not_known": NOTHING,
    "stalled": ATTRACTORS[4],
    "rocking": ATTRACTORS[5],
    "reversed": ATTRACTORS[2],
    "turning": ATTRACTORS[3],
    "captured": ATTRACTORS[0],
    "passed": ATTRACTORS[1],
}
RUN_UP = "#D55E00"
RUN_DOWN = "#004488"
BOTH_RUNS = "#333333"
BARRIER = OKABE_ITO[2]
BRANCH = "#C4C4C4"
MOTION = OKABE_ITO[1]
IMPACT = OKABE_ITO[0]
# of the pieces of a boundary, by what they lead to; `edge`: of what is not known
BOUNDARIES = {
    "stable_set": "#000000",
    "recurrent": OKABE_ITO[0],
    "graze": OKABE_ITO[1],
    "stick": OKABE_ITO[2],
    "chatter": OKABE_ITO[4],
    "other_event": OKABE_ITO[3],
    "not_known": "#404040",
    "edge": "#666666",
}
MOST_CLASSES = len(TOL_MUTED)


def palette(number: int) -> tuple[str, ...]:
    """Return the palette for a number of classes: that of attractors up to 8, Tol muted up to 10."""
    return ATTRACTORS if number <= len(ATTRACTORS) else TOL_MUTED


def of_attractors(counts: Mapping[int, int], highest: int) -> dict[int, str]:
    """Return the colours of attractors by number, from the points in their basins and the highest number.

    Up to ten attractors have the colour of their number. Of more, the ten with the largest basins have one.
    """
    if highest <= MOST_CLASSES:
        return {number: palette(highest)[number - 1] for number in counts}
    ranked = sorted(counts, key=lambda number: (-counts[number], number))
    return dict(zip(ranked, TOL_MUTED, strict=False))


def for_page() -> dict[str, object]:
    """Return the colours that the page of the viewer draws with; those of regimes by code."""
    more = [colour for colour in TOL_MUTED if colour not in ATTRACTORS]
    return {
        "classes": [*ATTRACTORS, *more], "nothing": NOTHING, "regimes": list(REGIMES.values()),
        "boundaries": BOUNDARIES, "up": RUN_UP, "down": RUN_DOWN, "many": BRANCH, "motion": MOTION,
        "impact": IMPACT,
    }  # fmt: skip
