# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the program, small cases and what files contain, for the end-to-end tests."""

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

CASE = """\
title = "Coulomb friction at ratio 1.2"
[body]
mass = 1.0
[restoring]
law = "linear"
stiffness = 88.82643960980423
free_length = "0.4 m"
[friction]
law = "coulomb"
kinetic_coefficient = 0.2
[contact]
law = "newton"
restitution = 0.5
upper = "1.1 m"
[drive]
law = "fourier"
ratio = 1.2
mean = 0.31055
cosine = [0.09495, 0.01, -0.02003]
sine = [0.0, 0.02849, -0.02686]
angle = "191.1 deg"
[start]
x0 = "0.4 m"
v0 = 0.0
[attractors]
sample = 32
[[axis]]
name = "x0"
from = 0
to = "1.1 m"
count = 19
[[axis]]
name = "v0"
from = -6
to = "6 m/s"
count = 31
[sweep]
from = 0.8
to = 1.4
step = 0.1
starts = [3, 2]
x0 = [0, 1.1]
v0 = [-6, 6]
samples = 4
"""

# Graze at amplitude 0.1, fold of the impacting orbit at 0.099970753628: in between both motions attract.
FOLD = """\
[body]
mass = 1
[restoring]
law = "linear"
stiffness = 1
[friction]
law = "viscous"
damping = 0.1
[contact]
law = "newton"
restitution = 0.8
upper = 1
[drive]
law = "harmonic"
ratio = 1
amplitude = 0.099985
[run]
duration = 600
[[axis]]
name = "x0"
from = -2
to = 1
count = 60
[[axis]]
name = "v0"
from = -2
to = 2
count = 60
"""

STARTS = """\
x0,v0,ratio
0.4,0,1.2
0.5,1,1.1
0.1,-2,0.8
1.1,6,1.2
0.30000000000000004,-0.1,1.2
"""

STACK = (
    "axis=[{name='drive.ratio', from=1.1, to=1.3, count=3}, {name='x0', from=0, to=1.1, count=7},"
    " {name='v0', from=-6, to=6, count=11}]"
)
PLANE = (
    "axis=[{name='drive.ratio', from=0.8, to=1.3, count=13},"
    " {name='friction.kinetic_coefficient', from=0.1, to=0.3, count=9}]"
)
KINDS = {
    "map": ["basin", "case.toml"],
    "stack": ["basin", "case.toml", "--set", STACK],
    "plane": ["basin", "case.toml", "--set", PLANE],
    "refined": ["basin", "case.toml", "--set", "refine.step=4", "--set", "refine.block=8"],
    "sweep": ["sweep", "case.toml"],
    "points": ["points", "case.toml", "--list", "starts.csv"],
    "trajectory": ["trajectory", "case.toml"],
}

# What a file of a case contains beside how and when it was made.
PROVENANCE = ("provenance", "tiles")
TIMES = ("history", "date_created")
PROGRESS = ", ETA |^following branch "
"""Progress of a run, printed where it takes longer, as beside others."""


@dataclass
class Outcome:
    """How a run of the program ended."""

    code: int
    out: str
    err: str

    @property
    def messages(self) -> list[str]:
        """The program's own words on stderr, without those of mpirun."""
        return [line for line in self.err.splitlines() if line.startswith("separatrix: ")]


def run(program: Path, *arguments: object, folder: Path, ranks: int = 0, timeout: float = 60) -> Outcome:
    """Run the program in `folder`, under mpirun if `ranks` is not 0."""
    command = [str(program), *map(str, arguments)]
    if ranks:
        command = ["mpirun", "-n", str(ranks), *command]
    ended = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=timeout,
        stdin=subprocess.DEVNULL,
    )
    return Outcome(ended.returncode, ended.stdout, ended.stderr)


def succeed(program: Path, *arguments: object, folder: Path, ranks: int = 0, timeout: float = 60) -> Outcome:
    """As `run`; the run must end with code 0 and print nothing on stderr but its progress."""
    outcome = run(program, *arguments, folder=folder, ranks=ranks, timeout=timeout)
    lines = [line for line in outcome.err.splitlines() if not re.search(PROGRESS, line)]
    assert (outcome.code, lines) == (0, []), outcome
    return outcome


def write_case(folder: Path, text: str = CASE, name: str = "case.toml") -> Path:
    """Write a case file."""
    path = folder / name
    path.write_text(text)
    return path


def make_results(program: Path, folder: Path) -> dict[str, Path]:
    """A file of every kind by one process, and in `folder` what they are made from."""
    write_case(folder)
    # More than one tile of starts.
    rows = [f"{i / 300},{i % 13 - 6},{0.8 + 0.5 * (i // 100) / 3}" for i in range(300)]
    (folder / "starts.csv").write_text(STARTS + "\n".join(rows) + "\n")
    files = {kind: folder / f"{kind}.h5" for kind in KINDS}
    for kind, command in KINDS.items():
        succeed(program, *command, "-o", files[kind], folder=folder)
    return files


def contents(path: Path) -> dict[str, object]:
    """Bytes, type and attributes of every dataset and the attributes of the root, without the provenance."""
    found: dict[str, object] = {}

    def note(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if name.split("/")[0] in PROVENANCE or not isinstance(item, h5py.Dataset):
            return
        found[name] = (item.shape, item.dtype.str, values_of(item))
        for key in item.attrs:
            if key not in ("REFERENCE_LIST", "DIMENSION_LIST"):
                found[f"{name}@{key}"] = repr(item.attrs[key])

    with h5py.File(path) as file:
        file.visititems(note)
        for key in file.attrs:
            if key not in TIMES:
                found[f"@{key}"] = repr(file.attrs[key])
    return found


def values_of(item: h5py.Dataset) -> bytes:
    """All bits of a dataset."""
    return np.asarray(item[()]).tobytes()


def meanings(item: h5py.Dataset) -> list[str]:
    """What the codes of a dataset stand for."""
    names = dict(zip(item.attrs["flag_values"], item.attrs["flag_meanings"].split(), strict=True))
    return [names[code] for code in item[()]]


def differences(first: Path, second: Path) -> list[str]:
    """Names of what differs between two files."""
    one, other = contents(first), contents(second)
    return sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))


def tiles_done(part: Path) -> int:
    """How many tiles a working file has."""
    with h5py.File(part, locking=False) as file:
        return int(np.sum(file["tiles/record"].fields("state")[()] == 1))


def change_tile(part: Path, name: str) -> None:
    """Change a value of the first tile that a working file has."""
    with h5py.File(part, "r+", locking=False) as file:
        records = file["tiles/record"]
        number = int(np.flatnonzero(records.fields("state")[()] == 1)[0])
        record = records[number : number + 1]
        record[name].flat[0] += 1
        records[number : number + 1] = record


def listing(folder: Path) -> dict[str, bytes]:
    """Every file below a folder with its bytes."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
