# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Hosts on one machine: network namespaces joined by a bridge, each with a name, a /dev/shm and a TMPDIR.

Needs root, iproute2 and util-linux. The bridge alone is visible outside the namespaces; it is removed.
"""

import contextlib
import os
import signal
import subprocess
import time
from pathlib import Path
from types import TracebackType

_BRIDGE = "sxcheck0"
_NETWORK = "10.213.77"
#: Address of the machine itself.
OUTSIDE = f"{_NETWORK}.254"
NETWORK = f"{_NETWORK}.0/24"


class Host:
    """One namespace, held by a process that sleeps."""

    def __init__(self, number: int, folder: Path) -> None:
        """Make it, with a link to the bridge."""
        self.name = f"sx{number}"
        self.address = f"{_NETWORK}.{number}"
        self.temporary = folder / f"tmp-{self.name}"
        self.temporary.mkdir()
        self._outer = f"sxcheckv{number}"
        steps = [f"hostname {self.name}", "mount -t tmpfs -o size=64m none /dev/shm"]
        steps += [f"mount --bind {folder}/hosts /etc/hosts", "ip link set lo up", "exec sleep infinity"]
        self._holder = subprocess.Popen(["unshare", "-n", "-u", "-m", "sh", "-ec", "; ".join(steps)])
        _wait_for_namespace(self._holder.pid)
        (folder / f"{self.name}.pid").write_text(str(self._holder.pid))
        _ip("link", "add", self._outer, "type", "veth", "peer", "name", "eth0", "netns", self._holder.pid)
        _ip("link", "set", self._outer, "master", _BRIDGE, "up")
        for step in (["addr", "add", f"{self.address}/24", "dev", "eth0"], ["link", "set", "eth0", "up"]):
            subprocess.run(self.enter("ip", *step), check=True)

    def enter(self, *command: object) -> list[str]:
        """Return the command that runs `command` on this host."""
        inside = ["nsenter", "-t", str(self._holder.pid), "-n", "-u", "-m"]
        return [*inside, "env", "-C", str(Path.cwd()), f"TMPDIR={self.temporary}", *map(str, command)]

    def link(self, state: str) -> None:
        """Set the link of this host `up` or `down`."""
        _ip("link", "set", self._outer, state)

    def processes(self, name: str = "") -> list[int]:
        """Return the processes on this host, or those of a program."""
        own = _namespace(self._holder.pid)
        found = []
        for path in Path("/proc").iterdir():
            if path.name.isdigit() and int(path.name) != self._holder.pid and _namespace(path.name) == own:
                with contextlib.suppress(OSError):
                    if (path / "comm").read_text().strip().startswith(name):
                        found.append(int(path.name))
        return found

    def kill(self) -> None:
        """End all that runs on this host, as a power failure does."""
        for process in self.processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def close(self) -> None:
        """Remove it, with all that runs there."""
        self.kill()
        self._holder.kill()
        self._holder.wait(10)


class Hosts:
    """Several hosts, sx1, sx2, ..., that share the file system."""

    def __init__(self, count: int, folder: Path) -> None:
        """Make them; their files are in `folder`."""
        self.folder = folder
        names = [f"{_NETWORK}.{i} sx{i}" for i in range(1, count + 1)]
        outside = f"{OUTSIDE} {os.uname().nodename}"
        (folder / "hosts").write_text("\n".join(["127.0.0.1 localhost", outside, *names]) + "\n")
        self.agent = folder / "agent"
        self.agent.write_text(
            "#!/bin/sh\nhost=$1\nshift\n"
            f"export TMPDIR={folder}/tmp-$host\n"
            f'exec nsenter -t "$(cat {folder}/$host.pid)" -n -u -m /bin/sh -c "$*"\n'
        )
        self.agent.chmod(0o755)
        _remove_bridge()
        _ip("link", "add", _BRIDGE, "type", "bridge")
        _ip("addr", "add", f"{OUTSIDE}/24", "dev", _BRIDGE)
        _ip("link", "set", _BRIDGE, "up")
        self._all = [Host(i, folder) for i in range(1, count + 1)]

    def __enter__(self) -> "Hosts":
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove the hosts and the bridge."""
        for one in self._all:
            one.close()
        _remove_bridge()

    def __getitem__(self, number: int) -> Host:
        """Return a host, from 0."""
        return self._all[number]

    def named(self, name: str) -> Host:
        """Return the host of this name."""
        return next(one for one in self._all if one.name == name)

    def mpirun(
        self, ranks: list[int], *command: object, settings: dict[str, object] | None = None
    ) -> list[str]:
        """Return the command that runs so many ranks on each host; mpirun itself runs on the first."""
        where = ",".join(f"{self[i].name}:{n}" for i, n in enumerate(ranks) if n > 0)
        options = {"plm_rsh_agent": self.agent, "btl_tcp_if_include": NETWORK, "oob_tcp_if_include": NETWORK}
        chosen = [word for pair in {**options, **(settings or {})}.items() for word in ("--mca", *pair)]
        return self[0].enter("mpirun", "--wdir", Path.cwd(), "--host", where, *chosen, *command)


def _wait_for_namespace(process: int) -> None:
    """Wait until a process has left the network namespace of this one."""
    deadline = time.monotonic() + 10
    while _namespace(process) in (None, _namespace("self")):
        if time.monotonic() > deadline:
            raise TimeoutError("no network namespace was made")
        time.sleep(0.01)


def _namespace(process: object) -> str | None:
    with contextlib.suppress(OSError):
        return str(Path(f"/proc/{process}/ns/net").readlink())
    return None


def _ip(*words: object) -> None:
    subprocess.run(["ip", *map(str, words)], check=True)


def _remove_bridge() -> None:
    subprocess.run(["ip", "link", "del", _BRIDGE], stderr=subprocess.DEVNULL)
