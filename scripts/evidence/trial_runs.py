# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trials of runs that are disturbed and resumed: kills, late and lost ranks, full and slow disks."""

import json
import os
import random
import re
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import life
from hosts import Hosts

#: How a trial may fail; each counts in a column of the table.
LOST, WRONG, ENDED = "lost", "silent wrong", "healthy run ended"
# Longest time of a run [s].
LONGEST = 120
# The map of the trials of packing: several slabs of compressed chunks, and soon computed.
PACKED = ["--set", "axis[1].count=270", "--set", "axis[2].count=260", "--set", "attractors.sample=16"]
PACKED_RUN = ["basin", "case.toml", "-o", life.NAME, *PACKED]


class Failure(Exception):
    """A trial that went wrong: `kind` is one of the columns."""

    def __init__(self, kind: str, what: str) -> None:
        """Keep both."""
        super().__init__(what)
        self.kind = kind


@dataclass(eq=False)
class Bench:
    """What all trials share: the program, the library of faults, files of undisturbed runs."""

    program: Path
    calls: Path
    folder: Path
    hosts: Hosts | None
    reference: str = ""
    packed: str = ""
    needed: int = 0
    packing_calls: int = 0

    def prepare(self) -> None:
        """Make the undisturbed files, and working files that are half done or all done, once."""
        known = self.folder / "prepared.json"
        if not known.exists():
            self.make_files()
            facts = (self.reference, self.packed, self.needed, self.packing_calls)
            known.write_text(json.dumps(facts))
        self.reference, self.packed, self.needed, self.packing_calls = json.loads(known.read_text())

    def make_files(self) -> None:
        """Make them."""
        whole = self.new_folder("whole")
        process = life.launch(self.program, whole, 0)
        part = whole / f"{life.NAME}.part"
        while not part.exists():
            time.sleep(0.001)
        self.needed = part.stat().st_size
        ended_well(process, whole, "the undisturbed run")
        self.needed += (whole / life.NAME).stat().st_size
        self.reference = life.content_hash(whole / life.NAME)
        life.stop_half_way(self.program, self.new_folder("half"))
        packed = self.new_folder("packed")
        count = packed / "count"
        name = {"FAULT_NAME": f"{life.NAME}.new", "LD_PRELOAD": str(self.calls)}
        self.run_packing(packed, 0, [], name | {"FAULT_COUNT": str(count)})
        self.packing_calls = max(map(int, count.read_text().split()))
        self.packed = life.content_hash(packed / life.NAME)
        done = self.new_folder("done")
        if self.run_packing(done, 0, [], name | {"FAULT_AT": "1", "FAULT_DO": "kill"}) == 0:
            raise RuntimeError("the run was not killed before the final file")

    def new_folder(self, name: str) -> Path:
        """Return an empty folder with the case."""
        folder = self.folder / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        life.write_case(folder)
        return folder

    def run_packing(self, folder: Path, ranks: int, more: list[str], variables: dict[str, str]) -> int:
        """Run the map of the trials of packing; return its exit code."""
        command = ["mpirun", "-n", str(ranks)] if ranks else []
        with (folder / "log").open("a") as log:
            return subprocess.run(
                [*command, self.program, *PACKED_RUN, *more],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=os.environ | variables,
                timeout=LONGEST,
            ).returncode


def ended_well(process: subprocess.Popen, folder: Path, what: str) -> None:
    """Wait for a healthy run; it has to end with 0."""
    try:
        code = process.wait(LONGEST)
    except subprocess.TimeoutExpired:
        process.kill()
        raise Failure(ENDED, f"{what} does not end") from None
    if code != 0:
        raise Failure(ENDED, f"{what} ended with {code}: {messages(folder)}")


def messages(folder: Path) -> list[str]:
    """Return the program's own words in the log of a run, without those of mpirun."""
    lines = (folder / "log").read_text(errors="replace").splitlines()
    return [line for line in lines if line.startswith("separatrix: ")]


def compare(folder: Path, expected: str) -> None:
    """Compare the final file with that of an undisturbed run."""
    if life.content_hash(folder / life.NAME) != expected:
        raise Failure(WRONG, "the content differs from that of an undisturbed run")


def resume(bench: Bench, folder: Path, ranks: int, done: int, expected: str, command: list[str]) -> None:
    """Resume without a disturbance: all tiles that were done are kept, and the content is the same."""
    if life.stage(folder) != "done":
        option = ["--resume"] if (folder / f"{life.NAME}.part").exists() else []
        outcome = life.run(bench.program, *command, *option, folder=folder, ranks=ranks, timeout=LONGEST)
        if outcome.code != 0:
            raise Failure(LOST, f"--resume on {ranks} ranks: {outcome.code} {outcome.messages}")
        if done and not re.search(rf"(?<!\d){done} of ", outcome.out):
            raise Failure(LOST, f"{done} tiles were done, then: {outcome.out[:400]}")
    compare(folder, expected)


def killed(bench: Bench, folder: Path, chance: random.Random) -> str:
    """SIGKILL to one rank or to all, at a random moment from the start to the renaming."""
    ranks = chance.choice([0, 1, 2, 3, 4])
    process = life.launch(bench.program, folder, ranks)
    wait_for_moment(process, folder, chance)
    victims = life.ranks_of(process, ranks)
    if victims and chance.random() < 0.5:
        victims = [chance.choice(victims)]
    if process.poll() is not None:
        return "done before"
    life.kill(process, victims)
    return after_kill(bench, folder, max(ranks, 1), chance)


def wait_for_moment(process: subprocess.Popen, folder: Path, chance: random.Random) -> None:
    """Wait for a random moment, most of them while the tiles are computed."""
    sign = chance.choice([None, ".part.new", ".part", ".part", ".part", ".new"])
    while sign and process.poll() is None and not (folder / f"{life.NAME}{sign}").exists():
        time.sleep(0.0005)
    time.sleep(chance.uniform(0, {None: 0.8, ".part": 0.6}.get(sign, 0.02)))


def after_kill(bench: Bench, folder: Path, ranks: int, chance: random.Random) -> str:
    """Look at what is left, and resume."""
    stage, done = life.stage(folder), 0
    if stage in ("fill", "finalise"):
        done, begun = life.tiles_of(folder)
        if begun > ranks:
            raise Failure(LOST, f"{begun} tiles are begun by {ranks} ranks")
    resume(bench, folder, chance.choice([0, 1, 2, 3]), done, bench.reference, life.RUN)
    return stage


def killed_packing(bench: Bench, folder: Path, chance: random.Random) -> str:
    """SIGKILL, half of a write before it in some, at a random call that changes the final file."""
    shutil.copy(bench.folder / "done" / f"{life.NAME}.part", folder)
    done = life.tiles_of(folder)[0]
    ranks = chance.choice([0, 2, 3])
    fault = {"FAULT_NAME": f"{life.NAME}.new", "LD_PRELOAD": str(bench.calls)}
    fault |= {"FAULT_DO": chance.choice(["kill", "tear"]), "FAULT_RANK": str(chance.randrange(max(ranks, 1)))}
    # The calls are shared by the ranks, and rank 0 has most of them.
    most = bench.packing_calls if fault["FAULT_RANK"] == "0" else bench.packing_calls // (4 * max(ranks, 1))
    fault["FAULT_AT"] = str(chance.randint(1, max(1, most)))
    code = bench.run_packing(folder, ranks, ["--resume"], fault)
    if (folder / life.NAME).exists() and (folder / f"{life.NAME}.part").exists():
        compare(folder, bench.packed)
    resume(bench, folder, chance.choice([0, 1, 2, 3]), done, bench.packed, PACKED_RUN)
    return "done before" if code == 0 else "packing"


def killed_on_hosts(bench: Bench, folder: Path, chance: random.Random) -> str:
    """SIGKILL to a rank, or to all that runs on a host, in a run over two or three hosts."""
    ranks = chance.choice([[1, 1], [2, 1], [1, 1, 1], [2, 2]])
    os.chdir(folder)
    with (folder / "log").open("a") as log:
        command = bench.hosts.mpirun(ranks, bench.program, *life.RUN)
        run = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
    wait_for_moment(run, folder, chance)
    host = bench.hosts[chance.randrange(len(ranks))]
    victims = host.processes("separatrix")
    if run.poll() is not None:
        return "done before"
    if victims and chance.random() < 0.7:
        os.kill(chance.choice(victims), signal.SIGKILL)
        what = "one rank"
    else:
        host.kill()
        what = "all of a host"
    try:
        run.wait(30)
    except subprocess.TimeoutExpired:
        what += ", mpirun hung"
    for one in range(3):
        bench.hosts[one].kill()
    run.wait(10)
    after_kill(bench, folder, sum(ranks), chance)
    return what


def late_rank(bench: Bench, folder: Path, chance: random.Random) -> str:
    """A rank opens the working file seconds after the others, which spin meanwhile."""
    ranks = chance.choice([2, 3])
    fault = {"FAULT_NAME": f"{life.NAME}.part", "FAULT_RANK": str(chance.randrange(1, ranks))}
    fault |= {"FAULT_AT": str(chance.randint(6, 9)), "FAULT_DO": "late", "LD_PRELOAD": str(bench.calls)}
    ended_well(life.launch(bench.program, folder, ranks, variables=fault), folder, "a run with a late rank")
    compare(folder, bench.reference)
    return "ended with 0"


def stopped_rank(bench: Bench, folder: Path, chance: random.Random) -> str:
    """A rank is stopped at a random moment and continued seconds later."""
    ranks = chance.choice([2, 3, 4])
    process = life.launch(bench.program, folder, ranks)
    wait_for_moment(process, folder, chance)
    victims = life.ranks_of(process, ranks)
    if victims:
        victim = chance.choice(victims)
        os.kill(victim, signal.SIGSTOP)
        time.sleep(chance.uniform(1, 4))
        os.kill(victim, signal.SIGCONT)
    ended_well(process, folder, "a run with a rank that was stopped")
    compare(folder, bench.reference)
    return "ended with 0"


def lost_rank(bench: Bench, folder: Path, chance: random.Random) -> str:
    """A rank never comes to the last barrier: the others end with 75 and the reason."""
    fault = {"FAULT_NAME": f"{life.NAME}.part", "FAULT_RANK": "1", "FAULT_DO": "arrive", "FAULT_AT": "300"}
    fault |= {"LD_PRELOAD": str(bench.calls), "SEPARATRIX_LAST_WAIT": "2"}
    ranks = chance.choice([2, 3])
    process = life.launch(bench.program, folder, ranks, variables=fault)
    code = process.wait(LONGEST)
    if code != 75 or "a rank has not answered" not in " ".join(messages(folder)):
        raise Failure(LOST, f"ended with {code}: {messages(folder)}")
    resume(bench, folder, chance.choice([0, 1, 2]), life.TILES, bench.reference, life.RUN)
    return "ended with 75"


def full_disk(bench: Bench, folder: Path, chance: random.Random) -> str:
    """A small tmpfs, enlarged before the run is resumed."""
    size = int(chance.uniform(0.05, 1.3) * bench.needed) // 4096 * 4096 + 4096
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], check=True)
    try:
        life.write_case(folder)
        ranks = chance.choice([0, 1, 2, 3])
        outcome = life.run(bench.program, *life.RUN, folder=folder, ranks=ranks, timeout=LONGEST)
        subprocess.run(["mount", "-o", f"remount,size={4 * bench.needed}", folder], check=True)
        if outcome.code not in (0, 73, 74) or (outcome.code and not outcome.messages):
            raise Failure(LOST, f"ended with {outcome.code}: {outcome.err[-400:]}")
        done = life.tiles_of(folder)[0] if (folder / f"{life.NAME}.part").exists() else 0
        resume(bench, folder, chance.choice([0, 1, 2]), done, bench.reference, life.RUN)
    finally:
        subprocess.run(["umount", "-l", folder], check=True)
    return f"ended with {outcome.code}"


def slow_disk(bench: Bench, folder: Path, chance: random.Random) -> str:
    """Each call that changes a file takes milliseconds, on one rank or on all."""
    ranks = chance.choice([1, 2, 3])
    fault = {"FAULT_NAME": life.NAME, "FAULT_AT": str(chance.randint(2, 20)), "FAULT_DO": "slow"}
    fault |= {"LD_PRELOAD": str(bench.calls)}
    if chance.random() < 0.5:
        fault["FAULT_RANK"] = str(chance.randrange(ranks))
    ended_well(life.launch(bench.program, folder, ranks, variables=fault), folder, "a run on a slow disk")
    compare(folder, bench.reference)
    return "ended with 0"
