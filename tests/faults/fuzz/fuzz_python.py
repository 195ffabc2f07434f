# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""fuzz_python.py TARGET SEEDS WORK --seconds S --seed N: the package's readers under changed inputs.

TARGET is `figures`, result files of which every variable is read and decoded, or `records`, measured records
in CSV and HDF5. Only the package's own exception may come out.
"""

import json
import random
import signal
import struct
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from separatrix import SeparatrixError, decode_flags, open_result, table
from separatrix.discovery.measured.records import read_record
from separatrix.open import reading

LONGEST_SECONDS = 10


def main() -> int:
    """Read seeds, then changed ones, until the time is over."""
    target, seeds_folder, work = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    seconds, seed = float(sys.argv[5]), int(sys.argv[7])
    reader = {"figures": read_result, "records": read_record}[target]
    chance = random.Random(seed)
    seeds = [path.read_bytes() for path in sorted(seeds_folder.iterdir())]
    codes: Counter[int] = Counter()
    inputs = 0
    deadline = time.monotonic() + seconds
    chance.shuffle(seeds)
    for data in seeds:
        if deadline - time.monotonic() < seconds / 2:
            break
        inputs += 1
        codes[read(reader, data, work, inputs)] += 1
    while time.monotonic() < deadline:
        inputs += 1
        codes[read(reader, change(chance.choice(seeds), chance), work, inputs)] += 1
    print(json.dumps({"target": target, "inputs": inputs, "codes": {str(k): v for k, v in codes.items()}}))
    return 0


def change(data: bytes, chance: random.Random) -> bytes:
    """Flip bits, overwrite ranges, cut."""
    changed = bytearray(data)
    for _ in range(chance.randint(1, 6)):
        if not changed:
            break
        at = chance.randrange(len(changed))
        what = chance.randrange(6)
        if what < 3:
            changed[at] ^= 1 << chance.randrange(8)
        elif what == 3:
            changed[at : at + 8] = struct.pack("<q", chance.choice([0, -1, 2**31, 2**62, 255]))[
                : len(changed) - at
            ]
        elif what == 4:
            changed[at : at + chance.randrange(64)] = chance.randbytes(chance.randrange(64))
        else:
            del changed[at + chance.randrange(len(changed)) :]
    return bytes(changed)


def read_result(path: Path) -> None:
    """Everything in a result file."""
    with reading(path), open_result(path) as result:
        for variable in result.variables.values():
            if variable.size < 2**24:
                variable.load()
        table(result, "catalogue").load()
        for name in ("regime", "reason"):
            if name in result:
                decode_flags(result[name])


def read(reader: Callable[[Path], object], data: bytes, work: Path, number: int) -> int:
    """Read one input; 0, or the exit code that the command would end with."""
    (work / "current").write_bytes(struct.pack("<QQ", len(data), number) + data)
    path = work / "input.h5"
    path.write_bytes(data)
    # Of the processor; the clock may run longer on a busy machine.
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_SECONDS)
    try:
        reader(path)
    except SeparatrixError as error:
        return error.code
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    return 0


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    sys.exit(main())
