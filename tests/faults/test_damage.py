# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flipped bit or a cut tail is found: a working file loses tiles, in a final file `verify` names them."""

import random
import re
import shutil
from collections import Counter
from pathlib import Path

import h5py
import life
import numpy as np
import pytest
import separatrix

SEED = 20261122
PART = f"{life.NAME}.part"
AXES = ("x0", "v0")
#: What a damaged result is called; the last is a beginning that no reader knows.
DAMAGED = re.compile(
    r"is damaged|match (its|their) checksum|cannot be read as HDF5 \(.*signature|no HDF5 file, or"
)


@pytest.fixture(scope="module")
def stopped(separatrix, tmp_path_factory):
    """A folder with a run that was stopped half-way."""
    folder = tmp_path_factory.mktemp("stopped")
    life.write_case(folder)
    life.stop_half_way(separatrix, folder)
    return folder


@pytest.fixture
def folder(stopped, tmp_path):
    """A copy of it."""
    shutil.copytree(stopped, tmp_path / "copy")
    return tmp_path / "copy"


def data_of_tiles(part: Path) -> dict[int, list[tuple[int, int]]]:
    """Where the working file holds the data of each tile that is done: (offset, bytes)."""
    extents = {}
    with h5py.File(part, locking=False) as file:
        records, shape = file["tiles/record"], file["tiles/tile_shape"][()]
        columns = -(-len(file[AXES[1]]) // int(shape[1]))
        whole = [len(file[name]) // length for name, length in zip(AXES, shape, strict=True)]
        first, width = records.id.get_offset(), records.dtype.itemsize
        for slot, head in enumerate(records.fields(["tile", "state"])[()]):
            i, k = divmod(int(head["tile"]) - 1, columns)
            # Records of tiles at the edge of the grid have cells of no point.
            if head["state"] != 1 or i >= whole[0] or k >= whole[1]:
                continue
            extents[int(head["tile"])] = [
                (first + slot * width + records.dtype.fields[name[1:]][1], records.dtype[name[1:]].itemsize)
                for name in file["tiles"].attrs["variables"].split()
            ]
    return extents


def flip(path: Path, offset: int, bit: int) -> None:
    """Flip one bit of a file."""
    with path.open("r+b") as file:
        file.seek(offset)
        byte = file.read(1)[0]
        file.seek(offset)
        file.write(bytes([byte ^ (1 << bit)]))


def test_flipped_bits_cost_their_tiles(mpi_separatrix, folder, reference, amount, figures):
    chance = random.Random(SEED)
    original = (folder / PART).read_bytes()
    extents = data_of_tiles(folder / PART)
    done = life.tiles_of(folder)[0]
    flips = 0
    for trial in range(amount(2, 25)):
        (folder / PART).write_bytes(original)
        (folder / life.NAME).unlink(missing_ok=True)
        tiles = chance.sample(sorted(extents), 1 + trial % 5)
        for tile in tiles:
            offset, size = chance.choice(extents[tile])
            flip(folder / PART, offset + chance.randrange(size), chance.randrange(8))
            flips += 1
        outcome = life.resume(mpi_separatrix, folder, chance.choice([0, 1, 2, 3]))
        assert f"{done - len(tiles)} of {life.TILES} tiles were done before" in outcome.out
        assert life.differences(reference, folder / life.NAME) == []
    figures.update(seed=SEED, flips=flips, tiles_recomputed=flips)


def test_a_cut_tail_costs_its_tiles(mpi_separatrix, folder, reference, amount, figures):
    chance = random.Random(SEED)
    original = (folder / PART).read_bytes()
    extents = data_of_tiles(folder / PART)
    first = min(offset for tiles in extents.values() for offset, _ in tiles)
    done = life.tiles_of(folder)[0]
    cuts = [len(original) - 1, first, *(chance.randrange(first, len(original)) for _ in range(amount(2, 40)))]
    lost = Counter()
    for cut in cuts:
        (folder / PART).write_bytes(original[:cut])
        (folder / life.NAME).unlink(missing_ok=True)
        outcome = life.resume(mpi_separatrix, folder, chance.choice([0, 1, 2, 3]))
        assert f"lacked {len(original) - cut} bytes" in outcome.out
        kept = int(re.search(r"(\d+) of \d+ tiles were done before", outcome.out)[1])
        # Tiles that lost a byte other than zero; those at the edge of the grid are not in `extents`.
        least = sum(
            any(any(original[max(at, cut) : at + size]) for at, size in tile) for tile in extents.values()
        )
        assert done - kept >= least
        assert done - kept <= least + done - len(extents)
        lost[done - kept > 0] += 1
        assert life.differences(reference, folder / life.NAME) == []
    assert lost[True]
    figures.update(
        seed=SEED, cuts=len(cuts), with_tiles_lost=lost[True], bytes=len(original), tiles_begin_at=first
    )


def test_a_cut_head_is_reported(separatrix, folder):
    original = (folder / PART).read_bytes()
    for cut in (0, 10, 47, 48, 1000, 20000):
        (folder / PART).write_bytes(original[:cut])
        outcome = life.run(separatrix, *life.RUN, "--resume", folder=folder)
        assert outcome.code == 74, outcome
        assert PART in outcome.messages[0]
        assert "--force" in outcome.messages[0]
        assert not (folder / life.NAME).exists()


def test_no_flipped_bit_changes_a_result(separatrix, folder, reference, amount, figures):
    chance = random.Random(SEED)
    original = (folder / PART).read_bytes()
    # Most bits that matter are in front of the tiles; what is zero there is mostly unused.
    written = [i for i in range(len(original)) if original[i]]
    ends = Counter()
    for _ in range(amount(6, 150)):
        (folder / PART).write_bytes(original)
        (folder / life.NAME).unlink(missing_ok=True)
        offset = chance.choice(written) if chance.random() < 0.9 else chance.randrange(len(original))
        flip(folder / PART, offset, chance.randrange(8))
        outcome = life.run(separatrix, *life.RUN, "--resume", folder=folder)
        assert outcome.code in (0, 74, 76), (offset, outcome)
        if outcome.code == 0:
            found = life.differences(reference, folder / life.NAME)
            assert found == [], (offset, found)
        else:
            assert outcome.messages
        ends[{0: "same content", 74: "refused with 74", 76: "refused with 76"}[outcome.code]] += 1
    figures.update(seed=SEED, flips=sum(ends.values()), ends=ends)


@pytest.fixture(scope="module", params=["plain", "compressed"])
def final(request, separatrix, reference, tmp_path_factory):
    """A final file, small and stored as it is, or large and compressed."""
    if request.param == "plain":
        return reference
    folder = tmp_path_factory.mktemp("compressed")
    life.write_case(folder)
    size = ["--set", "axis[1].count=96", "--set", "axis[2].count=64", "--set", "grid.tile=[16, 16]"]
    life.succeed(separatrix, *life.RUN, "--set", "run.stop='captured'", *size, folder=folder)
    return folder / life.NAME


def test_verify_finds_damage(separatrix, final, tmp_path, amount, figures):
    chance = random.Random(SEED)
    original = final.read_bytes()
    wanted = life.content_hash(final)
    copy = tmp_path / "copy.h5"
    ends = Counter()
    for _ in range(amount(8, 200)):
        copy.write_bytes(original)
        flip(copy, chance.randrange(len(original)), chance.randrange(8))
        outcome = life.run(separatrix, "verify", copy.name, "--sample", "1", folder=tmp_path)
        if outcome.code == 0:
            # A bit that no reader looks at, or one that only other readers do.
            try:
                found = life.content_hash(copy)
            except (OSError, RuntimeError, UnicodeDecodeError):
                ends["refused by other readers"] += 1
                continue
            assert found == wanted
            ends["in no value"] += 1
        else:
            assert outcome.code == 74, outcome
            assert copy.name in outcome.messages[0]
            ends["named" if "damaged: tile" in outcome.messages[0] else "found"] += 1
    figures.update(seed=SEED, flips=sum(ends.values()), ends=ends)


def test_info_shows_no_damaged_value(separatrix, final, tmp_path, amount, figures):
    chance = random.Random(SEED)
    original = final.read_bytes()
    copy = tmp_path / "copy.h5"
    copy.write_bytes(original)
    shown = life.succeed(separatrix, "info", copy.name, folder=tmp_path).out
    written = [i for i in range(len(original)) if original[i]]
    ends = Counter()
    for _ in range(amount(60, 200)):
        copy.write_bytes(original)
        flip(copy, chance.choice(written), chance.randrange(8))
        outcome = life.run(separatrix, "info", copy.name, folder=tmp_path)
        if outcome.code == 0:
            assert outcome.out == shown
        else:
            assert outcome.code == 74 and copy.name in outcome.messages[0], outcome
            assert DAMAGED.search(outcome.messages[0]), outcome
        ends["same" if outcome.code == 0 else "refused"] += 1
    figures.update(seed=SEED, flips=sum(ends.values()), ends=ends)


def test_the_package_calls_damage_damage(final, tmp_path, amount, figures):
    chance = random.Random(SEED)
    original = final.read_bytes()
    copy = tmp_path / "copy.h5"
    written = [i for i in range(len(original)) if original[i]]
    refused = 0
    for _ in range(amount(60, 400)):
        copy.write_bytes(original)
        flip(copy, chance.choice(written), chance.randrange(8))
        try:
            with separatrix.open_result(copy) as result:
                result.load()
        except separatrix.SeparatrixError as error:
            assert str(copy) in str(error)
            assert DAMAGED.search(str(error)), error
            refused += 1
    assert refused
    figures.update(seed=SEED, refused=refused)


def test_verify_names_the_tile(separatrix, final, tmp_path, amount, figures):
    chance = random.Random(SEED)
    copy = tmp_path / "copy.h5"
    flips = 0
    for _ in range(amount(2, 40)):
        shutil.copy(final, copy)
        with h5py.File(copy, "r+") as file:
            name = chance.choice(file["tiles"].attrs["variables"].split())
            values = file[name]
            point = tuple(chance.randrange(length) for length in values.shape)
            shape = file["tiles/tile_shape"][()]
            before = values[point]
            values[point] = before + 1
            if values[point] == before or (np.isnan(before) and np.isnan(values[point])):
                continue
        corner = [int(p // s * s) for p, s in zip(point, shape, strict=True)]
        tile = corner[0] // shape[0] * -(-values_length(copy, name) // shape[1]) + corner[1] // shape[1] + 1
        outcome = life.run(separatrix, "verify", copy.name, folder=tmp_path)
        assert outcome.code == 74
        assert name in outcome.messages[0]
        assert f"damaged: tile {tile} at [{corner[0]}, {corner[1]}]" in outcome.messages[0], outcome.messages
        flips += 1
    assert flips
    figures.update(seed=SEED, changed_values=flips)


def values_length(path: Path, name: str) -> int:
    """Length of the last dimension."""
    with h5py.File(path) as file:
        return file[name].shape[1]


def test_verify_finds_a_cut_file(separatrix, final, tmp_path):
    original = final.read_bytes()
    copy = tmp_path / "copy.h5"
    for cut in (0, 40, len(original) // 2, len(original) - 1):
        copy.write_bytes(original[:cut])
        outcome = life.run(separatrix, "verify", copy.name, folder=tmp_path)
        assert outcome.code == 74, outcome
        found = f"is cut: {cut} of {len(original)} bytes are left" if cut else "is empty"
        assert found in outcome.messages[0]
