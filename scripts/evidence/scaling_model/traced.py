# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the program asks of a file system, counted by strace for each rank."""

import re
import shutil
import subprocess
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from runs import Program

CALLS = (
    "open,openat,creat,stat,lstat,fstat,newfstatat,statx,access,faccessat,faccessat2,statfs,fstatfs,"
    "rename,renameat,renameat2,unlink,unlinkat,truncate,ftruncate,fallocate,fsync,fdatasync,"
    "flock,fcntl,read,pread64,readv,preadv,write,pwrite64,writev,pwritev"
)
#: What a call counts as, if not by its own name.
MEANS = {
    **dict.fromkeys(("stat", "lstat", "fstat", "newfstatat", "statx", "statfs", "fstatfs"), "stat"),
    **dict.fromkeys(("access", "faccessat", "faccessat2"), "stat"),
    **dict.fromkeys(("open", "openat", "creat"), "open"),
    **dict.fromkeys(("rename", "renameat", "renameat2"), "rename"),
    **dict.fromkeys(("unlink", "unlinkat"), "unlink"),
    **dict.fromkeys(("truncate", "ftruncate", "fallocate"), "length"),
    **dict.fromkeys(("fsync", "fdatasync"), "sync"),
    **dict.fromkeys(("flock", "fcntl"), "lock"),
    **dict.fromkeys(("read", "pread64", "readv", "preadv"), "read"),
    **dict.fromkeys(("write", "pwrite64", "writev", "pwritev"), "write"),
}
LINE = re.compile(r"^\d+ +(\w+)\((.*)\) += (-?\d+)")


@dataclass
class Traced:
    """The calls of a run; lists over the ranks. `calls`: of (operation, file), `bytes` of those moved."""

    ranks: int
    calls: list[Counter] = field(default_factory=list)
    bytes: list[Counter] = field(default_factory=list)
    costs: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Seconds of each tile, in the order of the map."""
    rank: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    """Which rank computed it."""

    def total(self, operation: str, file: str = "") -> int:
        """Calls of all ranks, of one file or all."""
        return sum(
            count
            for calls in self.calls
            for (name, of), count in calls.items()
            if name == operation and file in ("", of)
        )

    def moved(self, operation: str, file: str) -> int:
        """Bytes of all ranks."""
        return sum(moved[operation, file] for moved in self.bytes)


def file_of(words: str, folder: Path) -> str | None:
    """Which file a call names: 'begun', 'part', 'new', 'lock', 'other'; None outside the run's folder."""
    if str(folder) not in words:
        return None
    name = words.split(str(folder), 1)[1]
    name = re.match(r"/?([^>\"]*)", name)[1]
    endings = {".h5.part.new": "begun", ".h5.part": "part", ".h5.new": "new", ".lock": "lock"}
    return next((file for ending, file in endings.items() if name.endswith(ending)), "other")


def count(text: str, folder: Path) -> tuple[Counter, Counter]:
    """Count the calls in what strace has written of a rank."""
    calls, moved = Counter(), Counter()
    for line in text.splitlines():
        found = LINE.match(line)
        if found is None or (file := file_of(found[2], folder)) is None:
            continue
        operation = MEANS.get(found[1])
        if operation is None or (found[1] == "fcntl" and "LK" not in found[2]):
            continue
        if operation == "open" and "O_CREAT" in found[2]:
            operation = "create"
        calls[operation, file] += 1
        if operation in ("read", "write"):
            moved[operation, file] += int(found[3])
    return calls, moved


def trace(program: Program, ranks: int, case: Path, *words: object) -> Traced:
    """Run a map on so many ranks, each under strace."""
    folder = program.folder / f"traced-{ranks}"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "out").mkdir(parents=True)
    times = folder / "tiles.csv"
    map_of = [program.program, "basin", case, "-o", folder / "out" / "map.h5", "-q", "--tile-times", times]
    strace = f"strace -f -y -qq -s 0 -e signal=none --seccomp-bpf -e trace={CALLS}"
    strace += f" -o {folder}/$OMPI_COMM_WORLD_RANK"
    start = ["mpirun", "--bind-to", "none", "-n", ranks, "bash", "-c", f'exec {strace} "$@"', "bash"]
    subprocess.run([str(word) for word in (*start, *map_of, *words)], check=True, stdout=subprocess.DEVNULL)
    result = Traced(ranks)
    for rank in range(ranks):
        calls, moved = count((folder / str(rank)).read_text(errors="replace"), folder / "out")
        result.calls.append(calls)
        result.bytes.append(moved)
    rows = np.genfromtxt(times, delimiter=",", names=True)
    rows = rows[np.argsort(rows["tile"])]
    result.costs, result.rank = rows["end"] - rows["begin"], rows["rank"].astype(int)
    return result
