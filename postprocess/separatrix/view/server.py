# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewer's HTTP server: for one user, on the loopback interface or a Unix socket of mode 0600.

Loopback is no access control: every user of a host and every page in a browser reaches it. So answers need a
token, new for each start, that only the page of this start knows; other hosts, origins and methods are
refused; no address names a file.
"""

import contextlib
import gzip
import hmac
import json
import os
import secrets
import socket
import socketserver
import threading
import time
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from importlib import resources
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from separatrix.cores import cores
from separatrix.errors import SeparatrixError
from separatrix.simulate import StoppedError
from separatrix.view.connections import Connections
from separatrix.view.packing import pack
from separatrix.view.protocol import REQUESTS, Desk, RefusedError

__all__ = ["ASSETS", "Server", "UnixServer"]

_STATIC = resources.files("separatrix.view").joinpath("static")
#: Every address but those of requests, with the name and the type of what is there.
ASSETS = {"/": ("index.html", "text/html")} | {
    f"/{one.name}": (one.name, "text/css" if one.name.endswith(".css") else "text/javascript")
    for one in _STATIC.iterdir()
    if one.name.endswith((".js", ".css"))
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HOSTS = ("127.0.0.1", "localhost", "[::1]")
_CONNECTIONS = 128
#: Seconds for one request to arrive, however many parts it has.
_ARRIVAL = 20
_LONGEST_ADDRESS = 4096
# what keeps a core busy; as many at a time as there are cores
_HEAVY = ("motion", "download", "attractors", "points")
_SMALL_ANSWER = 1500


class Handler(BaseHTTPRequestHandler):
    """Answers for one connection."""

    protocol_version = "HTTP/1.1"
    # Head and body in two packets would wait for a delayed acknowledgement, 40 ms.
    disable_nagle_algorithm = True
    wbufsize = -1
    # Of an answer as a whole.
    timeout = 20
    server_version = "separatrix-view"
    sys_version = ""

    def handle_one_request(self) -> None:
        """Bound the time in which the request arrives."""
        self.server.connections.expect(self.connection)
        super().handle_one_request()

    def do_GET(self) -> None:
        """Answer a request, or send the page."""
        self._serve(acting=False)

    def do_HEAD(self) -> None:
        """As GET, without the body."""
        self._serve(acting=False)

    def do_POST(self) -> None:
        """Act; there is no body."""
        self.close_connection = True
        self._serve(acting=True)

    def _serve(self, acting: bool) -> None:
        self.server.connections.work(self.connection)
        self.server.last_used = time.monotonic()
        try:
            status, kind, body = self._answer(acting)
        except Exception as error:
            status, kind, body = _failure(
                HTTPStatus.INTERNAL_SERVER_ERROR, f"internal error: {type(error).__name__}"
            )
        with contextlib.suppress(OSError):
            self._send(status, kind, body)

    def _answer(self, acting: bool) -> tuple[int, str, bytes]:
        if self.headers.get("Host", "").rsplit(":", 1)[0] not in _HOSTS:
            return _failure(HTTPStatus.MISDIRECTED_REQUEST, "this host is not served here")
        if len(self.path) > _LONGEST_ADDRESS:
            return _failure(HTTPStatus.REQUEST_URI_TOO_LONG, "the address is too long")
        address = urlsplit(self.path)
        if address.path in ASSETS and not acting:
            name, kind = ASSETS[address.path]
            return HTTPStatus.OK, f"{kind}; charset=utf-8", _asset(name)
        if not address.path.startswith("/api/"):
            return _failure(HTTPStatus.NOT_FOUND, "no such address")
        problem = self._intruder()
        if problem:
            return _failure(HTTPStatus.FORBIDDEN, problem)
        self.server.connections.trust(self.connection)
        return self._request(address.path.removeprefix("/api/"), address.query, acting)

    def _intruder(self) -> str:
        """Return why the sender may not ask, empty if it may."""
        if self.headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none"):
            return "requests of other pages are refused"
        origin = self.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != self.headers.get("Host"):
            return "requests of other pages are refused"
        token = self.headers.get("X-Separatrix-Token", "").encode(errors="replace")
        if not hmac.compare_digest(token, self.server.token.encode()):
            return "the token is missing or wrong; open the address that separatrix-view printed"
        return ""

    def _request(self, name: str, query: str, acting: bool) -> tuple[int, str, bytes]:
        try:
            pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query), max_num_fields=32)
            texts = dict(pairs)
            if len(texts) < len(pairs):
                return _failure(HTTPStatus.BAD_REQUEST, "a parameter is given twice")
            with self.server.room(name):
                body = self.server.desk.answer(name, texts, acting)
        except StoppedError as error:
            body = pack({"stopped": str(error)})
        except RefusedError as error:
            return _failure(HTTPStatus.BAD_REQUEST, str(error))
        except SeparatrixError as error:
            return _failure(HTTPStatus.UNPROCESSABLE_ENTITY, str(error))
        except ValueError as error:
            return _failure(HTTPStatus.BAD_REQUEST, f"the address is not understood ({error})")
        return HTTPStatus.OK, "application/octet-stream", body

    def _send(self, status: int, kind: str, body: bytes) -> None:
        small = len(body) < _SMALL_ANSWER or "gzip" not in self.headers.get("Accept-Encoding", "")
        body = body if small else gzip.compress(body, 1)
        self.send_response(status)
        headers = {
            "Content-Type": kind,
            "Content-Length": str(len(body)),
            "Cache-Control": "no-store",
            "Content-Security-Policy": _POLICY,
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cross-Origin-Opener-Policy": "same-origin",
        }
        if not small:
            headers["Content-Encoding"] = "gzip"
        if self.close_connection:
            headers["Connection"] = "close"
        for key, value in headers.items():
            self.send_header(key, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)
        self.wfile.flush()

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Answer what is no request in the same form."""
        del explain
        self.close_connection = True
        with contextlib.suppress(OSError, AttributeError):
            status, kind, body = _failure(code, message or HTTPStatus(code).phrase)
            if not hasattr(self, "headers"):
                self.headers = {}
            self._send(status, kind, body)

    def log_message(self, *_: object) -> None:
        """Log nothing."""


class LocalHandler(Handler):
    """Answers for one connection of a Unix socket, which knows no delay."""

    disable_nagle_algorithm = False


class _Serving(socketserver.ThreadingMixIn):
    """What both servers share."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = 1024

    def prepare(self, desk: Desk) -> None:
        """Keep the files and make the token."""
        self.desk = desk
        self.token = secrets.token_urlsafe(32)
        self.last_used = time.monotonic()
        self.connections = Connections(_CONNECTIONS, _ARRIVAL)
        self._heavy = threading.BoundedSemaphore(max(2, cores()))
        self._light = threading.BoundedSemaphore(16)
        self._keeping = threading.BoundedSemaphore(1)

    def room(self, name: str) -> contextlib.AbstractContextManager:
        """Return what waits until a request may be worked on."""
        if name not in REQUESTS or name == "stop":
            return contextlib.nullcontext()
        return self._heavy if name in _HEAVY else self._keeping if name == "keep" else self._light

    def process_request(self, request: object, client_address: object) -> None:
        """Begin a connection, or refuse it at once: nothing here may wait."""
        if self.connections.admit(request):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def service_actions(self) -> None:
        """End connections whose request has not arrived in time."""
        self.connections.cut_late()

    def process_request_thread(self, request: object, client_address: object) -> None:
        """Serve a connection to its end."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.connections.forget(request)

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore errors of clients that have gone."""

    def watch_idle(self, minutes: float) -> None:
        """Shut down after so long without a request."""

        def watch() -> None:
            while time.monotonic() - self.last_used < 60 * minutes:
                time.sleep(min(5.0, 6 * minutes))
            self.shutdown()

        threading.Thread(target=watch, daemon=True).start()


class Server(_Serving, socketserver.TCPServer):
    """On a port of the loopback interface, 0: any that is free."""

    allow_reuse_address = True

    def __init__(self, desk: Desk, port: int = 0) -> None:
        """Bind; `serve_forever` serves."""
        self.prepare(desk)
        super().__init__(("127.0.0.1", port), Handler)

    @property
    def address(self) -> str:
        """Address with the token, which browsers do not send on."""
        return f"http://127.0.0.1:{self.server_address[1]}/#{self.token}"


class UnixServer(_Serving, socketserver.UnixStreamServer):
    """On a socket that its owner alone may open."""

    def __init__(self, desk: Desk, path: Path) -> None:
        """Bind; a socket that nobody serves any more is replaced, nothing else is."""
        self.prepare(desk)
        self.path = path
        if path.is_socket() and not _is_served(path):
            path.unlink()
        before = os.umask(0o177)
        try:
            super().__init__(str(path), LocalHandler)
        finally:
            os.umask(before)

    def server_close(self) -> None:
        """Take the socket away too."""
        super().server_close()
        with contextlib.suppress(OSError):
            self.path.unlink()

    def get_request(self) -> tuple[socket.socket, str]:
        """Give connections a name; they have none."""
        request, _ = self.socket.accept()
        return request, "local"


def _is_served(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as one:
        try:
            one.connect(str(path))
        except OSError:
            return False
    return True


def _asset(name: str) -> bytes:
    return _STATIC.joinpath(name).read_bytes()


def _failure(status: int, message: str) -> tuple[int, str, bytes]:
    return int(status), "application/json", json.dumps({"error": message}).encode()
