# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps by the kernel of a GPU, compiled for the host: those of the processor; and what may go wrong."""

import importlib.machinery
import importlib.util
import subprocess
import time
from pathlib import Path

import h5py
import pytest
from program import FOLD, KINDS, differences, run, succeed, write_case

ON_GPU = ["--device", "gpu"]
STRANGE = {
    "duration": ["--set", 'run.stop="duration"', "--set", "run.duration=20"],
    "soft": [
        *("--set", 'contact={law="kelvin_voigt", stiffness=1e4, damping=20, upper="1.1 m"}'),
        *("--set", "grid.tile=[7, 31]"),
    ],
    "cubic": ["--set", "effect={cubic_spring={stiffness=20}}", "--set", "run.duration=20"],
}
FAULTY_CALLS = [1, 2, 5, 9, 14, 15, 16, 18, 19, 21, 30, 60]


@pytest.fixture
def on_host(monkeypatch):
    """Two GPUs, which are the host, and that are taken for little work as well."""
    monkeypatch.setenv("SEPARATRIX_GPU_ON_HOST", "2")
    monkeypatch.setenv("SEPARATRIX_GPU_STARTS", "1")


@pytest.mark.parametrize("kind", ["map", "stack", "refined", "points", "sweep"])
def test_the_device_does_not_matter(separatrix, tmp_path, results, on_host, kind):
    output = tmp_path / "gpu.h5"
    ended = succeed(separatrix, *KINDS[kind], *ON_GPU, "-o", output, folder=results["map"].parent)
    assert "computed by GPU 0 (stand-in on the host, for tests)" in ended.out
    assert differences(results[kind], output) == []
    with h5py.File(output) as file:
        assert file["provenance"].attrs["device"].startswith("GPU 0")
    with h5py.File(results[kind]) as file:
        assert file["provenance"].attrs["device"].startswith("processor, vectors of ")


@pytest.mark.parametrize("case", STRANGE)
def test_nor_does_it_for_other_machines_and_spans(separatrix, tmp_path, results, on_host, case):
    for device in ("cpu", "gpu"):
        command = [*KINDS["map"], *STRANGE[case], "--device", device, "-o", tmp_path / f"{device}.h5"]
        succeed(separatrix, *command, folder=results["map"].parent)
    assert differences(tmp_path / "cpu.h5", tmp_path / "gpu.h5") == []


@pytest.mark.parametrize("threads", ["2", "3"])
def test_nor_do_threads(separatrix, tmp_path, results, on_host, monkeypatch, threads):
    """Two have a part of a pool that is large enough each, and refill it."""
    monkeypatch.setenv("SEPARATRIX_GPU_THREADS", threads)
    monkeypatch.setenv("SEPARATRIX_GPU_BODIES", "3200")
    monkeypatch.setenv("OMP_WAIT_POLICY", "passive")
    many = ["--set", "axis[1].count=90", "--set", "axis[2].count=100", "--set", "grid.tile=[90, 100]"]
    for device in ("cpu", "gpu"):
        command = [*KINDS["map"], *many, "--device", device, "-o", tmp_path / f"{device}.h5"]
        succeed(separatrix, *command, folder=results["map"].parent)
    assert differences(tmp_path / "cpu.h5", tmp_path / "gpu.h5") == []


def test_ranks_take_the_devices_in_turn(mpi_separatrix, tmp_path, results, on_host):
    output = tmp_path / "gpu.h5"
    command = [*KINDS["map"], *ON_GPU, "--set", "grid.tile=[4, 5]", "-o", output]
    ended = succeed(mpi_separatrix, *command, folder=results["map"].parent, ranks=3)
    assert "computed by rank 0: GPU 0, 1: GPU 1, 2: GPU 0" in ended.out
    assert differences(results["map"], output) == []


def test_ranks_with_one_device_are_named_together(mpi_separatrix, tmp_path, results, on_host, monkeypatch):
    monkeypatch.setenv("SEPARATRIX_GPU_ON_HOST", "1")
    output = tmp_path / "gpu.h5"
    command = [*KINDS["map"], *ON_GPU, "--set", "grid.tile=[4, 5]", "-o", output]
    ended = succeed(mpi_separatrix, *command, folder=results["map"].parent, ranks=3)
    assert "computed by rank 0-2: GPU 0" in ended.out
    assert differences(results["map"], output) == []


def test_ranks_with_and_without_a_gpu_share_a_map(mpi_separatrix, tmp_path, results):
    output = tmp_path / "mixed.h5"
    program = [mpi_separatrix, *KINDS["map"], "--set", "grid.tile=[4, 5]", "-o", output]
    gpu = ["-x", "SEPARATRIX_GPU_ON_HOST=1"]
    mixed = ["-n", "1", *gpu, *program, *ON_GPU, ":", "-n", "1", *program, "--device", "cpu"]
    ended = subprocess.run(
        ["mpirun", *mixed], cwd=results["map"].parent, capture_output=True, text=True, check=True, timeout=60
    )
    assert "computed by rank 0: GPU 0, 1: processor" in ended.stdout
    assert differences(results["map"], output) == []


@pytest.mark.parametrize(("capabilities", "number"), [("75,86", 1), ("120,75", 0), ("70,75", None)])
def test_a_gpu_without_code_for_it_is_passed_over(
    separatrix, tmp_path, results, on_host, monkeypatch, capabilities, number
):
    monkeypatch.setenv("SEPARATRIX_GPU_CAPABILITY", capabilities)
    ended = run(separatrix, *KINDS["map"], *ON_GPU, "-o", tmp_path / "map.h5", folder=results["map"].parent)
    if number is None:
        assert ended.code == 64
        assert "of 2, none has the compute capability that this build has code for, from 8.0 on" in ended.err
    else:
        assert ended.code == 0
        assert f"computed by GPU {number} (" in ended.out


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ([], "--device gpu: found no GPU on "),
        (["--set", 'integrator.lanes="off"'], "found a machine that only a processor flies"),
    ],
)
@pytest.mark.parametrize("count", ["0", "-1"])
def test_a_gpu_that_cannot_help_is_refused(separatrix, results, monkeypatch, more, words, count):
    monkeypatch.setenv("SEPARATRIX_GPU_ON_HOST", count)
    ended = run(separatrix, *KINDS["map"], *ON_GPU, *more, "-o", "none.h5", folder=results["map"].parent)
    assert ended.code == 64
    assert words in ended.err
    assert "allowed are auto and cpu" in ended.err
    assert not (results["map"].parent / "none.h5.part").exists()


@pytest.mark.parametrize("kind", ["plane", "map"])
@pytest.mark.parametrize("how", ["--validate", "--dry-run", "--force"])
def test_a_gpu_is_refused_where_nothing_flies_on_it(separatrix, tmp_path, results, monkeypatch, kind, how):
    """A plane of parameters, even where there is a GPU; and always before anything is done."""
    monkeypatch.setenv("SEPARATRIX_GPU_ON_HOST", "1" if kind == "plane" else "0")
    ended = run(separatrix, *KINDS[kind], *ON_GPU, how, "-o", tmp_path / "a.h5", folder=results["map"].parent)
    assert ended.code == 64
    words = {"plane": "found a basin that has no starts to fly together", "map": "found no GPU on "}
    assert f"--device gpu: {words[kind]}" in ended.err


@pytest.mark.parametrize(
    ("kind", "more", "device"),
    [
        ("plane", [], "processor"),
        ("sweep", [], "processor"),
        ("points", [], "processor"),
        ("refined", [], "processor"),
        ("map", [], "processor"),
        ("map", ["--set", "axis[1].count=64", "--set", "axis[2].count=64"], "GPU 0"),
    ],
)
def test_auto_takes_a_gpu_for_many_starts_only(
    separatrix, tmp_path, results, on_host, monkeypatch, kind, more, device
):
    monkeypatch.delenv("SEPARATRIX_GPU_STARTS")
    succeed(separatrix, *KINDS[kind], *more, "-o", tmp_path / "auto.h5", folder=results["map"].parent)
    with h5py.File(tmp_path / "auto.h5") as file:
        assert file["provenance"].attrs["device"].startswith(device)


MANY = ["--set", "axis[1].count=90", "--set", "axis[2].count=100"]
TAKEN = {"20": "200 starts/s; the processor was taken", "200": "2000 starts/s; the GPU was taken"}


@pytest.fixture(scope="module")
def many(separatrix, results, tmp_path_factory):
    """A map of so many starts that both devices are measured, by the processor."""
    output = tmp_path_factory.mktemp("many") / "cpu.h5"
    succeed(separatrix, *KINDS["map"], *MANY, "--device", "cpu", "-o", output, folder=results["map"].parent)
    return output


@pytest.mark.parametrize("percent", TAKEN)
def test_auto_takes_what_is_faster(separatrix, tmp_path, results, on_host, monkeypatch, many, percent):
    """By a clock that counts: the processor does 1000 starts per second, the GPU so many percent of that."""
    monkeypatch.setenv("SEPARATRIX_GPU_COUNTED", percent)
    ended = succeed(
        separatrix, *KINDS["map"], *MANY, "-o", tmp_path / "auto.h5", folder=results["map"].parent
    )
    assert f"measured: processor 1000 starts/s, GPU {TAKEN[percent]}" in ended.out
    assert "(stand-in on the host, for tests), or the processor where that is faster" in ended.out
    assert differences(tmp_path / "auto.h5", many) == []


@pytest.mark.parametrize("percent", TAKEN)
def test_every_rank_takes_what_is_faster(
    mpi_separatrix, tmp_path, results, on_host, monkeypatch, many, percent
):
    monkeypatch.setenv("SEPARATRIX_GPU_COUNTED", percent)
    command = [*KINDS["map"], *MANY, "-o", tmp_path / "auto.h5"]
    ended = succeed(mpi_separatrix, *command, folder=results["map"].parent, ranks=2)
    assert "measured (means of 2 ranks): processor 1000 starts/s" in ended.out
    assert differences(tmp_path / "auto.h5", many) == []


@pytest.mark.parametrize("device", ["cpu", "gpu"])
def test_only_auto_measures(separatrix, tmp_path, results, on_host, monkeypatch, device):
    monkeypatch.setenv("SEPARATRIX_GPU_COUNTED", "20" if device == "gpu" else "500")
    command = [*KINDS["map"], *MANY, "--device", device, "-o", tmp_path / "map.h5"]
    ended = succeed(separatrix, *command, folder=results["map"].parent)
    assert "measured" not in ended.out
    assert "where that is faster" not in ended.out
    with h5py.File(tmp_path / "map.h5") as file:
        wanted = "GPU 0" if device == "gpu" else "processor"
        assert file["provenance"].attrs["device"].startswith(wanted)


@pytest.mark.parametrize("kind", ["map", "refined", "points", "sweep"])
def test_a_small_run_stays_on_the_processor(separatrix, tmp_path, results, on_host, monkeypatch, kind):
    """By the clock that counts it ends before the processor has been measured for a second."""
    monkeypatch.setenv("SEPARATRIX_GPU_COUNTED", "1")
    ended = succeed(separatrix, *KINDS[kind], "-o", tmp_path / "auto.h5", folder=results["map"].parent)
    assert "measured: processor 1000 starts/s, GPU not tried; too few starts to choose" in ended.out
    assert differences(tmp_path / "auto.h5", results[kind]) == []


def test_a_run_goes_on_whatever_was_taken(separatrix, tmp_path, results, on_host, monkeypatch, many):
    """The GPU fails while it is measured; then the processor is taken, in the tiles that are left."""
    command = [*KINDS["map"], *MANY, "--set", "grid.tile=[30, 50]", "-o", tmp_path / "auto.h5"]
    with monkeypatch.context() as fault:
        fault.setenv("SEPARATRIX_GPU_COUNTED", "100")
        fault.setenv("SEPARATRIX_GPU_FAULT", "40")
        ended = run(separatrix, *command, folder=results["map"].parent)
    assert ended.code == 75
    assert "with --device cpu without a GPU" in ended.err
    monkeypatch.setenv("SEPARATRIX_GPU_COUNTED", "20")
    ended = succeed(separatrix, *command, "--resume", folder=results["map"].parent)
    assert "the processor was taken" in ended.out
    assert differences(tmp_path / "auto.h5", many) == []


def test_shares_take_what_is_faster_each(separatrix, tmp_path, results, on_host, monkeypatch, many):
    command = [*KINDS["map"], *MANY, "-o", tmp_path / "auto.h5"]
    for share, percent in enumerate(TAKEN, 1):
        monkeypatch.setenv("SEPARATRIX_GPU_COUNTED", percent)
        ended = succeed(separatrix, *command, "--shard", f"{share}/2", folder=results["map"].parent)
        assert TAKEN[percent] in ended.out
    parts = sorted(tmp_path.glob("auto.h5.shard-*.part"))
    succeed(separatrix, "merge", tmp_path / "auto.h5", *parts, folder=results["map"].parent)
    assert differences(tmp_path / "auto.h5", many) == []


def test_other_devices_are_refused(separatrix, results):
    ended = run(separatrix, *KINDS["map"], "--device", "tpu", folder=results["map"].parent)
    assert ended.code == 64
    assert "--device: found 'tpu', allowed auto, cpu, gpu" in ended.err
    ended = run(separatrix, "trajectory", "case.toml", *ON_GPU, folder=results["map"].parent)
    assert ended.code == 64
    assert "--device belongs to the commands basin, sweep, points" in ended.err


@pytest.mark.parametrize("call", FAULTY_CALLS)
def test_a_gpu_that_fails_leaves_a_file_to_go_on_with(
    separatrix, tmp_path, results, on_host, monkeypatch, call
):
    """From that call on every one fails, as CUDA's do."""
    output = tmp_path / "map.h5"
    command = [*KINDS["map"], "--set", "grid.tile=[4, 31]", "-o", output]
    with monkeypatch.context() as fault:
        fault.setenv("SEPARATRIX_GPU_FAULT", str(call))
        ended = run(separatrix, *command, *ON_GPU, folder=results["map"].parent)
    assert ended.code == 75
    assert "GPU 0: cuda" in ended.err
    assert "failure made for a test (CUDA error 719)" in ended.err
    assert "with --resume (without --force) goes on, with --device cpu without a GPU" in ended.err
    assert not output.exists()
    ended = succeed(separatrix, *command, "--resume", "--device", "cpu", folder=results["map"].parent)
    assert " of 5 tiles were done before" in ended.out
    assert differences(results["map"], output) == []


@pytest.mark.long
def test_a_gpu_that_fails_in_a_second_look_leaves_a_file_to_go_on_with(
    separatrix, tmp_path, on_host, monkeypatch
):
    """The last of all calls is made there."""
    write_case(tmp_path, FOLD)
    output = tmp_path / "map.h5"
    command = ["basin", "case.toml", "--set", "grid.tile=[20, 20]", "-o", output]
    last, beyond = 0, 8192
    while beyond - last > 1:
        call = (last + beyond) // 2
        with monkeypatch.context() as fault:
            fault.setenv("SEPARATRIX_GPU_FAULT", str(call))
            ended = run(separatrix, *command, *ON_GPU, "--force", folder=tmp_path)
        last, beyond = (call, beyond) if ended.code else (last, call)
    with monkeypatch.context() as fault:
        fault.setenv("SEPARATRIX_GPU_FAULT", str(last))
        failed = run(separatrix, *command, *ON_GPU, "--force", folder=tmp_path)
    output.unlink(missing_ok=True)
    assert failed.code == 75
    with h5py.File(tmp_path / "map.h5.part") as file:
        assert file["second_look/start"][0, -1] != 0
    assert "with --resume (without --force) goes on, with --device cpu without a GPU" in failed.err
    succeed(separatrix, *command, "--resume", "--device", "cpu", folder=tmp_path)
    succeed(separatrix, *command[:-1], tmp_path / "cpu.h5", "--device", "cpu", folder=tmp_path)
    assert differences(output, tmp_path / "cpu.h5") == []


def test_a_run_goes_on_with_the_tiles_of_a_gpu(separatrix, tmp_path, results, on_host, monkeypatch):
    """They are larger where the case leaves them open; the processor takes them as they are."""
    larger = ["--set", "axis[1].count=70", "--set", "axis[2].count=90", "--set", "run.duration=10"]
    command = [*KINDS["map"], *larger, "-o", tmp_path / "map.h5"]
    with monkeypatch.context() as fault:
        fault.setenv("SEPARATRIX_GPU_FAULT", "70")
        assert run(separatrix, *command, *ON_GPU, folder=results["map"].parent).code == 75
    succeed(separatrix, *command, "--resume", "--device", "cpu", folder=results["map"].parent)
    succeed(separatrix, *command[:-1], tmp_path / "cpu.h5", "--device", "cpu", folder=results["map"].parent)
    assert differences(tmp_path / "map.h5", tmp_path / "cpu.h5") == []
    with h5py.File(tmp_path / "map.h5") as file, h5py.File(tmp_path / "cpu.h5") as reference:
        assert file["tiles/tile_shape"][0] > reference["tiles/tile_shape"][0]


def test_a_gpu_stops_within_a_tile(separatrix, tmp_path, on_host):
    """One tile of some minutes, computed at one go."""
    write_case(tmp_path)
    slow = ["--set", 'run.stop="duration"', "--set", "run.duration=2000", "--set", "grid.tile=[300, 300]"]
    slow += ["--set", "axis[1].count=300", "--set", "axis[2].count=300", "--set", "attractors.sample=1"]
    began = time.monotonic()
    ended = run(
        separatrix, "basin", "case.toml", *slow, *ON_GPU, "--time-limit", "2", "-o", "map.h5", folder=tmp_path
    )
    assert ended.code == 75
    assert "stopped early" in ended.out
    assert time.monotonic() - began < 10


@pytest.fixture(scope="module")
def check(source_dir: Path):
    """The script that reads the code for GPUs, as a module."""
    path = str(source_dir / "scripts/evidence/gpu_check")
    loader = importlib.machinery.SourceFileLoader("gpu_check", path)
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("gpu_check", loader))
    loader.exec_module(module)
    return module


def test_what_is_fused_or_approximate_is_found(check):
    exact = "\tmul.rn.f64 %fd1, %fd2, %fd3;\n\t@%p1 add.rn.f64 %fd1, %fd2, %fd3;\n\tneg.f64 %fd1, %fd2;\n"
    assert check.faults_of_ptx(exact + "\tsetp.lt.f64 %p1, %fd1, %fd2;\n\tmov.f64 %fd1, 0d0;\n") == []
    assert check.faults_of_ptx(exact + "\tfma.rn.f64 %fd1, %fd2, %fd3, %fd4;\n") == ["1 fma.rn.f64"]
    assert check.faults_of_ptx("\tadd.f64 %fd1, %fd2, %fd3;\n") == ["1 add.f64"]
    assert check.faults_of_ptx("\tdiv.approx.f32 %f1, %f2, %f3;\n") == ["1 div.approx.f32"]


def test_fused_operations_of_divisions_are_distinguished(check):
    code = (
        "\t\tFunction : _Z1kN6flightE0EE\n        /*0040*/                   MUFU.RCP64H R3, R0 ;\n"
        "        /*0070*/              @!P0 DFMA R4, R2, -R6, 1 ;\n        /*0080*/     DMUL R4, R4, R4 ;\n"
    )
    kernels = check.operations_of_code(code)
    assert [check.flight_of(name) for name in kernels] == ["plain"]
    assert check.fused(next(iter(kernels.values()))) == (1, 1)


def test_the_benchmark_measures_nothing_without_a_gpu(source_dir, separatrix, build_dir, tmp_path, on_host):
    """Not even the stand-in's time, which would be no figure of a GPU."""
    command = [
        source_dir / "scripts/evidence/bench",
        "--gpu",
        "--build",
        build_dir,
        "-o",
        tmp_path / "page.md",
    ]
    ended = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert "no GPU: nothing was measured, no page was written" in ended.stdout
    assert not (tmp_path / "page.md").exists()


@pytest.mark.long
def test_the_page_of_the_benchmark(source_dir, separatrix, tmp_path, on_host, monkeypatch):
    for folder in ("scripts/evidence", "scripts/evidence/bench_peers"):
        monkeypatch.syspath_prepend(str(source_dir / folder))
    import gpu

    runs, size = gpu.Runs(separatrix, tmp_path), gpu.Size(4, 12, 100.0, 1, 1, 12)
    monkeypatch.setattr(gpu, "MACHINES", {"coulomb": "plain", "cubic": "in series"})
    monkeypatch.setattr(gpu, "RANKS", (1,))
    monkeypatch.setattr(gpu, "TILES", (8,))
    gpu.write_page(runs, gpu.device_of(runs), size, list(gpu.PARTS), tmp_path / "page.md")
    page = (tmp_path / "page.md").read_text()
    assert page.count("| the same, 12 x 12 |") == 4
    assert "| computed by | GPU 0 (stand-in on the host, for tests) |" in page
    assert "| 1 | settled | " in page
    assert "| 8 x 8 | " in page
    assert "settled, 12 x 12 starts" in page
