# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The same content for any ranks, tiles, resume history, instruction set and mathematical library."""

import os
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import life
import pytest

SEED = 20261125
RANKS = [1, 2, 3, 4, 7]
TILES = ["[1, 52]", "[44, 1]", "[5, 7]", "[8, 8]", "[16, 11]", "[44, 52]"]
STRIBECK = (
    "friction={law='coulomb_stribeck', kinetic_coefficient=0.2, static_coefficient=0.4,"
    " stribeck_velocity=0.5, stribeck_exponent=0.7}"
)
SMALL = ["--set", "axis[1].count=12", "--set", "axis[2].count=14", "--set", "run.duration=20"]
# What goes through every part of the numerics.
WORK = {
    "exact": ["basin"],
    "adaptive": ["basin", "--set", "integrator.flight='adaptive'", *SMALL],
    "stribeck": ["basin", "--set", STRIBECK, *SMALL],
    "sweep": ["sweep"],
    "trajectory": ["trajectory"],
}
# What glibc 2.33 and later call the instructions that its sin, exp and so on choose by.
HIDDEN = "glibc.cpu.hwcaps=-AVX512F,-AVX2,-AVX,-FMA,-FMA4"


def content_of(program: Path, folder: Path, work: str, tunables: str = "") -> str:
    """Hash of the content of a piece of work."""
    command, *settings = WORK[work]
    environment = {**os.environ, "GLIBC_TUNABLES": tunables} if tunables else os.environ
    subprocess.run(
        [program, command, "case.toml", *settings, "-o", "work.h5", "--force", "--quiet"],
        cwd=folder,
        env=environment,
        check=True,
        timeout=120,
    )
    return life.content_hash(folder / "work.h5")


def fused(program: Path) -> list[str]:
    """Fused multiply-adds in a program, if there is a disassembler."""
    if shutil.which("objdump") is None:
        return []
    text = subprocess.run(
        ["objdump", "-d", "--no-show-raw-insn", program], capture_output=True, text=True, check=True
    ).stdout
    return re.findall(r"\tvfn?m(?:add|sub)\S*", text)


def test_ranks_tiles_and_histories(mpi_separatrix, tmp_path, reference, amount, figures):
    chance = random.Random(SEED)
    pairs = [(ranks, tile) for ranks in RANKS for tile in TILES]
    expected = life.content_hash(reference)
    stops = 0
    chosen = chance.sample(pairs, amount(3, 18))
    for number, (ranks, tile) in enumerate(chosen):
        folder = tmp_path / str(number)
        folder.mkdir()
        life.write_case(folder)
        command = [*life.RUN, "--set", f"grid.tile={tile}", "--resume"]
        # Stopped up to three times, each time with other ranks.
        for _ in range(chance.randint(0, 3)):
            more = ["--time-limit", round(chance.uniform(0.05, 0.4), 3)]
            outcome = life.run(mpi_separatrix, *command, *more, folder=folder, ranks=chance.choice(RANKS))
            if outcome.code == 0:
                break
            assert outcome.code == 75, outcome
            stops += 1
        if not (folder / life.NAME).exists():
            life.succeed(mpi_separatrix, *command, folder=folder, ranks=ranks)
        assert life.content_hash(folder / life.NAME) == expected, (ranks, tile)
    figures.update(seed=SEED, runs=len(chosen), ranks=RANKS, tiles=len(TILES), stops=stops, content=expected)


def mathematics(tunables: str) -> bytes:
    """What glibc's exp and sin give."""
    text = "import math; print([(math.exp(i * 0.001), math.sin(i * 0.37)) for i in range(20000)])"
    variables = {**os.environ, "GLIBC_TUNABLES": tunables}
    return subprocess.run([sys.executable, "-c", text], env=variables, capture_output=True, check=True).stdout


@pytest.mark.parametrize("work", WORK)
def test_a_mathematical_library_without_fma(separatrix, tmp_path, figures, work):
    if mathematics("") == mathematics(HIDDEN):
        pytest.skip("this glibc gives the same with and without FMA, or this processor has none")
    life.write_case(tmp_path)
    assert content_of(separatrix, tmp_path, work) == content_of(separatrix, tmp_path, work, HIDDEN)
    figures.update(hidden=HIDDEN, glibc_itself_differs=True)


@pytest.mark.parametrize("work", WORK)
def test_other_instruction_sets(separatrix, tmp_path, figures, work):
    """Builds for other processors, in the folders that $SEPARATRIX_MARCH_BUILDS names (colons between)."""
    builds = [Path(build) for build in os.environ.get("SEPARATRIX_MARCH_BUILDS", "").split(":") if build]
    if not builds:
        pytest.skip("SEPARATRIX_MARCH_BUILDS names no builds")
    life.write_case(tmp_path)
    expected = content_of(separatrix, tmp_path, work)
    seen = []
    for build in builds:
        program = build / "bin" / "separatrix"
        version = subprocess.run([program, "--version"], capture_output=True, text=True)
        if version.returncode:
            continue
        found = [word for word in version.stdout.split() if word.startswith("-march=")]
        assert found, version.stdout
        assert not fused(program), found
        assert content_of(program, tmp_path, work) == expected, found
        seen += found[:1]
    assert seen
    figures.update(builds=seen, content=expected)
