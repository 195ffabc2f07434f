# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""SEPARATRIX_ALIGNMENT: where the large pieces of a file begin, and nothing else."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from program import run, succeed, write_case

BYTES = 2**13
GRID = ("--set", "axis[1].count=400", "--set", "axis[2].count=300", "--set", "grid.tile=[50,300]")


def pieces(path: Path) -> list[tuple[int, int]]:
    """Where all pieces of data of a file begin, and how long they are."""
    found = []

    def collect(_: str, item: object) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        if item.chunks:
            stored = [item.id.get_chunk_info(i) for i in range(item.id.get_num_chunks())]
            found.extend((chunk.byte_offset, chunk.size) for chunk in stored)
        elif item.id.get_offset() is not None:
            found.append((item.id.get_offset(), item.id.get_storage_size()))

    with h5py.File(path) as file:
        file.visititems(collect)
    return found


@pytest.mark.parametrize("ranks", [0, 2])
def test_large_pieces_are_aligned_and_the_contents_are_the_same(
    ranks: int, separatrix: Path, mpi_separatrix: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = mpi_separatrix if ranks else separatrix
    write_case(tmp_path)
    succeed(program, "basin", "case.toml", *GRID, "-o", "plain.h5", folder=tmp_path, ranks=ranks)
    monkeypatch.setenv("SEPARATRIX_ALIGNMENT", str(BYTES))
    succeed(program, "basin", "case.toml", *GRID, "-o", "aligned.h5", folder=tmp_path, ranks=ranks)
    succeed(separatrix, "info", "aligned.h5", folder=tmp_path)
    large = [at for at, size in pieces(tmp_path / "aligned.h5") if size >= BYTES]
    assert len(large) > 5 and not any(at % BYTES for at in large)
    assert any(at % BYTES for at, size in pieces(tmp_path / "plain.h5") if size >= BYTES)
    with h5py.File(tmp_path / "plain.h5") as plain, h5py.File(tmp_path / "aligned.h5") as aligned:
        for name in ("regime", "attractor", "settle_time", "x_max"):
            np.testing.assert_array_equal(plain[name][...], aligned[name][...])


@pytest.mark.parametrize("text", ["4M", "0", "-4096", str(2**31)])
def test_what_is_no_number_of_bytes_is_refused(
    text: str, separatrix: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SEPARATRIX_ALIGNMENT", text)
    write_case(tmp_path)
    ended = run(separatrix, "basin", "case.toml", "-o", "map.h5", folder=tmp_path)
    assert ended.code == 64
    assert f"SEPARATRIX_ALIGNMENT: found {text}, allowed a number of bytes from 1 to 1073741824" in ended.err
