# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sections of docs/validation.md, which are written one at a time."""

from evidence_rows import SOURCE


def section_of(page: str, heading: str) -> str:
    """The part of a page from the line `## heading` to the next such line."""
    first = f"## {heading}\n"
    return first + page.split(first)[1].split("\n## ")[0] + "\n"


def write_section(heading: str, **fields: object) -> None:
    """Write a section anew, by its part of the template."""
    path = SOURCE / "docs" / "validation.md"
    page = path.read_text()
    template = (SOURCE / "scripts" / "evidence" / "validation.md.in").read_text()
    path.write_text(page.replace(section_of(page, heading), section_of(template, heading).format(**fields)))
