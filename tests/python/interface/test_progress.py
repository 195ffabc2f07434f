# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress of long runs: sparse in a log, one line on a terminal."""

import json
import os
import pty
import re
import signal
import subprocess
import time

import pytest
from program import write_case

ENDLESS = ["basin", "case.toml", "--set", "axis[1].count=3000", "--set", "axis[2].count=3000"]
ENDLESS += ["--set", 'run.stop="duration"']


@pytest.mark.long
def test_progress_in_a_log_is_sparse(separatrix, tmp_path):
    write_case(tmp_path)
    more = {"plain": [], "lines": ["--json"], "quiet": ["--quiet"]}
    processes = {}
    for name, options in more.items():
        command = [separatrix, *ENDLESS, "--time-limit", "11.5", "-o", f"{name}.h5", *options]
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        processes[name] = subprocess.Popen(command, cwd=tmp_path, **streams)
    output = {name: process.communicate(timeout=60) for name, process in processes.items()}
    assert [process.returncode for process in processes.values()] == [75, 75, 75]
    assert re.fullmatch(r"\d+ of 9000000 points, \d+ %, [\d.]+ points/s, ETA .+\n", output["plain"][1])
    assert output["lines"][1] == ""
    events = [json.loads(line) for line in output["lines"][0].splitlines()]
    (progress,) = (event for event in events if event["event"] == "progress")
    assert progress["total"] == 9000000
    assert 0 < progress["done"] < 9000000
    assert 10 <= progress["seconds"] < 15
    assert progress["resident_bytes"] > 1e6
    assert events[-1]["event"] == "stopped"
    assert output["quiet"] == ("", "")


def test_progress_on_a_terminal_rewrites_its_line(separatrix, tmp_path):
    write_case(tmp_path)
    terminal, end = pty.openpty()
    command = [separatrix, *ENDLESS, "--time-limit", "60", "-o", "map.h5"]
    started = time.monotonic()
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=end)
    os.close(end)
    output = b""
    try:
        while chunk := os.read(terminal, 4096):
            output += chunk
            if output.count(b" points, ") >= 2:
                process.send_signal(signal.SIGUSR1)
    except OSError:
        pass  # the program has ended
    os.close(terminal)
    assert process.wait(10) == 75
    text = output.decode()
    # Twice a second, from half a second on.
    assert 2 <= text.count("\r  ") <= 2 * (time.monotonic() - started)
    # The search of the attractors has a line of its own where it takes long.
    assert text.count("\n") == sum(f" {things}, " in text for things in ("slices", "points"))
    assert "ETA" in text
