#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""prose.py [FILE.md ...]: lists sentences, table cells and lines of Markdown that are too long.

It ends with 1 if there are any. Without files: all pages but those of docs/reference and docs/gallery. Code
and formulas count as one word. A bullet, a heading and a cell end a sentence.
"""

import re
import subprocess
import sys
from pathlib import Path

SENTENCE, CELL, LINE = 30, 20, 132
ROOT = Path(__file__).resolve().parents[1]
# Pages that scripts write from code or results.
PRINTED = ("docs/reference/", "docs/gallery/")
_BLOCK = re.compile(r"^(?:[-*+] |\d+\. |#|>|\||[-=]{3,}$)")
_ENDS = re.compile(r"(?<=[.!?:;])[\"')*_]*\s+(?=[\"'(*_`A-Z0-9\[])")
# Abbreviations do not end a sentence.
_ABBREVIATED = re.compile(
    r"\b(e\.g|i\.e|vs|cf|al|Fig|Eq|Sec|No|resp|Dyn|Nonlinear|J|Phys|Proc|Mech|Eng|Sound|Vib|Int|vol|pp)\."
)


def pages() -> list[Path]:
    """The Markdown files that people write."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "*.md"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.split()
    return [ROOT / name for name in listed if not name.startswith(PRINTED) and (ROOT / name).is_file()]


def plain(text: str) -> str:
    """Prose without the marks of Markdown; code and formulas count as one word."""
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"`[^`]*`|\$[^$]*\$", "code", text)
    text = re.sub(r"\[[A-Z]{1,3}\d*\]", "", text)
    return _ABBREVIATED.sub(lambda found: found.group(0)[:-1], text)


def words(text: str) -> int:
    """The number of words of a text; numbers and signs between words are none."""
    return len(re.findall(r"[A-Za-z][\w'/.-]*", text))


def sentences(block: list[str]) -> list[str]:
    """Sentences that are too long in the lines of a paragraph, with their counts."""
    counted = [(words(one), one) for one in _ENDS.split(plain(" ".join(block)))]
    return [
        f"a sentence of {n} words, allowed {SENTENCE}: {one[:60]}..." for n, one in counted if n > SENTENCE
    ]


def row(line: str) -> list[str]:
    """Cells that are too long in a row of a table, with their counts."""
    counted = [(words(plain(one)), one.strip()) for one in re.split(r"(?<!\\)\|", line.strip().strip("|"))]
    return [f"a cell of {n} words, allowed {CELL}: {one[:60]}..." for n, one in counted if n > CELL]


def too_long(path: Path) -> list[str]:
    """What is too long in a file, a line each."""
    found: list[tuple[int, str]] = []
    block: list[str] = []
    start, code = 0, False
    for number, line in enumerate([*path.read_text(encoding="utf-8").splitlines(), ""], 1):
        fence = re.match(r"\s*(```|~~~)", line)
        ends = fence or not line.strip() or _BLOCK.match(line.lstrip())
        if ends and block:
            found += [(start, text) for text in sentences(block)]
            block = []
        code = code != bool(fence)
        if fence or code or not line.strip() or (not block and line.startswith(("    ", "<"))):
            continue
        if line.lstrip().startswith("|"):
            found += [(number, text) for text in row(line)]
            continue
        if len(line) > LINE and "](" not in line:
            found.append((number, f"{len(line)} columns, allowed {LINE}"))
        start = start if block else number
        block.append(re.sub(r"^\s*(?:[-*+]|\d+\.|#+|>)\s+", "", line.strip()))
        if line.startswith("#"):
            found += [(start, text) for text in sentences(block)]
            block = []
    name = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
    return [f"{name}:{number}: {text}" for number, text in found]


def main(arguments: list[str]) -> int:
    """Print what is too long; 1 if anything is."""
    found = [
        line for path in (map(Path, arguments) if arguments else pages()) for line in too_long(path.resolve())
    ]
    print("\n".join(found) or "prose: nothing is too long")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
