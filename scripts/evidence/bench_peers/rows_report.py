# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of `rows.py` for docs/performance.md."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import TYPE_CHECKING

from evidence_rows import table
from rows import ROWS

from machine import TOLERANCE

if TYPE_CHECKING:
    from rows_run import RowResult

PEERS = {
    "heyoka_batch": "heyoka, batches of 8",
    "heyoka": "heyoka, one by one",
    "gsl": "GSL rk8pd",
    "cvode": "SUNDIALS CVODE",
}
TIMES_WANTED = 5


def number(value: float) -> str:
    """Three digits, thousands apart."""
    digits = f"{value:.3g}"
    return f"{float(digits):,.0f}".replace(",", " ") if value >= 100 else digits


def rate(result: RowResult, name: str) -> float:
    """The median of the rounds."""
    return statistics.median(result.rates[name])


ROW = {row.key: row for row in ROWS}


def best_peer(result: RowResult) -> str | None:
    """The fastest."""
    ran = [name for name in PEERS if name in result.rates]
    return max(ran, key=lambda name: rate(result, name)) if ran else None


def times(result: RowResult, peer: str) -> float:
    """Median over the rounds of our rate over the peer's in the same round."""
    pairs = zip(result.rates["full"], result.rates[peer], strict=True)
    return statistics.median(mine / other for mine, other in pairs)


def in_order(results: list[RowResult]) -> list[RowResult]:
    """As the table of machines has them."""
    return sorted(results, key=lambda result: list(ROW).index(result.key))


def speed_table(results: list[RowResult]) -> str:
    """Rates, goals, and how many times the best peer."""
    rows = []
    for result in in_order(results):
        peer, mine = best_peer(result), rate(result, "full")
        bar = "no peer" if peer is None else number(times(result, peer))
        if peer is not None and times(result, peer) < TIMES_WANTED:
            bar = f"**{bar}**"
        rows.append(
            [
                ROW[result.key].title,
                number(mine) if mine >= ROW[result.key].goal else f"**{number(mine)}**",
                number(ROW[result.key].goal),
                number(rate(result, "stopped")),
                *(number(rate(result, name)) if name in result.rates else "" for name in PEERS),
                bar,
                f"{result.commit}, {result.date}",
            ]
        )
    header = [
        "machine",
        "full runs",
        "goal",
        "settle-and-stop",
        *PEERS.values(),
        "full runs, relative to the fastest peer",
        "commit",
    ]
    return table(header, rows)


def reached(results: list[RowResult]) -> str:
    """How many rows reach their goal, and their bar against the best peer."""
    goals = sum(rate(result, "full") >= ROW[result.key].goal for result in results)
    raced = [(result, best_peer(result)) for result in results if best_peer(result)]
    bars = sum(times(result, peer) >= TIMES_WANTED for result, peer in raced)
    return (
        f"{goals} of {len(results)}; at least {TIMES_WANTED} times the fastest peer: {bars} of {len(raced)}"
    )


def against(result: RowResult, name: str, what: str) -> str:
    """A number of an agreement, if there is one."""
    found = result.agreements.get(name)
    if found is None or found.points == 0:
        return ""
    if what == "deviation":
        typical = "" if found.typical is None else f"{found.typical:.1e}, at most "
        return f"{typical}{found.deviation:.1e}"
    return f"{found.counts} of {found.points}"


def accuracy_table(results: list[RowResult]) -> str:
    """Quadruple precision, single flights, labels."""
    rows = []
    for result in in_order(results):
        peer, bar = best_peer(result), 1e-11 if ROW[result.key].linear else 1e-10
        mine = against(result, "ours", "deviation")
        if mine and result.agreements["ours"].deviation > bar:
            mine = f"**{mine}**"
        rows.append(
            [
                ROW[result.key].title,
                mine,
                f"{bar:.0e}" if mine else "",
                against(result, "ours", "counts"),
                against(result, peer, "deviation") if peer else "",
                against(result, "single", "counts"),
                f"{result.agreements['single'].deviation:.1e}",
                f"{result.flips[0]} of {result.flips[1]}",
            ]
        )
    header = [
        "machine",
        "deviation from quadruple precision",
        "tolerance",
        "impact counts differing from it",
        "deviation of the fastest peer",
        "impact counts differing between lanes and one by one",
        "deviation of lanes from one by one",
        "labels of settle-and-stop differing from full runs",
    ]
    return table(header, rows)


def page(results: list[RowResult]) -> str:
    """docs/performance_machines.md."""
    template = Path(__file__).with_name("performance_machines.md.in").read_text()
    return template.format(
        times_wanted=TIMES_WANTED,
        reached=reached(results),
        speed=speed_table(results),
        accuracy=accuracy_table(results),
        tolerance=f"{TOLERANCE:g}",
    )
