# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists of starts of machines of several bodies."""

import h5py
import pytest
from program import run, succeed

LIST = """body.first.v0,x0,v0,body.first.x0
0.5,0.25,-1,0.125
0,-1,0.75,-0.5
"""
SHORT = ["--set", "run.duration=40", "--set", "run.window=10"]


@pytest.fixture
def starts(tmp_path):
    """A list that starts both bodies."""
    path = tmp_path / "starts.csv"
    path.write_text(LIST)
    return path


def test_points_start_every_body(separatrix, source_dir, starts, tmp_path):
    """A point is the trajectory of the case with its numbers in it, and the table lists all of them."""
    case = source_dir / "examples" / "structure_two_masses.toml"
    output, table = tmp_path / "points.h5", tmp_path / "ends.csv"
    succeed(
        separatrix, "points", case, "--list", starts, "--csv", table, "-o", output, *SHORT, folder=tmp_path
    )
    names = LIST.splitlines()[0].split(",")
    with h5py.File(output) as file:
        for row, line in enumerate(LIST.splitlines()[1:]):
            single = tmp_path / f"single_{row}.h5"
            values = [
                f"{name if '.' in name else 'start.' + name}={value}"
                for name, value in zip(names, line.split(","), strict=True)
            ]
            settings = [word for value in values for word in ("--set", value)]
            succeed(separatrix, "trajectory", case, "-o", single, *SHORT, *settings, folder=tmp_path)
            with h5py.File(single) as motion:
                assert abs(file["x"][row] - motion["x"][-1]) < 1e-12
                assert abs(file["v"][row] - motion["v"][-1]) < 1e-12
            assert file["body_first_x0"][row] == float(line.split(",")[3])
    assert table.read_text().splitlines()[0].startswith("x0,v0,ratio,body.first.v0,body.first.x0,x,v,")
    assert "0 differ from the file" in succeed(separatrix, "verify", output, folder=tmp_path).out


@pytest.mark.parametrize("column", ["body.third.x0", "body.first.mass", "body.first.x0"])
def test_columns_of_no_body_are_refused(separatrix, source_dir, starts, tmp_path, column):
    """A body that is not there, a parameter that is no start, a column twice: code 65."""
    case = source_dir / "examples" / "structure_two_masses.toml"
    starts.write_text(LIST.replace("body.first.v0", column))
    ended = run(
        separatrix, "points", case, "--list", starts, "-o", tmp_path / "points.h5", *SHORT, folder=tmp_path
    )
    assert ended.code == 65
    assert f"column '{column}'" in ended.err
    assert not (tmp_path / "points.h5").exists()
