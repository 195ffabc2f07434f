# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The section of a report on friction with memory."""

from separatrix.discovery.report.pages import Section, Table
from separatrix.discovery.wording import words


def memory_section(verdict: dict) -> list[Section]:
    """What laws of friction with memory leave of a force, beside forces without memory."""
    found = verdict.get("memory")
    if not found:
        return []
    uses = [use for use in ("training", "held_out") if use in found["laws"][0]]
    rows = []
    for law in found["laws"]:
        left = [f"{100 * law[use]['share']:.3g} %, {law[use]['left']:.3g} N" for use in uses]
        rows.append([words(law["name"]), *left])
    head = ["law", *(f"of the force left, {use.replace('_', ' ')}" for use in uses)]
    return [Section("memory", "Friction with memory", [f"{found['text']}.", Table(head, rows)])]
