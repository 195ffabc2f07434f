# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides effects in slow stick-slip, in ten other machines and behind mimics, and counts what is named.

    python scripts/evidence/regime_discovery.py --seed S [--first N] [--step N] [--cases N] [--limit SECONDS]
        [--planned N] --out DIR [--page FILE]

Runs the cases with the numbers first, first + step, ... below --cases: every third is in stick-slip, the
next one another machine, the third a mimic or the law that it passes for. A case without a verdict within
its limit of processor time counts as such. Prints a line for each case and a table by regime with Wilson
intervals; --page writes that table of all cases that are there. Started again it goes on where it was.
"""

import argparse
import json
import resource
import signal
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "generator"))
sys.path.insert(0, str(Path(__file__).resolve().parent / "campaign"))

import mimics
import rigs
import slow
from rates import Rate
from separatrix.discovery.options import Options
from separatrix.discovery.workflow import discover
from separatrix.errors import SeparatrixError

REGIMES = ("stick-slip", "other machines", "mimics and laws")
SLOW = ("stribeck", "position_dependent_friction", "", "static_excess", "dahl", "stribeck")
FILES = ("first.csv", "second.csv", "held_out.csv")
RIGHT = {
    "position_dependent_friction": ("friction_position_curve", "position_dependent_friction"),
    "friction_over_position": ("friction_position_curve", "position_dependent_friction"),
    "restitution": ("restitution_slope", "restitution_curve"),
    "delayed_spring": ("delayed_force",),
    "sensor_lag": ("sensor_low_pass",),
}
"""Names of which any is right, where it is not the name of what is hidden; of mimics, in a set."""
UNLIMITED = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
WORDS = ("right", "right set", "silent", "wrong set", "wrong", "no verdict")


class _LateError(Exception):
    """A case has used up its processor time."""


def draw(seed: int, number: int, folder: Path) -> tuple[str, tuple[str, ...]]:
    """Write a case; what it hides, and the sets of names that are right: none where it has no name."""
    which = number // len(REGIMES)
    if number % len(REGIMES) == 0:
        name = SLOW[which % len(SLOW)]
        slow.write_slow(folder, slow.draw_slow(seed, number, name, small=which % 4 == 3))
    elif number % len(REGIMES) == 1:
        machine = tuple(rigs.RIGS)[which % len(rigs.RIGS)]
        rig = rigs.write_rig(folder, seed, number, machine)
        # the slide hides both
        return machine, ("+".join(sorted(rig.hidden)),) if machine == "slide" else rig.hidden
    else:
        kinds = tuple(one for pair in zip(mimics.MIMICS * 2, mimics.LAWS, strict=False) for one in pair)
        name = kinds[which % len(kinds)]
        mimics.write_mimic(folder, mimics.draw_mimic(seed, number, name))
    return name, RIGHT.get(name, (name,) if name else ())


def ask(seed: int, number: int, limit: float, folder: Path) -> dict:
    """One case: what was hidden, and the verdict on it."""
    hidden, right = draw(seed, number, folder)
    answer = {"number": number, "regime": number % len(REGIMES), "hidden": hidden, "right": right}
    rest = folder / slow.REST
    paths = [folder / name for name in FILES]
    began = time.process_time()
    resource.setrlimit(resource.RLIMIT_CPU, (int(began + limit) + 1, resource.RLIM_INFINITY))
    try:
        verdict = discover(
            folder / "base.toml", paths[:2], paths[2:], Options(seed=1), rest if rest.is_file() else None
        )
    except (_LateError, SeparatrixError) as error:
        resource.setrlimit(resource.RLIMIT_CPU, UNLIMITED)
        answer |= {"outcome": "no verdict", "names": [], "sets": [], "reason": str(error)}
    else:
        resource.setrlimit(resource.RLIMIT_CPU, UNLIMITED)
        answer |= {
            "outcome": verdict["outcome"],
            "names": sorted(verdict["effects"]),
            "sets": [sorted(one.split("+")) for one in verdict["alternatives"]],
        }
    return answer | {"seconds": round(time.process_time() - began, 1)}


def scored(answer: dict) -> str:
    """Whether a verdict is right, a set with the truth in it, silent, or wrong."""
    if answer["outcome"] == "no verdict":
        return "no verdict"
    named, sets = "+".join(answer["names"]), ["+".join(one) for one in answer["sets"]]
    if not named:
        # nothing is named: right where nothing has a name
        return "right" if answer["hidden"] in ("", *mimics.MIMICS) else "silent"
    if answer["outcome"] == "ambiguous":
        return "right set" if set(answer["right"]) & {named, *sets} else "wrong set"
    mimic = answer["hidden"] in mimics.MIMICS
    return "right" if named in answer["right"] and not mimic else "wrong"


def table_of(answers: list[dict]) -> list[str]:
    """Counts by regime, with the share that is right or a right set and Wilson's 95 % interval."""
    lines = [
        f"| regime | cases | {' | '.join(WORDS)} | right or right set | wrong name | median time |",
        "| --- |" + " ---: |" * (len(WORDS) + 4),
    ]
    for number, regime in enumerate(REGIMES):
        mine = [one for one in answers if one["regime"] == number]
        if not mine:
            continue
        counts = Counter(map(scored, mine))
        good, bad = Rate(counts["right"] + counts["right set"], len(mine)), Rate(counts["wrong"], len(mine))
        seconds = sorted(one["seconds"] for one in mine)[len(mine) // 2]
        cells = [str(len(mine)), *(str(counts[word]) for word in WORDS), _percent(good), _percent(bad)]
        lines.append(f"| {regime} | {' | '.join(cells)} | {seconds:.0f} s |")
    return lines


def page_of(answers: list[dict], seed: int, planned: int, limit: float) -> str:
    """The page of all cases that are there."""
    hidden = Counter((one["hidden"] or "nothing", scored(one)) for one in answers)
    lines = [
        "<!-- made by scripts/evidence/regime_discovery.py -->",
        "",
        "# Missing physics by regime",
        "",
        f"A blind campaign of {planned} cases on seed {seed}, of which **{len(answers)} are done**: a part,",
        "whose intervals are as wide as that. Every third case is in slow stick-slip, the next one is one of",
        "ten machines that are not the published one, the third is a mechanism without a name (a force or a",
        "sensor that lags, a hidden state) or a law that it passes for. The records are those of",
        "`tests/generator`.",
        f"A case has {limit:.0f} s of processor time. Intervals are Wilson's, 95 %.",
        "",
        *table_of(answers),
        "",
        f"| hidden | {' | '.join(WORDS)} |",
        "| --- |" + " ---: |" * len(WORDS),
    ]
    for name in sorted({name for name, _ in hidden}):
        lines.append(f"| {name} | {' | '.join(str(hidden[name, word]) for word in WORDS)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Ask about all cases and print what came out."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--step", type=int, default=1)
    parser.add_argument("--cases", type=int, default=30)
    parser.add_argument("--planned", type=int, default=1000)
    parser.add_argument("--limit", type=float, default=120.0)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--page", type=Path)
    asked = parser.parse_args()
    signal.signal(signal.SIGXCPU, _late)
    for number in range(asked.first, asked.cases, asked.step):
        folder = asked.out / f"{asked.seed}-{number}"
        done = folder / "answer.json"
        if not done.is_file():
            answer = ask(asked.seed, number, asked.limit, folder)
            done.write_text(json.dumps(answer) + "\n")
        answer = json.loads(done.read_text())
        print(
            f"{number}: {answer['hidden'] or 'nothing'}: {scored(answer)}, {answer['outcome']} "
            f"{answer['names']} {answer['seconds']} s",
            flush=True,
        )
    files = sorted(asked.out.glob(f"{asked.seed}-*/answer.json"))
    answers = [json.loads(one.read_text()) for one in files]
    print("\n".join(table_of(answers)))
    if asked.page:
        asked.page.write_text(page_of(answers, asked.seed, asked.planned, asked.limit))


def _late(*_: object) -> None:
    raise _LateError("no verdict within the limit of processor time")


def _percent(rate: Rate) -> str:
    low, high = rate.interval
    return f"{100 * rate.share:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


if __name__ == "__main__":
    main()
