# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides effects in records of machines with a motor (tests/generator/cranks.py) and counts what is named.

    python scripts/evidence/motor_discovery.py --seed S [--first N] [--step N] [--cases N] [--limit SECONDS]
        [--quick] --out DIR

Runs the cases with the numbers first, first + step, ... below --cases. Prints a line for each case and a
table of the counts. Started again it goes on where it was.
"""

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "generator"))

import cranks
from separatrix.discovery.options import Options
from separatrix.discovery.workflow import discover
from separatrix.errors import SeparatrixError

KINDS = (
    "motor_line", "crank_inertia", "", "bearing_friction", "current_lag", "", "second_harmonic",
    "viscous", "coulomb", "", "motor_line", "maxwell", "crank_inertia", "bearing_friction",
    "", "inertia_wave", "current_lag", "late_sensor",
)  # fmt: skip
"""Effects in their order; '' is none."""


def ask(seed: int, number: int, limit: float, quick: bool, folder: Path) -> dict:
    """One case: what was hidden, and the verdict on it."""
    case = cranks.draw(seed, number, KINDS[number % len(KINDS)])
    cranks.write(folder, case)
    began = time.process_time()
    answer = {
        "number": number,
        "truth": case.effect,
        "machine": case.machine,
        "sensors": case.sensors,
        "names": [],
    }
    records = [folder / name for name in cranks.TRAINING]
    try:
        options = Options(time_limit=limit, quick=quick)
        verdict = discover(folder / cranks.BASE, records, [folder / cranks.HELD_OUT], options)
    except SeparatrixError as error:
        answer |= {"outcome": "no verdict", "reason": str(error)}
    else:
        rivals = [one.split("+") for one in verdict["alternatives"]]
        answer |= {
            "outcome": verdict["outcome"],
            "names": [name.partition("@")[0] for name in verdict["effects"]],
            "sets": [[name.partition("@")[0] for name in one] for one in rivals],
            "before": verdict["gap"]["training"]["before"],
            "after": verdict["gap"]["training"]["after"],
        }
    return answer | {"seconds": round(time.process_time() - began, 1)}


def scored(answer: dict) -> str:
    """Whether a verdict is right, a set with the truth in it, silent, or wrong.

    Where no effect of the catalogue is hidden, a set is a false one.
    """
    truth, outcome, names = answer["truth"], answer["outcome"], answer["names"]
    if outcome == "no verdict":
        return "no verdict"
    if truth in ("", *cranks.MIMICS):
        return "silent" if not names else "false set" if outcome == "ambiguous" else "wrong"
    if outcome == "ambiguous":
        return "in a set" if truth in names or [truth] in answer["sets"] else "wrong"
    if not names:
        return "silent"
    return "right" if names == [truth] else "wrong"


def main() -> None:
    """Ask about all cases and print what came out."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--step", type=int, default=1)
    parser.add_argument("--cases", type=int, default=len(KINDS))
    parser.add_argument("--limit", type=float, default=300.0)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    table: dict[str, Counter] = {}
    for number in range(asked.first, asked.cases, asked.step):
        folder = asked.out / f"{asked.seed}-{number}"
        done = folder / "answer.json"
        if not done.is_file():
            answer = ask(asked.seed, number, asked.limit, asked.quick, folder)
            done.write_text(json.dumps(answer) + "\n")
        answer = json.loads(done.read_text())
        word = scored(answer)
        print(
            f"{number}: {answer['truth'] or 'none'}: {word}, {answer['outcome']} {answer['names']}",
            flush=True,
        )
        table.setdefault(answer["truth"] or "none", Counter())[word] += 1
    words = ("right", "in a set", "silent", "false set", "wrong", "no verdict")
    print(f"| hidden | {' | '.join(words)} |")
    for truth, counts in table.items():
        print(f"| {truth} | {' | '.join(str(counts[word]) for word in words)} |")


if __name__ == "__main__":
    main()
