#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Processor time and verdict of cases of the campaign's generator, beside those of another version."""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(SOURCE / "tests" / "generator")]

import records  # noqa: E402
from design import draw  # noqa: E402

REPORTED = ("outcome", "effects", "alternatives")


def ask(folder: Path, seed: int, number: int) -> dict:
    """Verdict and processor seconds of a case, with its truth."""
    from separatrix.discovery import Options, discover

    case, truth = folder / "case", folder / "truth.json"
    records.write_case(case, truth, draw(seed, number))
    training = [case / name for name in records.TRAINING]
    began = time.process_time()
    verdict = discover(case / records.BASE, training, [case / records.HELD_OUT], Options(seed=seed))
    seconds = round(time.process_time() - began, 2)
    depends = [one["depends_on"] for one in verdict["character"]]
    hidden = json.loads(truth.read_text())["names"]
    return {"number": number, "hidden": hidden, "seconds": seconds, "depends_on": depends} | {
        key: verdict[key] for key in REPORTED
    }


def in_words(one: dict) -> str:
    """The verdict in few words."""
    names = [*one["effects"], *(f"or {_joined(other)}" for other in one["alternatives"])]
    if one["outcome"] == "characterised" and one["depends_on"]:
        names.append("of " + " and ".join(one["depends_on"][0]))
    return " ".join([one["outcome"], *names])


def _joined(names: str | list[str]) -> str:
    """Several effects in one word; those of a verdict are joined already."""
    return names if isinstance(names, str) else "+".join(names)


def same(one: dict, other: dict) -> bool:
    """Whether two verdicts name the same; the order of alternatives means nothing."""
    return all(
        one[key] == other[key]
        if key != "alternatives"
        else sorted(map(_joined, one[key])) == sorted(map(_joined, other[key]))
        for key in REPORTED
    )


def main() -> int:
    """Ask for each case and print a row; return 1 if a verdict is another than before."""
    parser = argparse.ArgumentParser(prog="speed.py", description=__doc__)
    parser.add_argument("--seed", type=int, default=41)
    parser.add_argument("--cases", default="0:40", help="FIRST:END or a list N,N,...")
    parser.add_argument("--keep", type=Path, help="append the answers here, one a line; those there are kept")
    parser.add_argument("--before", type=Path, help="such a file of another version, to compare with")
    options = parser.parse_args()
    first, colon, end = options.cases.partition(":")
    numbers = range(int(first), int(end)) if colon else [int(one) for one in options.cases.split(",") if one]
    kept = _read(options.keep)
    before = _read(options.before)
    for number in numbers:
        if number not in kept:
            with tempfile.TemporaryDirectory() as folder:
                kept[number] = ask(Path(folder), options.seed, number)
            if options.keep:
                with options.keep.open("a") as file:
                    file.write(json.dumps(kept[number]) + "\n")
        one, old = kept[number], before.get(number)
        was = f"  before {old['seconds']:6.1f} s" if old else ""
        if old and not same(one, old):
            was += f": {in_words(old)}"
        hidden = "+".join(one["hidden"]) or "nothing"
        print(f"{number:4} {one['seconds']:6.1f} s{was}  {hidden}: {in_words(one)}", flush=True)
    return _summary([kept[number] for number in numbers], before)


def _read(path: Path | None) -> dict[int, dict]:
    if path is None or not path.is_file():
        return {}
    return {one["number"]: one for one in map(json.loads, path.read_text().splitlines())}


def _summary(found: list[dict], before: dict[int, dict]) -> int:
    total = sum(one["seconds"] for one in found)
    print(
        f"mean {total / len(found):.1f} s of processor time, largest {max(o['seconds'] for o in found):.1f} s"
    )
    both = [(one, before[one["number"]]) for one in found if one["number"] in before]
    if not both:
        return 0
    old = sum(other["seconds"] for _, other in both)
    alike = sum(same(one, other) for one, other in both)
    now = sum(one["seconds"] for one, _ in both)
    print(f"{len(both)} cases of before: mean {old / len(both):.1f} s -> {now / len(both):.1f} s")
    print(f"verdicts alike: {alike} of {len(both)}")
    return int(alike < len(both))


if __name__ == "__main__":
    sys.exit(main())
