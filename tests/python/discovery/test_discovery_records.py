# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records that are wrong are refused with the row and the reason, and leave nothing behind."""

import os
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import CASE, listing
from separatrix.discovery import cli
from separatrix.discovery.cli import main
from separatrix.discovery.measured.records import make_record, read_record, unique_names
from separatrix.discovery.results import FILES, replacing
from separatrix.discovery.workflow import _all_different
from separatrix.errors import SeparatrixError

HEAD = [
    "# units: s, m",
    "# sampling_rate_hz: 100",
    "# sensor_noise_sigma_m: 0.001",
    "# drive_ratio: 1.2",
    "# phase: 0",
]


def rows(count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """A motion of the size of the machine."""
    t = np.arange(count) / 100
    return t, 0.8 + 0.2 * np.cos(11.3 * t) + 1e-3 * np.random.default_rng(0).standard_normal(count)


def write(path: Path, t: np.ndarray, x: np.ndarray, head: list[str] = HEAD) -> Path:
    """A record; row i of the arrays is line len(head) + 2 + i of the file."""
    lines = [f"{a:.9g},{b:.9g}" for a, b in zip(t, x, strict=True)]
    path.write_text("\n".join([*head, "t,x", *lines]) + "\n")
    return path


def spoiled(kind: str) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """A record with one defect."""
    t, x = rows()
    head = list(HEAD)
    if kind == "time":
        t[50] = t[48]
    elif kind == "nan":
        x[70] = np.nan
    elif kind == "constant":
        x[:] = 0.5
    elif kind == "rate":
        t *= 1000
    elif kind == "unit":
        head[0] = "# units: s, furlong"
    elif kind == "clipped":
        x = np.minimum(x, 0.9)
    elif kind == "still drive":
        head.append("# drive_frequency_rad_s: 0")
    elif kind == "negative noise":
        head.append("# sensor_noise_sigma_m_s: -1")
    elif kind == "short":
        t, x = t[:40], x[:40]
    return t, x, head


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("time", ["record.csv:57", "time does not increase"]),
        ("nan", ["record.csv:77", "nan"]),
        ("constant", ["constant"]),
        ("rate", ["sampling_rate_hz", "unit of time"]),
        ("unit", ["furlong", "expected"]),
        ("clipped", ["clipped"]),
        ("short", ["40 samples"]),
        ("still drive", ["'drive_frequency_rad_s' is 0"]),
        ("negative noise", ["'sensor_noise_sigma_m_s' is -1"]),
    ],
)
def test_defects_are_refused_with_their_row(tmp_path, kind, words):
    t, x, head = spoiled(kind)
    with pytest.raises(SeparatrixError) as error:
        read_record(write(tmp_path / "record.csv", t, x, head))
    for word in words:
        assert word in str(error.value)


def test_lines_that_are_no_rows_are_named(tmp_path):
    path = write(tmp_path / "record.csv", *rows())
    lines = path.read_text().splitlines()
    for text, word in (("1.0", "1 values for 2 columns"), ("a,b", "not a row of numbers")):
        path.write_text("\n".join([*lines[:20], text, *lines[20:]]))
        with pytest.raises(SeparatrixError, match=f"record.csv:21: .*{word}"):
            read_record(path)


def test_gaps_are_reported_and_cut(tmp_path):
    t, x = rows()
    t[200:] += 0.5
    record = read_record(write(tmp_path / "record.csv", t, x))
    assert record.pieces == [(0, 200), (200, 400)]
    assert any("record.csv:207: gap" in note for note in record.notes)


def test_units_and_hdf5(tmp_path):
    """A record in ms and mm, and one in HDF5, are the record in s and m."""
    t, x = rows()
    wanted = read_record(write(tmp_path / "si.csv", t, x))
    scaled = read_record(write(tmp_path / "mm.csv", 1000 * t, 1000 * x, ["# units: ms, mm", *HEAD[1:]]))
    assert scaled.t == pytest.approx(wanted.t)
    assert scaled.x == pytest.approx(wanted.x, rel=1e-7)
    with h5py.File(tmp_path / "record.h5", "w") as file:
        file["t"], file["x"] = wanted.t, wanted.x
        file.attrs["units"] = "s, m"
        file.attrs["drive_ratio"] = 1.2
    stored = read_record(tmp_path / "record.h5")
    assert np.array_equal(stored.x, wanted.x)
    assert stored.header["drive_ratio"] == 1.2


def test_a_body_at_rest_may_show_one_value(tmp_path):
    """A coarse sensor shows one value, or two of its steps."""
    t, x = rows()
    x[:] = 0.5
    for count in (0, 200):
        x[:count] = 0.51
        path = write(tmp_path / "rest.csv", t, x)
        assert np.array_equal(read_record(path, at_rest=True).x, x)
    with pytest.raises(SeparatrixError, match="constant"):
        read_record(write(tmp_path / "rest.csv", t, 0 * x))


def test_records_get_names_of_their_own(tmp_path):
    names = ["a", "a", "a_2", "b", "a"]
    records = [make_record(name, dict(zip("tx", rows(), strict=True))) for name in names]
    unique_names(records)
    assert [one.name for one in records] == ["a", "a_3", "a_2", "b", "a_4"]


@pytest.mark.parametrize("defect", ["nan", "other machine", "coarse", "no such file"])
def test_nothing_is_left_behind(tmp_path, library, capsys, defect):
    (tmp_path / "base.toml").write_text(CASE)
    good = write(tmp_path / "good.csv", *rows())
    t, x = rows()
    if defect == "nan":
        x[3] = np.nan
    elif defect == "other machine":
        x *= 1000
    elif defect == "coarse":
        t, x = np.arange(400) * 0.1, x
    bad = tmp_path / "bad.csv"
    if defect != "no such file":
        write(bad, t, x, [line for line in HEAD if "rate" not in line])
    before = listing(tmp_path)
    arguments = [tmp_path / "base.toml", good, bad, "--out", tmp_path / "out", "-q"]
    assert main([str(word) for word in arguments]) == (66 if defect == "no such file" else 65)
    assert "separatrix-discover: " in capsys.readouterr().err
    assert listing(tmp_path) == before


@pytest.mark.parametrize("earlier", [True, False])
def test_a_report_that_fails_leaves_what_was_there(tmp_path, monkeypatch, capsys, earlier):
    """Neither half of a new result nor a mixture with an old one."""
    out = tmp_path / "folder" / "out"
    if earlier:
        out.mkdir(parents=True)
        for name in (*FILES, "notes.txt"):
            (out / name).write_text("of an earlier run")
    before = listing(tmp_path)

    def write(folder: Path, *_: object) -> None:
        (folder / "verdict.json").write_text("new")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    verdict = {"outcome": "none", "effects": [], "alternatives": [], "parameters": {}, "gap": {}, "where": []}
    verdict |= {"reasons": [], "separating_experiment": "", "notes": [], "asked_for": None}
    verdict |= {"remains": [], "families": [], "function": None, "character": []}
    verdict |= {"added": [], "not_added": "", "locations": {}, "in_families": []}
    monkeypatch.setattr(cli, "investigate", lambda *_: (verdict, None))
    monkeypatch.setattr(cli, "write_results", write)
    monkeypatch.setattr(cli, "write_report", fail)
    arguments = ["base.toml", "record.csv", "--out", str(out), "-q"]
    assert main(arguments) == 73
    assert f"{out}: No space left" in capsys.readouterr().err
    assert listing(tmp_path) == before
    assert out.parent.exists() == earlier
    monkeypatch.setattr(cli, "write_report", lambda *_: None)
    assert main(arguments) == 0
    left = {path.name: path.read_text() for path in out.iterdir()}
    assert left == {"verdict.json": "new"} | ({"notes.txt": "of an earlier run"} if earlier else {})


def test_what_a_killed_run_left_goes_and_what_a_running_one_writes_stays(tmp_path):
    with replacing(tmp_path) as running:
        (running / "verdict.json").write_text("one")
        killed = tmp_path / ".writing-killed"
        killed.mkdir()
        (killed / "details.h5").write_text("half")
        with replacing(tmp_path) as second:
            assert {running, second} == set(tmp_path.iterdir())
            (second / "verdict.json").write_text("two")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"verdict.json": "one"}


def test_usage(capsys):
    for arguments in (
        ["base.toml"],
        ["base.toml", "r.csv", "--out", "o", "--seed", "-1"],
        ["--effects", "magic"],
    ):
        assert main(arguments) == 64
        assert "separatrix-discover: " in capsys.readouterr().err


def test_a_byte_order_mark_is_no_text(tmp_path):
    path = write(tmp_path / "record.csv", *rows())
    wanted = read_record(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert np.array_equal(read_record(path).x, wanted.x)
    assert read_record(path).header == wanted.header


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("# drive_ration: 1.2", "'drive_ration' is not used: 'drive_ratio'?"),
        ("# phase: 180", "phase is 180 rad, more than a turn: degrees?"),
        ("# operator: none", ""),
    ],
)
def test_header_lines_that_look_wrong_are_reported(tmp_path, line, words):
    notes = read_record(write(tmp_path / "record.csv", *rows(), [*HEAD[:-1], line])).notes
    assert [words in text for text in notes] == ([True] if words else [])


@pytest.mark.parametrize(
    ("above", "below", "words"),
    [
        (["# drive_ratio: 1.3"], [], "record.csv:6: 'drive_ratio' is given again, first in line 4"),
        ([], ["# units: s, mm"], "record.csv:407: 'units' stands below"),
        ([], ["# operator: none", "# done"], ""),
    ],
)
def test_a_header_key_stands_once_and_above_the_rows(tmp_path, above, below, words):
    path = write(tmp_path / "record.csv", *rows(), [*HEAD, *above])
    path.write_text(path.read_text() + "\n".join(below) + "\n")
    if words:
        with pytest.raises(SeparatrixError, match=words):
            read_record(path)
    else:
        assert read_record(path).notes == []


def test_rows_are_named_by_their_line_after_comments_and_empty_lines(tmp_path):
    t, x = rows()
    x[200] = np.nan
    path = write(tmp_path / "record.csv", t, x)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:50], "", "# a pause", *lines[50:]]))
    with pytest.raises(SeparatrixError, match="record.csv:209: 'x' is nan"):
        read_record(path)


@pytest.mark.parametrize(("separator", "point"), [(";", "."), (";", ","), ("\t", "."), ("\t", ",")])
def test_other_separators_are_read(tmp_path, separator, point):
    path = write(tmp_path / "record.csv", *rows())
    wanted = read_record(path)
    head, names, body = path.read_text().partition("t,x")
    body = body.replace(",", separator).replace(".", point)
    path.write_text(head + names.replace(",", separator) + body)
    found = read_record(path)
    assert np.array_equal(found.t, wanted.t)
    assert np.array_equal(found.x, wanted.x)


def test_bytes_that_are_no_text_are_taken_in_comments_only(tmp_path):
    path = write(tmp_path / "record.csv", *rows(), ["# site: München", *HEAD])
    wanted = read_record(path)
    text = path.read_text()
    path.write_bytes(text.encode("latin-1"))
    assert np.array_equal(read_record(path).x, wanted.x)
    path.write_bytes(text.replace("t,x", "t,x,ü").encode("latin-1"))
    with pytest.raises(SeparatrixError, match="record.csv:7: no text in UTF-8; supported are CSV"):
        read_record(path)
    path.write_bytes(text.encode("utf-16"))
    with pytest.raises(SeparatrixError, match="UTF-16"):
        read_record(path)


def test_columns_that_are_not_used_are_reported(tmp_path):
    t, x = rows()
    columns = {"t": t, "x": x, "a": 0 * t + 7, "driver_x": x}
    note = "columns that are not used: a, driver_x"
    assert note in make_record("record", columns).notes
    with h5py.File(tmp_path / "record.h5", "w") as file:
        for name, column in columns.items():
            file[name] = column
    assert note in read_record(tmp_path / "record.h5").notes


def test_a_folder_is_no_record(tmp_path):
    with pytest.raises(SeparatrixError, match="a folder, expected a record"):
        read_record(tmp_path)


@pytest.mark.parametrize("size", [0.4, -50.0])
def test_a_sample_that_no_motion_reaches_is_left_out_and_reported(tmp_path, size):
    t, x = rows()
    x[150] += size
    record = read_record(write(tmp_path / "record.csv", t, x))
    assert np.array_equal(record.t, np.delete(t, 150))
    assert record.pieces == [(0, 150), (150, 399)]
    assert any(
        text.startswith(f"{tmp_path}/record.csv:157: ") and "left out" in text for text in record.notes
    )
    x[10:200:19] += size
    with pytest.raises(SeparatrixError, match=r"record.csv:17: .* 11 such samples"):
        read_record(write(tmp_path / "record.csv", t, x))


def test_impacts_and_steps_of_the_sensor_are_no_stray_samples():
    t = np.arange(2000) / 100
    bouncing = np.abs(np.sin(3 * t))
    for x in (bouncing, np.round(bouncing / 0.2) * 0.2, np.where(t < 19, 0.5, bouncing)):
        assert make_record("record", {"t": t, "x": x}).t.size == t.size


def test_the_same_record_is_not_taken_twice(tmp_path, library, capsys):
    (tmp_path / "base.toml").write_text(CASE)
    (tmp_path / "copies").mkdir()
    first = write(tmp_path / "first.csv", *rows())
    copy = write(tmp_path / "copies" / "first.csv", *rows())
    for words in ([first, "--hold-out", first], [first, "--hold-out", copy], [first, copy]):
        arguments = [tmp_path / "base.toml", *words, "--out", tmp_path / "out", "-q"]
        assert main([str(word) for word in arguments]) == 64
        assert f"{words[-1]}: the same record as {first}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_runs_along_one_commanded_motion_are_two_records():
    """Their force distinguishes them; a copy that lacks a column is a copy."""
    t, x = rows()
    force = np.cos(5 * t)
    one, other = (make_record(f"run{k}", {"t": t, "x": x, "force": k * force}) for k in (1, 2))
    _all_different([one, other])
    for copy in ({"t": t, "x": x, "force": force}, {"t": t, "x": x}, {"t": t, "x": x, "v": force}):
        with pytest.raises(SeparatrixError, match="copy: the same record as run1"):
            _all_different([one, make_record("copy", copy)])
    bodies = [make_record(f"b{k}", {"t": t, "x.first": x, "x.second": k * force}) for k in (1, 2)]
    _all_different(bodies)
    with pytest.raises(SeparatrixError, match="b2: the same record as b2"):
        _all_different([*bodies, bodies[1]])


def test_a_folder_that_cannot_be_written_is_refused_before_any_work(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    before = listing(tmp_path)
    for out, words in (("file", "file: a file, expected a folder"), ("file/sub", "Not a directory")):
        # were it looked for, the case would be missing: 66
        assert main(["no.toml", "no.csv", "--out", str(tmp_path / out)]) == 73
        assert f"{tmp_path}/{out}" in (message := capsys.readouterr().err)
        assert words in message
    assert main(["no.toml", "no.csv", "--out", str(tmp_path / "new" / "sub")]) == 66
    assert listing(tmp_path) == before


def test_an_interrupt_ends_with_one_line(tmp_path, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "investigate", interrupt)
    assert main(["base.toml", "r.csv", "--out", str(tmp_path / "out")]) == 130
    assert capsys.readouterr().err.splitlines() == ["separatrix-discover: interrupted before the end"]
    assert not (tmp_path / "out").exists()


def test_a_termination_ends_with_one_line_and_leaves_nothing(tmp_path, monkeypatch, capsys):
    """Also while results are written; the handler of the caller is put back."""
    before = signal.getsignal(signal.SIGTERM)
    for step in ("investigate", "write_report"):
        monkeypatch.setattr(cli, "investigate", lambda *_: ({}, None))
        monkeypatch.setattr(cli, "write_results", lambda folder, *_: (folder / "a").write_text("half"))
        monkeypatch.setattr(cli, step, lambda *_: os.kill(os.getpid(), signal.SIGTERM))
        assert main(["base.toml", "r.csv", "--out", str(tmp_path / "out")]) == 143
        messages = capsys.readouterr().err.splitlines()
        assert messages == ["separatrix-discover: terminated before the end"]
        assert not (tmp_path / "out").exists()
    assert signal.getsignal(signal.SIGTERM) is before


def test_the_report_has_its_share_of_the_time(capsys):
    progress = cli.Progress()
    progress.began -= 67.0
    progress("writing the report", 0.9)
    assert "about 33 s left" in capsys.readouterr().err


def test_an_angle_is_reported_in_rad():
    t = np.arange(400) / 100
    x = 20 * np.cos(3 * t)
    x[150] += 10
    (message,) = [
        note for note in make_record("r", {"t": t, "x": x}, {"units": "s, deg"}).notes if "left out" in note
    ]
    assert f"x is {np.radians(x[150]):.6g} rad between" in message


def test_columns_that_are_not_used_may_hold_anything(tmp_path):
    text = "# units: t s, x m\nt,flag,x\n" + "\n".join(f"{k / 100},ok?,{np.cos(k / 9)}" for k in range(200))
    (tmp_path / "flags.csv").write_text(text)
    record = read_record(tmp_path / "flags.csv")
    assert record.x[:2] == pytest.approx([1.0, np.cos(1 / 9)])
    assert record.notes == ["columns that are not used: flag"]


def test_columns_are_read_and_not_changed():
    t = np.arange(400) / 100
    columns = {"t": 1e3 * t, "x": 1e3 * np.cos(3 * t)}
    for _ in range(2):
        assert make_record("r", columns, {"units": "ms, mm"}).t == pytest.approx(t)


@pytest.mark.parametrize("name", ["x", "v", "v.slide"])
def test_a_record_without_samples_is_refused(name):
    with pytest.raises(SeparatrixError, match="r: 0 samples, at least 60 are needed"):
        make_record("r", {"t": np.zeros(0), name: np.zeros(0)})
