# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results as tables: in memory, as CSV, and as Parquet."""

import sys
from pathlib import Path

import numpy as np
import pandas
import pytest
import separatrix as sx
import xarray as xr
from sample_files import write_basin, write_sweep, write_trajectory


@pytest.fixture
def computed(source_dir: Path, library: Path) -> xr.Dataset:
    """A map that was computed, and so has the case that its attractors need."""
    return sx.basin(source_dir / "examples/basin_coulomb.toml", x0=6, v0=5, progress=False)


@pytest.fixture
def basin(tmp_path: Path) -> Path:
    """A map with unequal sizes in which attractor 2 sits at one known point."""
    attractor = np.ones((5, 3), dtype=int)
    attractor[4, 1] = 2
    return write_basin(
        tmp_path / "basin.h5", {"x0": np.linspace(-1, 1, 5), "v0": np.linspace(-6, 6, 3)}, attractor
    )


def test_a_map_has_a_row_for_each_point_in_the_order_of_its_arrays(basin: Path) -> None:
    with sx.open_result(basin) as result:
        rows = result.separatrix.table("attractor")
        assert len(rows) == 15 and list(rows.columns[:2]) == ["x0", "v0"]
        assert rows["x0"].to_numpy() == pytest.approx(np.repeat(np.linspace(-1, 1, 5), 3))
        assert rows.loc[rows["attractor"] == 2, ["x0", "v0"]].to_numpy().tolist() == [[1.0, 0.0]]
        assert rows["regime"].tolist().count("impact") == 1
        assert rows["event_word"][13] == "R."
        assert rows.attrs["units"]["x0"] == "m" and rows.attrs["units"]["settle_time"] == "s"
        assert not [name for name in rows if name.startswith("catalogue")]


def test_each_group_of_dimensions_is_a_table(tmp_path: Path) -> None:
    with sx.open_result(write_sweep(tmp_path / "sweep.h5", np.linspace(0.7, 1.8, 4))) as result:
        for name in ("regime", "branch_regime", "section_x"):
            rows = result.separatrix.table(name)
            assert len(rows) == result[name].size
            assert set(result[name].dims) <= set(rows.columns) and name in rows
    with sx.open_result(write_trajectory(tmp_path / "motion.h5")) as result:
        samples = result.separatrix.table()
        assert samples["time"].tolist() == result["time"].values.tolist()
        assert samples["x"].tolist() == result["x"].values.tolist()
        events = result.separatrix.table("event_kind")
        assert len(events) == result.sizes["event"]
        assert events["event_kind"].tolist() == sx.decode_flags(result["event_kind"]).values.tolist()
        with pytest.raises(sx.SeparatrixError, match=r"^table: found 'nothing', allowed drive, event_kind"):
            result.separatrix.table("nothing")


def test_csv_has_every_bit(basin: Path, tmp_path: Path) -> None:
    with sx.open_result(basin) as result:
        result = result.load()
        result["settle_time"] = result["settle_time"].astype(float) + 1 / 3
        path = result.separatrix.save_table(tmp_path / "points.csv", "attractor")
        read = pandas.read_csv(path, dtype=str)
        rows = result.separatrix.table("attractor")
        np.testing.assert_array_equal(
            read["settle_time"].map(float).to_numpy(), rows["settle_time"].to_numpy()
        )
        assert list(read.columns) == list(rows.columns)


def test_a_map_without_a_name_has_its_attractors(computed: xr.Dataset, tmp_path: Path) -> None:
    rows = computed.separatrix.table()
    pandas.testing.assert_frame_equal(rows, computed.separatrix.attractors)
    read = pandas.read_csv(computed.separatrix.save_table(tmp_path / "attractors.csv"))
    assert read["attractor"].tolist() == rows.index.tolist()
    assert read["count"].sum() == 30


def test_files_that_exist_and_other_suffixes_are_refused(basin: Path, tmp_path: Path) -> None:
    with sx.open_result(basin) as result:
        path = tmp_path / "kept.csv"
        path.write_text("kept")
        with pytest.raises(sx.SeparatrixError, match=r"kept.csv: exists; overwrite=True replaces it"):
            result.separatrix.save_table(path, "regime")
        assert path.read_text() == "kept"
        assert result.separatrix.save_table(path, "regime", overwrite=True).read_text().startswith("x0,v0,")
        with pytest.raises(sx.SeparatrixError, match=r"found suffix '.xls', allowed .csv, .parquet"):
            result.separatrix.save_table(tmp_path / "table.xls", "regime")
        with pytest.raises(sx.SeparatrixError, match=r"cannot be written \(No such file"):
            result.separatrix.save_table(tmp_path / "nowhere" / "table.csv", "regime")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["basin.h5", "kept.csv"]


def test_parquet_without_its_package_names_what_is_missing(
    basin: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with (
        sx.open_result(basin) as result,
        pytest.raises(sx.SeparatrixError, match="needs the package pyarrow"),
    ):
        result.separatrix.save_table(tmp_path / "table.parquet", "regime")
    assert not (tmp_path / "table.parquet").exists()


def test_parquet_has_every_bit_and_the_units(basin: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    with sx.open_result(basin) as result:
        path = result.separatrix.save_table(tmp_path / "points.parquet", "attractor")
        read, rows = pandas.read_parquet(path), result.separatrix.table("attractor")
        pandas.testing.assert_frame_equal(read, rows)
        assert read.attrs["units"] == rows.attrs["units"]
