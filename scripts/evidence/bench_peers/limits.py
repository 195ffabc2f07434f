# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How near the lanes are to what the processor can do: counts per event, cycles, share of the peak."""

from __future__ import annotations

import datetime
import os
import re
import statistics
import subprocess
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from evidence_rows import processor, table
from ours import FULL, Program
from rows import ROWS, Row

from machine import SOURCE

PAGE = SOURCE / "docs" / "performance_limits.md"
TEMPLATE = Path(__file__).with_name("performance_limits.md.in")
SHOWN = ("coulomb", "cubic")
COUNTED = 60
"""Side of the map whose events are counted."""
EMULATED = {"coulomb": 32, "cubic": 8}
"""Side of the map that valgrind runs."""
ROUNDS = 3
KERNEL = "separatrix_fly_avx2"
"""The widest that valgrind knows."""
DOUBLES = {"zmm": 8, "ymm": 4, "xmm": 2}
ARITHMETIC = re.compile(r"v?(add|sub|mul|div|sqrt|min|max|fn?m(?:add|sub)\d*)(pd|sd)$")
PEAK = 16
"""Additions and multiplications of doubles in a cycle: two vectors of eight, none fused with another."""
LEAST = 2
"""Evaluations of the motion per event that would suffice for a better algorithm: one for its time, one for
the state there."""


@dataclass
class Counts:
    """What the lanes did on a map."""

    events: float
    """Of a trajectory."""
    evaluations: float
    """Of an event."""
    left: float
    """Share of the events that are left to the event loop."""


@dataclass
class Limits:
    """A machine; all but the rate per event."""

    row: Row
    rate: float
    """Trajectories per second of processor time."""
    counts: Counts
    arithmetic: float
    """Operations on doubles, those of lanes that wait included."""
    instructions: float
    megahertz: float

    @property
    def cycles(self) -> float:
        """Of one core."""
        return 1e6 * self.megahertz / (self.rate * self.counts.events)

    @property
    def share(self) -> float:
        """Of the peak."""
        return self.arithmetic / self.cycles / PEAK

    @property
    def bound(self) -> float:
        """Cycles at the present operations per evaluation and the peak, with the fewest evaluations."""
        return self.arithmetic / self.counts.evaluations * LEAST / PEAK


def sizes(count: int) -> list[str]:
    """Settings of a square map."""
    return [word for axis in (1, 2) for word in ("--set", f"axis[{axis}].count={count}")]


def count(case: Path, program: Path, folder: Path) -> Counts | None:
    """What the lanes do; None if the machine has none."""
    counts = folder / "counts"
    counts.unlink(missing_ok=True)
    command = [program, "basin", case, "-o", folder / "counted.h5", *sizes(COUNTED), *FULL, "--force", "-q"]
    subprocess.run(command, check=True, env={**os.environ, "LANE_COUNTS": str(counts)})
    evaluations, events, left = map(int, counts.read_text().split())
    return Counts(events / COUNTED**2, evaluations / events, left / (events + left)) if events else None


def emulated(row: Row, case: Path, program: Path, folder: Path) -> Counter:
    """Executed instructions of the kernel, by address."""
    out = folder / "callgrind.out"
    options = ("--dump-instr=yes", "--compress-pos=no", "--compress-strings=no")
    command = ["valgrind", "--quiet", "--tool=callgrind", f"--callgrind-out-file={out}", *options]
    command += [f"--toggle-collect={KERNEL}", program, "basin", case, "-o", folder / "emulated.h5"]
    side = EMULATED[row.key]
    subprocess.run([*command, *sizes(side), *FULL, "--force", "-q"], check=True, capture_output=True)
    executed, own, inclusive = Counter(), False, False
    for line in out.read_text().splitlines():
        if line.startswith("ob="):
            own = line.endswith("/separatrix")
        elif line.startswith("calls="):
            inclusive = True
        elif line.startswith("0x"):
            address, _, count = line.split()
            if own and not inclusive:
                executed[int(address, 16)] += int(count)
            inclusive = False
    return executed


def mnemonics(program: Path, addresses: Counter) -> dict[int, tuple[str, str]]:
    """Mnemonic and operands of the instructions that were executed."""
    span = (f"--start-address={min(addresses)}", f"--stop-address={max(addresses) + 16}")
    command = ["objdump", "-d", "--no-show-raw-insn", *span, program]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = {}
    for line in text.splitlines():
        match = re.match(r"\s*([0-9a-f]+):\s+(\S+)\s*(.*)", line)
        if match:
            found[int(match[1], 16)] = (match[2], match[3])
    return found


def operations(name: str, operands: str) -> int:
    """Additions, multiplications and so on that an instruction does."""
    match = ARITHMETIC.match(name)
    if match is None:
        return 0
    if match[2] == "sd":
        return 1
    return next((doubles for register, doubles in DOUBLES.items() if register in operands), 2)


def measure(row: Row, program: Program, build: Path) -> Limits:
    """Everything about a machine."""
    case = row.write(program.folder)
    counts = count(case, build / "bin" / "separatrix_counted", program.folder)
    executed = emulated(row, case, program.program, program.folder)
    known = mnemonics(program.program, executed)
    done = sum(count * operations(*known.get(address, ("", ""))) for address, count in executed.items())
    total = EMULATED[row.key] ** 2 * counts.events
    rates = []
    for _ in range(ROUNDS):
        short, long = (
            program.timed(side**2, "basin", case, "-o", program.folder / "timed.h5", *sizes(side), *FULL)
            for side in row.fast
        )
        rates.append((long - short).points / (long - short).cpu)
    rate = statistics.median(rates)
    return Limits(row, rate, counts, done / total, executed.total() / total, megahertz())


def megahertz() -> float:
    """Clock of the processor [MHz], as the system reports it."""
    return float(processor()["cpu MHz"])


def limits_table(found: list[Limits]) -> str:
    """A column for each machine."""
    rows = [
        ["trajectories/s/core, 50 s", *(f"{one.rate:,.0f}".replace(",", " ") for one in found)],
        ["events per trajectory", *(f"{one.counts.events:.1f}" for one in found)],
        ["evaluations of the motion", *(f"{one.counts.evaluations:.2f}" for one in found)],
        ["arithmetic operations", *(f"{one.arithmetic:,.0f}".replace(",", " ") for one in found)],
        [
            "instructions, for vectors of four",
            *(f"{one.instructions:,.0f}".replace(",", " ") for one in found),
        ],
        ["cycles", *(f"{one.cycles:,.0f}".replace(",", " ") for one in found)],
        ["operations per cycle", *(f"{one.arithmetic / one.cycles:.2f}" for one in found)],
        [f"share of the peak, {PEAK} per cycle", *(f"{100 * one.share:.0f} %" for one in found)],
        ["lower bound of the cycles", *(f"{one.bound:,.1f}".replace(",", " ") for one in found)],
        ["cycles relative to the bound", *(f"{one.cycles / one.bound:.1f}" for one in found)],
    ]
    return table(["per event except in the first two rows", *(one.row.title for one in found)], rows)


def shares_table(program: Program, build: Path) -> str:
    """What the lanes of every machine do."""
    rows = []
    for row in ROWS:
        found = count(row.write(program.folder), build / "bin" / "separatrix_counted", program.folder)
        if found is None:
            rows.append([row.title, "no lanes", "", "100 %"])
        else:
            cells = [f"{found.events:.1f}", f"{found.evaluations:.2f}", f"{100 * found.left:.3f} %"]
            rows.append([row.title, *cells])
    return table(
        ["machine", "events per trajectory", "evaluations per event", "left to the event loop"], rows
    )


def report(program: Program, build: Path) -> str:
    """Measure, write the page, and return its table."""
    before = os.getloadavg()[0]
    found = [measure(row, program, build) for row in ROWS if row.key in SHOWN]
    text = limits_table(found)
    fields = processor()
    PAGE.write_text(
        TEMPLATE.read_text().format(
            table=text,
            shares=shares_table(program, build),
            counted=COUNTED,
            peak=PEAK,
            least=LEAST,
            date=datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
            processor=f"{fields.get('model name')}, {fields['cpu MHz']} MHz, {os.cpu_count()} cores",
            load=f"{before:.1f}, {os.getloadavg()[0]:.1f}",
            commit=program.version["commit"],
        )
    )
    return text
