# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading in a process of its own, because libraries loop or crash in some damaged files."""

import faulthandler
import os
import pickle
import re
import resource
import signal
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from separatrix.errors import SeparatrixError

# why what is tried is not read
CASE_GIVEN = "found a case, allowed a result; `separatrix basin` makes one of a case"
# Processor time of a loop [s]; what is tried takes milliseconds.
_LONGEST = 2
# the same of a whole file: at least, and per byte
_LONGEST_WHOLE, _PER_BYTE = 20, 1e-5
# time by the clock, in processor times
_WAITING = 20
# memory of a reader beside what it has at its beginning [bytes]: at least, and over the size of the file
_MOST_MEMORY, _MEMORY_OVER_FILE = 4 << 30, 40
# characters of the message of a library
_LONGEST_REASON = 200

Result = TypeVar("Result")


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


def read_apart(path: str | Path, kind: str, read: Callable[[], Result]) -> Result:
    """Return what `read` does in a process of its own; a file in which it fails, crashes or loops is refused.

    `kind`: of file, for the message.
    """
    source, sink = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(source)
            faulthandler.disable()
            _answer(path, kind, read, sink)
        finally:
            os._exit(0)
    os.close(sink)
    try:
        with os.fdopen(source, "rb") as answer:
            content = answer.read()
    except BaseException:
        os.kill(child, signal.SIGKILL)
        raise
    finally:
        _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status) or not content:
        loops = os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGALRM)
        why = "does not come to an end" if loops else "crashes"
        raise SeparatrixError(f"{path}: is damaged (the reader of {kind} files {why} in it)")
    try:
        result = pickle.loads(content)
    except (EOFError, pickle.UnpicklingError):
        raise SeparatrixError(f"{path}: not enough memory for what its reader found") from None
    if isinstance(result, SeparatrixError):
        if str(path) not in str(result):
            raise SeparatrixError(f"{path}: {result}", result.code)
        raise result
    return result


def _answer(path: str | Path, kind: str, read: Callable[[], object], sink: int) -> None:
    """Send what `read` returns, or why it fails, within limits of time and memory."""
    # an interrupt ends it at once; libraries print what they find
    for one in (signal.SIGTERM, signal.SIGINT, signal.SIGALRM):
        signal.signal(one, signal.SIG_DFL)
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    size = Path(path).stat().st_size
    longest = int(_LONGEST_WHOLE + _PER_BYTE * size)
    _limit(resource.RLIMIT_CPU, longest, longest + 1)
    # who waits for a lock that another thread of the parent held takes no processor time
    signal.alarm(_WAITING * longest)
    _limit(resource.RLIMIT_CORE, 0, 0)
    used = _used_memory()
    if used:
        most = used + max(_MOST_MEMORY, _MEMORY_OVER_FILE * size)
        _limit(resource.RLIMIT_AS, most, resource.RLIM_INFINITY)
    try:
        answer = read()
    except SeparatrixError as error:
        answer = error
    except MemoryError:
        answer = SeparatrixError(f"{path}: not enough memory to read it")
    except Exception as error:
        # what a library raises in a damaged file may be anything
        message = re.sub(r"[^ -~]+", " ", str(error))[:_LONGEST_REASON].strip()
        why = f"{type(error).__name__}: {message}" if message else type(error).__name__
        answer = SeparatrixError(f"{path}: not a {kind} file that can be read: {why}")
    with os.fdopen(sink, "wb") as file:
        pickle.dump(answer, file, protocol=pickle.HIGHEST_PROTOCOL)


def _limit(what: int, soft: int, hard: int) -> None:
    """Set a limit, within those that this process has: a hard one cannot be raised."""

    def within(limit: int, given: int) -> int:
        return given if limit == resource.RLIM_INFINITY or 0 <= given < limit else limit

    given = resource.getrlimit(what)
    resource.setrlimit(what, (within(soft, given[0]), within(hard, given[1])))


def _used_memory() -> int:
    """Address space of this process [bytes]; 0 where the system does not report it."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except (OSError, ValueError):
        return 0
