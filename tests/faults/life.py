# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The life of one run: begun, disturbed, resumed, and what its files hold at any moment."""

import contextlib
import hashlib
import math
import os
import signal
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np
from program import Outcome, contents, differences, run, succeed, write_case

__all__ = ["contents", "differences", "run", "succeed", "write_case"]

NAME = "map.h5"
# Small and cheap, but many tiles.
SETTINGS = [
    *("--set", "grid.tile=[8, 8]", "--set", "axis[1].count=44", "--set", "axis[2].count=52"),
    # One by one: in lanes it would be over before anything can happen to it.
    *("--set", 'integrator.lanes="off"'),
    *("--set", 'run.stop="duration"', "--set", "run.duration=30", "--set", "attractors.sample=16"),
]
RUN = ["basin", "case.toml", *SETTINGS, "-o", NAME]
TILES = 6 * 7


def launch(
    program: Path, folder: Path, ranks: int, *more: object, variables: dict[str, str] | None = None
) -> subprocess.Popen:
    """Start the run; its output is added to the file `log`."""
    command = ["mpirun", "-n", str(ranks)] if ranks else []
    with (folder / "log").open("a") as log:
        return subprocess.Popen(
            [*command, program, *RUN, *map(str, more)],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, **(variables or {})},
        )


def stop_half_way(program: Path, folder: Path) -> None:
    """Start the run and stop it by a signal when it has done some tiles and not all."""
    process = launch(program, folder, 0)
    while not (folder / f"{NAME}.part").exists() or tiles_of(folder)[0] == 0:
        assert process.poll() is None
        time.sleep(0.002)
    time.sleep(0.2)
    process.terminate()
    assert process.wait(20) == 75
    assert 0 < tiles_of(folder)[0] < TILES


def ranks_of(process: subprocess.Popen, ranks: int) -> list[int]:
    """The processes that compute: those that mpirun has started so far, or the process itself."""
    if not ranks:
        return [process.pid]
    try:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    except (FileNotFoundError, ProcessLookupError):
        return []
    return [int(child) for child in children if is_program(child)]


def is_program(process: str) -> bool:
    """Whether the process already runs the program."""
    try:
        return Path(f"/proc/{process}/comm").read_text().strip() == "separatrix"
    except (FileNotFoundError, ProcessLookupError):
        return False


def kill(process: subprocess.Popen, victims: list[int]) -> float:
    """SIGKILL to the victims, or to mpirun if it has none yet; the seconds until all is over.

    mpirun 4.1 itself may hang when a rank dies while it connects: then it is killed, the answer is infinity.
    """
    started = time.monotonic()
    for victim in victims or [process.pid]:
        with contextlib.suppress(ProcessLookupError):
            os.kill(victim, signal.SIGKILL)
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait(10)
        return math.inf
    return time.monotonic() - started


def stage(folder: Path) -> str:
    """Progress of the run according to its files."""
    final, part = folder / NAME, folder / f"{NAME}.part"
    if final.exists():
        return "renamed" if part.exists() else "done"
    if part.exists():
        return "finalise" if (folder / f"{NAME}.new").exists() else "fill"
    return "create" if (folder / f"{NAME}.part.new").exists() else "start"


def tiles_of(folder: Path) -> tuple[int, int]:
    """How many tiles the working file has done, and how many others hold some data."""
    with h5py.File(folder / f"{NAME}.part", locking=False) as file:
        records = file["tiles/record"][()]
    done = records["state"] == 1
    return int(np.sum(done)), int(np.sum([np.any(values) for values in records["regime"][~done]]))


def resume(program: Path, folder: Path, ranks: int) -> Outcome:
    """Go on undisturbed until the file is there."""
    return succeed(program, *RUN, "--resume", folder=folder, ranks=ranks)


def content_hash(path: Path) -> str:
    """SHA-256 of all that does not depend on how, where and when the file was made."""
    digest = hashlib.sha256()
    for name, value in sorted(contents(path).items()):
        digest.update(name.encode())
        digest.update(repr(value).encode())
    return digest.hexdigest()


def sound(program: Path, folder: Path) -> None:
    """The final file must pass `verify`."""
    outcome = run(program, "verify", NAME, "--sample", "1", "--partial", folder=folder)
    assert outcome.code == 0, outcome
