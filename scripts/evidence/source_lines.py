#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of src/ folder by folder at some revisions, without comments and blank lines."""

import argparse
import io
import subprocess
import tarfile
from collections import Counter
from pathlib import Path

from evidence_rows import table

SOURCE = Path(__file__).resolve().parents[2]
COMMENTS = {
    ".f90": ("!",),
    ".F90": ("!", "#"),
    ".c": ("//", "/*", "*"),
    ".h": ("//", "/*", "*"),
    ".cpp": ("//", "/*", "*"),
    ".hpp": ("//", "/*", "*"),
}


def lines_of(revision: str) -> Counter:
    """Lines of code by folder of src/."""
    command = ["git", "-C", SOURCE, "archive", revision, "src"]
    archive = subprocess.run(command, check=True, capture_output=True).stdout
    found: Counter = Counter()
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        for member in files:
            path = Path(member.name)
            if not member.isfile() or path.suffix not in COMMENTS:
                continue
            code = [line.strip() for line in files.extractfile(member).read().decode().splitlines()]
            folder = path.parts[1] if len(path.parts) > 2 else "."
            found[folder] += sum(bool(line) and not line.startswith(COMMENTS[path.suffix]) for line in code)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("revision", nargs="*", default=["HEAD"], help="revisions of git [HEAD]")
    revisions = parser.parse_args().revision
    counts = [lines_of(revision) for revision in revisions]
    folders = sorted(set().union(*counts))
    rows = [[folder, *(str(count[folder]) for count in counts)] for folder in folders]
    rows.append(["all", *(str(sum(count.values())) for count in counts)])
    print(table(["folder", *revisions], rows))


if __name__ == "__main__":
    main()
