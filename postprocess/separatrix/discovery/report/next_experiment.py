# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The section of the report that proposes what to measure next."""

from separatrix.discovery.report.pages import Section, Table
from separatrix.discovery.wording import number


def next_experiment(verdict: dict) -> Section:
    """Experiments that would separate what remains, or why there is none."""
    if verdict["separating_experiment"]:
        faster = any(one["rate"] is not None for one in verdict["experiments"])
        key = "rate" if faster else "drive_ratio"
        rows = [
            [
                "-" if one[key] is None else number(one[key], 3),
                number(one["scale"], 3),
                number(one["d_prime"], 3),
            ]
            for one in verdict["experiments"]
        ]
        text = f"To separate what remains: {verdict['separating_experiment']}."
        header = (
            ["times as fast", "amplitude over that of the first record", "standard errors apart"]
            if faster
            else ["drive ratio", "drive (or start) over that of the first record", "standard errors apart"]
        )
        return Section("next", "What to measure next", [text, *([Table(header, rows)] if rows else [])])
    elif verdict["outcome"] == "ambiguous":
        text = (
            "No experiment was found that would separate the candidates. Experiments are worked out for "
            "one body, driven or free, without a force that must be measured."
        )
    elif verdict["outcome"] in ("not-in-catalogue", "characterised"):
        text = "The maps above show where to look for a law that the catalogue lacks."
    elif verdict["outcome"] == "named" and not verdict["complete"]:
        text = "No record is asked for: the figure of what is left over shows when the remaining gap appears."
    else:
        text = "Nothing stays ambiguous."
    return Section("next", "What to measure next", [text])
