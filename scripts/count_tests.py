#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Adds up the JUnit files of ctest and pytest; the last line is `N passed, N failed`.

count_tests.py FILE.xml...
"""

import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter


def outcome(case: ElementTree.Element) -> str:
    """passed, failed or skipped. ctest calls a test whose program is missing `notrun`."""
    if case.get("status") in ("fail", "notrun"):
        return "failed"
    if case.get("status") == "disabled":
        return "skipped"
    if case.find("failure") is not None or case.find("error") is not None:
        return "failed"
    return "passed" if case.find("skipped") is None else "skipped"


def main() -> int:
    total: Counter[str] = Counter()
    for path in sys.argv[1:]:
        counts = Counter(outcome(case) for case in ElementTree.parse(path).iter("testcase"))
        total += counts
        print(f"{path}: {counts['passed']} passed, {counts['failed']} failed, {counts['skipped']} skipped")
    print(f"{total['passed']} passed, {total['failed']} failed")
    return 1 if total["failed"] or not total["passed"] else 0


if __name__ == "__main__":
    sys.exit(main())
