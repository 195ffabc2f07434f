# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands whose reader has gone, as `head` does after its lines, end as if it were there."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import separatrix

COMMANDS = (
    "cli.py",
    "noise_cli.py",
    "discovery/cli.py",
    "measuring/cli.py",
    "structures/cli.py",
    "view/cli.py",
)


def test_what_nobody_reads_is_no_error():
    text = "from separatrix.printed import show\nfor i in range(9): show(i)"
    reader, writer = os.pipe()
    os.close(reader)
    ended = subprocess.run(
        [sys.executable, "-c", text],
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(writer)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_commands_print_nothing_else_on_stdout():
    for name in COMMANDS:
        tree = ast.parse((Path(separatrix.__file__).parent / name).read_text())
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "print":
                assert "file" in {word.arg for word in call.keywords}, f"{name}:{call.lineno}"
