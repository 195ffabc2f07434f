# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases with keys of format version 1 are those of today in Python, too."""

from pathlib import Path

import h5py
import separatrix as sx
from separatrix.view.files import ResultFile

HAMMER = Path(__file__).parents[3] / "examples" / "hammer.toml"


def test_a_case_with_older_keys_is_the_same_case() -> None:
    case = sx.load(HAMMER)
    older = HAMMER.read_text().replace("impulse_time =", "blow_time =").replace("impulse =", "blow =")
    assert "blow = 1" in older
    assert sx.Case.from_text(older) == case


def test_values_of_parameters_are_found_by_their_older_names() -> None:
    case = sx.load(HAMMER)
    assert case.in_si("body.blow", "2 N s") == case.in_si("body.impulse", "2 N s") == 2.0
    assert case.in_si("body.blow_time", "250 ms") == 0.25


def test_an_axis_with_an_older_name_is_that_of_the_parameter(separatrix: Path, tmp_path: Path) -> None:
    """In the viewer and in Python: sliders and motions find the parameter by its name of today."""
    path = tmp_path / "old.h5"
    values = {"body.impulse": [0.5, 1.0], "body.impulse_time": [0.1, 0.2]}
    sx.basin(sx.load(HAMMER), values, output=path, progress=False)
    with h5py.File(path, "r+") as file:
        for name in ("impulse", "impulse_time"):
            file.move(f"body_{name}", f"body_{name.replace('impulse', 'blow')}")
        group = file["provenance"].attrs
        text = group["resolved_case"]
        text = text.decode() if isinstance(text, bytes) else text
        group["resolved_case"] = text.replace("impulse", "blow")
        del group["attributes_checksum"]
        file.attrs["format_version"] = 1
        assert "body.blow_time" in group["resolved_case"]
    with sx.open_result(path) as result:
        assert result["regime"].dims == ("body_impulse", "body_impulse_time")
        assert result.separatrix.plot("regime").axes
    file = ResultFile(path)
    assert [axis["path"] for axis in file.axes] == ["body.impulse", "body.impulse_time"]
