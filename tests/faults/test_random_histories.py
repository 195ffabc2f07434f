# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""However a result came about, it has the same bits: lanes, ranks, nodes, tiles, stops, shares by chance."""

import random
from pathlib import Path

import life
import pytest
from program import STACK, STARTS

SEED = 20261126
WIDTHS = [None, 2, 4, 8]
RANKS = [0, 1, 2, 3, 4]
MAP = ["basin", "case.toml", "--set", "axis[1].count=61", "--set", "axis[2].count=53"]
PAIR = ["--set", 'run.stop="duration"', "--set", "run.duration=40"]
# What is computed, the lengths of its grid, and whether it can be shared.
WORK = {
    "map": ([*MAP, *PAIR], (61, 53), True),
    "captured": (MAP, (61, 53), True),
    "stack": (["basin", "case.toml", "--set", STACK], (3, 7, 11), True),
    "refined": ([*MAP, "--set", "refine.step=4", "--set", "refine.block=8"], None, True),
    "points": (["points", "case.toml", "--list", "starts.csv"], None, True),
    "sweep": (["sweep", "case.toml"], None, False),
}


def write_inputs(folder: Path) -> None:
    """The case and the list of starts."""
    life.write_case(folder)
    rows = [f"{i / 1200},{i % 13 - 6},{0.8 + 0.5 * (i // 100) / 12}" for i in range(1200)]
    (folder / "starts.csv").write_text(STARTS + "\n".join(rows) + "\n")


@pytest.fixture(scope="module")
def expected(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The content of each piece of work by one process at once, in the widest lanes."""
    folder = tmp_path_factory.mktemp("expected")
    write_inputs(folder)
    found = {}
    for name, (command, _, _) in WORK.items():
        life.succeed(separatrix, *command, "-o", f"{name}.h5", folder=folder)
        found[name] = life.content_hash(folder / f"{name}.h5")
    return found


class History:
    """One way to a file, chosen by chance."""

    def __init__(self, chance: random.Random, name: str, program: Path, folder: Path, environment) -> None:
        self.chance, self.program, self.folder, self.environment = chance, program, folder, environment
        self.command, lengths, shared = WORK[name]
        self.tile = [chance.randint(1, length) for length in lengths] if lengths else None
        self.shares = chance.choice([0, 0, 1, 2, 3, 5]) if shared else 0
        self.stops = 0

    def compute(self, more: list[str], first: bool) -> None:
        """Stopped up to three times, each time with other ranks, nodes and lanes, then to the end."""
        again = not first
        stops = self.chance.choice([0, 1, 1, 2, 3])
        while True:
            limit = ["--time-limit", f"{self.chance.uniform(0.001, 0.25):.4f}"] if stops > 0 else []
            outcome = self.attempt([*more, *limit, *(["--resume"] if again else [])])
            if outcome.code == 0:
                return
            assert outcome.code == 75 and limit, outcome
            stops -= 1
            self.stops += 1
            again = True

    def attempt(self, more: list[str]) -> life.Outcome:
        """One start of the program."""
        width, ranks = self.chance.choice(WIDTHS), self.chance.choice(RANKS)
        if width is None:
            self.environment.delenv("SEPARATRIX_LANE_WIDTH", raising=False)
        else:
            self.environment.setenv("SEPARATRIX_LANE_WIDTH", str(width))
        nodes = (
            ["--ranks-per-node", str(self.chance.randint(1, 3))]
            if ranks and self.chance.random() < 0.5
            else []
        )
        tile = ["--set", f"grid.tile={self.tile}"] if self.tile else []
        asked = [*self.command, *tile, "-o", life.NAME, *nodes, *more]
        return life.run(self.program, *asked, folder=self.folder, ranks=ranks)

    def run(self) -> str:
        """The content at the end."""
        if self.shares == 0:
            self.compute([], first=True)
            return life.content_hash(self.folder / life.NAME)
        parts = [f"{life.NAME}.shard-{i + 1}-of-{self.shares}.part" for i in range(self.shares)]
        order = self.chance.sample(range(self.shares), self.shares)
        for number, i in enumerate(order):
            taken = ["--catalogue", parts[order[0]]] if number > 0 and self.command[0] == "basin" else []
            self.compute(["--shard", f"{i + 1}/{self.shares}", *self.chance.choice([taken, []])], first=True)
        self.chance.shuffle(parts)
        life.succeed(self.program, "merge", life.NAME, *parts, folder=self.folder)
        return life.content_hash(self.folder / life.NAME)


def test_any_history_gives_the_same_bits(mpi_separatrix, tmp_path, monkeypatch, amount, figures, expected):
    counts = {"histories": 0, "shares": 0, "stops": 0}
    names = list(WORK)
    for number in range(amount(len(names), 20 * len(names))):
        name = names[number % len(names)]
        folder = tmp_path / str(number)
        folder.mkdir()
        write_inputs(folder)
        # How often a run is stopped depends on the machine, and shall not decide about the next history.
        history = History(random.Random(f"{SEED} {number}"), name, mpi_separatrix, folder, monkeypatch)
        assert history.run() == expected[name], (number, name, vars(history))
        counts["histories"] += 1
        counts["shares"] += history.shares
        counts["stops"] += history.stops
    assert counts["stops"] > 0 and counts["shares"] > 0
    figures.update(seed=SEED, widths="2, 4, 8 and the widest", ranks=RANKS[1:], work=names, **counts)
