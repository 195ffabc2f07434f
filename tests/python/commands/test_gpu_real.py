# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files by a GPU, where there is one: those of the processor, to the bit. Skipped elsewhere."""

import subprocess
from pathlib import Path

import h5py
import pytest
from program import KINDS, differences, run, succeed, write_case

ON_GPU = ["--device", "gpu"]
SIZE = ["--set", "axis[1].count=72", "--set", "axis[2].count=70"]
FULL = ["--set", 'run.stop="duration"']
# Beside the machines of the benchmark, which has one with each effect.
EXAMPLES = ("basin_coulomb", "basin_viscous", "basin_stribeck")
CHANGED = {
    "two_barriers": ["--set", "contact.lower=-0.1"],
    "much_friction": ["--set", "friction.kinetic_coefficient=0.5"],
    "elastic": ["--set", "contact.restitution=0.95"],
    "chatter": ["--set", "contact.restitution=0.2"],
    "soft_tiles": [
        *("--set", 'contact={law="kelvin_voigt", stiffness=1e4, damping=20, upper="1.1 m"}'),
        *("--set", "grid.tile=[7, 31]"),
    ],
}


@pytest.fixture(scope="module", autouse=True)
def real_gpu(separatrix, tmp_path_factory) -> str:
    """What the GPU is called."""
    folder = tmp_path_factory.mktemp("asked")
    write_case(folder)
    ended = run(separatrix, *KINDS["map"], *ON_GPU, "-o", "asked.h5", folder=folder)
    if ended.code != 0 or "stand-in" in ended.out:
        pytest.skip("no GPU")
    return ended.out.splitlines()[0]


def compare(program: Path, folder: Path, *command: object) -> None:
    """A run by either device."""
    for device in ("cpu", "gpu"):
        succeed(
            program, *command, "--device", device, "-o", folder / f"{device}.h5", folder=folder, timeout=600
        )
    assert differences(folder / "cpu.h5", folder / "gpu.h5") == []
    with h5py.File(folder / "gpu.h5") as file:
        assert file["provenance"].attrs["device"].startswith("GPU ")


@pytest.mark.parametrize("span", ["settled", "full"])
@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_have_the_same_bits(separatrix, source_dir, tmp_path, example, span):
    words = FULL if span == "full" else []
    compare(separatrix, tmp_path, "basin", source_dir / "examples" / f"{example}.toml", *SIZE, *words)


def machines_of_one_body() -> list[str]:
    """Keys of the machines of the benchmark that a GPU flies; read as text, as its modules are no package."""
    text = (Path(__file__).resolve().parents[3] / "scripts/evidence/bench_peers/rows.py").read_text()
    keys = [part.split('"')[1] for part in text.split("ROWS = (")[1].split("\n    Row(")[1:]]
    return [key for key in keys if not key.startswith("chain_") and key != "pair"]


@pytest.mark.parametrize("span", ["settled", "full"])
@pytest.mark.parametrize("key", machines_of_one_body())
def test_machines_have_the_same_bits(separatrix, source_dir, tmp_path, monkeypatch, key, span):
    monkeypatch.syspath_prepend(str(source_dir / "scripts/evidence/bench_peers"))
    from rows import ROWS

    case = next(row for row in ROWS if row.key == key).write(tmp_path)
    compare(separatrix, tmp_path, "basin", case, *SIZE, *(FULL if span == "full" else []))


@pytest.mark.parametrize("key", CHANGED)
def test_changed_machines_have_the_same_bits(separatrix, tmp_path, key):
    write_case(tmp_path)
    compare(separatrix, tmp_path, *KINDS["map"], *SIZE, *CHANGED[key])


@pytest.mark.parametrize("kind", ["map", "stack", "refined", "points", "sweep"])
def test_files_of_every_kind_have_the_same_bits(separatrix, tmp_path, results, kind):
    output = tmp_path / "gpu.h5"
    ended = succeed(separatrix, *KINDS[kind], *ON_GPU, "-o", output, folder=results["map"].parent)
    assert "computed by GPU 0 (" in ended.out
    assert differences(results[kind], output) == []


def test_more_starts_than_a_pool_have_the_same_bits(separatrix, source_dir, tmp_path):
    """The pool is refilled, also while a half of it flies."""
    case = source_dir / "examples" / "basin_coulomb.toml"
    size = ["--set", "axis[1].count=1300", "--set", "axis[2].count=1300", "--set", "grid.tile=[1300, 1300]"]
    compare(separatrix, tmp_path, "basin", case, *size)


@pytest.mark.parametrize("ranks", [2, 5])
def test_ranks_that_share_a_gpu(mpi_separatrix, tmp_path, results, ranks):
    output = tmp_path / "gpu.h5"
    command = [*KINDS["map"], "--set", "grid.tile=[4, 5]", *ON_GPU, "-o", output]
    succeed(mpi_separatrix, *command, folder=results["map"].parent, ranks=ranks)
    assert differences(results["map"], output) == []


def test_ranks_with_and_without_a_gpu_share_a_map(mpi_separatrix, tmp_path, results):
    output = tmp_path / "mixed.h5"
    program = [mpi_separatrix, *KINDS["map"], "--set", "grid.tile=[4, 5]", "-o", output]
    mixed = ["-n", "1", *program, "--device", "gpu", ":", "-n", "1", *program, "--device", "cpu"]
    ended = subprocess.run(
        ["mpirun", *mixed], cwd=results["map"].parent, capture_output=True, text=True, check=True, timeout=60
    )
    assert "computed by rank 0: GPU 0, 1: processor" in ended.stdout
    assert differences(results["map"], output) == []


@pytest.mark.parametrize("first", ["cpu", "gpu"])
def test_an_interrupted_run_goes_on_with_the_other_device(separatrix, source_dir, tmp_path, first):
    case = source_dir / "examples" / "basin_coulomb.toml"
    size = ["--set", "axis[1].count=1200", "--set", "axis[2].count=1200", "--set", "grid.tile=[100, 100]"]
    command = ["basin", case, *size, "-o", tmp_path / "map.h5"]
    limits = ["--time-limit", "1", "--device", first]
    ended = run(separatrix, *command, *limits, folder=tmp_path)
    assert ended.code == 75, ended
    other = "gpu" if first == "cpu" else "cpu"
    ended = succeed(separatrix, *command, "--resume", "--device", other, folder=tmp_path, timeout=600)
    done = next(line for line in ended.out.splitlines() if " tiles were done before" in line)
    assert not done.startswith("0 of ")
    succeed(separatrix, *command[:-1], tmp_path / "cpu.h5", "--device", "cpu", folder=tmp_path, timeout=600)
    assert differences(tmp_path / "map.h5", tmp_path / "cpu.h5") == []
