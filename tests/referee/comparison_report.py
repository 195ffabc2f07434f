# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of the referee's report."""

from collections import Counter

PARTS = ("basin", "points", "runs", "starts")
# Disagreements that were looked into: (case, part) and why, with the evidence.
EXPLAINED: dict[tuple[str, str], str] = {}
CAUSES = {
    "not known": "the program leaves the motion unclassified",
    "rounding": "the referee agrees in extended precision or with the start shifted by 1e-12",
    "unfounded": "a cycle closed by rounding: the motion is unstable for too long between two chatters",
    "wrong": "**not explained**",
}


def table(header: list[str], rows: list[list[str]]) -> str:
    """A table of Markdown."""
    return "\n".join(f"| {' | '.join(line)} |" for line in [header, ["---"] * len(header), *rows])


def cell(part: dict) -> str:
    """Number of comparisons, and how many did not agree."""
    counts = dict(part["counts"])
    total, agreed = sum(counts.values()), counts.pop("agrees", 0)
    others = ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))
    return f"{total}" if agreed == total else f"{total}: {others}"


def motions(kinds: dict[str, int]) -> str:
    """The periods that the referee met, in order."""
    periods = sorted(int(kind.split()[1]) for kind in kinds if kind.startswith("period"))
    others = [kind for kind in ("chaos", "slow", "failed") if kind in kinds]
    shown = [str(period) for period in periods]
    if len(shown) > 12:
        shown = [*shown[:11], f"... {shown[-1]}"]
    return ", ".join([f"periods {', '.join(shown)}", *others])


def summary_table(reports: dict[str, dict]) -> str:
    """A row per machine."""
    head = ["machine", "motions", "basin", "points", "largest difference", "runs", "starts"]
    rows = []
    for name, report in reports.items():
        cells = {part: cell(report[part]) for part in PARTS}
        points = [cells["basin"], cells["points"], f"{report['worst']:.1e}"]
        rows.append(
            [
                f"`{name}`: {report['title']}",
                motions(report["kinds"]),
                *points,
                cells["runs"],
                cells["starts"],
            ]
        )
    return table(head, rows)


def disagreements(reports: dict[str, dict]) -> str:
    """Every comparison that did not agree; alike ones are one row."""
    rows = []
    for name, report in reports.items():
        for part in PARTS:
            alike = Counter()
            shown = {}
            for item in report[part]["listed"]:
                key = (item["verdict"], kind_of(item["ours"]), kind_of(item["referee"]))
                alike[key] += 1
                shown.setdefault(key, []).append(item)
            for key, count in alike.most_common():
                verdict, first = key[0], shown[key][0]
                cause = (
                    EXPLAINED.get((name, part), CAUSES[verdict]) if verdict == "wrong" else CAUSES[verdict]
                )
                rows.append(
                    [
                        f"`{name}`",
                        part,
                        verdict,
                        str(count),
                        where(first),
                        first["ours"],
                        first["referee"],
                        cause,
                    ]
                )
    head = ["machine", "part", "verdict", "count", "first case", "program", "referee", "cause"]
    return table(head, rows) if rows else "None."


def kind_of(text: str) -> str:
    """A motion without its numbers: label and period."""
    return ", ".join(
        word for word in text.split(", ") if word.startswith(("label", "no label", "period", "chaos", "slow"))
    )


def where(item: dict) -> str:
    """Value and start of a comparison."""
    value = f"{item['value']:.10g} " if "value" in item else ""
    start = f"({item['start'][0]:.6g}, {item['start'][1]:.6g})" if "start" in item else item.get("run", "")
    return (value + start).strip()


def wrong_in(reports: dict[str, dict]) -> int:
    """How many comparisons are wrong and not explained."""
    return sum(
        report[part]["counts"].get(verdict, 0)
        for name, report in reports.items()
        for part in PARTS
        for verdict in ("wrong", "unfounded")
        if (name, part) not in EXPLAINED
    )
