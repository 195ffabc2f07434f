# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the code blocks of a page, one after the other, in a folder of their own.

- ```toml with a first line `# NAME.toml` is written into that file.
- ```python is executed; all blocks of a page share their names. `print(...)  # TEXT` must print TEXT.
- ```console: lines after `$ ` are commands; what follows must be what they print. A line `...` stands for any
  lines; durations and sizes are not compared.
- ```sh is installation, which `scripts/wheel --check` tries; ```text shows something that is no command.
"""

import contextlib
import io
import os
import re
import subprocess
from pathlib import Path

BLOCK = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LANGUAGES = {"toml", "python", "console", "sh", "text"}
VARIES = re.compile(r"\b(\d+ h )?(\d+ min )?\d+(\.\d+)?(e-?\d+)? (s|MiB|ms)\b|\b\d+ bytes\b")


def blocks(page: Path) -> list[tuple[str, str]]:
    """The code blocks of a page: language and text."""
    return [(language, text) for language, text in BLOCK.findall(page.read_text())]


def run_page(page: Path, folder: Path, programs: list[Path]) -> None:
    """Run a page in `folder`; an AssertionError names what differs from it."""
    names: dict[str, object] = {"__name__": "__main__"}
    path = os.pathsep.join([*map(str, programs), os.environ["PATH"]])
    for language, text in blocks(page):
        if language == "toml":
            name = re.match(r"# (\S+\.toml)\n", text)
            if name:
                (folder / name[1]).write_text(text)
        elif language == "python":
            _python(text, page, names)
        elif language == "console":
            _console(text, page, folder, {**os.environ, "PATH": path})


def _python(text: str, page: Path, names: dict[str, object]) -> None:
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile(text, str(page), "exec"), names)
    wanted = re.findall(r"^ *print\(.*\)  +# (.*)$", text, re.MULTILINE)
    for line in wanted:
        assert line.strip() in output.getvalue().splitlines(), (
            f"{page.name}: {line!r}, printed {output.getvalue()!r}"
        )


def _console(text: str, page: Path, folder: Path, environment: dict[str, str]) -> None:
    parts = re.split(r"^\$ ", text, flags=re.MULTILINE)
    assert parts[0] == "", f"{page.name}: a console block begins with a command"
    for part in parts[1:]:
        command, _, wanted = part.partition("\n")
        words = ["bash", "-c", command]
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
        expected = [line for line in wanted.splitlines() if line.strip()]
        refused = any(line.startswith("separatrix: ") for line in expected)
        outcome = f"{done.returncode}\n{done.stdout}{done.stderr}"
        assert (done.returncode == 0) != refused, f"{page.name}: {command}: {outcome}"
        if expected:
            # progress goes to stderr, and how much of it hangs on how busy the machine is
            printed = done.stderr if refused else done.stdout
            assert matches(expected, printed.splitlines()), (
                f"{page.name}: {command}\nwanted\n{wanted}\nprinted\n{printed}"
            )


def matches(wanted: list[str], printed: list[str]) -> bool:
    """Whether lines were printed as wanted, where `...` stands for any number of lines."""
    if not wanted:
        return not printed
    if wanted[0] == "...":
        return any(matches(wanted[1:], printed[k:]) for k in range(len(printed) + 1))
    if not printed or VARIES.sub("N", wanted[0].rstrip()) != VARIES.sub("N", printed[0].rstrip()):
        return False
    return matches(wanted[1:], printed[1:])
