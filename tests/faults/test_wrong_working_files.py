# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Working files that HDF5 reads well and that are wrong: they end in the right content, or are refused."""

import random
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import life
import numpy as np
import pytest
from program import listing

sys.path.insert(0, str(Path(__file__).resolve().parent / "fuzz"))

from wrong_files import ATTRIBUTE_CHANGES, OBJECT_CHANGES, replace  # noqa: E402

SEED = 20261127
SMALL = ["--set", "axis[1].count=6", "--set", "axis[2].count=8", "--set", "attractors.sample=4"]
RUN = ["basin", "case.toml", *SMALL, "--set", "grid.tile=[3, 3]"]
PART = "map.h5.part"
SHARE = "map.h5.shard-1-of-1.part"
# Exit codes allowed for a file that is wrong.
REFUSED = (65, 66, 73, 74, 75, 76)


def stored_as(**how: object) -> Callable:
    """The same values, stored in another way."""

    def change(file: h5py.File, name: str) -> None:
        replace(file, name, data=file[name][()], **how)

    return change


def of_type(kind: str) -> Callable:
    """The same values in another type."""

    def change(file: h5py.File, name: str) -> None:
        replace(file, name, data=file[name][()].astype(kind))

    return change


def longer(file: h5py.File, name: str) -> None:
    """A row more."""
    values = file[name][()]
    replace(file, name, data=np.concatenate([values, values[-1:]]))


def transposed(file: h5py.File, name: str) -> None:
    """Rows for columns."""
    replace(file, name, data=file[name][()].T)


def linked(file: h5py.File, name: str) -> None:
    """A link to nowhere in place of the object."""
    del file[name]
    file[name] = h5py.SoftLink("/nowhere")


def circle(file: h5py.File, name: str) -> None:
    """A link to itself."""
    del file[name]
    file[name] = h5py.SoftLink(f"/{name}")


MORE_CHANGES = [
    stored_as(chunks=True),
    stored_as(chunks=True, compression="gzip"),
    stored_as(chunks=True, fletcher32=True),
    stored_as(chunks=True, maxshape=(None, None)),
    *map(of_type, (">f8", "f4", "i8", "u1")),
    *(longer, transposed, linked, circle),
]


@pytest.fixture(scope="module")
def model(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a working file, some of whose tiles are not done, and the file that it shall become."""
    folder = tmp_path_factory.mktemp("model")
    life.write_case(folder)
    life.succeed(separatrix, *RUN, "-o", "whole.h5", folder=folder)
    life.succeed(separatrix, *RUN, "-o", "map.h5", "--shard", "1/1", folder=folder)
    shutil.copy(folder / SHARE, folder / PART)
    with h5py.File(folder / PART, "r+") as file:
        records = file["tiles/record"][()]
        records["state"][1:3] = 0
        file["tiles/record"][()] = records
    return folder


def changes(path: Path) -> Iterator[tuple]:
    """Every change of every object and attribute of a file."""
    with h5py.File(path) as file:
        names: list[str] = []
        file.visit(names.append)
        attributes = [(name, key) for name in ["/", *names] for key in file[name].attrs if key.isidentifier()]
    for name in names:
        for change in [*OBJECT_CHANGES, *MORE_CHANGES]:
            yield change, name
    for name, key in attributes:
        for change in ATTRIBUTE_CHANGES:
            yield change, name, key


def is_refusal(outcome: life.Outcome) -> bool:
    """Whether the program ended with a code of its own and one message."""
    return outcome.code in REFUSED and len(outcome.messages) == 1


def test_wrong_working_files(separatrix, model, tmp_path, amount, figures):
    chance = random.Random(SEED)
    expected = life.content_hash(model / "whole.h5")
    every = list(changes(model / PART))
    ends = {"resumed": 0, "merged": 0, "refused": 0}
    tried = 0
    for change, *what in chance.sample(every, amount(25, 600)):
        folder = shutil.copytree(model, tmp_path / "work", dirs_exist_ok=True)
        try:
            for name in (PART, SHARE):
                with h5py.File(folder / name, "r+") as file:
                    change(file, *what)
        except (AttributeError, TypeError, ValueError, OSError, RuntimeError, KeyError, OverflowError):
            shutil.rmtree(folder)
            continue
        tried += 1
        which = change.__qualname__, what
        for end, command in {
            "resumed": [*RUN, "-o", "map.h5", "--resume"],
            "merged": ["merge", "merged.h5", SHARE],
        }.items():
            outcome = life.run(separatrix, *command, folder=folder)
            assert outcome.code == 0 or is_refusal(outcome), (which, end, outcome)
            ends[end if outcome.code == 0 else "refused"] += 1
            result = folder / ("map.h5" if end == "resumed" else "merged.h5")
            assert result.exists() == (outcome.code == 0), (which, end, outcome)
            if outcome.code == 0:
                assert life.content_hash(result) == expected, (which, end)
        for reader in ("info", "verify"):
            outcome = life.run(separatrix, reader, SHARE, folder=folder)
            assert outcome.code == 0 or is_refusal(outcome), (which, reader, outcome)
        left = [name for name in listing(folder) if name.endswith((".new", ".lock"))]
        assert not left, (which, left)
        shutil.rmtree(folder)
    assert min(ends.values()) > 0
    figures.update(seed=SEED, changes=len(every), tried=tried, ends=ends)
