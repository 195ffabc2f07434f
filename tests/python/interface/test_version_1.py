# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of format version 1 open wherever those of today do.

`version_1.tar.xz` was written by commit ae8bca6f: a small file of each kind, and the two shares of a map.
"""

import tarfile
from pathlib import Path

import h5py
import numpy as np
import pytest
import separatrix as sx
from program import meanings, run, succeed
from separatrix.view.files import ResultFile

KINDS = ("basin", "refined", "sweep", "points", "branches", "boundary", "trajectory", "measures")
SHARES = tuple(f"share.h5.shard-{i}-of-2.part" for i in (1, 2))
DRAWN = {
    "basin": "event_word",
    "refined": "origin",
    "boundary": "boundary",
    "measures": "erosion",
    "sweep": "bifurcation",
}


@pytest.fixture(scope="module")
def old(tmp_path_factory) -> Path:
    """The folder with the files."""
    folder = tmp_path_factory.mktemp("version_1")
    with tarfile.open(Path(__file__).with_name("version_1.tar.xz")) as archive:
        archive.extractall(folder, filter="data")
    assert {path.name for path in folder.iterdir()} == {*SHARES, *(f"{kind}.h5" for kind in KINDS)}
    for path in folder.iterdir():
        with h5py.File(path) as file:
            assert file.attrs["format_version"] == 1
    return folder


@pytest.mark.parametrize("kind", KINDS)
def test_python_opens_and_draws_it(old, kind):
    with sx.open_result(old / f"{kind}.h5") as result:
        result.load()
        assert result.attrs["kind"] == ("basin" if kind == "refined" else kind)
        assert result.separatrix.case.title.startswith(("Coulomb friction", "Impact oscillator"))
        assert result.separatrix.plot(DRAWN.get(kind)).axes
        if kind == "basin":
            assert set(sx.decode_words(result["event_word"]).values.ravel()) == {".", "R."}
            margins = result.separatrix.attractors["grazing_margin"]
            assert margins.isna().sum() == 1
            assert (margins.dropna() < 1).all()
        if kind == "trajectory":
            assert sx.flag_names(result["event_kind"])[12] == "impulse"
        if kind == "sweep":
            assert result["section_x"].dims[-1] == "sample"
            assert list(sx.table(result, "limits")["settled"].values) == [*["bracketed"] * 3, "not_known"]
        if kind == "boundary":
            assert result["sets_part"].max() > 1


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "measures"])
def test_the_viewer_opens_it(old, kind):
    described = ResultFile(old / f"{kind}.h5").describe()
    assert described["kind"] == ("basin" if kind == "refined" else kind)
    assert described["machine"]["contact"]["law"] == "newton"
    if kind == "sweep":
        assert {"section_x", "section_v"} <= set(ResultFile(old / "sweep.h5").series()[1])


@pytest.mark.parametrize("kind", KINDS)
def test_the_program_shows_and_verifies_it(separatrix, old, kind):
    shown = succeed(separatrix, "info", f"{kind}.h5", folder=old).out
    assert "format_version: 1" in shown
    assert ("impacts_start_up: " in shown) == (kind == "sweep")
    if kind != "measures":
        succeed(separatrix, "verify", f"{kind}.h5", "--sample", "5", folder=old)


def test_the_program_goes_on_from_a_map(separatrix, old, tmp_path):
    succeed(separatrix, "boundary", old / "basin.h5", "-o", "boundary.h5", folder=tmp_path)
    succeed(separatrix, "stability", old / "basin.h5", folder=tmp_path)
    with h5py.File(old / "boundary.h5") as was, h5py.File(tmp_path / "boundary.h5") as now:
        for name in ("x0", "v0", "error", "saddles/event_word"):
            np.testing.assert_array_equal(now[name], was[name], name)


def test_shares_are_refused(separatrix, old, tmp_path):
    outcome = run(separatrix, "merge", "map.h5", *(old / name for name in SHARES), folder=tmp_path)
    assert outcome.code == 76
    assert "the program that began it finishes it" in outcome.err
    assert not (tmp_path / "map.h5").exists()


def test_limits_are_the_same_as_codes(separatrix, old, tmp_path):
    with h5py.File(old / "sweep.h5") as was:
        (tmp_path / "case.toml").write_bytes(was["provenance/resolved_case"][()])
        succeed(separatrix, "sweep", "case.toml", "-o", "sweep.h5", folder=tmp_path)
        with h5py.File(tmp_path / "sweep.h5") as now:
            for name in ("limits/name", "limits/settled"):
                assert meanings(now[name]) == [text.decode() for text in was[name][()]]


def test_a_working_file_is_refused(separatrix, old, tmp_path):
    part = tmp_path / SHARES[0]
    part.write_bytes((old / SHARES[0]).read_bytes())
    with h5py.File(part) as file:
        (tmp_path / "case.toml").write_bytes(file["provenance/case_text"][()])
    again = ("basin", "case.toml", "-o", "share.h5", "--shard", "1/2", "--resume")
    outcome = run(separatrix, *again, folder=tmp_path)
    assert outcome.code == 76
    assert "format version 1, this program writes 2" in outcome.err
    assert part.read_bytes() == (old / SHARES[0]).read_bytes()


def test_a_later_version_is_refused(separatrix, old, tmp_path):
    path = tmp_path / "basin.h5"
    path.write_bytes((old / "basin.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = sx.variables.FORMAT_VERSION + 1
    outcome = run(separatrix, "info", path, folder=tmp_path)
    assert outcome.code == 65
    assert "found format_version 3, this program reads 1 to 2" in outcome.err
