# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The check of words: those of the list are found wherever they stand, and nothing else is."""

import re
import subprocess
import sys
from types import ModuleType

import pytest


@pytest.fixture(scope="module")
def words(source_dir) -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(source_dir / "scripts"))
        import words

        return words


def test_every_word_of_the_list_is_found(words):
    listed = words.read_list()
    patterns = [re.sub(r"\(\?<?!.*?\)", "", pattern.pattern) for pattern, _ in listed]
    plain = {word for pattern in patterns for word in re.findall(r"[a-z]{3,}", pattern)}
    assert len(plain) > 40
    for word in plain:
        for text in (
            f"it is {word} here",
            f"{word.capitalize()}.",
            f"the_{word}_of = 1",
            f"// {word.upper()}",
        ):
            found = [one for _, one, _ in words.found_in(text, listed)]
            assert [one.lower() for one in found] == [word]


@pytest.mark.parametrize("text", [
    "an impact takes place", "in place of it", "to two decimal places", "MPI_IN_PLACE", "placeholder",
    "household", "histories", "essays", "the attribute strobe_x of version 1",
])  # fmt: skip
def test_other_words_are_not(words, text):
    assert words.found_in(text, words.read_list()) == []


def test_a_line_and_what_to_write_are_named(words):
    assert words.found_in("one\nfleet\n", words.read_list()) == [(2, "fleet", "lane batch")]


def test_the_checkout_has_none(source_dir):
    ended = subprocess.run(
        [sys.executable, source_dir / "scripts" / "words.py"], capture_output=True, text=True
    )
    assert (ended.stdout, ended.returncode) == ("", 0)
