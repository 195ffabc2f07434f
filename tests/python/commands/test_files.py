# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of real runs: readable by others, right way round, verified, and drawn."""

import os
import re
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from program import KINDS, meanings, run, succeed, write_case
from sample_files import EVENTS, MODES, REASONS, REGIMES
from separatrix.variables import FORMAT_VERSION

COORDINATES = {
    "map": {"x0": (19, "m"), "v0": (31, "m/s")},
    "stack": {"drive_ratio": (3, "1"), "x0": (7, "m"), "v0": (11, "m/s")},
    "plane": {"drive_ratio": (13, "1"), "friction_kinetic_coefficient": (9, "1")},
    "refined": {"x0": (19, "m"), "v0": (31, "m/s")},
    "sweep": {"drive_ratio": (7, "1")},
    "trajectory": {"time": (18001, "s")},
    "points": {},
}
SIZES = {
    "sweep": {"direction": 2, "drive_ratio": 7, "sample": 4, "start": 6},
    "points": {"point": 305},
}
# Dimensions that only count.
NUMBERINGS = (
    *("direction", "entry", "event", "limit", "point", "sample", "start"),
    *("coordinate", "cycle_point", "look", "look_column"),
)
TYPES = {
    "regime": "int8",
    "attractor": "int32",
    "reason": "int8",
    "period": "int16",
    "event_word": "float64",
    "origin": "int8",
}


@pytest.mark.parametrize("kind", KINDS)
def test_xarray_has_names_units_and_integers(results, kind):
    with xr.open_dataset(results[kind], engine="h5netcdf") as data:
        for name, (length, unit) in COORDINATES[kind].items():
            assert data[name].dims == (name,)
            assert data[name].size == length
            assert data[name].attrs["units"] == unit
        assert not [name for name in data.dims if "phony" in str(name)]
        for name, length in SIZES.get(kind, {}).items():
            assert data.sizes[name] == length
        for name, variable in data.data_vars.items():
            assert "units" in variable.attrs, name
            assert variable.attrs["long_name"], name
            kept_as = TYPES.get(str(name).removeprefix("branch_"))
            if kept_as:
                assert variable.dtype == kept_as, name
            if "flag_values" in variable.attrs:
                flags = np.atleast_1d(variable.attrs["flag_values"])
                assert flags.dtype == variable.dtype
                assert len(variable.attrs["flag_meanings"].split()) == len(flags)
                assert np.isin(variable.values, flags).all()
        if kind in ("map", "stack", "plane", "refined"):
            assert data["regime"].dims == tuple(COORDINATES[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_root_and_provenance(results, kind):
    with h5py.File(results[kind]) as file:
        for name in (
            "Conventions",
            "title",
            "source",
            "history",
            "references",
            "format",
            "kind",
            "date_created",
        ):
            assert isinstance(file.attrs[name], str), name
        assert file.attrs["Conventions"] == "CF-1.10"
        assert (file.attrs["format"], file.attrs["format_version"], file.attrs["complete"]) == (
            "separatrix",
            FORMAT_VERSION,
            1,
        )
        facts = file["provenance"].attrs
        for name in (
            "version",
            "commit",
            "compiler",
            "flags",
            "mpi",
            "hdf5",
            "command_line",
            "hosts",
            "case_identity",
        ):
            assert facts[name], name
        assert facts["ranks"] == 1
        assert facts["wall_seconds"] > 0
        assert facts["started"] <= facts["finished"]
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", facts["finished"])
        assert facts["case_text"] == (results[kind].parent / "case.toml").read_text()
        assert "[provenance]" not in facts["resolved_case"]


@pytest.mark.parametrize("kind", KINDS)
def test_checksums_are_crc_32_of_the_values(results, kind):
    with h5py.File(results[kind]) as file:
        names = [name for name, item in file.items() if isinstance(item, h5py.Dataset)]
        names += [f"{group}/{name}" for group in ("catalogue", "limits") for name in file.get(group, ())]
        names = [name for name in names if name.split("/")[-1] not in NUMBERINGS]
        assert len(names) >= 5
        for name in names:
            assert "checksum" in file[name].attrs, name
            assert zlib.crc32(file[name][()].tobytes()) == file[name].attrs["checksum"], name


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.skipif(shutil.which("h5dump") is None, reason="h5dump is not installed")
def test_h5dump_reads_the_headers(results, kind):
    dumped = subprocess.run(["h5dump", "-H", results[kind]], capture_output=True, text=True, check=True)
    assert 'DATASET "reason"' in dumped.stdout or kind == "trajectory"
    assert dumped.stderr == ""


@pytest.mark.parametrize("kind", ["map", "stack"])
def test_a_value_of_a_map_is_that_of_its_start(separatrix, tmp_path, results, kind):
    write_case(tmp_path)
    with xr.open_dataset(results[kind], engine="h5netcdf") as data:
        data.load()
    shape = data["regime"].shape
    random = np.random.default_rng(1)
    indices = [tuple(int(random.integers(n)) for n in shape) for _ in range(6)]
    seen = set()
    for i, index in enumerate(indices):
        point = data.isel(dict(zip(data["regime"].dims, index, strict=True)))
        options = [f"start.x0={float(point['x0'])!r}", f"start.v0={float(point['v0'])!r}"]
        if "drive_ratio" in point.coords:
            options.append(f"drive.ratio={float(point['drive_ratio'])!r}")
        options = [word for option in options for word in ("--set", option)]
        # Long enough to be on the attractor that the map names.
        command = ["trajectory", "case.toml", *options, "--set", "run.duration=120", "-o", f"{i}.h5"]
        succeed(separatrix, *command, folder=tmp_path)
        with h5py.File(tmp_path / f"{i}.h5") as file:
            facts = dict(file.attrs)
        regimes = data["regime"].attrs["flag_meanings"].split()
        assert regimes[int(point["regime"])] == facts["regime"]
        for name in ("amplitude", "x_max", "x_min", "v_max"):
            assert float(point[name]) == pytest.approx(facts[name], rel=2e-6)
        seen.add((facts["regime"], round(facts["amplitude"], 4)))
    assert len(seen) >= 2


def test_a_map_agrees_with_points_where_no_axis_is_a_start(separatrix, tmp_path, results):
    write_case(tmp_path)
    with xr.open_dataset(results["plane"], engine="h5netcdf") as data:
        point = data.isel(drive_ratio=10, friction_kinetic_coefficient=2).load()
    options = [f"drive.ratio={float(point['drive_ratio'])!r}"]
    options += [f"friction.kinetic_coefficient={float(point['friction_kinetic_coefficient'])!r}"]
    options = [word for option in [*options, "run.duration=120"] for word in ("--set", option)]
    succeed(separatrix, "trajectory", "case.toml", *options, folder=tmp_path)
    with h5py.File(tmp_path / "case.trajectory.h5") as file:
        assert float(point["amplitude"]) == pytest.approx(file.attrs["amplitude"], rel=2e-6)
        assert float(point["v_max"]) == pytest.approx(file.attrs["v_max"], rel=2e-6)


def test_axes_have_exact_ends_and_equal_steps(results):
    with h5py.File(results["stack"]) as file:
        assert (file["drive_ratio"][0], file["drive_ratio"][-1]) == (1.1, 1.3)
        assert (file["x0"][0], file["x0"][-1]) == (0, 1.1)
        assert (file["v0"][0], file["v0"][-1]) == (-6, 6)
        np.testing.assert_allclose(np.diff(file["v0"]), 1.2, rtol=1e-14)


@pytest.mark.parametrize("kind", ["map", "stack"])
def test_the_catalogue_explains_the_labels(results, kind):
    with h5py.File(results[kind]) as file:
        catalogue = {
            name: item[()] for name, item in file["catalogue"].items() if isinstance(item, h5py.Dataset)
        }
        labels = file["attractor"][()]
        labels = labels.reshape((-1, labels.shape[-2] * labels.shape[-1]))
        regimes = file["regime"][()].reshape(labels.shape)
        amplitudes = file["amplitude"][()].reshape(labels.shape)
    assert catalogue["slice"].dtype == "int32"
    assert catalogue["count"].dtype == "int64"
    for i, (where, label) in enumerate(zip(catalogue["slice"], catalogue["attractor"], strict=True)):
        here = labels[where] == label
        assert here.sum() == catalogue["count"][i]
        assert (regimes[where][here] == catalogue["regime"][i]).all()
        np.testing.assert_array_equal(amplitudes[where][here], np.float32(catalogue["amplitude"][i]))
    assert catalogue["count"].sum() == (labels > 0).sum()


def test_made_up_files_have_the_codes_of_real_ones(results):
    with h5py.File(results["map"]) as basin, h5py.File(results["trajectory"]) as trajectory:
        assert basin["regime"].attrs["flag_meanings"] == REGIMES
        assert basin["reason"].attrs["flag_meanings"] == REASONS
        assert trajectory["event_kind"].attrs["flag_meanings"] == EVENTS
        assert trajectory["mode"].attrs["flag_meanings"] == MODES


def test_the_sweep_has_the_limits_it_prints(separatrix, tmp_path, results):
    outcome = succeed(separatrix, *KINDS["sweep"], "-o", tmp_path / "o.h5", folder=results["map"].parent)
    with h5py.File(results["sweep"]) as file:
        columns = ("observed_lower", "observed_upper", "lower", "upper")
        names, settled = (meanings(file[f"limits/{column}"]) for column in ("name", "settled"))
        ends = (file[f"limits/{column}"] for column in columns)
        limits = list(zip(names, settled, *ends, strict=True))
        assert file.attrs["barrier_upper"] == 1.1
        assert "barrier_lower" not in file.attrs
        ratio, impacts = file["drive_ratio"][()], file["impacts_per_period"][()]
    assert len(limits) == outcome.out.count("run up") + outcome.out.count("run down")
    for name, settled, lower, upper, *bracket in limits:
        assert 0 < upper - lower <= 1e-3
        if settled == "bracketed":
            assert 0 < bracket[1] - bracket[0] <= 1e-3
        else:
            # on the way down the motions with impacts are chaotic before they stop
            assert name == "impacts_stop_down"
            assert np.isnan(bracket).all()
        direction = 0 if name.endswith("up") else 1
        below = impacts[direction][ratio < lower][-1] > 0
        above = impacts[direction][ratio > upper][0] > 0
        assert below != above
        starts = above if direction == 0 else below
        assert name.startswith("impacts_start") == starts


def test_the_trajectory_has_a_history_and_its_events(results):
    with h5py.File(results["trajectory"]) as file:
        time, x, v = (file[name][()] for name in ("time", "x", "v"))
        kinds, at = file["event_kind"][()], file["event_time"][()]
        before, after = file["event_v_before"][()], file["event_v_after"][()]
        facts = dict(file.attrs)
        modes = file["mode"][()]
    assert (x <= 1.1 + 1e-12).all()
    assert (np.diff(time) > 0).all()
    assert (np.diff(at) >= 0).all()
    impacts = kinds == 1
    np.testing.assert_allclose(after[impacts], -0.5 * before[impacts], rtol=1e-15)
    in_window = impacts & (at > 50 - facts["window"])
    periods = facts["window"] / facts["drive_period"]
    assert periods == pytest.approx(round(periods), rel=1e-12)
    assert facts["window"] == pytest.approx(12.5, abs=0.501 * facts["drive_period"])
    assert facts["impacts"] == in_window.sum()
    assert facts["period"] == 1
    assert facts["impacts_per_period"] == 1
    assert facts["mean_impact_speed"] == pytest.approx(before[in_window].mean(), rel=1e-9)
    assert facts["x_max"] == 1.1
    assert facts["amplitude"] == (facts["x_max"] - facts["x_min"]) / 2
    assert x[time > 37.5].min() >= facts["x_min"]
    assert (v[modes == 1] >= 0).all()
    assert (v[modes == 2] <= 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_verify_names_a_changed_dataset(separatrix, tmp_path, results, kind):
    name = {"trajectory": "x", "points": "x", "sweep": "branch_amplitude", "refined": "origin"}.get(
        kind, "amplitude"
    )
    path = tmp_path / "file.h5"
    shutil.copy(results[kind], path)
    with h5py.File(path, "r+") as file:
        values = file[name][()]
        flat = values.view(np.uint8).reshape(-1)
        flat[flat.size // 2] ^= 1
        file[name][...] = values
    outcome = run(separatrix, "verify", "file.h5", folder=tmp_path)
    assert (outcome.code, outcome.out) == (74, "")
    assert f"'/{name}'" in outcome.err


def test_verify_names_a_dataset_with_a_flipped_byte(separatrix, tmp_path, results):
    path = tmp_path / "file.h5"
    shutil.copy(results["map"], path)
    with h5py.File(path) as file:
        offset = file["v_max"].id.get_offset()
        size = file["v_max"].nbytes
    content = bytearray(path.read_bytes())
    content[offset + size // 2] ^= 1
    path.write_bytes(content)
    outcome = run(separatrix, "verify", "file.h5", folder=tmp_path)
    assert (outcome.code, outcome.out) == (74, "")
    assert "/v_max" in outcome.err


def test_verify_names_a_dataset_with_a_damaged_chunk(separatrix, tmp_path):
    write_case(tmp_path)
    shape = ["--set", "axis[1].count=300", "--set", "axis[2].count=301"]
    succeed(separatrix, "basin", "case.toml", *shape, folder=tmp_path)
    path = tmp_path / "case.basin.h5"
    with h5py.File(path) as file:
        assert file["x_min"].compression == "gzip"
        chunk = file["x_min"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 1
    path.write_bytes(content)
    outcome = run(separatrix, "verify", "case.basin.h5", folder=tmp_path)
    assert (outcome.code, outcome.out) == (74, "")
    assert "/x_min" in outcome.err


def test_verify_finds_values_that_no_run_gives(separatrix, tmp_path, results):
    path = tmp_path / "file.h5"
    shutil.copy(results["map"], path)
    with h5py.File(path, "r+") as file:
        values = file["settle_time"][()] + np.float32(1)
        file["settle_time"][...] = values
        file["settle_time"].attrs.modify("checksum", np.uint32(zlib.crc32(values.tobytes())))
    outcome = run(separatrix, "verify", "file.h5", "--sample", 5, folder=tmp_path)
    assert outcome.code == 74
    assert "settle_time" in outcome.err


def test_a_truncated_file_is_refused(separatrix, tmp_path, results):
    (tmp_path / "file.h5").write_bytes(results["map"].read_bytes()[:5000])
    for command in ("info", "verify"):
        outcome = run(separatrix, command, "file.h5", folder=tmp_path)
        assert (outcome.code, outcome.out) == (74, "")
        assert "file.h5" in outcome.err


@pytest.mark.long
def test_figures_of_real_files(tmp_path, results):
    command = [sys.executable, "-m", "separatrix.cli", *map(str, results.values()), "-o", str(tmp_path)]
    drawn = subprocess.run(command, capture_output=True, text=True)
    assert (drawn.returncode, drawn.stderr) == (0, "")
    names = sorted(path.name for path in tmp_path.iterdir())
    for kind in results:
        stems = [name for name in names if name.startswith(f"{kind}_")]
        assert {Path(name).suffix for name in stems} == {".png", ".pdf"}
    for path in tmp_path.iterdir():
        assert path.read_bytes()[:4] == {".png": b"\x89PNG", ".pdf": b"%PDF"}[path.suffix]
        assert path.stat().st_size > 5000


MEASURE = """
import os, resource, subprocess, sys
code = subprocess.call(sys.argv[2:])
peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
open(sys.argv[1] + os.environ.get("OMPI_COMM_WORLD_RANK", ""), "w").write(str(peak))
sys.exit(code)
"""


@pytest.mark.long
def test_the_memory_of_a_rank_does_not_grow_with_the_map(mpi_separatrix, tmp_path):
    """5 times the rows, 800 000 points more, may take 2 MB more: 2.5 bytes a point. Ranks also
    pack the final file, a slab of up to 2**20 values at a time: as many rows as a chunk has, so longer rows
    take more until it is full. The peak of one run varies by 1 MB with the messages in flight: the smallest
    of three is taken, and of maps that are all large enough to have the buffers in use."""
    write_case(tmp_path)
    peaks = {}
    for shape in ((1000, 200), (5000, 200), (200, 5000)):
        counts = [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count={shape[axis - 1]}")]
        command = [mpi_separatrix, "basin", "case.toml", *counts, "-o", "map.h5", "--quiet"]
        measured = ["mpirun", "-n", "2", sys.executable, "-c", MEASURE, "peak_", *command]
        peaks[shape] = [np.inf, np.inf]
        for _ in range(3):
            subprocess.run(measured, cwd=tmp_path, check=True, timeout=120, env=os.environ)
            seen = [int((tmp_path / f"peak_{rank}").read_text()) for rank in (0, 1)]
            peaks[shape] = np.minimum(peaks[shape], seen)
            (tmp_path / "map.h5").unlink()
    small = peaks[1000, 200]
    assert np.subtract(peaks[5000, 200], small).max() < 2000
    assert np.subtract(peaks[200, 5000], small).max() < 16000
