# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes of good inputs: of words, numbers and lines of a text, and of the bytes of any file."""

import random
import re
import struct
from collections.abc import Callable
from pathlib import Path

#: What replaces a number, or any value.
NUMBERS = [
    *("0", "-1", "1", "2", "1e308", "-1e308", "1e-308", "nan", "inf", "-inf", "1e999", "9223372036854775807"),
    *("2147483648", "1e6", "1e-6", "0.5", "3.25", "1000", "-0.1", "1_000", "0x10", "1,5", "1e5 N/m", "-3 mm"),
]
VALUES = [
    *('""', '"x"', '"1.2 m"', '"5 deg"', "[]", "[1]", "[1, 2]", "[[1, 2], [2, 5]]", "{}", "true", "false"),
    *('["a.tip"]', '"../x"', '"\u00e9"', "1979-05-27", "[nan]", "{a = 1}", '"drive.ratio"'),
]
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?![\w.])")
_WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]{2,}")
Maker = Callable[[Path, random.Random], list[str]]


def text_maker(texts: list[str], name: str) -> Maker:
    """Return what writes a changed one of these texts under this name."""
    lines = sorted({line for text in texts for line in text.splitlines() if line.strip()})
    words = sorted({word for text in texts for word in _WORD.findall(text)})

    def make(folder: Path, chance: random.Random) -> list[str]:
        text = chance.choice(texts)
        for _ in range(chance.choice([1, 1, 1, 2, 2, 3, 6])):
            text = changed_text(text, chance, lines, words)
        (folder / name).write_bytes(text.encode("utf-8", "surrogateescape"))
        return [name]

    return make


def changed_text(text: str, chance: random.Random, lines: list[str], words: list[str]) -> str:
    """Change one thing."""
    what = chance.randrange(12)
    if what < 4:
        return replaced(text, _NUMBER, chance, lambda old: other_number(old, chance))
    if what == 4:
        return replaced(text, re.compile(r"(?<== ).+"), chance, lambda _: chance.choice(VALUES + NUMBERS))
    if what in (5, 6):
        return replaced(text, _WORD, chance, lambda _: chance.choice(words))
    kept = text.splitlines(keepends=True)
    if not kept:
        return text
    at = chance.randrange(len(kept))
    if what == 7:
        del kept[at : at + chance.choice([1, 1, 2, 8])]
    elif what == 8:
        kept.insert(at, chance.choice(lines) + "\n")
    elif what == 9:
        kept[at:at] = kept[at : at + chance.choice([1, 3, 10])]
    elif what == 10:
        del kept[at:]
    else:
        line = kept[at]
        cut = chance.randrange(len(line) + 1)
        kept[at] = (
            line[:cut] + chance.choice(["\0", "\udcff", '"', "[", "=", "#", "\t", "\u03c0"]) + line[cut:]
        )
    return "".join(kept)


def replaced(text: str, pattern: re.Pattern, chance: random.Random, new: Callable[[str], str]) -> str:
    """Replace one match of the pattern."""
    found = list(pattern.finditer(text))
    if not found:
        return text
    match = chance.choice(found)
    return text[: match.start()] + new(match[0]) + text[match.end() :]


def other_number(old: str, chance: random.Random) -> str:
    """Return a special number, or one of another size."""
    if chance.random() < 0.4:
        return chance.choice(NUMBERS)
    value = float(old) * chance.choice([-1, 0.1, 0.9, 1.1, 2, 10, 1e3])
    return repr(int(value)) if re.fullmatch(r"[-+]?\d+", old) and abs(value) < 1e6 else f"{value:.6g}"


def bytes_maker(groups: list[list[Path]]) -> Maker:
    """Return what writes the files of one group, one of them with changed bytes or words."""
    content = [[(path.name, path.read_bytes()) for path in group] for group in groups]

    def make(folder: Path, chance: random.Random) -> list[str]:
        group = chance.choice(content)
        bad = chance.randrange(len(group))
        for number, (name, data) in enumerate(group):
            (folder / name).write_bytes(changed_bytes(data, chance) if number == bad else data)
        return [name for name, _ in group]

    return make


def changed_bytes(data: bytes, chance: random.Random) -> bytes:
    """Flip bits, overwrite numbers, cut; of texts also exchange numbers and lines."""
    if b"\0" not in data and chance.random() < 0.7:
        text = data.decode("utf-8", "surrogateescape")
        lines = [line for line in text.splitlines() if line.strip()]
        for _ in range(chance.choice([1, 1, 2, 3])):
            text = changed_text(text, chance, lines, _WORD.findall(text) or ["x"])
        return text.encode("utf-8", "surrogateescape")
    bad = bytearray(data)
    # What describes the data is mostly at the beginning.
    near = min(len(bad), 2048)
    for _ in range(chance.choice([1, 1, 2, 4, 8])):
        if not bad:
            break
        at = chance.randrange(min(near, len(bad)) if chance.random() < 0.5 else len(bad))
        what = chance.randrange(6)
        if what < 3:
            bad[at] ^= 1 << chance.randrange(8)
        elif what == 3:
            number = struct.pack("<q", chance.choice([0, -1, 255, 65535, 2**31 - 1, 2**31, 2**62]))
            size = chance.choice([1, 2, 4, 8])
            bad[at : at + size] = number[:size]
        elif what == 4:
            bad[at : at + chance.randrange(40)] = chance.randbytes(chance.randrange(40))
        elif chance.random() < 0.3:
            del bad[at:]
    return bytes(bad)


def beside(case: str, make: Maker) -> Maker:
    """Return what also writes a good case."""

    def make_both(folder: Path, chance: random.Random) -> list[str]:
        (folder / "case.toml").write_text(case)
        return make(folder, chance)

    return make_both


def structure_maker(groups: list[list[Path]]) -> Maker:
    """Return what writes matrices, and gives the options that name them."""
    make = bytes_maker(groups)

    def make_options(folder: Path, chance: random.Random) -> list[str]:
        names = make(folder, chance)
        return names if len(names) == 1 else ["--mass", names[0], "--stiffness", names[1]]

    return make_options


def in_case(pair: list[Path]) -> Maker:
    """Return what writes matrices and a case that reads them."""
    make = bytes_maker([pair])
    case = (
        '[structure.s]\nmass = "mass.mtx"\nstiffness = "stiffness.mtx"\ndamping_ratio = 0.05\n'
        "[structure.s.point]\ntip = [0, 0, 1]\n"
        '[drive.f]\nlaw = "force"\nbody = "s.tip"\namplitude = 1\nfrequency = 1.3\n[run]\nduration = 20\n'
    )

    def make_both(folder: Path, chance: random.Random) -> list[str]:
        make(folder, chance)
        (folder / "case.toml").write_text(case)
        return ["case.toml"]

    return make_both
