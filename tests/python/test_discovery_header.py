# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Headers as a person would write them are understood, or refused with an example of a right one."""

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
def test_a_phase_may_be_told_at_a_time(phase, angle, at):
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
