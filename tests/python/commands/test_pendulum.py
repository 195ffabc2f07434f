# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A pendulum that goes round: files, logs and figures speak of an angle on a circle."""

import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
import separatrix as sx
from separatrix.figures import trajectory
from separatrix.open import open_result

SMALL = ["--set", "axis[1].count=6", "--set", "axis[2].count=5"]


@pytest.fixture
def run(separatrix: Path, source_dir: Path, tmp_path: Path):
    """Runs a command on the example and returns its file and what it printed."""

    def run_it(command: str, *options: str) -> tuple[Path, str]:
        out = tmp_path / f"{command}.h5"
        case = source_dir / "examples" / "basin_pendulum.toml"
        ended = subprocess.run(
            [separatrix, command, case, "-o", out, *options], check=True, capture_output=True, text=True
        )
        return out, ended.stdout

    return run_it


def test_both_senses_of_rotation_are_found(run):
    out, printed = run("basin", *SMALL)
    with h5py.File(out) as file:
        catalogue = file["catalogue"]
        assert sorted(catalogue["rotation_number"][:]) == [-1.0, 1.0]
        assert list(catalogue["period"][:]) == [1, 1]
        assert set(np.unique(file["attractor"])) == {1, 2}
        units = {name: file[name].attrs["units"] for name in ("x0", "v0", "x_max", "v_max", "amplitude")}
    assert set(units.values()) == {b"rad", b"rad/s"} or set(units.values()) == {"rad", "rad/s"}
    assert "amplitude 3.1416 rad" in printed
    assert "rotation number -1.000" in printed


PARTS = """
[body.first]
mass = 1
[body.second]
mass = 1
[spring.weight]
law = "pendulum"
between = ["first"]
moment = 9.81
[spring.coupling]
between = ["first", "second"]
stiffness = 0.5
[start]
x0 = "40 deg"
[run]
duration = 20
"""


def test_pendulums_in_parts_are_angles_and_have_no_drive(separatrix, tmp_path):
    """Units of the log, the file and the figure; no drive period and no impacts where there is neither."""
    (tmp_path / "case.toml").write_text(PARTS)
    command = [separatrix, "trajectory", tmp_path / "case.toml", "-o", tmp_path / "out.h5"]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert " rad, v_max " in printed
    assert "impacts" not in printed
    assert "drive" not in printed
    # the mode of the coupling alone is none of the machine
    assert "unit of time" in printed
    pendulum = sx.trajectory(tmp_path / "case.toml", duration=1.0)
    assert [pendulum[name].attrs["units"] for name in ("x", "event_x", "v")] == ["rad", "rad", "rad/s"]
    assert pendulum.attrs["driven"] == 0
    with open_result(tmp_path / "out.h5") as result:
        assert result.attrs["driven"] == 0
        assert {result[name].attrs["units"] for name in ("x", "first_x", "second_x")} == {"rad"}
        assert {result[name].attrs["units"] for name in ("v", "first_v", "second_v")} == {"rad/s"}
        figure = trajectory.phase_portrait(result, "pendulums")
        assert "rad" in figure.axes[0].get_xlabel()


def test_the_catalogue_of_a_map_of_angles_is_in_rad(run):
    """As the map itself is; multipliers and crank angles keep their units."""
    out, _ = run("basin", *SMALL)
    with h5py.File(out) as file:
        units = {name: file[name].attrs["units"] for name in ("amplitude", "catalogue/x", "catalogue/v")}
        units["catalogue/amplitude"] = file["catalogue/amplitude"].attrs["units"]
    assert units == {
        "amplitude": "rad", "catalogue/x": "rad", "catalogue/v": "rad/s", "catalogue/amplitude": "rad"
    }  # fmt: skip


def test_a_trajectory_goes_on_and_its_portrait_goes_round(run):
    options = ["--set", 'start.x0="90 deg"', "--set", "run.duration=300.0"]
    out, printed = run("trajectory", *options)
    assert "3.14159 rad" in printed
    with open_result(out) as result:
        assert abs(result.attrs["rotation_number"]) == 1
        x = result["x"].values
        assert np.abs(np.diff(x)).max() < np.pi
        assert np.ptp(x) > 20 * np.pi
        figure = trajectory.phase_portrait(result, "pendulum")
        drawn = figure.axes[0].lines[0].get_xdata()
        assert np.nanmax(np.abs(drawn)) <= np.pi
        assert np.isnan(drawn).sum() >= 9
        assert "rad" in figure.axes[0].get_xlabel()


def test_lengths_are_refused_where_an_angle_is_meant(separatrix, source_dir, tmp_path):
    case = source_dir / "examples" / "basin_pendulum.toml"
    command = [separatrix, "basin", case, "-o", tmp_path / "a.h5", "--set", 'start.x0="1 m"']
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 65
    assert "deg" in ended.stderr


def test_a_sweep_counts_the_turns(run, source_dir, separatrix, tmp_path):
    text = (source_dir / "examples" / "basin_pendulum.toml").read_text().split("[[axis]]")[0]
    text += '[sweep]\nparameter = "friction.damping"\nfrom = 0.5\nto = 0.52\ncount = 2\nsamples = 8\n'
    text += "starts = [0, 0]\nx0 = [0, 0]\nv0 = [0, 0]\n"
    case = tmp_path / "sweep.toml"
    case.write_text(text)
    out = tmp_path / "sweep.h5"
    subprocess.run([separatrix, "sweep", case, "-o", out], check=True, capture_output=True)
    with h5py.File(out) as file:
        assert (np.abs(file["rotation_number"][:]) == 1).all()
        assert (file["period"][:] == 1).all()
        assert (np.abs(file["section_x"][:]) <= np.pi).all()


STOPS = """
[contact.stops]
law = "newton"
between = ["first"]
lower = "{0}"
upper = "45 {1}"
restitution = 0.5
"""


def test_stops_of_an_angle_are_angles(separatrix, tmp_path):
    """Also those of a body that a spring joins to a pendulum, and of one body alone; a length is rejected."""
    (tmp_path / "case.toml").write_text(PARTS + STOPS.format("-0.7 rad", "deg").replace("first", "second"))
    run = [separatrix, "trajectory", "case.toml", "--dry-run"]
    subprocess.run(run, check=True, cwd=tmp_path)
    (tmp_path / "case.toml").write_text(PARTS + STOPS.format("-0.7 rad", "mm"))
    ended = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == 65
    assert "'contact.stops.upper': found \"45 mm\", allowed a number in rad" in ended.stderr


def test_an_axis_of_stops_of_one_body_is_an_angle(separatrix, source_dir):
    case = source_dir / "examples" / "basin_pendulum.toml"
    stop = ['contact.law="newton"', 'contact.upper="90 deg"', "contact.restitution=0.5"]
    axis = ['axis[1].name="contact.upper"', 'axis[1].from="80 deg"', 'axis[1].to="90 mm"']
    options = [word for one in (*stop, *axis) for word in ("--set", one)]
    ended = subprocess.run([separatrix, "basin", case, "--dry-run", *options], capture_output=True, text=True)
    assert ended.returncode == 65
    assert ended.stderr.count("'") == 2, ended.stderr
    assert "'axis[1].to': found \"90 mm\", allowed a number in rad" in ended.stderr
