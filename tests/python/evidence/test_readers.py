# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A file of every kind in those readers of others that are installed; what makes it open everywhere."""

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import separatrix as sx
from program import succeed

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "scripts" / "evidence"))

import readers_check  # noqa: E402

# Dimensions without values of their own.
BARE = b"This is a netCDF dimension but not a netCDF variable."


@pytest.fixture(scope="module")
def kinds(separatrix, build_dir, source_dir, results, branch_file, tmp_path_factory) -> list[Path]:
    """A file of every kind, small; several of maps and of trajectories."""
    folder = tmp_path_factory.mktemp("kinds")
    files = {
        name: folder / f"{name}.h5" for name in ("boundary", "structure", "measures", "noise", "passage")
    }
    succeed(separatrix, "boundary", results["map"], "-o", files["boundary"], folder=folder)
    case = source_dir / "examples" / "structure_blocks_on_a_belt.toml"
    short = ("--set", "run.duration=3")
    succeed(separatrix, "trajectory", case, *short, "-o", files["structure"], folder=folder)
    with pytest.MonkeyPatch.context() as patch, sx.open_result(results["stack"]) as stack:
        patch.setenv("SEPARATRIX_LIBRARY", str(build_dir / "lib" / "libseparatrix.so"))
        sx.measures_along(stack, names="global_integrity", output=files["measures"], progress=False)
        some = {"duration": 0.5, "motions": 4, "impulses": (5.0, 0.1)}
        sx.noisy(source_dir / "examples" / "basin_viscous.toml", output=files["noise"], **some)
        some |= {"leaves": "impact", "x0": [0.0, 0.1], "v0": [0.0, 1.0]}
        sx.first_passage(source_dir / "examples" / "basin_viscous.toml", output=files["passage"], **some)
    made = (results[kind] for kind in ("map", "refined", "sweep", "points", "trajectory"))
    return [*made, branch_file, *files.values()]


def datasets(path: Path) -> dict[str, tuple[np.dtype, dict]]:
    """Type and attributes of all datasets of a file, by path."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: (
                found.update({name: (item.dtype, dict(item.attrs))})
                if isinstance(item, h5py.Dataset)
                else None
            )
        )
    return found


def test_there_is_a_file_of_every_kind(kinds):
    found = set()
    for path in kinds:
        with h5py.File(path) as file:
            found.add(file.attrs["kind"])
    assert found == set(sx.open.KINDS)


def test_nothing_in_a_file_stops_a_reader(kinds):
    """No texts beside attributes, no wide integers in the root, no variable called like a dimension."""
    for path in kinds:
        found = datasets(path)
        dimensions = set()
        for name, (_, attributes) in found.items():
            if attributes.get("CLASS") == b"DIMENSION_SCALE":
                dimensions.add(name.split("/")[-1])
        for name, (kind, attributes) in found.items():
            assert kind.kind in "iuf", f"{path}: {name}"
            assert "/" in name or kind.kind == "f" or kind.itemsize < 8, f"{path}: {name}"
            if "CLASS" not in attributes:
                assert name.split("/")[-1] not in dimensions, f"{path}: {name}"


def test_codes_have_their_meanings_in_every_group(kinds):
    for path in kinds:
        for name, (kind, attributes) in datasets(path).items():
            if attributes.get("NAME", b"").startswith(BARE) or kind != "int8":
                continue
            # a side of a saddle is a number, 1 or -1
            assert "flag_meanings" in attributes or name == "sets/direction", f"{path}: {name}"
            if "flag_meanings" in attributes:
                words = attributes["flag_meanings"].split()
                assert len(words) == len(np.atleast_1d(attributes["flag_values"])), f"{path}: {name}"


def test_no_number_stands_for_none(kinds):
    """What is not there is infinite or no number, never the largest number."""
    for path in kinds:
        with h5py.File(path) as file:
            for name in datasets(path):
                values = np.asarray(file[name][()], float)
                assert not (np.isfinite(values) & (np.abs(values) > 1e100)).any(), f"{path}: {name}"


def test_lengths_and_speeds_together_have_no_unit_of_one(kinds):
    path = next(one for one in kinds if one.stem == "boundary")
    with h5py.File(path) as file:
        assert (file["x0"].attrs["units"], file["v0"].attrs["units"]) == ("m", "m/s")
        assert file["error"].attrs["units"] == "SI"


@pytest.mark.parametrize("reader", readers_check.READERS, ids=lambda one: one.name)
def test_a_reader_reads_every_variable_of_every_kind(reader, kinds):
    there = readers_check.version(reader)
    if there is None:
        pytest.skip(f"{reader.name} is not installed")
    assert readers_check.missing(reader, there[0], kinds) == []


def test_the_page_has_the_line_of_every_reader(source_dir):
    page = (source_dir / "docs" / "readers.md").read_text()
    for reader in readers_check.READERS:
        assert any(
            line.startswith(f"| {reader.name} |") and line.endswith(f"| `{reader.line}` |")
            for line in page.splitlines()
        ), reader.name
