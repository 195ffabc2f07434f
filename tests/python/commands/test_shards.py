# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A map or a list in shares, merged, is the map or the list; what is no set of shares is refused."""

import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import STACK, change_tile, differences, listing, run, succeed, tiles_done, write_case

SMALL = ["--set", "grid.tile=[4, 5]"]
COMMAND = ["basin", "case.toml", *SMALL, "-o", "map.h5"]
LIST = ["points", "case.toml", "--list", "starts.csv"]


def part(number: int, count: int) -> str:
    """The file of a share."""
    return f"map.h5.shard-{number}-of-{count}.part"


@pytest.fixture(scope="module")
def shares(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the whole map and its three shares. Not to be changed."""
    folder = tmp_path_factory.mktemp("shares")
    write_case(folder)
    succeed(separatrix, "basin", "case.toml", *SMALL, "-o", "whole.h5", folder=folder)
    for number in (1, 2, 3):
        succeed(separatrix, *COMMAND, "--shard", f"{number}/3", folder=folder)
    return folder


@pytest.fixture
def folder(shares: Path, tmp_path: Path) -> Path:
    """A copy of that folder."""
    return shutil.copytree(shares, tmp_path / "copy")


def test_the_merged_map_is_that_of_one_run(separatrix, folder):
    outcome = succeed(separatrix, "merge", "map.h5", *(part(i, 3) for i in (2, 3, 1)), folder=folder)
    assert "wrote map.h5" in outcome.out
    assert differences(folder / "whole.h5", folder / "map.h5") == []
    with h5py.File(folder / "whole.h5") as whole, h5py.File(folder / "map.h5") as merged:
        for text in ("case_text", "resolved_case"):
            assert whole["provenance"].attrs[text] == merged["provenance"].attrs[text]
        one, other = (file["provenance"].attrs["case_identity"] for file in (whole, merged))
        assert one == other
    succeed(separatrix, "verify", "map.h5", "--sample", "20", folder=folder)
    assert len(list(folder.glob("*.part"))) == 3


def test_the_plan_is_that_of_the_share(separatrix, folder):
    """The shares of a plan have the tiles and points that their runs have, for a map and for a list."""
    (folder / "starts.csv").write_text("x0,v0\n" + "0.01,0.1\n" * 2000)
    for words in (["basin", "case.toml", *SMALL], LIST):
        whole = succeed(separatrix, *words, "--dry-run", folder=folder).out
        of_map = [int(part) for part in re.search(r"(\d+) points in (\d+) tiles", whole).groups()]
        sums = [0, 0]
        for number in (1, 2, 3):
            plan = succeed(separatrix, *words, "--dry-run", "--shard", f"{number}/3", folder=folder).out
            found = re.search(rf"share {number} of 3: (\d+) points in (\d+) tiles; ([\d.]+) .?B while", plan)
            sums = [sums[0] + int(found[1]), sums[1] + int(found[2])]
            if words is not LIST:
                assert int(found[2]) == tiles_done(folder / part(number, 3))
            assert float(found[3]) < 0.5 * float(re.search(r"([\d.]+) .?B while", whole)[1])
        assert sums == of_map


@pytest.mark.parametrize("count", [1, 5])
def test_slices_and_any_number_of_shares_on_any_ranks(mpi_separatrix, tmp_path, count):
    write_case(tmp_path)
    asked = ["basin", "case.toml", "--set", STACK, "--set", "grid.tile=[2, 3, 4]"]
    succeed(mpi_separatrix, *asked, "-o", "whole.h5", folder=tmp_path)
    for number in range(1, count + 1):
        succeed(
            mpi_separatrix,
            *(*asked, "-o", "map.h5", "--shard", f"{number}/{count}"),
            folder=tmp_path,
            ranks=number % 3,
        )
    succeed(mpi_separatrix, "merge", "map.h5", *(part(i + 1, count) for i in range(count)), folder=tmp_path)
    assert differences(tmp_path / "whole.h5", tmp_path / "map.h5") == []


def test_a_cut_share_is_mended_by_resume(mpi_separatrix, folder):
    share = folder / part(2, 3)
    share.write_bytes(share.read_bytes()[:-1000])
    merging = ["merge", "map.h5", *(part(i, 3) for i in (1, 2, 3))]
    assert run(mpi_separatrix, *merging, folder=folder).code == 74
    outcome = run(
        mpi_separatrix, *COMMAND, "--shard", "2/3", "--resume", "--set", "drive.ratio=1.3", folder=folder
    )
    assert outcome.code == 76
    assert "drive.ratio: 1.2, now 1.3" in outcome.err
    outcome = succeed(mpi_separatrix, *COMMAND, "--shard", "2/3", "--resume", folder=folder, ranks=2)
    succeed(mpi_separatrix, *merging, folder=folder)
    assert differences(folder / "whole.h5", folder / "map.h5") == []


@pytest.fixture(scope="module")
def lists(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a list of starts, its results and its two shares. Not to be changed."""
    folder = tmp_path_factory.mktemp("lists")
    write_case(folder)
    rows = [f"{i / 600},{i % 13 - 6},{0.8 + 0.5 * (i // 100) / 6}" for i in range(600)]
    (folder / "starts.csv").write_text("x0,v0,ratio\n" + "\n".join(rows) + "\n")
    succeed(separatrix, *LIST, "-o", "whole.h5", "--csv", "whole.csv", folder=folder)
    for number in (1, 2):
        succeed(separatrix, *LIST, "-o", "map.h5", "--shard", f"{number}/2", folder=folder)
    return folder


def test_a_list_in_shares(mpi_separatrix, lists, tmp_path):
    folder = shutil.copytree(lists, tmp_path / "copy")
    # A share of several ranks that is begun again is the same share.
    share = folder / part(2, 2)
    share.unlink()
    succeed(mpi_separatrix, *LIST, "-o", "map.h5", "--shard", "2/2", folder=folder, ranks=2)
    merging = ["merge", "map.h5", part(2, 2), part(1, 2), "--csv", "map.csv"]
    succeed(mpi_separatrix, *merging, folder=folder)
    assert differences(folder / "whole.h5", folder / "map.h5") == []
    assert (folder / "map.csv").read_bytes() == (folder / "whole.csv").read_bytes()


def test_shares_of_lists_and_of_maps_do_not_mix(separatrix, lists, shares, tmp_path):
    names = [lists / part(1, 2), shares / part(2, 3)]
    for first, second in (names, names[::-1]):
        outcome = run(separatrix, "merge", "map.h5", first, second, folder=tmp_path)
        assert outcome.code in (65, 76), outcome
    with h5py.File(lists / part(1, 2)) as file:
        changed = file["v0"][()]
    copy = shutil.copytree(lists, tmp_path / "copy")
    with h5py.File(copy / part(1, 2), "r+") as file:
        file["v0"][...] = changed + 1
    outcome = run(separatrix, "merge", "map.h5", part(1, 2), part(2, 2), folder=copy)
    assert outcome.code == 76 and "another case" in outcome.err


def test_a_share_takes_the_attractors_of_another(separatrix, folder):
    """As bits of a made-up catalogue show, which is neither searched again nor compared with anything."""
    with h5py.File(folder / part(1, 3)) as file:
        searched = file["shard/catalogue"][()]
    (folder / part(2, 3)).unlink()
    taking = [*COMMAND, "--shard", "2/3", "--catalogue", part(1, 3)]
    succeed(separatrix, *taking, "--set", "attractors.sample=32", folder=folder)
    with h5py.File(folder / part(2, 3)) as file:
        assert np.array_equal(file["shard/catalogue"][()], searched)
    succeed(separatrix, "merge", "map.h5", *(part(i, 3) for i in (1, 2, 3)), folder=folder)
    assert differences(folder / "whole.h5", folder / "map.h5") == []
    with h5py.File(folder / part(1, 3), "r+") as file:
        # The second attractor's label; slice, number and the first one are before it, and its length.
        size = (len(searched) - 2) // 2
        file["shard/catalogue"][2 + size + 1] = 7
    succeed(separatrix, *taking, "--force", folder=folder)
    with h5py.File(folder / part(2, 3)) as file:
        assert set(np.unique(file["tiles/record"]["attractor"])) == {0, 1, 7}


def test_a_search_for_all_shares(mpi_separatrix, folder):
    """The first share's file is made for its attractors alone; the shares are begun from it."""
    for number in (1, 2, 3):
        (folder / part(number, 3)).unlink()
    searching = [*COMMAND, "--shard", "1/3", "--search-only"]
    outcome = succeed(mpi_separatrix, *searching, folder=folder, ranks=2)
    assert "2 attractors in 1 slice discovered" in outcome.out
    assert sorted(path.name for path in folder.glob("*.part")) == [part(1, 3)]
    assert tiles_done(folder / part(1, 3)) == 0
    # Searched again, as after a kill: the same file.
    before = listing(folder)
    assert run(mpi_separatrix, *searching, folder=folder).code == 73
    succeed(mpi_separatrix, *searching, "--resume", folder=folder)
    assert listing(folder) == before
    for number in (2, 1, 3):
        taking = [*COMMAND, "--shard", f"{number}/3", "--resume", "--catalogue", part(1, 3)]
        outcome = succeed(mpi_separatrix, *taking, folder=folder, ranks=number - 1)
        assert f"taken from {part(1, 3)}" in outcome.out
    succeed(mpi_separatrix, "merge", "map.h5", *(part(i, 3) for i in (1, 2, 3)), folder=folder)
    assert differences(folder / "whole.h5", folder / "map.h5") == []


def test_a_search_is_one_of_a_share(separatrix, tmp_path):
    write_case(tmp_path)
    for command in ([*COMMAND, "--search-only"], ["sweep", "case.toml", "--search-only"]):
        assert run(separatrix, *command, folder=tmp_path).code == 64
    both = [*COMMAND, "--shard", "1/2", "--search-only", "--catalogue", "other.part"]
    assert run(separatrix, *both, folder=tmp_path).code == 64
    assert list(listing(tmp_path)) == ["case.toml"]


@pytest.mark.parametrize(
    ("source", "change", "code"),
    [
        ("whole.h5", [], 65),
        ("nowhere.part", [], 66),
        ("case.toml", [], 65),
        (part(1, 3), ["--set", "drive.ratio=1.21"], 76),
        (part(1, 3), ["--set", "attractors.sample=31"], 76),
    ],
)
def test_what_has_no_attractors_for_this_map(separatrix, folder, source, change, code):
    before = listing(folder)
    outcome = run(
        separatrix, "basin", "case.toml", *change, "-o", "new.h5", "--catalogue", source, folder=folder
    )
    assert outcome.code == code
    assert "wrote" not in outcome.out
    assert source in outcome.err
    assert listing(folder) == before


@pytest.mark.parametrize(("at", "value"), [(0, 2.0), (0, -1.0), (0, np.nan), (1, 3.0), (1, -1.0), (1, 1e300)])
def test_a_damaged_catalogue_is_refused(separatrix, folder, at, value):
    """Not read beyond its end, nor into a slice that there is not."""
    for number in (1, 2, 3):
        with h5py.File(folder / part(number, 3), "r+") as file:
            file["shard/catalogue"][at] = value
    outcome = run(separatrix, "merge", "map.h5", *(part(i, 3) for i in (1, 2, 3)), folder=folder)
    assert outcome.code == 74 and "catalogue" in outcome.err, outcome
    taking = ["basin", "case.toml", "-o", "new.h5", "--catalogue", part(1, 3)]
    assert run(separatrix, *taking, folder=folder).code == 74


def test_more_shares_than_tiles(separatrix, tmp_path):
    write_case(tmp_path)
    asked = ["basin", "case.toml", "--set", "grid.tile=[19, 31]", "-o", "map.h5"]
    for number in (1, 2):
        succeed(separatrix, *asked, "--shard", f"{number}/2", folder=tmp_path)
    succeed(separatrix, "merge", "map.h5", part(1, 2), part(2, 2), folder=tmp_path)
    succeed(separatrix, "verify", "map.h5", "--sample", "5", folder=tmp_path)


def test_a_share_that_was_stopped_goes_on(separatrix, folder):
    change_tile(folder / part(2, 3), "x_max")
    outcome = run(separatrix, "merge", "map.h5", *(part(i, 3) for i in (1, 2, 3)), folder=folder)
    assert outcome.code == 75
    for word in ("share 2 of 3", "1 tiles", "--shard 2/3", "--resume"):
        assert word in outcome.err
    assert not (folder / "map.h5").exists() and not (folder / "map.h5.part").exists()
    outcome = succeed(separatrix, *COMMAND, "--shard", "2/3", "--resume", folder=folder)
    assert "tiles were done before" in outcome.out
    succeed(separatrix, "merge", "map.h5", *(part(i, 3) for i in (1, 2, 3)), folder=folder)
    assert differences(folder / "whole.h5", folder / "map.h5") == []


@pytest.mark.parametrize(
    ("files", "code", "words"),
    [
        ((1, 2), 66, ["share 3 of 3", "missing"]),
        ((1, 2, 3, 2), 65, ["share 2 of 3", "twice", part(2, 3)]),
        ((1, "whole.h5"), 65, ["whole.h5", "no share"]),
        ((1, "nowhere.part"), 66, ["nowhere.part"]),
        ((1, "case.toml"), 65, ["case.toml"]),
    ],
)
def test_what_is_no_set_of_shares(separatrix, folder, files, code, words):
    before = listing(folder)
    names = [part(name, 3) if isinstance(name, int) else name for name in files]
    outcome = run(separatrix, "merge", "map.h5", *names, folder=folder)
    assert (outcome.code, outcome.out) == (code, "")
    assert outcome.err.count("\n") == 1
    for word in words:
        assert word in outcome.err
    assert listing(folder) == before


@pytest.mark.parametrize(
    ("change", "shard", "code", "words"),
    [
        (["--set", "drive.ratio=1.21"], "3/3", 76, ["another case"]),
        (["--set", "run.domain=1e5"], "3/3", 76, ["another case"]),
        (["--set", "grid.tile=[6, 5]"], "3/3", 76, ["another layout"]),
        ([], "1/2", 65, ["is a share of 2", "is one of 3"]),
    ],
)
def test_a_share_of_another_map(separatrix, folder, change, shard, code, words):
    other = ["basin", "case.toml", *SMALL, *change, "-o", "other.h5", "--shard", shard]
    succeed(separatrix, *other, folder=folder)
    name = f"other.h5.shard-{shard.replace('/', '-of-')}.part"
    before = listing(folder)
    outcome = run(separatrix, "merge", "map.h5", part(1, 3), part(2, 3), name, folder=folder)
    assert outcome.code == code
    for word in words:
        assert word in outcome.err
    assert listing(folder) == before


def test_an_existing_output_is_only_replaced_with_force(separatrix, folder):
    (folder / "map.h5").write_text("something dear")
    command = ["merge", "map.h5", *(part(i, 3) for i in (1, 2, 3))]
    outcome = run(separatrix, *command, folder=folder)
    assert outcome.code == 73
    assert (folder / "map.h5").read_text() == "something dear"
    succeed(separatrix, *command, "--force", folder=folder)
    assert differences(folder / "whole.h5", folder / "map.h5") == []


@pytest.mark.parametrize(
    "output", [part(2, 3), f"./{part(2, 3)}", part(2, 3).removesuffix(".part"), "link.h5"]
)
def test_no_output_replaces_a_share(separatrix, folder, output):
    """Neither the new file nor its working file replaces a share, not even with --force."""
    (folder / "link.h5.part").symlink_to(part(2, 3))
    before = listing(folder)
    outcome = run(separatrix, "merge", output, *(part(i, 3) for i in (1, 2, 3)), "--force", folder=folder)
    assert (outcome.code, outcome.out) == (64, "")
    assert f"would replace the share '{part(2, 3)}'" in outcome.err
    assert listing(folder) == before


def test_a_merge_that_was_killed_begins_again(separatrix, folder):
    """The message names no option that merge does not have."""
    (folder / "map.h5.part").write_text("a part")
    command = ["merge", "map.h5", *(part(i, 3) for i in (1, 2, 3))]
    outcome = run(separatrix, *command, folder=folder)
    assert outcome.code == 73
    assert "--force begins again" in outcome.err and "--resume" not in outcome.err
    succeed(separatrix, *command, "--force", folder=folder)
    assert differences(folder / "whole.h5", folder / "map.h5") == []


@pytest.mark.parametrize("value", ["0/3", "4/3", "1", "1/", "/3", "1/0", "-1/3", "1/3/5", "one/3", "1.0/3"])
def test_bad_shares(separatrix, tmp_path, value):
    write_case(tmp_path)
    outcome = run(separatrix, *COMMAND, "--shard", value, folder=tmp_path)
    assert outcome.code == 64
    assert f"'{value}'" in outcome.err and "I/N" in outcome.err
    assert list(listing(tmp_path)) == ["case.toml"]
