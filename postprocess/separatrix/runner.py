# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the program: its progress, its warnings, its errors as exceptions, and how to stop it."""

import contextlib
import ctypes
import json
import logging
import os
import queue
import shutil
import signal
import subprocess
import threading
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from separatrix.errors import BAD_DATA, STOPPED, CaseError, SeparatrixError, SeparatrixWarning
from separatrix.program import program_path
from separatrix.progress import Progress

log = logging.getLogger("separatrix")

# Seconds that a program has to end after it was asked to.
_GRACE = 20.0
# Linux: the signal that a process gets when the one that started it ends.
_PR_SET_PDEATHSIG = 1

# What OpenMPI 4.1 needs on one machine (scripts/environment.sh); what is set already stays.
_MPI_ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_io": "romio321",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "OMP_NUM_THREADS": "1",
}


class StoppedError(Exception):
    """A run was stopped at the share `done` and can go on. `ended`: before the signal took effect."""

    def __init__(self, done: float, ended: bool = False) -> None:
        """Keep how far it went."""
        super().__init__(f"stopped at {100 * done:.0f} %")
        self.done = done
        self.ended = ended


@dataclass
class _Process:
    """A running program and the last lines that it wrote."""

    process: subprocess.Popen
    things: str = ""
    done: int = 0
    total: int = 0
    lines: list[str] = field(default_factory=list)


def run(
    commands: Sequence[Sequence[str]],
    progress: Progress,
    ranks: int | None = None,
    rename: Mapping[str, str] | None = None,
    time_limit: float | None = None,
    take: Callable[[dict], object] | None = None,
) -> None:
    """Run the program once for each list of arguments, all at once, to their ends.

    `ranks`: each under mpiexec with so many. `rename`: what the names of files in messages stand for.
    `take` gets each line of the report.
    Raises CaseError or SeparatrixError with the message of the program, StoppedError where it was stopped and
    can go on; Ctrl-C stops it so.
    """
    running: list[_Process] = []
    events: queue.Queue = queue.Queue()
    interrupted = False
    try:
        running = [_start(arguments, events, ranks, progress) for arguments in commands]
        _follow(running, events, progress, time_limit, take)
    except KeyboardInterrupt:
        interrupted = True
        _stop(running)
    except BaseException:
        _kill(running)
        raise
    finally:
        _reap(running)
    codes = [one.process.returncode for one in running]
    # A message is the first that a program gave; the others may have been stopped because of it.
    for one, code in zip(running, codes, strict=True):
        if code not in (0, STOPPED) and not interrupted:
            _raise(code, _message(one, rename or {}))
    if interrupted or STOPPED in codes:
        total = sum(one.total for one in running)
        ended = bool(codes) and not any(codes)
        raise StoppedError(sum(one.done for one in running) / total if total else 0.0, ended)


def run_at_once(
    command: Sequence[str],
    progress: Progress,
    ranks: int | None = None,
    rename: Mapping[str, str] | None = None,
    take: Callable[[dict], object] | None = None,
) -> None:
    """`run` of one command that cannot be resumed: Ctrl-C is a KeyboardInterrupt that states what is kept."""
    try:
        run([command], progress, ranks, rename=rename, take=take)
    except StoppedError as stop:
        kept = "after its end, its result is kept" if stop.ended else "nothing of it is kept"
        raise KeyboardInterrupt(f"{command[0]} was stopped; {kept}") from None


def _start(
    arguments: Sequence[str],
    events: queue.Queue,
    ranks: int | None,
    progress: Progress,
) -> _Process:
    command = [*_launcher(ranks), str(program_path()), *arguments]
    # These compute and report their progress.
    if arguments[0] in ("basin", "sweep", "points", "branches", "boundary") and progress.wanted:
        command += ["--progress", "0.2"]
    log.debug("run: %s", " ".join(command))
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        env={**_MPI_ENVIRONMENT, **os.environ} if ranks else None,
        # A group of its own: Ctrl-C reaches this process alone, which then asks the program to stop.
        process_group=0,
        preexec_fn=_end_with_parent(),
    )
    one = _Process(process)
    for stream, take in ((process.stdout, _take_line), (process.stderr, _take_words)):
        threading.Thread(target=_read, args=(one, stream, take, events), daemon=True).start()
    return one


def _launcher(ranks: int | None) -> list[str]:
    if not ranks:
        return []
    for name in ("mpiexec", "mpirun"):
        if shutil.which(name):
            return [name, "-n", str(ranks)]
    raise SeparatrixError("ranks: neither mpiexec nor mpirun was found; workers=N needs no MPI", BAD_DATA)


def _end_with_parent() -> Callable[[], None]:
    """What the child does first: ask for SIGTERM, a clean stop, when this process is killed."""
    libc = ctypes.CDLL(None)

    def ask() -> None:
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)

    return ask


def _read(one: _Process, stream: object, take: Callable, events: queue.Queue) -> None:
    with contextlib.suppress(ValueError, OSError):
        for line in stream:
            take(one, line.rstrip("\n"), events)
    events.put(None)


def _take_line(one: _Process, line: str, events: queue.Queue) -> None:
    try:
        event = json.loads(line)
    except json.JSONDecodeError:
        return
    if isinstance(event, dict):
        events.put((one, event))


def _take_words(one: _Process, line: str, events: queue.Queue) -> None:
    one.lines.append(line)
    del one.lines[:-200]


def _follow(
    running: list[_Process],
    events: queue.Queue,
    progress: Progress,
    time_limit: float | None,
    take: Callable[[dict], object] | None,
) -> None:
    """Pass on what the programs report until all streams have ended; stop them when the time is over."""
    open_streams = 2 * len(running)
    last = None if time_limit is None else time.monotonic() + time_limit
    while open_streams:
        try:
            event = events.get(timeout=0.2)
        except queue.Empty:
            if last is not None and time.monotonic() > last:
                last = None
                _signal(running, signal.SIGTERM)
            continue
        if event is None:
            open_streams -= 1
            # One that failed ends the others.
            if any(one.process.poll() not in (None, 0, STOPPED) for one in running):
                _signal(running, signal.SIGTERM)
            continue
        _pass_on(running, *event, progress)
        if take is not None:
            take(event[1])


def _pass_on(running: list[_Process], one: _Process, event: dict, progress: Progress) -> None:
    kind, message = event.get("event"), str(event.get("message", ""))
    if kind == "progress" and "of" not in event:
        # how far work is whose end is not known
        log.debug("%s", message)
    elif kind == "progress":
        one.things, one.done, one.total = str(event["of"]), int(event["done"]), int(event["total"])
        same = [other for other in running if other.things == one.things]
        # Shares are alike; one that has not spoken yet has as much to do.
        total = sum(other.total for other in same) * len(running) // len(same)
        progress(one.things, sum(other.done for other in same), total)
    elif kind == "warning":
        warnings.warn(message.removeprefix("warning: "), SeparatrixWarning, stacklevel=6)
    else:
        log.info("%s", message)


def _stop(running: list[_Process]) -> None:
    """Ask for a clean stop; a second Ctrl-C, or too long a time, ends the programs at once."""
    # mpiexec takes an interrupt for itself, and a script in the background has its children ignore it.
    _signal(running, signal.SIGUSR1)
    try:
        last = time.monotonic() + _GRACE
        for one in running:
            one.process.wait(max(0.1, last - time.monotonic()))
    except (KeyboardInterrupt, subprocess.TimeoutExpired):
        _kill(running)


def _signal(running: list[_Process], number: int) -> None:
    for one in running:
        if one.process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                one.process.send_signal(number)


def _kill(running: list[_Process]) -> None:
    for one in running:
        if one.process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(one.process.pid, signal.SIGKILL)


def _reap(running: list[_Process]) -> None:
    for one in running:
        one.process.wait()


def _message(one: _Process, rename: Mapping[str, str]) -> str:
    """The last messages of the program, without its own name."""
    own = [line.removeprefix("separatrix: ") for line in one.lines if line.startswith("separatrix: ")]
    if own:
        # the lines after the first are further problems of the case
        first = next(i for i, line in enumerate(one.lines) if line.startswith("separatrix: "))
        own = [line.removeprefix("separatrix: ") for line in one.lines[first:]]
    text = "\n".join(own or one.lines[-5:]).strip()
    if not text:
        text = f"the program ended with code {one.process.returncode} without a message"
    for path, name in rename.items():
        text = text.replace(path, name)
    return text.replace("--set ", "")


def _raise(code: int, message: str) -> None:
    if code < 0:
        name = signal.Signals(-code).name
        raise SeparatrixError(f"the program was ended by {name}: {message}", 128 - code)
    raise (CaseError if code == BAD_DATA else SeparatrixError)(message, code)
