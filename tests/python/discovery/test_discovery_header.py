# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Headers as a person would write them are understood, or refused with an example of a right one."""

import h5py
import numpy as np
import pytest
from separatrix.discovery.measured.records import make_record, read_record
from separatrix.errors import SeparatrixError

T = np.arange(400) / 200
COLUMNS = {"t": T, "x": 0.1 * np.sin(5 * T)}


@pytest.mark.parametrize(
    "units",
    [
        "s, mm",
        "t s, x mm",
        "x: mm, t: s",
        "t = s; x = mm",
        "t [s], x [mm]",
        "t(s), x(mm)",
        "seconds, millimetres",
    ],
)
def test_units_in_any_usual_form(units):
    record = make_record("r", COLUMNS, {"units": units})
    assert np.allclose(record.x, 1e-3 * COLUMNS["x"])
    assert np.allclose(record.t, T)


def test_units_of_further_columns_are_turned_into_si():
    columns = COLUMNS | {"v": 0.5 * np.cos(5 * T), "phi": T}
    record = make_record("r", columns, {"units": "t ms, x mm, v mm/s, phi turn"})
    assert np.allclose(record.v, 5e-4 * np.cos(5 * T))
    assert np.allclose(record.phi, 2 * np.pi * T)
    assert np.allclose(make_record("r", columns, {"units": "s, m, m/s, rad"}).phi, T)


@pytest.mark.parametrize("units", ["s, furlong", "mm", "t m, x s", "s, m, furlong/s"])
def test_other_units_are_refused_with_an_example(units):
    columns = COLUMNS | {"v": 0.5 * np.cos(5 * T)}
    with pytest.raises(SeparatrixError, match="as in 'units: s, mm' or 'units: t s, x mm'"):
        make_record("r", columns, {"units": units})


@pytest.mark.parametrize(
    ("phase", "angle", "at"),
    [
        ("0.5", 0.5, None),
        ("0 at t = 0", 0.0, 0.0),
        ("90 deg at t = 2", np.pi / 2, 2e-3),
        ("0.5 turn @ t=1 s", np.pi, 1.0),
    ],
)
def test_a_phase_may_be_stated_at_a_time(phase, angle, at):
    """A time without a unit is in that of the column."""
    header = make_record("r", COLUMNS, {"units": "ms, m", "phase": phase}).header
    assert header["phase"] == pytest.approx(angle)
    assert header.get("phase_origin_s") == (at if at is None else pytest.approx(at))


def test_numbers_may_have_units():
    header = {"units": "s, m", "sampling_rate_hz": "0.2 kHz", "drive_frequency_rad_s": "1.5 Hz"}
    found = make_record("r", COLUMNS, header | {"sensor_noise_sigma_m": "8 µm"}).header
    assert found["drive_frequency_rad_s"] == pytest.approx(3 * np.pi)
    assert found["sensor_noise_sigma_m"] == pytest.approx(8e-6)


@pytest.mark.parametrize(
    ("key", "text", "example"),
    [
        ("phase", "zero at the start", "phase: 20 deg at t = 0 s"),
        ("drive_ratio", "about 1", "drive_ratio: 0.5'"),
        ("drive_frequency_rad_s", "3 m", "drive_frequency_rad_s: 0.5 rpm"),
        ("phi_noise_sigma_rad", "-1", "expected at least 0"),
    ],
)
def test_other_numbers_are_refused_with_an_example(key, text, example):
    with pytest.raises(SeparatrixError, match=example):
        make_record("r", COLUMNS, {"units": "s, m", key: text})


def test_units_beside_the_names_of_columns(tmp_path):
    path = tmp_path / "named.csv"
    path.write_text(
        "t [ms],x (mm)\n" + "".join(f"{a},{b}\n" for a, b in zip(1e3 * T, COLUMNS["x"], strict=True))
    )
    record = read_record(path)
    assert np.allclose(record.t, T)
    assert np.allclose(record.x, 1e-3 * COLUMNS["x"])
    assert not any("units" in one for one in record.notes)


IN_BETWEEN = {"t": T, "y": 7 + 0 * T, "x": COLUMNS["x"], "v": 0.5 * np.cos(5 * T)}


def as_array(path, columns, header):
    return make_record(path.name, columns, header)


def as_csv(path, columns, header):
    head = [*(f"# {key}: {text}" for key, text in header.items()), ",".join(columns)]
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header="\n".join(head), comments="")
    return read_record(path)


def as_text(path, columns, header):
    """Read line by line, because of a comment among the rows."""
    as_csv(path, columns, header)
    path.write_text(path.read_text() + "# end\n")
    return read_record(path)


def as_npz(path, columns, header):
    np.savez(path.with_suffix(".npz"), **columns, **header)
    return read_record(path.with_suffix(".npz"))


def as_hdf5(path, columns, header):
    with h5py.File(path, "w") as file:
        for name, column in columns.items():
            file[name] = column
        file.attrs.update(header)
    return read_record(path)


ORDERED = [as_array, as_csv, as_text]


@pytest.mark.parametrize("written", ORDERED)
@pytest.mark.parametrize(
    ("names", "units", "size"),
    [
        ("tyx", "s, mm, m", {"x": 1}),
        ("tyx", "s, furlong, mm", {"x": 1e-3}),
        ("tyx", "t s, x mm", {"x": 1e-3}),
        ("ytx", "mm, s, m", {"x": 1}),
        # columns with units precede unused ones
        ("txy", "s, mm", {"x": 1e-3}),
        ("txyv", "s, mm", {"x": 1e-3, "v": 1}),
        ("txyv", "s, m, m, mm/s", {"x": 1, "v": 1e-3}),
        ("txvy", "s, m, mm/s", {"x": 1, "v": 1e-3}),
    ],
)
def test_units_in_order_count_columns_that_are_not_used(written, names, units, size, tmp_path):
    record = written(tmp_path / "record", {name: IN_BETWEEN[name] for name in names}, {"units": units})
    for name, factor in size.items():
        assert np.allclose(getattr(record, name), factor * IN_BETWEEN[name])


@pytest.mark.parametrize("written", ORDERED)
@pytest.mark.parametrize(("names", "units"), [("tyx", "s, mm"), ("ytx", "s, mm"), ("txyv", "s, m, mm/s")])
def test_units_in_order_of_some_columns_are_refused_where_one_is_not_used(written, names, units, tmp_path):
    why = f"units '{units}': {units.count(',') + 1} units in the order of {len(names)} columns, of which y is"
    with pytest.raises(
        SeparatrixError, match=f"{why} not used: state them by name, as in 'units: t s, x mm'"
    ):
        written(tmp_path / "record", {name: IN_BETWEEN[name] for name in names}, {"units": units})


@pytest.mark.parametrize("written", [as_npz, as_hdf5])
def test_arrays_without_an_order_have_units_of_those_that_are_used(written, tmp_path):
    """Where an array that is not used stands among the others nobody knows."""
    columns = {name: IN_BETWEEN[name] for name in "tyx"}
    assert np.allclose(written(tmp_path / "two", columns, {"units": "s, mm"}).x, 1e-3 * COLUMNS["x"])
    with pytest.raises(SeparatrixError, match="3 units in the order of 3 columns, of which y is not used"):
        written(tmp_path / "three", columns, {"units": "s, mm, m"})


def test_units_of_datasets_are_their_own_whatever_lies_between(tmp_path):
    with h5py.File(tmp_path / "record.h5", "w") as file:
        for name in "txv":
            file[name] = IN_BETWEEN[name]
        file["t"].attrs["units"], file["x"].attrs["units"] = "s", "mm"
    assert np.allclose(read_record(tmp_path / "record.h5").x, 1e-3 * COLUMNS["x"])


def stated(path, columns, units, header):
    with h5py.File(path, "w") as file:
        for name, column in columns.items():
            file[name] = column
        for name, unit in units.items():
            file[name].attrs["unit" if name == "phi" else "units"] = unit
        file.attrs.update(header)
    return read_record(path)


def test_units_of_every_dataset_count(tmp_path):
    columns = {"t": 1e3 * T, "x": COLUMNS["x"], "v": 0.5 * np.cos(5 * T), "force": 3 + T, "phi": T}
    units = {"t": "ms", "x": "millimeters", "v": "mm s-1", "force": "kN", "phi": "degrees"}
    record = stated(tmp_path / "a.h5", columns, units, {})
    assert np.allclose(record.t, T)
    assert np.allclose(record.x, 1e-3 * COLUMNS["x"])
    assert np.allclose(record.v, 0.5e-3 * np.cos(5 * T))
    assert np.allclose(record.force, 1e3 * (3 + T))
    assert np.allclose(record.phi, np.pi / 180 * T)


def test_a_unit_of_one_dataset_counts_and_the_others_are_reported(tmp_path):
    record = stated(tmp_path / "a.h5", COLUMNS | {"force": T}, {"x": "mm"}, {})
    assert np.allclose(record.x, 1e-3 * COLUMNS["x"])
    assert any("no unit of force, t: read in SI units" in one for one in record.notes)


@pytest.mark.parametrize("unit", ["V", "1", "full scale", "m/s"])
def test_units_that_are_none_of_the_column_are_refused(unit, tmp_path):
    with pytest.raises(SeparatrixError, match=f"'x' is in '{unit}', expected one of m, cm, mm"):
        stated(tmp_path / "a.h5", COLUMNS, {"x": unit}, {})


def test_units_that_contradict_each_other_are_refused(tmp_path):
    why = "'units' gives 'm' for 'x', whose own unit is 'mm'"
    with pytest.raises(SeparatrixError, match=why):
        stated(tmp_path / "a.h5", COLUMNS, {"x": "mm"}, {"units": "t s, x m"})
    path = tmp_path / "a.csv"
    rows = "".join(f"{a},{b}\n" for a, b in zip(T, COLUMNS["x"], strict=True))
    path.write_text(f"# units: s, m\nt,x [mm]\n{rows}")
    with pytest.raises(SeparatrixError, match=why):
        read_record(path)
    # the user has the last word
    path.write_text(f"t,x [mm]\n{rows}")
    path.with_name("a.csv.keys").write_text("units: t s, x um\n")
    record = read_record(path)
    assert np.allclose(record.x, 1e-6 * COLUMNS["x"])
    assert any("x is in 'um' as the user states, not in 'mm'" in one for one in record.notes)


def test_packed_datasets_are_unpacked(tmp_path):
    """As the CF conventions have it: scale, offset, and a number for what is missing."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"] = T
        file["x"] = np.round(1e5 * COLUMNS["x"]).astype("i2")
        file["x"].attrs.update({"scale_factor": 1e-5, "add_offset": 0.5, "_FillValue": np.int16(-999)})
        file["t"].attrs["units"] = "seconds since 2026-01-01"
    assert np.allclose(read_record(tmp_path / "a.h5").x, 0.5 + COLUMNS["x"], atol=1e-5)
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["x"][7] = -999
    with pytest.raises(SeparatrixError, match="row 8: 'x' is nan"):
        read_record(tmp_path / "a.h5")
