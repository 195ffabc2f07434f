# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""SLURM on several hosts of this machine: controller outside, one daemon on each host.

Needs Debian's slurmctld, slurmd, slurm-client and munge.
"""

import os
import shutil
import subprocess
import time
from types import TracebackType

from hosts import OUTSIDE, Host, Hosts

PROGRAMS = ("slurmctld", "slurmd", "sbatch", "munged")
_CORES = 2


def missing() -> list[str]:
    """Return the programs that are not installed."""
    return [name for name in PROGRAMS if shutil.which(name) is None]


class Slurm:
    """A cluster of `count` nodes, the names of which are those of the hosts."""

    def __init__(self, hosts: Hosts, count: int, variables: dict[str, str]) -> None:
        """Start it; `variables` are added to the environment of its commands."""
        self.folder = hosts.folder / "slurm"
        for name in ("state", "log"):
            (self.folder / name).mkdir(parents=True)
        self._nodes = [hosts[i] for i in range(count)]
        (self.folder / "key").write_bytes(os.urandom(128))
        (self.folder / "key").chmod(0o400)
        self.environment = os.environ | variables | {"SLURM_CONF": str(self.folder / "slurm.conf")}
        (self.folder / "slurm.conf").write_text(self._configuration())
        self._running: dict[str, subprocess.Popen] = {}
        munge = ["munged", "-F", "-f", f"--key-file={self.folder}/key", f"--socket={self.folder}/munge"]
        self._start(
            "munged", [*munge, f"--pid-file={self.folder}/munged.pid", f"--seed-file={self.folder}/seed"]
        )
        self._start("slurmctld", ["slurmctld", "-D", "-c"])
        for node in self._nodes:
            self.start_node(node)
        self.wait_for_nodes(count)

    def _configuration(self) -> str:
        nodes = "".join(
            f"NodeName={one.name} NodeAddr={one.address} CPUs={_CORES} State=UNKNOWN\n" for one in self._nodes
        )
        names = ",".join(one.name for one in self._nodes)
        return f"""\
ClusterName=check
SlurmctldHost={os.uname().nodename}({OUTSIDE})
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={self.folder}/munge,cred_expire=10
StateSaveLocation={self.folder}/state
SlurmdSpoolDir={self.folder}/spool-%n
TmpFS={self.folder.parent}/tmp-%n
SlurmctldPidFile={self.folder}/slurmctld.pid
SlurmdPidFile={self.folder}/slurmd-%n.pid
SlurmctldPort=16817
SlurmdPort=16818
ProctrackType=proctrack/pgid
TaskPlugin=task/none
MpiDefault=none
ReturnToService=2
SlurmctldTimeout=30
SlurmdTimeout=20
KillWait=5
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
{nodes}PartitionName=all Nodes={names} Default=YES MaxTime=INFINITE State=UP PriorityTier=1
PartitionName=urgent Nodes={names} MaxTime=INFINITE State=UP PriorityTier=9 PreemptMode=OFF
"""

    def _start(self, name: str, command: list[str]) -> None:
        log = (self.folder / "log" / name).open("a")
        self._running[name] = subprocess.Popen(
            command, env=self.environment, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )
        time.sleep(1)

    def start_node(self, node: Host) -> None:
        """Start the daemon of a node."""
        (self.folder / f"spool-{node.name}").mkdir(exist_ok=True)
        self._start(f"slurmd-{node.name}", node.enter("slurmd", "-D", "-N", node.name))

    def wait_for_nodes(self, count: int) -> None:
        """Wait until so many nodes are idle."""
        deadline = time.monotonic() + 60
        while self.ask("sinfo", "-h", "-N", "-t", "idle", "-o", "%n").count("\n") < count:
            if time.monotonic() > deadline:
                logs = "\n".join(path.read_text()[-1000:] for path in (self.folder / "log").iterdir())
                raise TimeoutError(f"the nodes of SLURM do not become idle\n{logs}")
            time.sleep(0.5)

    def ask(self, *command: object) -> str:
        """Return what a command of SLURM prints."""
        found = subprocess.run(
            list(map(str, command)), env=self.environment, capture_output=True, text=True, timeout=60
        )
        if found.returncode != 0:
            raise RuntimeError(f"{command}: {found.stderr}")
        return found.stdout

    def facts(self, job: str) -> dict[str, str]:
        """Return what the controller knows about a job."""
        words = self.ask("scontrol", "show", "job", "-o", job).split()
        return dict(word.split("=", 1) for word in words if "=" in word)

    def wait_for(self, job: str, states: tuple[str, ...], seconds: float) -> dict[str, str]:
        """Wait until a job is in one of the states."""
        deadline = time.monotonic() + seconds
        while (found := self.facts(job)).get("JobState") not in states:
            if time.monotonic() > deadline:
                raise TimeoutError(f"job {job} is {found.get('JobState')}, not {states}")
            time.sleep(0.5)
        return found

    def __enter__(self) -> "Slurm":
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the jobs and the daemons."""
        subprocess.run(["scancel", "--user=root"], env=self.environment, capture_output=True, timeout=60)
        for one in reversed(self._running.values()):
            one.terminate()
        for one in self._running.values():
            try:
                one.wait(10)
            except subprocess.TimeoutExpired:
                one.kill()
