# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The batch scripts on a one-node SLURM that this test starts; as root, asked for by SEPARATRIX_SLURM=1.

apt-get install slurmctld slurmd slurm-client munge
SEPARATRIX_SLURM=1 pytest tests/python/commands/test_slurm.py
"""

import json
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from program import differences, succeed, write_case

ROOT = Path(__file__).resolve().parents[3]

pytestmark = pytest.mark.skipif(
    os.environ.get("SEPARATRIX_SLURM") != "1" or os.geteuid() != 0 or shutil.which("slurmctld") is None,
    reason="asked for by SEPARATRIX_SLURM=1, as root, with slurmctld, slurmd and munge installed",
)

# A map of many small tiles that takes two ranks about two minutes, and a short one.
LONG = ["--set", "grid.tile=[8, 8]", "--set", "run.stop='duration'", "--set", "run.duration=400"]
LONG += ["--set", "axis[1].count=400", "--set", "axis[2].count=400"]
SHORT = ["--set", "grid.tile=[5, 5]", "--set", "axis[1].count=40", "--set", "axis[2].count=31"]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """The environment in which the commands of SLURM speak to the cluster."""
    folder = tmp_path_factory.mktemp("slurm")
    host = socket.gethostname().split(".")[0]
    (folder / "key").write_bytes(os.urandom(128))
    (folder / "key").chmod(0o400)
    for name in ("state", "spool", "log"):
        (folder / name).mkdir()
    # Credentials live 10 s, which is also what a job waits for after it is put into the queue again.
    (folder / "slurm.conf").write_text(
        f"""\
ClusterName=test
SlurmctldHost={host}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=10
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
ProctrackType=proctrack/pgid
TaskPlugin=task/none
MpiDefault=none
ReturnToService=2
KillWait=10
SchedulerType=sched/backfill
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
NodeName={host} CPUs=4 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""
    )
    environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf"), "SEPARATRIX_ROOT": str(ROOT)}
    munge = ["munged", "-F", "-f", f"--key-file={folder}/key", f"--socket={folder}/munge.socket"]
    munge += [f"--pid-file={folder}/munged.pid", f"--seed-file={folder}/munged.seed"]
    daemons = []
    try:
        for command in (munge, ["slurmctld", "-D"], ["slurmd", "-D"]):
            log = (folder / "log" / command[0]).open("w")
            daemons.append(subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT))
            time.sleep(1)
        deadline = time.monotonic() + 60
        while (
            "idle"
            not in subprocess.run(["sinfo", "-h"], env=environment, capture_output=True, text=True).stdout
        ):
            assert time.monotonic() < deadline, [path.read_text() for path in (folder / "log").iterdir()]
            time.sleep(0.5)
        yield environment
        subprocess.run(["scancel", "--user=root"], env=environment)
        time.sleep(1)
    finally:
        for daemon in reversed(daemons):
            daemon.terminate()
            daemon.wait(30)


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as found:
        found.bind(("", 0))
        return found.getsockname()[1]


def sbatch(cluster: dict[str, str], separatrix: Path, folder: Path, *arguments: str) -> str:
    """Submit a job; its number."""
    ended = subprocess.run(
        ["sbatch", "--parsable", *arguments],
        cwd=folder,
        env=cluster | {"SEPARATRIX": str(separatrix)},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.strip()


def facts(cluster: dict[str, str], job: str) -> dict[str, str]:
    """What the controller knows of a job."""
    shown = subprocess.run(
        ["scontrol", "show", "job", "-o", job], env=cluster, capture_output=True, text=True
    ).stdout
    return dict(word.split("=", 1) for word in shown.split() if "=" in word)


def wait_for(cluster: dict[str, str], job: str, states: tuple[str, ...], seconds: float) -> dict[str, str]:
    """Wait until a job is in one of the states."""
    deadline = time.monotonic() + seconds
    while (found := facts(cluster, job)).get("JobState") not in states:
        assert time.monotonic() < deadline, found
        time.sleep(0.5)
    return found


def wait_for_tiles(part: Path, separatrix: Path, more_than: int) -> int:
    """Wait until a working file has more tiles than that."""
    deadline = time.monotonic() + 60
    while True:
        if part.exists():
            output = subprocess.run(
                [separatrix, "info", part, "--json"], capture_output=True, text=True
            ).stdout
            if output and (tiles := json.loads(output)["tiles_done"]) > more_than:
                return tiles
        assert time.monotonic() < deadline
        time.sleep(0.2)


def kept_tiles(folder: Path) -> int:
    """Tiles that a job had done when it went into the queue again."""
    return int((folder / "map.h5.part.tiles").read_text().split()[0])


@pytest.fixture(scope="module")
def reference(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The short map from one process."""
    folder = tmp_path_factory.mktemp("reference")
    write_case(folder)
    succeed(separatrix, "basin", "case.toml", *SHORT, "-o", "map.h5", folder=folder)
    return folder / "map.h5"


@pytest.mark.parametrize("template", ["srun.sh", "mpirun.sh"])
def test_a_job_runs_to_the_same_file(cluster, mpi_separatrix, reference, tmp_path, template):
    write_case(tmp_path)
    script = str(ROOT / "scripts/slurm" / template)
    job = sbatch(cluster, mpi_separatrix, tmp_path, "--ntasks=2", script, "case.toml", "map.h5", *SHORT)
    wait_for(cluster, job, ("COMPLETED",), 60)
    assert differences(reference, tmp_path / "map.h5") == []
    events = [json.loads(line)["event"] for line in (tmp_path / "map.h5.log.jsonl").read_text().splitlines()]
    assert {"binding", "balance", "written"} <= set(events)


@pytest.mark.parametrize("template", ["srun.sh", "mpirun.sh"])
def test_a_signal_stops_and_the_job_comes_again(cluster, mpi_separatrix, tmp_path, template):
    write_case(tmp_path)
    script = str(ROOT / "scripts/slurm" / template)
    job = sbatch(cluster, mpi_separatrix, tmp_path, "--ntasks=2", script, "case.toml", "map.h5", *LONG)
    part = tmp_path / "map.h5.part"
    before = wait_for_tiles(part, mpi_separatrix, 5)
    # As --signal does: to the ranks, or to the script alone.
    whom = ["--batch"] if template == "mpirun.sh" else []
    subprocess.run(["scancel", *whom, "--signal=USR1", job], env=cluster, check=True)
    wait_for(cluster, job, ("PENDING",), 30)
    assert kept_tiles(tmp_path) >= before
    found = wait_for(cluster, job, ("RUNNING",), 90)
    assert found["Restarts"] == "1"
    wait_for_tiles(part, mpi_separatrix, kept_tiles(tmp_path))
    subprocess.run(["scancel", job], env=cluster, check=True)
    wait_for(cluster, job, ("CANCELLED",), 60)
    log = next(tmp_path.glob("separatrix-*.log")).read_text()
    assert "goes into the queue again" in log and "tiles were done before" in log


def test_the_time_limit_of_the_job_sends_the_signal(cluster, mpi_separatrix, tmp_path):
    write_case(tmp_path)
    script = str(ROOT / "scripts/slurm/srun.sh")
    asked = ["--ntasks=2", "--time=2", "--signal=USR1@60", script, "case.toml", "map.h5", *LONG]
    job = sbatch(cluster, mpi_separatrix, tmp_path, *asked, "--set", "run.duration=4000")
    wait_for(cluster, job, ("RUNNING",), 30)
    started = time.monotonic()
    found = wait_for(cluster, job, ("PENDING",), 150)
    assert found["Restarts"] in ("0", "1")
    # Before the limit of 120 s, with the tiles kept.
    assert time.monotonic() - started < 118
    assert kept_tiles(tmp_path) > 0
    subprocess.run(["scancel", job], env=cluster, check=True)


def test_a_job_that_gets_nowhere_is_not_repeated(cluster, mpi_separatrix, tmp_path):
    write_case(tmp_path)
    script = str(ROOT / "scripts/slurm/srun.sh")
    asked = ["--ntasks=1", script, "case.toml", "map.h5", *LONG, "--time-limit", "0.001"]
    job = sbatch(cluster, mpi_separatrix, tmp_path, *asked)
    found = wait_for(cluster, job, ("FAILED", "COMPLETED", "PENDING"), 60)
    if found["JobState"] == "PENDING":
        found = wait_for(cluster, job, ("FAILED",), 60)
    assert found["ExitCode"] == "75:0"
    assert "no tile was finished" in next(tmp_path.glob("separatrix-*.log")).read_text()


def test_an_array_of_shares_is_merged(cluster, mpi_separatrix, reference, tmp_path):
    write_case(tmp_path)
    ended = subprocess.run(
        [ROOT / "scripts/slurm/submit_array.sh", "--ntasks=1", "--", "3", "case.toml", "map.h5", *SHORT],
        cwd=tmp_path,
        env=cluster | {"SEPARATRIX": str(mpi_separatrix)},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    wait_for(cluster, ended.stdout.split()[2], ("COMPLETED",), 120)
    assert differences(reference, tmp_path / "map.h5") == []
    assert list(tmp_path.glob("*.part")) == []
    logs = [path.read_text() for path in tmp_path.glob("*.log.jsonl")]
    assert sorted(" discovered" in log for log in logs) == [False, False, False, True]


def test_a_share_comes_again_before_the_merge(cluster, mpi_separatrix, tmp_path):
    write_case(tmp_path)
    command = [ROOT / "scripts/slurm/submit_array.sh", "--ntasks=1", "--", "2", "case.toml", "map.h5", *LONG]
    ended = subprocess.run(
        [*command, "--set", "run.duration=40"],
        cwd=tmp_path,
        env=cluster | {"SEPARATRIX": str(mpi_separatrix)},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    _, array, merge = ended.stdout.split()
    wait_for(cluster, f"{array}_1", ("RUNNING",), 60)
    wait_for_tiles(tmp_path / "map.h5.shard-1-of-2.part", mpi_separatrix, 5)
    subprocess.run(["scancel", "--signal=USR1", f"{array}_1"], env=cluster, check=True)
    wait_for(cluster, f"{array}_1", ("PENDING",), 30)
    assert facts(cluster, merge)["JobState"] == "PENDING"
    wait_for(cluster, merge, ("COMPLETED",), 240)
    succeed(mpi_separatrix, "verify", "map.h5", "--sample", "5", folder=tmp_path)
    assert "tiles were done before" in (tmp_path / f"separatrix-share-{array}_1.log").read_text()
