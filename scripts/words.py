#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""words.py [--count] [PATH ...]: lists words of scripts/words.txt in code, messages and documents.

It ends with 1 if there are any. --count: numbers by folder. Without paths: all files of the checkout.
"""

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIST = Path(__file__).with_name("words.txt")
# Files that name old words: this list, the licence, older cases, verdicts of an earlier version; data.
EXEMPT = re.compile(
    r"scripts/words\.(txt|py)$|LICENSE$|LICENSES/|NAMING\.md$|CHANGELOG\.md$|docs/discovery\.md$"
    r"|src/config/old_keys\.f90$|scripts/evidence/campaign/scoring\.py$|tests/python/evidence/test_campaign_scoring\.py$"
    r"|tests/(config|python/interface)/test_old_keys\.(pf|py)$|tests/python/(\w+/)?test_words\.py$"
    r"|.*\.(json|svg|png|xz|h5|hdf|bin|csv|txt\.gz|lock|mtx)$|tests/faults/corpus/"
)

# Names in older results.
OLD_NAMES = re.compile(r'strobe_[xv]|critical_blow|body_blow(?:_time)?\b|"blow"|`blow`')


def read_list() -> list[tuple[re.Pattern, str]]:
    """The words as regular expressions, each with what is written in its stead."""
    listed = []
    for line in LIST.read_text().splitlines():
        if line and not line.startswith("#"):
            word, instead = line.split(" -> ")
            pattern = rf"(?<![A-Za-z])(?:{word})(?![A-Za-z])"
            listed.append((re.compile(pattern, re.IGNORECASE), instead))
    return listed


def files(paths: list[str]) -> list[Path]:
    """The files of the checkout at or below some paths."""
    command = ["git", "ls-files", "-co", "--exclude-standard", "--", *paths]
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    return [ROOT / name for name in done.stdout.splitlines() if not EXEMPT.match(name)]


def found_in(text: str, listed: list[tuple[re.Pattern, str]]) -> list[tuple[int, str, str]]:
    """Line, word and what to write instead, of each word in a text."""
    # most texts have none of them: lines are searched only for words that are among those of the text
    words = "\n".join(sorted(set(re.findall("[a-z]+", text.lower()))))
    somewhere = [one for one in listed if one[0].search(words)]
    if not somewhere:
        return []
    return [
        (number, match.group(0), instead)
        for number, line in enumerate(text.splitlines(), 1)
        for pattern, instead in somewhere
        for match in pattern.finditer(OLD_NAMES.sub("", line))
    ]


def main() -> int:
    """List or count the words."""
    paths = [one for one in sys.argv[1:] if one != "--count"]
    listed, counts, total = read_list(), Counter(), 0
    for path in files(paths):
        try:
            text = path.read_text(encoding="utf-8")
        except (UnicodeDecodeError, OSError):
            continue
        for number, word, instead in found_in(text, listed):
            total += 1
            name = path.relative_to(ROOT)
            counts[str(name.parent)] += 1
            if "--count" not in sys.argv:
                print(f"{name}:{number}: '{word}', write: {instead}")
    for folder, count in sorted(counts.items()) if "--count" in sys.argv else []:
        print(f"{count:5} {folder}")
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
