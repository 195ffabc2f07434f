# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sections of docs/scaling.md on file systems: parts of whole jobs, calls counted here, a slow one."""

from __future__ import annotations

import dataclasses

import simulation
from evidence_rows import table
from slow_files import Slow
from storage import METADATA, SOURCES, Job, Storage, counts, most_writes
from traced import Traced

BEGIN, END = "<!-- operations -->", "<!-- /operations -->"


def number(value: float) -> str:
    """Thousands apart, small values with two digits."""
    return f"{value:,.0f}".replace(",", " ") if value >= 100 else f"{value:.3g}"


def parts_table(parts: dict[int, simulation.Parts]) -> str:
    """Return what each part of the stated job takes."""
    jobs = list(parts.values())
    names = [
        ("tiles: computed, mean of the ranks", [job.busy for job in jobs]),
        ("tiles: written and waited for, mean", [job.writing for job in jobs]),
        ("tiles: without work at the end, mean", [job.idle for job in jobs]),
        *((name, [job.seconds[name] for job in jobs]) for name in jobs[0].seconds),
    ]
    rows = [[name, *(f"{value:.2f}" for value in values)] for name, values in names]
    rows.append(["writes into the working file per second", *(number(job.writes_per_second) for job in jobs)])
    return table([f"seconds, tiles of {simulation.STATED:g} s", *(f"{number(r)} ranks" for r in parts)], rows)


def storage_table(storage: Storage) -> str:
    """Return the rates of the file system and their sources."""
    usual = Storage()
    rows = [
        [f"`{field.name}`", number(value), SOURCES[field.name] if value == same else "`--storage`"]
        for field in dataclasses.fields(storage)
        for value, same in [(getattr(storage, field.name), getattr(usual, field.name))]
    ]
    return table(["rate", "value", "source"], rows)


def storage_text(storage: Storage) -> str:
    """Return from which rate of writes on one file is the limit."""
    return (
        f"The locks of one file on {storage.stripes:g} stripes allow {number(most_writes(storage))} writes "
        f"per second, those of one stripe {number(1 / storage.lock)}."
    )


def pair(found: float, expected: float) -> str:
    """A count beside that of the model, once if they agree."""
    return f"{found}" if found == expected else f"{found} ({expected})"


def counted_table(runs: list[tuple[Traced, Job, int]], record: int) -> str:
    """Return the calls of runs beside those of the model; with each its predicted writes of tiles."""
    rows = []
    for run, job, writes in runs:
        model = counts(job)
        tiles = run.total("write", "part")
        rows.append(
            [
                str(run.ranks),
                *(pair(run.total(name), model[name]) for name in METADATA),
                pair(run.total("read", "part"), model["read of tiles"]),
                pair(run.total("read", "new"), model["read of the final file"]),
                pair(
                    run.total("write", "begun") + run.total("write", "new"),
                    model["write of descriptions"] + model["write of chunks"],
                ),
                pair(tiles, writes),
                pair(run.moved("write", "part"), job.tiles * record),
                f"{run.moved('read', 'part') / job.tiles:.0f}",
            ]
        )
    header = ["ranks", *METADATA, "reads of tiles", "reads of the final file", "other writes"]
    return table([*header, "writes of tiles", "bytes of tiles", "bytes read per tile"], rows)


def per_rank_table(runs: list[tuple[Traced, Job, int]]) -> str:
    """Return the most calls on names of a rank, rank 0 apart."""
    rows = []
    for run, job, _ in runs:
        calls = [
            (sum(count for (name, _), count in own.items() if name in METADATA), sum(own.values()))
            for own in run.calls
        ]
        others = calls[1:] or [(0, 0)]
        rows.append(
            [
                str(run.ranks),
                f"{calls[0][0]} of {calls[0][1]}",
                f"{max(name for name, _ in others)} of {max(whole for _, whole in others)}",
                f"{sum(whole for _, whole in calls) / job.tiles:.2f}",
            ]
        )
    header = ["ranks", "calls of rank 0 on names and lengths", "most of another rank", "all calls per tile"]
    return table(header, rows)


def slow_table(runs: list[Slow]) -> str:
    """Return measured and predicted times."""
    rows = [
        [
            str(run.ranks),
            f"{run.delay:g} ms",
            f"{run.measured:.2f} s",
            f"{run.predicted:.2f} s" if run.delay else "the base",
            f"{100 * (run.predicted / run.measured - 1):+.0f} %" if run.delay else "",
        ]
        for run in runs
    ]
    return table(["ranks", "time of an operation", "measured", "predicted", "difference"], rows)


def section(
    traced: list[tuple[Traced, Job, int]], slow: list[Slow], record: int, commit: str, load: float
) -> str:
    """Return the section on calls."""
    points = f"{traced[0][1].tiles} tiles, {traced[0][1].slabs} slabs, {traced[0][1].chunks} chunks"
    lines = [
        BEGIN,
        f"Obtained with commit {commit}: {points}; load of the machine {load:.1f}.",
        "",
        counted_table(traced, record),
        "",
        per_rank_table(traced),
        "",
        slow_table(slow) if slow else "This machine has no FUSE.",
        END,
    ]
    return "\n".join(lines)
