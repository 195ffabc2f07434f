# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged values of a small file, which is stored without compression, are refused."""

import h5py
import pytest
import separatrix as sx
from program import run, succeed, write_case


@pytest.fixture(scope="module")
def small(separatrix, tmp_path_factory):
    """A map of a few points."""
    folder = tmp_path_factory.mktemp("small")
    write_case(folder)
    few = ["--set", "axis[1].count=7", "--set", "axis[2].count=9"]
    succeed(separatrix, "basin", "case.toml", *few, "-o", "map.h5", folder=folder)
    return folder / "map.h5"


def offsets(path) -> dict[str, int]:
    """Where the values of each array begin in the file."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: (
                found.update({name: item.id.get_offset()})
                if isinstance(item, h5py.Dataset) and "checksum" in item.attrs and item.id.get_offset()
                else None
            )
        )
    return found


def test_every_array_is_compared_with_its_checksum(small, tmp_path):
    values = offsets(small)
    assert {"regime", "x_max", "catalogue/period"} <= set(values)
    whole = small.read_bytes()
    for name, offset in values.items():
        damaged = bytearray(whole)
        damaged[offset] ^= 1
        path = tmp_path / "damaged.h5"
        path.write_bytes(damaged)
        with pytest.raises(sx.SeparatrixError, match=f"is damaged.*/{name}"):
            sx.open_result(path)
    with sx.open_result(small) as result:
        assert result["regime"].shape == (7, 9)


@pytest.fixture(scope="module")
def compressed(separatrix, tmp_path_factory):
    """A map that is stored in compressed chunks."""
    folder = tmp_path_factory.mktemp("compressed")
    write_case(folder)
    many = ["--set", "axis[1].count=90", "--set", "axis[2].count=80"]
    succeed(separatrix, "basin", "case.toml", *many, "-o", "map.h5", folder=folder)
    return folder / "map.h5"


def test_values_that_cannot_be_decompressed_name_the_file_and_the_array(compressed, tmp_path):
    with h5py.File(compressed) as file:
        chunk = file["x_max"].id.get_chunk_info(0)
    damaged = bytearray(compressed.read_bytes())
    damaged[chunk.byte_offset + chunk.size // 2] ^= 255
    path = tmp_path / "damaged.h5"
    path.write_bytes(damaged)
    with sx.open_result(path) as result, sx.open_result(compressed) as whole:
        assert result["regime"].equals(whole["regime"])
        for read in (lambda: result["x_max"].values, lambda: result["x_max"][3, 4].item(), result.load):
            with pytest.raises(sx.SeparatrixError, match=r"damaged\.h5: is damaged \(/x_max: "):
                read()


def test_every_text_is_compared_with_the_checksum_of_the_attributes(small, tmp_path):
    """HDF5 stores texts without a checksum."""
    whole = small.read_bytes()
    texts = [b"non_impact impact", b"label of the attractor", b"restitution = 0.5", b"coulomb"]
    found = [text for text in texts if text in whole]
    assert len(found) >= 2
    for text in found:
        path = tmp_path / "damaged.h5"
        path.write_bytes(whole.replace(text, text[:-1] + bytes([text[-1] ^ 1]), 1))
        with pytest.raises(sx.SeparatrixError, match="its attributes do not match their checksum"):
            sx.open_result(path)


def test_attributes_that_are_gone_are_damage(small, separatrix, tmp_path):
    path = tmp_path / "damaged.h5"
    path.write_bytes(small.read_bytes())
    with h5py.File(path, "r+") as file:
        file.move("provenance", "provenancd")
    with pytest.raises(sx.SeparatrixError, match="the checksum of its attributes is missing"):
        sx.open_result(path)
    outcome = run(separatrix, "info", path.name, folder=tmp_path)
    assert outcome.code == 74 and "the checksum of its attributes is missing" in outcome.err
