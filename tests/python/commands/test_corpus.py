# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs that once made a reader crash, hang or read beyond its memory, and awkward ones: a message or a run.

`scripts/evidence/fuzz` found those of tests/faults/corpus, and uses them as seeds.
"""

import subprocess
from pathlib import Path

import pytest
from program import CASE, STARTS, Outcome, run, write_case
from separatrix import SeparatrixError, open_result, trial
from separatrix.discovery.measured.records import read_record
from separatrix.open import reading

CORPUS = Path(__file__).resolve().parents[2] / "faults" / "corpus"
CODES = {65, 66, 74, 76}


def check(outcome: Outcome) -> None:
    """A run, or one message and its code."""
    assert outcome.code == 0 or outcome.code in CODES, outcome
    assert "runtime error" not in outcome.err and "Sanitizer" not in outcome.err, outcome
    if outcome.code != 0:
        assert outcome.err.startswith("separatrix: "), outcome


def refused(outcome: Outcome, code: int) -> None:
    """One message, this code, and nothing else."""
    check(outcome)
    assert outcome.code == code, outcome


def test_the_corpus_is_there():
    assert len(list(CORPUS.iterdir())) >= 6


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*.toml")), ids=lambda path: path.name)
def test_case_files(separatrix, tmp_path, path):
    refused(run(separatrix, "basin", path, "--validate", folder=tmp_path, timeout=10), 65)


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*.part")), ids=lambda path: path.name)
def test_working_files(separatrix, tmp_path, path):
    refused(run(separatrix, "info", path, folder=tmp_path, timeout=60), 74)


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*.hdf")), ids=lambda path: path.name)
def test_result_files(separatrix, tmp_path, path):
    check(run(separatrix, "info", path, folder=tmp_path, timeout=60))
    refused(run(separatrix, "verify", path, "--sample", "1", folder=tmp_path, timeout=60), 74)
    try:
        with reading(path), open_result(path) as result:
            result.load()
    except SeparatrixError as error:
        assert str(path) in str(error)


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*.record")), ids=lambda path: path.name)
def test_measured_records(path, monkeypatch):
    monkeypatch.setattr(trial, "_LONGEST_WHOLE", 2)  # one of them never ends
    with pytest.raises(SeparatrixError, match=path.name):
        read_record(path)


def awkward_cases() -> dict[str, bytes]:
    """Cases cut short and in other encodings."""
    text = CASE.encode()
    cases = {
        "carriage returns": text.replace(b"\n", b"\r\n"),
        "byte order mark": b"\xef\xbb\xbf" + text,
        "UTF-16": CASE.encode("utf-16"),
        "Latin-1": text.replace(b"Coulomb", b"Coul\xf6mb"),
        "zero bytes": text.replace(b"mass", b"ma\0ss"),
        "brackets": b"a = " + b"[" * 100000,
        "long line": b"title = '" + b"x" * 1000000 + b"'",
        "large axis": text.replace(b"count = 19", b"count = 2147483647"),
        "larger axis": text.replace(b"count = 19", b"count = 9223372036854775807"),
        "fast drive": text.replace(b"ratio = 1.2", b"ratio = 1e300"),
        "slow drive": text.replace(b"ratio = 1.2", b"ratio = 1e-300"),
        "long run": text.replace(b"[attractors]", b"[run]\nduration = 1e300\n[attractors]"),
        "heavy body": text.replace(b"mass = 1.0", b"mass = 1e308"),
        "light body": text.replace(b"mass = 1.0", b"mass = 5e-324"),
    }
    return cases | {f"cut at {at}": text[:at] for at in range(0, len(text), 61)}


@pytest.mark.parametrize("name", awkward_cases())
def test_awkward_cases(separatrix, tmp_path, name):
    (tmp_path / "case.toml").write_bytes(awkward_cases()[name])
    check(run(separatrix, "basin", "case.toml", "--validate", folder=tmp_path, timeout=10))


@pytest.mark.parametrize("command", ["basin", "sweep", "trajectory", "points"])
@pytest.mark.parametrize("change", ["drive.ratio=1e300", "run.duration=1e300"])
def test_a_run_that_would_never_end_is_refused(separatrix, tmp_path, command, change):
    write_case(tmp_path)
    (tmp_path / "starts.csv").write_text(STARTS.replace(",1.2", ",1e300" if "ratio" in change else ",1.2"))
    more = ["--list", "starts.csv"] if command == "points" else []
    if command == "sweep":
        more = ["--set", "sweep.to=1e300", "--set", "sweep.step=5e299"] if "ratio" in change else []
    outcome = run(separatrix, command, "case.toml", "--set", change, *more, folder=tmp_path, timeout=20)
    refused(outcome, 65)
    assert "run.duration" in outcome.err and "periods of the drive" in outcome.err


def awkward_lists() -> dict[str, bytes]:
    """Lists cut short and in other encodings."""
    text = STARTS.encode()
    lists = {
        "carriage returns": text.replace(b"\n", b"\r\n"),
        "old Mac": text.replace(b"\n", b"\r"),
        "byte order mark": b"\xef\xbb\xbf" + text,
        "UTF-16": STARTS.encode("utf-16"),
        "zero bytes": text.replace(b"0.4", b"0\x00.4"),
        "many commas": b"x0,v0\n" + b"," * 1000000,
        "long number": b"x0,v0\n0." + b"1" * 1000000 + b",0\n",
        "fortran repeat": b"x0,v0\n2*0.1,0\n",
        "fortran null": b"x0,v0\n/,0\n",
        "quotes": b'"x0","v0"\n"0.1","0"\n',
        "semicolons": text.replace(b",", b";"),
    }
    return lists | {f"cut at {at}": text[:at] for at in range(0, len(text), 7)}


@pytest.mark.parametrize("name", awkward_lists())
def test_awkward_lists(separatrix, tmp_path, name):
    write_case(tmp_path)
    (tmp_path / "starts.csv").write_bytes(awkward_lists()[name])
    check(
        run(
            separatrix,
            "points",
            "case.toml",
            "--list",
            "starts.csv",
            "--validate",
            folder=tmp_path,
            timeout=10,
        )
    )


def test_flipped_bits_and_cuts_of_a_result(separatrix, results, tmp_path):
    data = results["map"].read_bytes()
    changed = tmp_path / "changed.h5"
    for at in range(0, len(data), max(1, len(data) // 60)):
        for damaged in (data[:at], data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1 :]):
            changed.write_bytes(damaged)
            ended = subprocess.run([separatrix, "info", changed], capture_output=True, text=True, timeout=60)
            check(Outcome(ended.returncode, ended.stdout, ended.stderr))
