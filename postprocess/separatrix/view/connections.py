# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The open connections of the viewer: bounded in number and in the time that a request may take to arrive.

Any user of the host can open connections. So one without the token makes room for a new one, and those with
it are kept.
"""

import contextlib
import dataclasses
import math
import socket
import threading
import time

__all__ = ["Connections"]


@dataclasses.dataclass
class _State:
    trusted: bool = False
    deadline: float = math.inf


class Connections:
    """At most `most` connections, each with at most `seconds` for one request to arrive."""

    def __init__(self, most: int, seconds: float) -> None:
        """Begin without connections."""
        self._most = most
        self._seconds = seconds
        self._lock = threading.Lock()
        self._open: dict[socket.socket, _State] = {}

    def admit(self, connection: socket.socket) -> bool:
        """Take a connection, instead of the oldest without the token if need be; False if all have it."""
        with self._lock:
            if len(self._open) >= self._most:
                oldest = next((one for one, state in self._open.items() if not state.trusted), None)
                if oldest is None:
                    return False
                del self._open[oldest]
                _cut(oldest)
            self._open[connection] = _State(deadline=time.monotonic() + self._seconds)
        return True

    def forget(self, connection: socket.socket) -> None:
        """Note that a connection has ended."""
        with self._lock:
            self._open.pop(connection, None)

    def expect(self, connection: socket.socket) -> None:
        """Note that a request may arrive from now on."""
        self._change(connection, deadline=time.monotonic() + self._seconds)

    def work(self, connection: socket.socket) -> None:
        """Note that a whole request has arrived."""
        self._change(connection, deadline=math.inf)

    def trust(self, connection: socket.socket) -> None:
        """Note that a connection has shown the token."""
        self._change(connection, trusted=True)

    def cut_late(self) -> None:
        """End the connections whose request has not arrived in time."""
        now = time.monotonic()
        with self._lock:
            for one in [one for one, state in self._open.items() if state.deadline < now]:
                del self._open[one]
                _cut(one)

    def _change(self, connection: socket.socket, **values: object) -> None:
        with self._lock:
            if connection in self._open:
                self._open[connection] = dataclasses.replace(self._open[connection], **values)


def _cut(connection: socket.socket) -> None:
    """End a connection; its thread notices."""
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)
