# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The check of the documents: sentences, cells and lines that are too long are listed with their lines."""

import subprocess
import sys

import pytest

LONG = "word " * 31


@pytest.fixture
def listed(source_dir, tmp_path):
    """Lists what is too long in a text."""

    def list_it(text: str) -> list[str]:
        page = tmp_path / "page.md"
        page.write_text(text)
        run = [sys.executable, source_dir / "scripts" / "prose.py", page]
        ended = subprocess.run(run, capture_output=True, text=True)
        found = [line for line in ended.stdout.splitlines() if line.startswith(str(page))]
        assert ended.returncode == bool(found), ended
        return [line[len(str(page)) + 1 :] for line in found]

    return list_it


@pytest.mark.parametrize("text", [
    "# Title\n\nA sentence. " + "Another one, of six words only. " * 20,
    "```\n" + LONG + "\n```\n",
    "Text.\n\n    " + LONG + "\n\nText.",
    "* " + "word " * 20 + "\n* " + "word " * 20,
    "| " + "word " * 20 + " | " + "word " * 20 + " |",
])  # fmt: skip
def test_what_is_short_enough_is_not_listed(listed, text):
    assert listed("".join(f"{line[:131]}\n" for line in text.splitlines())) == []


@pytest.mark.parametrize(("text", "found"), [
    ("Short.\n\n" + LONG.replace("word word", "word\nword", 1), "3: a sentence of 31 words"),
    ("| a | " + "word " * 21 + "|", "1: a cell of 21 words"),
    ("a" * 133, "1: 133 columns"),
    ("* A bullet.\n* " + LONG[:130] + "\n  " + LONG[130:], "2: a sentence of 31 words"),
])  # fmt: skip
def test_what_is_too_long_is_listed_with_its_line(listed, text, found):
    (line,) = [line for line in listed(text) if "columns" not in line or "columns" in found]
    assert line.startswith(found)


def test_the_documents_are_short_enough(source_dir):
    ended = subprocess.run(
        [sys.executable, source_dir / "scripts" / "prose.py"], capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stdout
