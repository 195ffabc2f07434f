# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files as instruments write them: units, clocks, bursts and channels that are no column."""

import re
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile
from separatrix.discovery.measured.formats import read_table
from separatrix.discovery.measured.records import read_record
from separatrix.errors import SeparatrixError

T = np.arange(300) / 200
X = 100 * np.sin(5 * T)


def keys(path: Path, *lines: str) -> None:
    path.with_name(path.name + ".keys").write_text("\n".join(lines) + "\n")


def noted(record, *words: str) -> bool:
    return any(all(word in note for word in words) for note in record.notes)


# ---- universal files


def function(data=X, t=T, **more):
    pyuff = pytest.importorskip("pyuff")
    chosen = {"binary": 0, "func_type": 1, "rsp_node": 1, "rsp_dir": 1, "ref_node": 0, "ref_dir": 0}
    chosen |= {"data": np.asarray(data), "x": np.asarray(t), "id2": "", "id3": "", "id4": "", "id5": ""}
    chosen |= {"id1": "NONE", "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "abscissa_spacing": 1}
    chosen |= {"abscissa_spec_data_type": 17, "ordinate_spec_data_type": 8, "orddenom_spec_data_type": 0}
    chosen |= {"z_axis_spec_data_type": 0, "spec_data_type": 8}
    return pyuff.prepare_58(**chosen | more)


def units(length, force, code=9):
    pyuff = pytest.importorskip("pyuff")
    more = {"units_description": "x", "temp_mode": 1, "temp": 1.0, "temp_offset": 273.15}
    return pyuff.prepare_164(units_code=code, length=length, force=force, **more)


def uff(path: Path, *sets) -> Path:
    pytest.importorskip("pyuff").UFF(str(path)).write_sets(list(sets), "overwrite")
    return path


def test_units_of_a_universal_file_count(tmp_path):
    force = function(3 + T, ordinate_spec_data_type=13)
    record = read_record(uff(tmp_path / "a.uff", units(1000.0, 0.001), function(), force))
    assert np.allclose(record.x, 1e-3 * X, atol=1e-6)
    assert np.allclose(record.force, 1e3 * (3 + T), rtol=1e-5)
    record = read_record(uff(tmp_path / "b.uff", function(ordinate_axis_units_lab="mm")))
    assert np.allclose(record.x, 1e-3 * X, atol=1e-6)
    # the position of a rotation is an angle, whatever the unit of length
    turned = read_record(uff(tmp_path / "c.uff", units(1000.0, 1.0), function(rsp_dir=5)))
    assert np.allclose(turned.x, X, atol=1e-3)
    with pytest.raises(SeparatrixError, match="in 'mm by its label, 1.0 m by data set 164', expected"):
        read_record(uff(tmp_path / "d.uff", units(1.0, 1.0), function(ordinate_axis_units_lab="mm")))
    keys(tmp_path / "d.uff", "units: t s, x mm")
    assert np.allclose(read_record(tmp_path / "d.uff").x, 1e-3 * X, atol=1e-6)
    # the code of metres with the factors of millimetres
    with pytest.raises(SeparatrixError, match="code and factors of data set 164 disagree.*e.uff.keys"):
        read_record(uff(tmp_path / "e.uff", units(1000.0, 1.0, code=1), function()))
    keys(tmp_path / "e.uff", "units: t s, x mm")
    assert np.allclose(read_record(tmp_path / "e.uff").x, 1e-3 * X, atol=1e-6)


def test_functions_that_are_no_column_over_time_are_left_out(tmp_path):
    spectrum = function(X[:100], np.arange(100.0), abscissa_spec_data_type=18)
    response = function(X[:50] + 0j, np.arange(50.0), func_type=4, abscissa_spec_data_type=18)
    unused = [function(X[:77], T[:77], ordinate_spec_data_type=12) for _ in range(2)]
    record = read_record(uff(tmp_path / "a.uff", spectrum, function(), response, *unused))
    assert np.allclose(record.t, T)
    assert noted(record, "2 functions that are not over time")
    assert noted(record, "even steps of 0.005 s", "200 Hz")
    with pytest.raises(SeparatrixError, match="'t' is missing"):
        read_record(uff(tmp_path / "b.uff", spectrum))


def test_times_of_six_digits_are_refused_by_name(tmp_path):
    late = 100 + np.arange(300) / 2000 + 1e-5 * np.sin(np.arange(300))
    with pytest.raises(SeparatrixError, match="the times of 'x' have six digits"):
        read_record(uff(tmp_path / "a.uff", function(t=late, abscissa_spacing=0)))


# ---- TDMS


def tdms(path: Path, *segments) -> Path:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as file:
        for segment in segments:
            file.write_segment([nptdms.ChannelObject("rig", *channel) for channel in segment])
    return path


def wave(start_s: float, **more) -> dict:
    start = np.datetime64("2026-01-01T00:00:00", "us") + np.timedelta64(round(1e6 * start_s), "us")
    return {"wf_start_time": start, "wf_increment": 1 / 200, "wf_start_offset": 0.0} | more


def test_bursts_keep_the_gaps_between_them(tmp_path):
    path = tdms(
        tmp_path / "a.tdms",
        [("x", X[:100], wave(0.0, unit_string="mm"))],
        [("x", X[100:200], wave(3.5, unit_string="mm"))],
        # a writer in pieces may repeat its start or state the start of each piece: no gap
        [("x", X[200:250], wave(3.5, unit_string="mm"))],
        [("x", X[250:], wave(4.25, unit_string="mm"))],
    )
    record = read_record(path)
    late = np.concatenate([T[:100], 3.5 + np.arange(200) / 200])
    assert np.allclose(record.t, late, atol=1e-9)
    assert np.allclose(record.x, 1e-3 * X)
    assert record.pieces == [(0, 100), (100, 300)]
    back = [[("x", X[:100], wave(0.0))], [("x", X[100:], wave(0.2))]]
    with pytest.raises(
        SeparatrixError, match="begins at 0.2 s, before the end of the one before it at 0.5 s"
    ):
        read_record(tdms(tmp_path / "b.tdms", *back))


def test_channels_of_tdms_with_clocks_of_their_own_are_refused(tmp_path):
    both = [("x", X, wave(0.0)), ("v", X, wave(0.0, wf_increment=1 / 100))]
    with pytest.raises(SeparatrixError, match="'v' is not sampled at the times of 'x'"):
        read_record(tdms(tmp_path / "a.tdms", both))
    begun = [("x", X, wave(0.0)), ("v", X, wave(0.002))]
    with pytest.raises(SeparatrixError, match="'v' is not sampled at the times of 'x'"):
        read_record(tdms(tmp_path / "b.tdms", begun))


def test_a_channel_of_time_stamps_is_read(tmp_path):
    stamps = np.datetime64("2026-01-01T00:00:00", "us") + (1e6 * T).astype("timedelta64[us]")
    record = read_record(tdms(tmp_path / "a.tdms", [("t", stamps, {}), ("x", X, {"unit_string": "mm"})]))
    assert np.allclose(record.t, T, atol=1e-9)
    np.savez(tmp_path / "a.npz", t=stamps, x=X)
    assert np.allclose(read_record(tmp_path / "a.npz").t, T)
    # durations have their own beginning, from which a phase counts
    np.savez(tmp_path / "b.npz", t=(1e6 * (3 + T)).astype("timedelta64[us]"), x=X)
    assert np.allclose(read_record(tmp_path / "b.npz").t, 3 + T)


# ---- MDF


def mdf(path: Path, *groups) -> Path:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for group in groups:
            file.append(
                [asammdf.Signal(y, t, name=name, unit=unit, **more) for name, y, t, unit, more in group]
            )
        return Path(file.save(path, overwrite=True))


def test_a_channel_of_mdf_has_its_own_clock(tmp_path):
    other = ("temperature", T[:20], 10 * T[:20], "degC", {})
    path = mdf(tmp_path / "a.mf4", [("Laser 1", X, T, "mm", {})], [other])
    keys(path, "# of the rig", "columns: x = Laser 1", "drive_ratio: 1.05")
    record = read_record(path)
    assert np.allclose(record.t, T)
    assert np.allclose(record.x, 1e-3 * X)
    assert record.header["drive_ratio"] == 1.05
    apart = mdf(tmp_path / "b.mf4", [("x", X, T, "mm", {})], [("force", X, T + 1e-3, "kN", {})])
    with pytest.raises(SeparatrixError, match="'force' is not sampled at the times of 'x'"):
        read_record(apart)


def test_samples_that_the_recorder_calls_invalid_are_gaps(tmp_path):
    bad = np.zeros(X.size, bool)
    bad[120:140] = True
    path = mdf(tmp_path / "a.mf4", [("x", np.where(bad, 7.0, X), T, "mm", {"invalidation_bits": bad})])
    record = read_record(path)
    assert record.t.size == 280
    assert record.pieces == [(0, 120), (120, 280)]
    assert noted(record, "20 samples are marked invalid")


# ---- LabVIEW measurement files


def lvm(path: Path, columns: str, decimal: str = ".", empty: bool = False) -> Path:
    """A file of two channels; without x values their column is `empty`, as LabVIEW leaves it, or left out."""
    numbers = [[f"{a:.6f}".replace(".", decimal) for a in row] for row in zip(T, X, 2 * X, strict=True)]
    rows = ["\t".join(row if columns == "One" else ["", *row[1:]]) for row in numbers]
    if columns == "No" and not empty:
        rows = [row[1:] for row in rows]
    step = "5.0E-3".replace(".", decimal)
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", f"Decimal_Separator\t{decimal}"]
    head += [f"X_Columns\t{columns}", "Time_Pref\tRelative", "***End_of_Header***\t", "\t"]
    head += ["Channels\t2\t", "Samples\t300\t300\t", "Y_Unit_Label\tMillimeters\tN\t"]
    head += ["X_Dimension\tTime\tTime\t", "X0\t0\t0\t", f"Delta_X\t{step}\t{step}\t", "***End_of_Header***\t"]
    title = ("X_Value\t" if columns == "One" or empty else "") + "x\tforce\tComment"
    path.write_text("\n".join([*head, title, *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("columns", "decimal", "empty"), [("One", ".", False), ("No", ",", True), ("No", ".", False)]
)
def test_a_labview_measurement_is_read(tmp_path, columns, decimal, empty):
    record = read_record(lvm(tmp_path / "a.lvm", columns, decimal, empty))
    assert np.allclose(record.t, T, atol=1e-6)
    assert np.allclose(record.x, 1e-3 * X, atol=1e-6)
    assert np.allclose(record.force, 2 * X, atol=1e-5)


@pytest.mark.parametrize("word", ["1_000", "\u0661"])
def test_a_word_that_is_no_number_to_the_eye_is_refused(tmp_path, word):
    path = lvm(tmp_path / "a.lvm", "One")
    lines = path.read_text().split("\n")
    lines[-2] = f"1.495000\t{word}\t2"
    path.write_text("\n".join(lines))
    with pytest.raises(SeparatrixError, match=f"a.lvm:{len(lines) - 1}: '{word}' is no number"):
        read_record(path)
    path = tmp_path / "a.csv"
    path.write_text("t,x\n" + "".join(f"{a},{b}\n" for a, b in zip(T, X, strict=True)) + f"1.5,{word}\n")
    with pytest.raises(SeparatrixError, match=f"a.csv:302: '1.5,{word}' is not a row of numbers"):
        read_record(path)


# ---- WAV


@pytest.mark.parametrize("kind", ["u1", "i2", "i4", "f4", "f8"])
def test_a_wav_file_needs_the_size_of_full_scale(tmp_path, kind):
    path, share = tmp_path / "a.wav", 0.5 * np.sin(5 * T)
    if kind[0] == "f":
        wavfile.write(path, 200, share.astype(kind))
    else:
        limits = np.iinfo(kind)
        middle = 128 if kind == "u1" else 0
        wavfile.write(path, 200, np.round(middle + share * (limits.max - middle)).astype(kind))
    with pytest.raises(SeparatrixError, match="'x' is in 'full scale', expected one of m, cm, mm"):
        read_record(path)
    keys(path, "units: t s, x 2.5 mm")
    table = read_table(path)
    assert np.allclose(table.columns["x"], share, atol=1e-2 if kind == "u1" else 1e-4)
    if kind != "u1":
        assert np.allclose(read_record(path).x, 2.5e-3 * share, atol=1e-7)


def test_24_bits_and_samples_at_full_scale(tmp_path):
    numbers = np.clip(np.round(1.02 * np.sin(5 * T) * 2**23), -(2**23), 2**23 - 1).astype(int)
    samples = b"".join(int(one).to_bytes(3, "little", signed=True) for one in numbers)
    head = struct.pack(
        "<4sI4s4sIHHIIHH", b"RIFF", 36 + len(samples), b"WAVE", b"fmt ", 16, 1, 1, 200, 600, 3, 24
    )
    path = tmp_path / "a.wav"
    path.write_bytes(head + struct.pack("<4sI", b"data", len(samples)) + samples)
    keys(path, "units: t s, x 2.5 mm")
    table = read_table(path)
    assert np.allclose(table.columns["x"], numbers / 2**23)
    assert any(
        f"{np.sum(np.abs(numbers) >= 2**23 - 1)} samples of x are at full scale" in one for one in table.notes
    )


def test_two_channels_of_a_wav_file_are_selected_by_number(tmp_path):
    path = tmp_path / "a.wav"
    wavfile.write(path, 200, np.stack([0.5 * np.sin(5 * T), 0.2 * np.cos(5 * T)], axis=1))
    keys(path, "columns: x = 2, force = 1", "units: t s, x 2.5 mm, force 100 N")
    record = read_record(path)
    assert np.allclose(record.x, 0.5e-3 * np.cos(5 * T))
    assert np.allclose(record.force, 50 * np.sin(5 * T))


# ---- keys, and what is not read


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("unit: mm", "a.npz.keys:1: found 'unit: mm', allowed lines 'key: value' of columns, drive"),
        ("columns: Laser 1", "expected columns and channels, as in 'columns: x = Laser 1"),
        ("columns: force = Load cell", "columns: 'Load cell' is not in the record; it has note"),
        ("drive_ratio: 2", "'drive_ratio' is '2', in the record itself '1.05'"),
    ],
)
def test_keys_beside_a_record_are_refused_with_the_line(tmp_path, line, why):
    path = tmp_path / "a.npz"
    np.savez(path, t=T, x=X, drive_ratio="1.05", note=X)
    keys(path, line)
    with pytest.raises(SeparatrixError, match=why):
        read_record(path)


def test_a_structure_beside_other_variables_is_found(tmp_path):
    savemat(tmp_path / "a.mat", {"meta": {"who": "me"}, "run": {"t": T, "x": X}, "drive_ratio": 1.05})
    record = read_record(tmp_path / "a.mat")
    assert np.allclose(record.x, X)
    assert record.header["drive_ratio"] == 1.05


def test_what_is_not_read_is_answered_with_what_is(tmp_path):
    (tmp_path / "a.sac").write_bytes(bytes(400))
    with pytest.raises(SeparatrixError, match=r"supported are CSV.*'separatrix\[formats\]'; MDF with"):
        read_record(tmp_path / "a.sac")


# ---- damage


def test_truncated_files_are_reported(tmp_path):
    whole = uff(tmp_path / "a.uff", function(), function(3 + T, ordinate_spec_data_type=13)).read_bytes()
    (tmp_path / "cut.uff").write_bytes(whole[:-400])
    with pytest.raises(SeparatrixError, match="cut.uff: is cut off: its last data set has no end"):
        read_record(tmp_path / "cut.uff")
    whole = tdms(tmp_path / "a.tdms", [("x", X, wave(0.0))]).read_bytes()
    (tmp_path / "cut.tdms").write_bytes(whole[:-400])
    record = read_record(tmp_path / "cut.tdms")
    assert record.t.size == 250
    assert noted(record, "the file is cut off in its last segment")
    samples = np.round(1e4 * np.sin(5 * T)).astype("i2")
    wavfile.write(tmp_path / "a.wav", 200, samples)
    (tmp_path / "cut.wav").write_bytes((tmp_path / "a.wav").read_bytes()[:-100])
    keys(tmp_path / "cut.wav", "units: t s, x 2.5 mm")
    with pytest.raises(SeparatrixError, match=r"cut\.wav: .*(cut|damaged|WAV)"):
        read_record(tmp_path / "cut.wav")


@pytest.mark.parametrize("binary", [0, 1])
def test_a_function_has_as_many_values_as_its_header_states(tmp_path, binary):
    whole = uff(tmp_path / "a.uff", function(ord_data_type=4)).read_bytes()
    if binary:
        lines = whole.splitlines(keepends=True)[:13]
        lines[1] = b"    58b     1     2          11%12d     0     0           0           0\n" % (8 * X.size)
        whole = b"".join([*lines, X.tobytes(), b"    -1\n"])
        (tmp_path / "a.uff").write_bytes(whole)
    assert read_record(tmp_path / "a.uff").t.size == X.size
    middle = len(whole) // 2
    begin = middle if binary else whole.index(b"\n", middle) + 1
    end = begin + 80 if binary else whole.index(b"\n", begin) + 1
    (tmp_path / "lost.uff").write_bytes(whole[:begin] + whole[end:])
    with pytest.raises(SeparatrixError, match=rf"lost.uff: 'x' has \d+ values, expected {X.size} as its"):
        read_record(tmp_path / "lost.uff")


def test_a_data_set_without_an_end_is_refused(tmp_path):
    whole = uff(tmp_path / "a.uff", function(), function(3 + T, ordinate_spec_data_type=13)).read_bytes()
    mark = next(re.finditer(rb" {4}-1[^\n]*\n(?= {4}-1)", whole))
    (tmp_path / "odd.uff").write_bytes(whole[: mark.start()] + whole[mark.end() :])
    with pytest.raises(SeparatrixError, match="odd.uff: found 3 lines '-1', allowed an even number"):
        read_record(tmp_path / "odd.uff")
    two = whole[mark.end() :].split(b"\n", 1)[1]
    (tmp_path / "two.uff").write_bytes(whole[: mark.end()] + two.removesuffix(b"\n") + b"\n    -1\n")
    with pytest.raises(SeparatrixError, match="two.uff:.*found lines between two data sets"):
        read_record(tmp_path / "two.uff")


def test_a_measurement_shorter_than_its_header_states_is_refused(tmp_path):
    path = lvm(tmp_path / "a.lvm", "One")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines, "1.500000\t1\t2\n"]))
    # with one header for several writings there are more
    assert read_record(path).t.size == 301
    path.write_text("".join(lines[:-100]))
    with pytest.raises(SeparatrixError, match="a.lvm: 'x' has 200 samples, expected 300 as the header"):
        read_record(path)


def test_damaged_files_of_any_kind_are_refused_or_read(tmp_path):
    """No traceback, no crash, no end of this process, whatever bytes are changed."""
    whole = {"npz": tmp_path / "a.npz", "mat": tmp_path / "a.mat", "wav": tmp_path / "a.wav"}
    np.savez_compressed(whole["npz"], t=T, x=X)
    savemat(whole["mat"], {"t": T, "x": X, "run": {"note": "text"}}, do_compression=True)
    wavfile.write(whole["wav"], 200, (100 * X).astype("i2"))
    whole["uff"] = uff(tmp_path / "a.uff", function())
    whole["tdms"] = tdms(tmp_path / "a.tdms", [("x", X, wave(0.0))])
    random = np.random.default_rng(39)
    refused = 0
    for ending, path in whole.items():
        content = path.read_bytes()
        for _ in range(6):
            bad = bytearray(content[: random.integers(len(content) // 3, len(content) + 1)])
            for at in random.integers(0, min(len(bad), 600), 3):
                bad[at] = random.integers(256)
            broken = tmp_path / f"{zlib.crc32(bad):08x}.{ending}"
            broken.write_bytes(bad)
            try:
                read_record(broken)
            except SeparatrixError as error:
                assert broken.name in str(error)
                assert error.code == 65
                refused += 1
    assert refused > 15
