# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged values of a small file, which is stored without compression, are refused."""

import h5py
import pytest
import separatrix as sx
from program import succeed, write_case


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
