#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides effects, asks the discovery workflow and the baselines what is missing, and writes the page.

Each case is a file of its own in the folder of results, written under another name and renamed, so that
a campaign can be killed at any time and goes on where it was. The truth lies sealed beside the cases:
its hash is kept before anybody is asked, and it is opened only when the page is written.
"""

import argparse
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(SOURCE / "tests" / "generator"), str(SOURCE / "scripts" / "evidence")]

import archive  # noqa: E402
import records  # noqa: E402
import seeds  # noqa: E402
from design import Unreachable, draw  # noqa: E402
from simulator import SimulationError  # noqa: E402

CI_SEED, CI_CASES = 1, (0, 12, 14, 16, 17, 32)
"""Nothing hidden, one effect, an effect that is one of a set; quick ones."""
KEPT = (
    "outcome effects alternatives equivalent in_families parameters gap gates leaves p_value reasons"
    " detectable d_prime negative_controls character where experiments notes records seed version runtime_s"
).split()
UNREACHABLE = "unreachable"


@cache
def commit() -> str:
    """The commit of the source, as far as that is known; `-dirty` where files differ from it."""
    words = ["git", "-C", str(SOURCE), "describe", "--always", "--exclude=*", "--abbrev=7", "--dirty"]
    result = subprocess.run(words, capture_output=True, text=True)
    return result.stdout.strip() or "unknown"


@cache
def library() -> str:
    """The first digits of the SHA-256 of the library that computes."""
    path = Path(os.environ.get("SEPARATRIX_LIBRARY", ""))
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12] if path.is_file() else "unknown"


class Late(Exception):
    """A case has used up its time."""


class Folders:
    """Where a campaign keeps what."""

    def __init__(self, out: Path) -> None:
        self.cases, self.sealed, self.results = out / "cases", out / "sealed", out / "results"
        self.seals, self.follow_ups = out / "seals", out / "follow_ups"

    def make(self) -> None:
        """Make them all."""
        for folder in vars(self).values():
            folder.mkdir(parents=True, exist_ok=True)

    def result(self, number: int) -> Path:
        """The result of a case."""
        return self.results / f"{number:04}.json"

    def follow_up(self, number: int) -> Path:
        """The result of a case with the record that its verdict asked for."""
        return self.follow_ups / f"{number:04}.json"

    def portable(self, path: Path) -> dict:
        """A result without the folders of the machine that its messages name."""
        return json.loads(path.read_text().replace(f"{self.cases}/", ""))


def write_whole(path: Path, text: str) -> None:
    """A file that is there whole or not at all."""
    draft = path.with_name(f"{path.name}.{os.getpid()}")
    draft.write_text(text)
    draft.rename(path)


def prepare(folders: Folders, seed: int, number: int) -> str:
    """Write records and sealed truth of a case if they are not there; return the seal."""
    kept = folders.seals / f"{number:04}.txt"
    if not kept.is_file():
        try:
            found = records.write_case(
                folders.cases / f"{number:04}", folders.sealed / f"{number:04}.json", draw(seed, number)
            )
        except Unreachable:
            found = UNREACHABLE
        write_whole(kept, f"{found}\n")
    return kept.read_text().strip()


def ask(case: Path, asked: dict[str, list[str]], seed: int, limit: float) -> dict:
    """The verdict of the discovery workflow; `asked`: records that were made later, by their use."""
    from separatrix.discovery import Options, discover
    from separatrix.errors import SeparatrixError

    def stop(*_: object) -> None:
        raise Late

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, limit)
    try:
        training = [*records.TRAINING, *asked.get("training", [])]
        held_out = [records.HELD_OUT, *asked.get("held out", [])]
        paths = [[case / name for name in names] for names in (training, held_out)]
        verdict = discover(case / records.BASE, *paths, Options(seed=seed))
        return {key: verdict[key] for key in KEPT if key in verdict}
    except Late:
        return {"outcome": "failed", "reasons": [f"not done after {limit:g} s of processor time"]}
    except SeparatrixError as reason:
        return {"outcome": "failed", "reasons": [str(reason)]}
    except Exception as reason:
        # one broken case must not end the campaign, and counts as a failure
        where = traceback.extract_tb(reason.__traceback__)[-1]
        text = f"{type(reason).__name__} in {Path(where.filename).name}:{where.lineno}: {reason}"
        return {"outcome": "failed", "reasons": [text]}
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def run_case(folders: Folders, seed: int, number: int, limit: float, with_baselines: bool) -> None:
    """One case from hiding to result."""
    found = prepare(folders, seed, number)
    if found == UNREACHABLE:
        write_whole(folders.result(number), json.dumps({"number": number, "seal": found}) + "\n")
        return
    case = folders.cases / f"{number:04}"
    began = time.process_time()
    verdict = ask(case, {}, seed, limit)
    seconds = round(time.process_time() - began, 2)
    named = {}
    if with_baselines:
        from baselines import verdicts

        named = verdicts(case / records.BASE, [case / name for name in records.TRAINING], number)
    result = {"number": number, "commit": commit(), "library": library(), "seal": found, "verdict": verdict}
    result |= {"baselines": named, "seconds": seconds}
    write_whole(folders.result(number), json.dumps(result, default=plain) + "\n")
    text = " ".join(verdict.get("effects", [])) or "; ".join(verdict.get("reasons", []))
    print(f"case {number}: {verdict['outcome']} {text} ({seconds:.0f} s)", flush=True)


def asks_for_more(folders: Folders, number: int) -> bool:
    """Whether the verdict leaves effects with different motions and proposes how to separate them."""
    verdict = json.loads(folders.result(number).read_text()).get("verdict", {})
    one_answer = verdict.get("equivalent") or verdict.get("in_families")
    return verdict.get("outcome") == "ambiguous" and not one_answer and bool(verdict.get("experiments"))


def follow_up(folders: Folders, seed: int, number: int, limit: float) -> None:
    """Make the first record that the verdict of a case asks for and that can be made, and ask again."""
    result, case = folders.portable(folders.result(number)), folders.cases / f"{number:04}"
    drawn = draw(seed, number)
    again = folders.follow_ups / f"{number:04}.truth"
    kept = records.write_case(case, again, drawn)
    again.unlink()
    if kept != result["seal"]:
        raise SystemExit(f"discovery_campaign: case {number} is not drawn as it was")
    found = {"number": number, "commit": commit(), "library": library(), "asked": None}
    for one in result["verdict"]["experiments"]:
        try:
            records.write_asked(case / records.ASKED, drawn, one["drive_ratio"], one["scale"])
        except SimulationError:
            continue
        began = time.process_time()
        use = {one.get("use", "training"): [records.ASKED]}
        found |= {"asked": one, "verdict": ask(case, use, seed, limit)}
        found["seconds"] = round(time.process_time() - began, 2)
        break
    write_whole(folders.follow_up(number), json.dumps(found, default=plain) + "\n")
    print(f"case {number} with what it asked for: {found.get('verdict', {}).get('outcome')}", flush=True)


def plain(value: object) -> object:
    """A number of NumPy as JSON."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def work(numbers: list[int], do: Callable[[int], None]) -> None:
    """Do all cases, handed out one by one by rank 0 where there is more than one rank; done when all are."""
    if int(os.environ.get("OMPI_COMM_WORLD_SIZE", "1")) == 1:
        for number in numbers:
            do(number)
        return
    from mpi4py import MPI

    world = MPI.COMM_WORLD
    if world.rank == 0:
        hand_out(world, numbers)
    else:
        while (number := world.sendrecv(None, 0, source=0)) is not None:
            do(number)
    wait_for_all(world)


def wait_for_all(world: object) -> None:
    """A barrier that leaves the core to those who compute."""
    request = world.Ibarrier()
    while not request.Test():
        time.sleep(0.02)


def hand_out(world: object, numbers: Iterable[int]) -> None:
    """Give every other rank a case whenever it asks; ask seldom, because somebody computes on this core."""
    from mpi4py import MPI

    left, busy = iter(numbers), world.size - 1
    while busy:
        status = MPI.Status()
        if not world.iprobe(status=status):
            time.sleep(0.02)
            continue
        world.recv(source=status.source)
        number = next(left, None)
        busy -= number is None
        world.send(number, status.source)


def main() -> int:
    """Run or summarise; return the exit code."""
    parser = argparse.ArgumentParser(prog="discovery_campaign")
    parser.add_argument("--cases", type=int, default=520)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--subset", choices=["ci"])
    parser.add_argument("--out", type=Path, default=SOURCE / "out" / "discovery")
    parser.add_argument("--output", type=Path, default=SOURCE / "docs" / "discovery.md")
    parser.add_argument("--limit", type=float, default=300.0)
    parser.add_argument("--prepare", action="store_true")
    parser.add_argument("--summary", action="store_true")
    parser.add_argument("--follow-up", action="store_true")
    parser.add_argument("--archive", type=Path)
    options = parser.parse_args()
    numbers: Sequence[int] = range(options.cases)
    if options.subset:
        options.seed, numbers = CI_SEED, CI_CASES
    if options.seed is None:
        print(
            "discovery_campaign: --seed S is needed, one that nobody has looked at;"
            f" the method was developed on {seeds.developed_on()}",
            file=sys.stderr,
        )
        return 64
    folders = Folders(options.out / f"seed_{options.seed}")
    folders.make()
    is_first = int(os.environ.get("OMPI_COMM_WORLD_RANK", "0")) == 0
    if options.archive and is_first and options.archive.is_file():
        taken = archive.unpack(options.archive, folders)
        print(f"discovery_campaign: {taken} results taken from {options.archive}")
    if not options.summary:
        if options.prepare:
            missing = [n for n in numbers if not (folders.seals / f"{n:04}.txt").is_file()]
            work(missing, lambda number: prepare(folders, options.seed, number))
            return 0
        missing = [n for n in numbers if not folders.result(n).is_file()]
        work(
            missing, lambda number: run_case(folders, options.seed, number, options.limit, not options.subset)
        )
    if options.follow_up:
        given = [n for n in numbers if folders.result(n).is_file() and asks_for_more(folders, n)]
        missing = [n for n in given if not folders.follow_up(n).is_file()]
        work(missing, lambda number: follow_up(folders, options.seed, number, options.limit))
    if is_first:
        if options.archive:
            kept = archive.pack(options.archive, folders, numbers)
            print(f"discovery_campaign: {kept} results kept in {options.archive}")
        import report

        return report.write(folders, options.seed, numbers, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
