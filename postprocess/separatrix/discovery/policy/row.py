# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A row of the policy: a threshold with its unit, the kind of its source, and its meaning."""

from collections.abc import Iterator
from dataclasses import field, fields

SOURCES = {
    "test": "statistics: a level, odds, standard errors, or the least number that has a distribution",
    "campaign": "chosen on the development seeds of the campaign (docs/discovery.md)",
    "rig": "usual sizes of errors of instruments and rigs",
    "effort": "bounds time and memory",
    "rounding": "accuracy of arithmetic and integration",
}
"""Kinds of source, and what they mean."""


def row(value: object, unit: str, source: str, meaning: str):
    """A field with this value; the rest is its row in the table."""
    return field(default=value, metadata={"unit": unit, "source": source, "meaning": meaning})


def rows_of(policy: object) -> Iterator[tuple[str, object, str, str, str]]:
    """Name, value, unit, meaning and source of every row."""
    for one in fields(policy):
        if "meaning" in one.metadata:
            about = one.metadata
            yield one.name, one.default, about["unit"], about["meaning"], about["source"]
