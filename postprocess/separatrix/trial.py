# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading first in a process of its own, because HDF5 loops or crashes in some damaged files."""

import os
import resource
from collections.abc import Callable
from pathlib import Path

from separatrix.errors import SeparatrixError

# Processor time of a loop [s]; what is tried takes milliseconds.
_LONGEST = 2


def try_first(path: str | Path, read: Callable[[], object]) -> None:
    """Refuse a file in which `read` does not end or crashes; what it raises is left to the caller."""
    child = os.fork()
    if child == 0:
        # No way back into the caller's stack, and no report of a crash.
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (_LONGEST, _LONGEST))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            read()
        finally:
            os._exit(0)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        raise SeparatrixError(f"{path}: is damaged (HDF5 does not come to an end in it)")
