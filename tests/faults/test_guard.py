# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The guard around calls into a library: a crash inside ends with its code, one outside stays a crash."""

import signal
import subprocess
from pathlib import Path

import pytest

WORDS = {
    "begin": 'separatrix_guard_begin("the file is damaged", 1, 74);',
    "end": "separatrix_guard_end();",
    "hold": "separatrix_guard_hold();",
    "release": "separatrix_guard_release();",
    "abort": "abort();",
    "loop": "for (volatile int i = 1; i;);",
    "speak": 'fprintf(stderr, "a word\\n");',
}
PROGRAM = """
#include <stdio.h>
#include <stdlib.h>
void separatrix_guard_begin(const char *, int, int);
void separatrix_guard_end(void);
void separatrix_guard_hold(void);
void separatrix_guard_release(void);
int main(void) { %s return 0; }
"""


def end_of(source: Path, folder: Path, words: str) -> tuple[int, str]:
    """Exit code and standard error of a program of these words."""
    text = folder / "main.c"
    text.write_text(PROGRAM % " ".join(WORDS[word] for word in words.split()))
    program = folder / "main"
    subprocess.run(["cc", "-O0", "-o", program, text, source / "src/csupport/guard.c"], check=True)
    done = subprocess.run([program], capture_output=True, text=True, timeout=60)
    return done.returncode, done.stderr


@pytest.mark.parametrize("crash", ["abort", "loop"])
@pytest.mark.parametrize(
    "words", ["begin {}", "hold begin {}", "hold begin end begin {}", "hold release begin {}"]
)
def test_a_crash_inside_ends_with_the_code(source_dir, tmp_path, words, crash) -> None:
    assert end_of(source_dir, tmp_path, words.format(crash)) == (74, "separatrix: the file is damaged\n")


@pytest.mark.parametrize("words", ["abort", "begin end", "hold", "hold begin end", "hold begin end release"])
def test_a_crash_outside_stays_one(source_dir, tmp_path, words) -> None:
    assert end_of(source_dir, tmp_path, f"{words} abort")[0] == -signal.SIGABRT


@pytest.mark.parametrize(
    ("words", "expected"),
    [("begin speak end speak", "a word\n"), ("hold begin end speak release speak", "a word\n")],
)
def test_standard_error_speaks_again_afterwards(source_dir, tmp_path, words, expected) -> None:
    assert end_of(source_dir, tmp_path, words) == (0, expected)
