# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `stability`: exponents, their sum, and what a motion is."""

import json
import subprocess
from pathlib import Path

import pytest


@pytest.fixture
def run(separatrix: Path, source_dir: Path):
    """Runs the command on the oscillator of Budd and Dux; returns what ended."""

    def run_it(*options: str) -> subprocess.CompletedProcess:
        case = source_dir / "examples" / "validation" / "budd_dux.toml"
        return subprocess.run(
            [separatrix, "stability", case, *options], capture_output=True, text=True, check=False
        )

    return run_it


def test_chaos_has_a_positive_exponent_and_the_exact_sum(run):
    ended = run("--set", "contact.upper=0.0", "--set", "start.x0=-0.3", "--periods", "20000", "--json")
    assert ended.returncode == 0, ended.stderr
    lines = {line["event"]: line for line in map(json.loads, ended.stdout.splitlines())}
    assert lines["sum"]["found"] == pytest.approx(lines["sum"]["exact"], abs=1e-8)
    assert lines["zero_one"]["value"] > 0.9
    assert lines["motion"]["type"] == "chaotic"
    first = next(line for line in map(json.loads, ended.stdout.splitlines()) if line.get("number") == 1)
    assert first["value"] == pytest.approx(0.14, abs=0.01)
    assert 0 < first["error"] < 0.01


def test_a_stable_orbit_is_periodic(run):
    ended = run("--set", "start.x0=-1.0", "--periods", "2000", "--json")
    lines = {line["event"]: line for line in map(json.loads, ended.stdout.splitlines())}
    assert lines["motion"]["type"] in ("periodic", "not_known")


def test_what_makes_no_sense_is_refused(run):
    assert run("--periods", "3").returncode == 64
    ended = run("-o", "file.h5")
    assert ended.returncode == 64
    assert "writes no file" in ended.stderr
