# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading in a process of its own, because HDF5, SciPy and others loop or crash in some damaged files."""

import faulthandler
import os
import pickle
import resource
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from separatrix.errors import BAD_DATA, SeparatrixError

# Processor time of a loop [s]; what is tried takes milliseconds.
_LONGEST = 2
# Processor time for what is read as a whole [s]: this, and as much again for so many bytes.
_READING, _BYTES = 10, 10_000_000

Content = TypeVar("Content")


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


def read_apart(path: str | Path, read: Callable[[], Content]) -> Content:
    """Return what `read` returns, with this process safe from it; its exceptions become a SeparatrixError.

    For readers of others that crash or loop in damaged files.
    """
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(receive)
            faulthandler.disable()
            longest = _READING * (1 + Path(path).stat().st_size // _BYTES)
            resource.setrlimit(resource.RLIMIT_CPU, (longest, longest))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            for stream in (1, 2):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
            with os.fdopen(send, "wb") as pipe:
                pickle.dump(_outcome(read), pipe, protocol=pickle.HIGHEST_PROTOCOL)
        finally:
            os._exit(0)
    os.close(send)
    with os.fdopen(receive, "rb") as pipe:
        sent = pipe.read()
    os.waitpid(child, 0)
    try:
        content, problem, code = pickle.loads(sent)
    except (EOFError, pickle.UnpicklingError):
        raise SeparatrixError(f"{path}: is damaged (its reader does not come to an end in it)") from None
    if problem is not None:
        raise SeparatrixError(problem if problem.startswith(str(path)) else f"{path}: {problem}", code)
    return content


def _outcome(read: Callable[[], Content]) -> tuple[Content | None, str | None, int]:
    """Return content, problem and exit code."""
    try:
        return read(), None, 0
    except SeparatrixError as error:
        return None, str(error), error.code
    except Exception as error:
        words = " ".join(str(error).split())[:200]
        return None, f"cannot be read: {words or type(error).__name__}", BAD_DATA
