# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps the results of a campaign in one file, from which it can be continued and its page written again.

A line of JSON for each case, compressed by LZMA: its number, its seal, the text of its truth, its result,
and the result with the record that its verdict asked for. Records are not kept: the seed draws them again.
Messages name files by their paths among the cases.
"""

import json
import lzma
from collections.abc import Sequence
from pathlib import Path


def unpack(archive: Path, folders: object) -> int:
    """Write what the archive has and the folders lack; return the number of results."""
    written = 0
    with lzma.open(archive, "rt") as lines:
        for line in lines:
            kept = json.loads(line)
            number = kept["number"]
            if kept.get("follow_up") and not folders.follow_up(number).is_file():
                folders.follow_up(number).write_text(json.dumps(kept["follow_up"]) + "\n")
            if folders.result(number).is_file():
                continue
            if kept["truth"] is not None:
                (folders.sealed / f"{number:04}.json").write_text(kept["truth"])
            (folders.seals / f"{number:04}.txt").write_text(f"{kept['result']['seal']}\n")
            folders.result(number).write_text(json.dumps(kept["result"]) + "\n")
            written += 1
    return written


def pack(archive: Path, folders: object, numbers: Sequence[int]) -> int:
    """Write the archive anew from the folders; return the number of results."""
    lines = []
    for number in numbers:
        if not folders.result(number).is_file():
            continue
        sealed = folders.sealed / f"{number:04}.json"
        truth = sealed.read_text() if sealed.is_file() else None
        kept = {"number": number, "truth": truth, "result": folders.portable(folders.result(number))}
        if folders.follow_up(number).is_file():
            kept["follow_up"] = folders.portable(folders.follow_up(number))
        lines.append(json.dumps(kept) + "\n")
    draft = archive.with_name(archive.name + ".new")
    draft.parent.mkdir(parents=True, exist_ok=True)
    with lzma.open(draft, "wt", preset=9) as out:
        out.writelines(lines)
    draft.rename(archive)
    return len(lines)
