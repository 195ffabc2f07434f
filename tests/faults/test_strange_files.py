# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files where none can be, odd names, two runs at one file: reported before any work, nothing is spoilt."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import h5py
import life
import pytest
from program import change_tile, listing

SMALL = ["--set", "axis[1].count=6", "--set", "axis[2].count=8", "--set", "attractors.sample=4"]
QUICK = ["basin", "case.toml", *SMALL]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the case."""
    life.write_case(tmp_path)
    return tmp_path


def begin(program: Path, folder: Path, ranks: int) -> subprocess.Popen:
    """A run that takes long, once it is at work."""
    process = life.launch(program, folder, ranks, "--set", "run.duration=1e5")
    deadline = time.monotonic() + 30
    while not (folder / f"{life.NAME}.part").exists():
        assert process.poll() is None and time.monotonic() < deadline, (folder / "log").read_text()
        time.sleep(0.01)
    return process


@pytest.mark.parametrize("ranks", [0, 2])
def test_a_second_run_leaves_the_file_of_the_first_alone(mpi_separatrix, folder, ranks):
    first = begin(mpi_separatrix, folder, ranks)
    before = (folder / f"{life.NAME}.part").stat().st_ino
    for more in ([], ["--resume"], ["--force"]):
        outcome = life.run(mpi_separatrix, *life.RUN, "--set", "run.duration=1e5", *more, folder=folder)
        assert outcome.code == 73, outcome
        assert "at work" in outcome.err or "interrupted" in outcome.err
    assert (folder / f"{life.NAME}.part").stat().st_ino == before
    life.kill(first, life.ranks_of(first, ranks))
    # What a dead run leaves does not hinder.
    outcome = life.run(
        mpi_separatrix, *life.RUN, "--set", "run.duration=1e5", "--resume", "--time-limit", "1", folder=folder
    )
    assert outcome.code == 75, outcome
    assert sorted(listing(folder)) == ["case.toml", "log", f"{life.NAME}.part"]


@pytest.mark.parametrize("more", [[], ["--force"], ["--resume"]])
@pytest.mark.parametrize("name", ["map.h5", "map.h5.part"])
def test_a_folder_in_the_way(separatrix, folder, name, more):
    (folder / name).mkdir()
    before = listing(folder)
    outcome = life.run(separatrix, *QUICK, "-o", "map.h5", *more, folder=folder)
    assert (outcome.code, outcome.out) == (73, ""), outcome
    assert f"'{name}'" in outcome.err and "is a folder" in outcome.err
    assert listing(folder) == before


def test_a_name_that_is_too_long(separatrix, folder):
    outcome = life.run(separatrix, *QUICK, "-o", "x" * 250 + ".h5", folder=folder)
    assert (outcome.code, outcome.out) == (73, ""), outcome
    assert "too long" in outcome.err
    assert list(listing(folder)) == ["case.toml"]


def test_a_folder_that_is_not_there(separatrix, folder):
    outcome = life.run(separatrix, *QUICK, "-o", "nowhere/map.h5", folder=folder)
    assert (outcome.code, outcome.out) == (73, ""), outcome
    assert "nowhere/map.h5" in outcome.err


def test_blanks_quotes_and_letters_of_all_alphabets(mpi_separatrix, folder):
    odd = folder / "a b ü'\"$x;#漢"
    odd.mkdir()
    shutil.move(folder / "case.toml", odd / "ça se.toml")
    asked = ["basin", "ça se.toml", *QUICK[2:], "-o", "out put é.h5", "--log", "lo g.jsonl"]
    life.succeed(mpi_separatrix, *asked, folder=odd, ranks=2)
    life.succeed(mpi_separatrix, "verify", "out put é.h5", "--sample", "2", folder=odd)
    life.succeed(mpi_separatrix, *asked[:-4], "-o", "s h.h5", "--shard", "1/1", folder=odd)
    life.succeed(mpi_separatrix, "merge", "m m.h5", "s h.h5.shard-1-of-1.part", folder=odd)
    assert life.content_hash(odd / "m m.h5") == life.content_hash(odd / "out put é.h5")


def test_a_title_as_long_as_a_book(separatrix, folder):
    text = (folder / "case.toml").read_text().partition("\n")[2]
    title = "Über alles, was stößt. " * 2600
    life.write_case(folder, f'title = "{title}"\n{text}')
    life.succeed(separatrix, *QUICK, "-o", "map.h5", folder=folder)
    life.succeed(separatrix, "verify", "map.h5", "--sample", "2", folder=folder)
    with h5py.File(folder / "map.h5") as file:
        assert file.attrs["title"] == title


def as_nobody(program: Path, folder: Path, *arguments: object) -> subprocess.CompletedProcess:
    """Run the program as a user who may write nothing; only root can."""
    nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    return subprocess.run(
        [*nobody, program, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=60
    )


@pytest.fixture
def public(tmp_path_factory: pytest.TempPathFactory, separatrix: Path) -> Path:
    """A folder that everybody may read and nobody but this user write, with the program in it."""
    if os.geteuid() != 0 or shutil.which("setpriv") is None or sys.platform != "linux":
        pytest.skip("needs root, to be somebody else")
    folder = Path("/tmp") / f"separatrix-public-{os.getpid()}"
    folder.mkdir(mode=0o755)
    shutil.copy(separatrix, folder / "program")
    (folder / "program").chmod(0o755)
    life.write_case(folder)
    yield folder
    shutil.rmtree(folder)


def test_a_folder_to_read_only(separatrix, public):
    life.succeed(separatrix, *QUICK, "-o", "map.h5", "--shard", "1/1", folder=public)
    part = public / "map.h5.shard-1-of-1.part"
    shutil.copy(part, public / "map.h5.part")
    before = listing(public)
    for more in ([], ["--resume"], ["--force"]):
        ended = as_nobody(public / "program", public, *QUICK, "-o", "map.h5", *more)
        assert (ended.returncode, ended.stdout) == (73, ""), ended
    ended = as_nobody(public / "program", public, "verify", "map.h5.part")
    assert ended.returncode == 74
    assert listing(public) == before
    # Shares are only read.
    writable = public / "writable"
    writable.mkdir()
    writable.chmod(0o777)
    ended = as_nobody(public / "program", writable, "merge", "map.h5", part)
    assert ended.returncode == 0, ended
    assert life.run(separatrix, "verify", "map.h5", "--sample", "2", folder=writable).code == 0


def test_merge_changes_no_share(separatrix, folder):
    """Not even one that is damaged, which only its own run mends."""
    life.succeed(separatrix, *QUICK, "-o", "map.h5", "--shard", "1/1", folder=folder)
    part = folder / "map.h5.shard-1-of-1.part"
    change_tile(part, "x_max")
    before = part.read_bytes()
    outcome = life.run(separatrix, "merge", "map.h5", part.name, folder=folder)
    assert outcome.code == 75, outcome
    assert part.read_bytes() == before


def test_shares_of_other_builds_and_versions(separatrix, folder):
    for number in (1, 2):
        life.succeed(separatrix, *QUICK, "-o", "map.h5", "--shard", f"{number}/2", folder=folder)
    parts = [f"map.h5.shard-{number}-of-2.part" for number in (1, 2)]
    with h5py.File(folder / parts[1], "r+") as file:
        file["provenance"].attrs.modify("commit", "0123456789ab")
    outcome = life.succeed(separatrix, "merge", "map.h5", *parts, folder=folder)
    assert f"'{parts[1]}' was made by another build: commit 0123456789ab" in outcome.out
    with h5py.File(folder / "map.h5") as file:
        assert "commit 0123456789ab" in file["provenance"].attrs["other_builds"]
    with h5py.File(folder / parts[1], "r+") as file:
        file["provenance"].attrs.modify("version", "9.9.9")
    outcome = life.run(separatrix, "merge", "other.h5", *parts, folder=folder)
    assert outcome.code == 76 and "version 9.9.9" in outcome.err
