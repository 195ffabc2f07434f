# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cores that a process may use: bound to them, and with the time that its control groups allow."""

import contextlib
import math
import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

__all__ = ["cores"]


def cores(root: Path = Path("/")) -> int:
    """Return how many cores this process may use, at least 1; `root` is the folder of proc and sys."""
    return max(1, min([len(os.sched_getaffinity(0)), *_quotas(root)]))


def _quotas(root: Path) -> Iterator[int]:
    """Yield the limits in cores, rounded up, of the control group of this process and of those above."""
    try:
        lines = (root / "proc/self/cgroup").read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, name = line.split(":", 2)
        if controllers and "cpu" not in controllers.split(","):
            continue
        top = root / "sys/fs/cgroup" / controllers
        group = PurePosixPath(name.lstrip("/"))
        for folder in (top / group, *(top / above for above in group.parents)):
            with contextlib.suppress(OSError, ValueError):
                quota, period = _quota(folder, version=1 if controllers else 2)
                if quota > 0:
                    yield math.ceil(quota / period)


def _quota(folder: Path, version: int) -> tuple[int, int]:
    """Return processor time and its period, in microseconds; a ValueError where there is no limit."""
    if version == 1:
        texts = [(folder / f"cpu.cfs_{one}_us").read_text() for one in ("quota", "period")]
    else:
        texts = (folder / "cpu.max").read_text().split()
    quota, period = map(int, texts)
    return quota, period
