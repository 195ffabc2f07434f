# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening result files: names, units, tables, codes, refusals."""

import os
from pathlib import Path

import h5py
import numpy as np
import pytest
from sample_files import WORD_IMPACT, write_basin, write_points, write_sweep, write_trajectory
from separatrix import (
    SeparatrixError,
    decode_flags,
    decode_word,
    decode_words,
    flag_names,
    open_result,
    table,
)
from separatrix.figures.caption import describe_case, resolved_case


@pytest.fixture
def basin(tmp_path: Path) -> Path:
    """A map with unequal sizes in which attractor 2 sits at one known point."""
    attractor = np.ones((5, 3, 2), dtype=int)
    attractor[4, 1, 0] = 2
    axes = {"x0": np.linspace(-1, 1, 5), "v0": np.linspace(-6, 6, 3), "drive_ratio": np.array([1.1, 1.2])}
    return write_basin(tmp_path / "basin.h5", axes, attractor)


def change(path: Path, **attributes: object) -> Path:
    with h5py.File(path, "r+") as file:
        for name, value in attributes.items():
            file.attrs[name] = value
    return path


def test_dimensions_coordinates_and_units(basin: Path) -> None:
    with open_result(basin) as result:
        assert result.regime.dims == ("x0", "v0", "drive_ratio")
        assert dict(result.sizes) == {"x0": 5, "v0": 3, "drive_ratio": 2, "entry": 4}
        np.testing.assert_array_equal(result.x0, np.linspace(-1, 1, 5))
        assert result.x0.attrs["units"] == "m"
        assert result.settle_time.attrs["units"] == "s"
        assert result.regime.dtype == np.int8
        assert result.attrs["kind"] == "basin"


def test_a_value_is_found_at_its_coordinates(basin: Path) -> None:
    with open_result(basin) as result:
        where = result.attractor.sel(x0=1.0, v0=0.0, drive_ratio=1.1, method="nearest")
        assert int(where) == 2
        assert int((result.attractor == 2).sum()) == 1


def test_every_kind_opens(tmp_path: Path) -> None:
    for kind, write in (
        ("sweep", lambda p: write_sweep(p, np.linspace(0.7, 1.8, 23))),
        ("trajectory", write_trajectory),
        ("points", write_points),
    ):
        with open_result(write(tmp_path / f"{kind}.h5")) as result:
            assert result.attrs["kind"] == kind
            assert all(
                "units" in variable.attrs
                for name, variable in result.data_vars.items()
                if name != "limits_name"
            )


def test_catalogue_is_a_table(basin: Path) -> None:
    with open_result(basin) as result:
        catalogue = table(result, "catalogue")
        assert list(catalogue.attractor.values) == [1, 2, 1, 2]
        assert list(catalogue.slice.values) == [0, 0, 1, 1]
        assert table(result, "limits").sizes == {}


def test_limits_are_a_table_of_names_and_brackets(tmp_path: Path) -> None:
    with open_result(write_sweep(tmp_path / "sweep.h5", np.linspace(0.7, 1.8, 23))) as result:
        limits = table(result, "limits")
        assert list(limits.name.values) == [
            "impacts_start_up",
            "impacts_stop_up",
            "impacts_start_down",
            "impacts_stop_down",
        ]
        assert (limits.lower < limits.upper).all()


def test_resolved_case_is_parsed_and_described(basin: Path) -> None:
    with open_result(basin) as result:
        assert resolved_case(result)["friction"]["law"] == "coulomb"
        assert result.attrs["provenance_ranks"] == 2
        text = "; ".join(describe_case(result))
        assert text.startswith(r"Coulomb friction, $\mu$ = 0.1, $\mu_s$ = 0.12")
        # the ratio is an axis of this map
        assert "omega" not in text
        result.attrs["resolved_case"] = "[friction"
        assert describe_case(result) == []


def test_codes_become_text(basin: Path) -> None:
    with open_result(basin) as result:
        assert flag_names(result.regime)[4] == "mixed"
        regime = decode_flags(result.regime)
        assert regime.dims == result.regime.dims
        assert str(regime.values[4, 1, 0]) == "impact"
        assert set(regime.values.ravel()) == {"impact", "non_impact"}
        words = decode_words(result.event_word)
        assert words.values[4, 1, 0] == "R."
        assert words.values[0, 0, 0] == "."


@pytest.mark.parametrize("text", ["", ".", "R.", "RRL.", "SC.D.", "R.R.R.R.R.R.R.R.R+"])
def test_a_word_survives_packing(text: str) -> None:
    codes = {"R": 1, "L": 2, "S": 3, "C": 4, "D": 5, "+": 6, ".": 7}
    packed = sum(codes[symbol] << 3 * index for index, symbol in enumerate(text))
    assert decode_word(np.int64(packed)) == text


def test_word_of_the_samples() -> None:
    assert decode_word(WORD_IMPACT) == "R."


def test_an_unknown_code_is_shown_as_its_number(tmp_path: Path) -> None:
    path = write_points(tmp_path / "points.h5", 4)
    with h5py.File(path, "r+") as file:
        file["regime"][0] = 99
    with open_result(path) as result:
        assert decode_flags(result.regime).values[0] == "99"


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"format_version": 3}, "format_version 3"),
        ({"format": "other"}, "not a Separatrix file"),
        ({"kind": "soup"}, "unknown kind 'soup'; known kinds: basin"),
        ({"complete": 0}, "not complete"),
    ],
)
def test_other_files_are_refused(basin: Path, attributes: dict, message: str) -> None:
    with pytest.raises(SeparatrixError, match=message) as caught:
        open_result(change(basin, **attributes))
    assert caught.value.code == 65
    assert str(basin) in str(caught.value)


def test_fixed_length_attributes_are_read(basin: Path) -> None:
    with open_result(change(basin, format=np.bytes_("separatrix  "), kind=np.array([b"basin "]))) as result:
        assert result.attrs["kind"] == "basin"


def test_a_cut_file_is_called_cut(basin: Path) -> None:
    whole = basin.read_bytes()
    basin.write_bytes(whole[:-9])
    with pytest.raises(SeparatrixError, match=f"is cut: {len(whole) - 9} of {len(whole)} bytes") as caught:
        open_result(basin)
    assert caught.value.code == 65


def test_missing_file_and_no_hdf5(tmp_path: Path) -> None:
    with pytest.raises(SeparatrixError, match="no such file") as caught:
        open_result(tmp_path / "absent.h5")
    assert caught.value.code == 66
    with pytest.raises(SeparatrixError, match="a folder, expected a file") as caught:
        open_result(tmp_path)
    assert caught.value.code == 66
    os.mkfifo(tmp_path / "pipe.h5")
    with pytest.raises(SeparatrixError, match="not a regular file"):
        open_result(tmp_path / "pipe.h5")
    text = tmp_path / "text.h5"
    text.write_text("not HDF5")
    with pytest.raises(SeparatrixError, match="cannot be read as HDF5") as caught:
        open_result(text)
    assert caught.value.code == 65
