# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The same file content, bit for bit, however the work is shared."""

import os
from pathlib import Path

import h5py
import pytest
from program import CASE, KINDS, contents, differences, succeed, write_case

RANKS = {
    "map": [2, 3, 4, 7],
    "sweep": [2, 3, 4, 7],
    "points": [2, 7],
    "stack": [3, 7],
    "plane": [2, 4],
    "refined": [2, 7],
}
TILES = {
    "map": ["[1, 31]", "[4, 5]", "[19, 31]"],
    "stack": ["[3, 7, 11]", "[2, 1, 5]"],
    "plane": ["[13, 9]", "[5, 2]"],
    "refined": ["[8, 16]", "[16, 31]"],
}


@pytest.fixture(scope="module")
def serial_separatrix(source_dir: Path) -> Path:
    """The program without MPI: $SEPARATRIX_SERIAL_BUILD or build-serial/."""
    build = Path(os.environ.get("SEPARATRIX_SERIAL_BUILD", source_dir / "build-serial"))
    if not (build / "bin" / "separatrix").is_file():
        pytest.skip(f"{build} has no program")
    return build / "bin" / "separatrix"


@pytest.mark.parametrize(("kind", "ranks"), [(kind, ranks) for kind in RANKS for ranks in RANKS[kind]])
def test_the_number_of_ranks_does_not_matter(mpi_separatrix, tmp_path, results, kind, ranks):
    output = tmp_path / f"{kind}_{ranks}.h5"
    succeed(mpi_separatrix, *KINDS[kind], "-o", output, folder=results["map"].parent, ranks=ranks)
    assert differences(results[kind], output) == []
    with h5py.File(output) as file:
        assert file["provenance"].attrs["ranks"] == ranks


@pytest.mark.parametrize(("kind", "tile"), [(kind, tile) for kind in TILES for tile in TILES[kind]])
def test_the_shape_of_the_tiles_does_not_matter(mpi_separatrix, tmp_path, results, kind, tile):
    output = tmp_path / f"{kind}_{tile}.h5"
    command = [*KINDS[kind], "--set", f"grid.tile={tile}", "-o", output]
    succeed(mpi_separatrix, *command, folder=results["map"].parent, ranks=2)
    assert differences(results[kind], output) == []
    with h5py.File(output) as file:
        assert str(file["tiles/tile_shape"][()].tolist()) == tile


@pytest.mark.parametrize(("kind", "per_node"), [("map", 1), ("map", 2), ("sweep", 2), ("points", 1)])
def test_the_nodes_do_not_matter(mpi_separatrix, tmp_path, results, kind, per_node):
    output = tmp_path / f"{kind}_nodes_of_{per_node}.h5"
    tile = ["--set", "grid.tile=[2, 7]"] if kind == "map" else []
    command = [*KINDS[kind], *tile, "--ranks-per-node", per_node, "-o", output]
    succeed(mpi_separatrix, *command, folder=results["map"].parent, ranks=4)
    assert differences(results[kind], output) == []


@pytest.mark.parametrize("kind", KINDS)
def test_the_serial_build_gives_the_same(serial_separatrix, tmp_path, results, kind):
    output = tmp_path / f"{kind}_serial.h5"
    succeed(serial_separatrix, *KINDS[kind], "-o", output, folder=results["map"].parent)
    assert differences(results[kind], output) == []


def test_a_second_run_gives_the_same(separatrix, tmp_path, results):
    output = tmp_path / "again.h5"
    succeed(separatrix, *KINDS["map"], "-o", output, folder=results["map"].parent)
    assert differences(results["map"], output) == []


def test_the_title_and_nothing_else_follows_the_title(separatrix, tmp_path, results):
    output = tmp_path / "titled.h5"
    succeed(separatrix, *KINDS["map"], "--set", 'title="Other"', "-o", output, folder=results["map"].parent)
    assert differences(results["map"], output) == ["@title"]


def test_a_parameter_changes_what_is_compared(separatrix, tmp_path, results):
    output = tmp_path / "other.h5"
    succeed(
        separatrix,
        *KINDS["map"],
        "--set",
        "contact.restitution=0.51",
        "-o",
        output,
        folder=results["map"].parent,
    )
    changed = differences(results["map"], output)
    assert {"amplitude", "amplitude@checksum", "catalogue/x"} <= set(changed)
    assert not {"x0", "v0", "x0@units"} & set(changed)


@pytest.mark.parametrize("text", ["case_text", "resolved_case"])
def test_the_case_in_the_file_gives_the_same_map(separatrix, tmp_path, results, text):
    with h5py.File(results["map"]) as file:
        case = file["provenance"].attrs[text]
    if text == "case_text":
        assert case == CASE
    write_case(tmp_path, case, f"{text}.toml")
    output = tmp_path / f"{text}.h5"
    succeed(separatrix, "basin", f"{text}.toml", "-o", output, folder=tmp_path)
    assert differences(results["map"], output) == []
    assert len(contents(output)) > 20
