# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trials of damaged files: flipped bits, then `info`, `verify`, Python and `--resume`."""

import functools
import os
import pickle
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import life
import separatrix
from separatrix import SeparatrixError
from trial_runs import LONGEST, PACKED_RUN, WRONG, Bench, Failure, compare, messages

# How a reader may end: a damaged file is refused with 65 or 74, another version or case with 76.
REFUSED = (65, 74, 76)
# Bits flipped in one trial, and how often each number.
FLIPS = [1, 1, 1, 2, 8]


def flip(path: Path, chance: random.Random) -> None:
    """Flip one bit or several, most of them in bytes that are not zero."""
    data = bytearray(path.read_bytes())
    written = [at for at, byte in enumerate(data) if byte]
    for _ in range(chance.choice(FLIPS)):
        at = chance.choice(written) if chance.random() < 0.8 else chance.randrange(len(data))
        data[at] ^= 1 << chance.randrange(8)
    path.write_bytes(data)


def apart(read: Callable[[], object]) -> tuple[str, object]:
    """Return what `read` does in a process of its own: a value, an error with its code, or an end."""
    source, sink = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        try:
            answer = ("value", read())
        except SeparatrixError as error:
            answer = ("error", error.code)
        except BaseException as error:
            answer = ("other", f"{type(error).__name__}: {error}")
        with os.fdopen(sink, "wb") as file:
            pickle.dump(answer, file)
        os._exit(0)
    os.close(sink)
    with os.fdopen(source, "rb") as file:
        content = file.read()
    _, status = os.waitpid(child, 0)
    return pickle.loads(content) if content else ("other", f"signal {os.waitstatus_to_exitcode(status)}")


def opened(path: Path) -> list[object]:
    """Return all that the Python package finds in a result."""
    with separatrix.open_result(path) as result:
        found: list[object] = [sorted((key, repr(value)) for key, value in result.attrs.items())]
        for name in sorted(result.variables):
            variable = result[name]
            attributes = sorted((key, repr(value)) for key, value in variable.attrs.items())
            found.append((name, variable.dims, variable.values.tobytes(), attributes))
    return found


def command(bench: Bench, folder: Path, *words: str) -> tuple[int, str]:
    """Run the program on the damaged file; its code, and what it prints."""
    try:
        outcome = life.run(bench.program, *words, folder=folder, timeout=60)
    except subprocess.TimeoutExpired:
        raise Failure(WRONG, f"{words[0]} does not end") from None
    if outcome.code != 0 and (outcome.code not in REFUSED or not outcome.messages):
        raise Failure(WRONG, f"{words[0]} ended with {outcome.code}: {outcome.err[-300:]}")
    return outcome.code, outcome.out


@functools.cache
def undamaged(bench: Bench, name: str) -> tuple[object, str, str]:
    """What Python and `info` find in a final file, and its content."""
    path = bench.folder / name / life.NAME
    return (
        apart(lambda: opened(path)),
        command(bench, path.parent, "info", life.NAME)[1],
        life.content_hash(path),
    )


def final_file(bench: Bench, folder: Path, chance: random.Random) -> str:
    """A final file, small and plain or compressed, and one of its readers."""
    name = chance.choice(["whole", "packed"])
    found, about, content = undamaged(bench, name)
    path = folder / life.NAME
    shutil.copy(bench.folder / name / life.NAME, path)
    flip(path, chance)
    reader = chance.choice(["info", "verify", "Python", "Python"])
    if reader == "Python":
        kind, answer = apart(lambda: opened(path))
        if kind == "other":
            raise Failure(WRONG, f"sx.open_result: {answer}")
        refused = kind == "error"
        wrong = not refused and (kind, answer) != found
    elif reader == "info":
        code, text = command(bench, folder, "info", life.NAME)
        refused = code != 0
        wrong = not refused and text != about
    else:
        code, _ = command(bench, folder, "verify", life.NAME, "--sample", "1")
        kind, answer = apart(lambda: life.content_hash(path))
        refused = code != 0
        wrong = not refused and kind == "value" and answer != content
    if wrong:
        raise Failure(WRONG, f"{reader} accepts other values")
    return f"{reader} {'refuses' if refused else 'finds the same'}"


def working_file(bench: Bench, folder: Path, chance: random.Random) -> str:
    """A working file, half done or all done, which is resumed."""
    name, run, expected = chance.choice(
        [("half", life.RUN, bench.reference)] * 3 + [("done", PACKED_RUN, bench.packed)]
    )
    part = folder / f"{life.NAME}.part"
    shutil.copy(bench.folder / name / part.name, part)
    flip(part, chance)
    code, _ = command(bench, folder, *run, "--resume")
    if code:
        return f"refused with {code}"
    compare(folder, expected)
    return "same content"


def cut_while_running(bench: Bench, folder: Path, chance: random.Random) -> str:
    """A working file truncated at a random length while the run writes it."""
    part = folder / f"{life.NAME}.part"
    process = life.launch(bench.program, folder, chance.choice([0, 1, 2]))
    while process.poll() is None and (not part.exists() or life.stage(folder) == "create"):
        time.sleep(0.0005)
    time.sleep(chance.uniform(0, 0.4))
    try:
        size = part.stat().st_size
        os.truncate(part, chance.randrange(size))
    except FileNotFoundError:
        return "done before"
    code = process.wait(LONGEST)
    if code != 0 and f"{life.NAME}.part" not in " ".join(messages(folder)):
        raise Failure(WRONG, f"ended with {code} without naming the file: {messages(folder)}")
    if code != 0:
        code, _ = command(bench, folder, *life.RUN, "--resume")
    if code:
        return f"refused with {code}"
    compare(folder, bench.reference)
    return "same content"
