# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewer's server attacked: nothing leaks, nothing dies."""

import contextlib
import http.client
import json
import os
import re
import signal
import socket
import stat
import subprocess
import sys
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from separatrix.view.connections import Connections
from separatrix.view.packing import unpack
from separatrix.view.protocol import Desk
from separatrix.view.server import ASSETS, Server, UnixServer

pytestmark = pytest.mark.usefixtures("library")

TILE = "/api/tile?file=0&across=0&up=1&at=0,0&variable=0&level=0&row=0&column=0"
MOTION = "/api/motion?file=0&at=0,0&x=0.3&v=0&angle=0&periods=20&samples=16"


@pytest.fixture
def server(results: dict[str, Path]) -> Server:
    """A server of a map on a free port."""
    desk = Desk([results["map"]])
    with Server(desk) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        yield server
        server.shutdown()
        desk.close()


def get(
    server: Server, path: str, method: str = "GET", token: str | None = "", **headers: str
) -> tuple[int, bytes, http.client.HTTPMessage]:
    """Ask a server; `token` "" is the right one, None none."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=30)
    headers = {key.replace("_", "-"): value for key, value in headers.items()}
    if token is not None:
        headers["X-Separatrix-Token"] = token or server.token
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, body, answer.headers


def test_serves_page_and_answers(server: Server) -> None:
    """Assets without a token, answers with it; every answer has the policy and is kept nowhere."""
    for path in ASSETS:
        status, body, headers = get(server, path, token=None)
        assert (status, bool(body)) == (200, True)
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert headers["Cache-Control"] == "no-store"
    status, body, _ = get(server, "/api/describe")
    assert status == 200
    assert unpack(body)[0]["version"] == 1
    status, body, headers = get(server, "/api/describe", method="HEAD")
    assert (status, body) == (200, b"")
    assert int(headers["Content-Length"]) > 100


def test_needs_the_token(server: Server) -> None:
    """None, wrong, cut, in the address, as a cookie: 403 and no data."""
    for token, path, headers in (
        (None, TILE, {}),
        ("wrong", TILE, {}),
        (server.token[:-1], TILE, {}),
        (server.token + "x", TILE, {}),
        (None, f"{TILE}&token={server.token}", {}),
        (None, TILE, {"Cookie": f"token={server.token}"}),
        ("\u00e9".encode().decode("latin-1"), TILE, {}),
    ):
        status, body, _ = get(server, path, token=token, **headers)
        assert status == 403
        assert set(json.loads(body)) == {"error"}
    with Server(server.desk) as other:
        assert other.token != server.token


def test_refuses_other_hosts_and_pages(server: Server) -> None:
    """DNS rebinding, cross-site requests, forms of other pages, even with the token."""
    port = server.server_address[1]
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1.evil.example", "", "10.0.0.1"):
        assert get(server, TILE, Host=host)[0] == 421
        assert get(server, "/", Host=host)[0] == 421
    assert get(server, TILE, Host=f"localhost:{port}")[0] == 200
    for site in ("cross-site", "same-site"):
        assert get(server, TILE, Sec_Fetch_Site=site)[0] == 403
    for origin in ("http://evil.example", "null", f"http://localhost:{port + 1}"):
        assert get(server, TILE, Origin=origin)[0] == 403
        assert get(server, "/api/stop?page=1&view=1", "POST", Origin=origin)[0] == 403
    assert get(server, "/api/stop?page=1&view=1", "POST", Origin=f"http://127.0.0.1:{port}")[0] == 200
    _, _, headers = get(server, TILE)
    assert "Access-Control-Allow-Origin" not in headers


def test_addresses_name_no_files(server: Server) -> None:
    """Path traversal in every dress."""
    for path in (
        "/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/..%2f..%2fetc%2fpasswd", "//etc/passwd",
        "/static/app.js", "/app.js/../../server.py", "/server.py", "/.git/config", "/api/../app.js", "/api/",
        "/api", "/api/tile/..",
        "/index.html%00", "/\\..\\..\\etc\\passwd", "/api/%00",
    ):  # fmt: skip
        status, body, _ = get(server, path)
        assert status in (400, 403, 404), path
        assert b"root:" not in body


def test_refuses_other_methods_and_bad_requests(server: Server) -> None:
    """PUT, DELETE, OPTIONS, TRACE; a long address; twice the same; acts by GET."""
    for method in ("PUT", "DELETE", "OPTIONS", "TRACE", "PATCH", "CONNECT"):
        assert get(server, TILE, method)[0] in (400, 405, 501)
    assert get(server, "/" + "a" * 5000)[0] == 414
    assert get(server, f"{TILE}&row=0")[0] == 400
    assert get(server, "/api/stop?page=1&view=1")[0] == 400
    assert get(server, "/api/tile?" + "&".join(f"a{i}=1" for i in range(60)))[0] == 400
    assert get(server, "/api/motion?file=0&at=0,0&x=nan&v=0&angle=0")[0] == 400
    assert get(server, "/api/motion?file=0&at=0,0&x=5&v=0&angle=0")[0] == 422
    for raw in (b"\0\1\2\3\r\n\r\n", b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"x" * 70000 + b"\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", server.server_address[1]), timeout=10) as one:
            one.sendall(raw)
            with_answer = one.recv(1000)
        assert b" 200 " not in with_answer
    assert get(server, "/api/describe")[0] == 200


def test_a_thousand_requests_at_once(server: Server) -> None:
    """All are answered rightly, and the server goes on; silent connections do not stop it."""
    waiting = [socket.create_connection(("127.0.0.1", server.server_address[1])) for _ in range(40)]
    paths = [(TILE, MOTION, "/api/describe", "/app.js", "/nothing")[i % 5] for i in range(1000)]
    expected = {path: get(server, path)[1] for path in set(paths)}
    with ThreadPoolExecutor(100) as pool:
        answers = list(pool.map(lambda path: get(server, path), paths))
    counted = Counter(status for status, _, _ in answers)
    assert counted == {200: 800, 404: 200}
    for path, (_, body, _) in zip(paths, answers, strict=True):
        assert body == expected[path]
    for one in waiting:
        one.close()
    assert get(server, TILE)[0] == 200


def silent(server: Server, count: int, data: bytes = b"") -> list[socket.socket]:
    """Connections without a token that have sent the beginning of a request and wait."""
    opened = []
    for _ in range(count):
        one = socket.create_connection(("127.0.0.1", server.server_address[1]), timeout=5)
        one.sendall(data)
        opened.append(one)
    return opened


def test_connections_without_a_token_block_nobody(server: Server) -> None:
    """However many; those that have shown the token stay."""
    kept = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=5)

    def ask() -> int:
        kept.request("GET", TILE, headers={"X-Separatrix-Token": server.token})
        answer = kept.getresponse()
        answer.read()
        return answer.status

    assert ask() == 200
    opened = silent(server, 300, b"GET / HTTP/1.1\r\n")
    own = kept.sock
    assert ask() == 200 and kept.sock is own
    assert get(server, TILE)[0] == 200
    for one in opened:
        one.close()
    kept.close()


def test_full_of_connections_with_the_token(server: Server) -> None:
    """A further one is refused at once, and the server goes on."""
    connections = []
    for _ in range(128):
        one = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=10)
        one.request("GET", "/api/describe", headers={"X-Separatrix-Token": server.token})
        one.getresponse().read()
        connections.append(one)
    (further,) = silent(server, 1)
    assert further.recv(1) == b""
    for one in connections:
        one.close()
    deadline = time.monotonic() + 10
    while True:
        with contextlib.suppress(OSError, http.client.HTTPException):
            assert get(server, TILE)[0] == 200
            break
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_request_arrives_as_a_whole_in_time(server: Server) -> None:
    """A header now and then does not keep a connection open."""
    server.connections = Connections(4, 1.0)
    (one,) = silent(server, 1, b"GET / HTTP/1.1\r\n")
    began = time.monotonic()
    with contextlib.suppress(OSError):
        while time.monotonic() - began < 10:
            one.sendall(b"X: y\r\n")
            time.sleep(0.1)
    assert time.monotonic() - began < 5


def test_only_loopback(server: Server) -> None:
    """No other interface of this host is served."""
    port = server.server_address[1]
    names = {found[4][0] for found in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for address in names - {"127.0.0.1"} - {one for one in names if one.startswith("127.")}:
        with pytest.raises(OSError, match=""), socket.create_connection((address, port), timeout=1):
            pass
    assert server.server_address[0] == "127.0.0.1"


def test_a_unix_socket_is_its_owners(results: dict[str, Path], tmp_path: Path) -> None:
    """Mode 0600; refused if it is served, gone at the end; token and host as on a port."""
    desk, path = Desk([results["map"]]), tmp_path / "view.sock"
    with UnixServer(desk, path) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        for token, host, status in (
            (server.token, "localhost:8000", 200),
            ("", "localhost:8000", 403),
            (server.token, "x", 421),
        ):
            with socket.socket(socket.AF_UNIX) as one:
                one.connect(str(path))
                lines = [
                    f"GET {TILE} HTTP/1.1",
                    f"Host: {host}",
                    f"X-Separatrix-Token: {token}",
                    "Connection: close",
                ]
                one.sendall("\r\n".join([*lines, "", ""]).encode())
                assert f" {status} " in one.recv(100).decode(errors="replace").splitlines()[0]
        with pytest.raises(OSError, match="in use"):
            UnixServer(desk, path)
        server.shutdown()
    assert not path.exists()
    desk.close()


def start_command(results: dict[str, Path], *options: str) -> tuple[subprocess.Popen, str]:
    """Start separatrix-view as a user does; return the process and the address that it prints."""
    code = "import sys; from separatrix.view.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", code, str(results["map"]), "--no-browser", *options]
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"}
    )
    line = process.stderr.readline()
    return process, re.search(r"http\S+", line)[0]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_the_command_ends_cleanly(results: dict[str, Path], how: signal.Signals) -> None:
    """Ctrl-C: code 0, nothing on stderr but the address, nothing left."""
    process, address = start_command(results)
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/#[\w-]{43}", address)
    process.send_signal(how)
    assert process.wait(10) == 0
    assert process.stderr.read() == "Ctrl-C ends the viewer\n"


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_the_command_ends_beside_waiting_connections(results: dict[str, Path], how: signal.Signals) -> None:
    """At once, with more of them than are served."""
    process, address = start_command(results)
    port = int(re.search(r":(\d+)/", address)[1])
    opened = [socket.create_connection(("127.0.0.1", port)) for _ in range(200)]
    for one in opened:
        one.sendall(b"GET / HTTP/1.1\r\n")
    time.sleep(0.5)
    began = time.monotonic()
    process.send_signal(how)
    assert process.wait(30) == 0
    assert time.monotonic() - began < 5


def test_the_command_ends_when_idle(results: dict[str, Path]) -> None:
    """`--idle`, in minutes."""
    began = time.monotonic()
    process, _ = start_command(results, "--idle", "0.01")
    assert process.wait(20) == 0
    assert time.monotonic() - began < 15


def test_the_command_reports_what_is_wrong(
    results: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A missing file, no file of ours, a folder that is none, a page that exists: one line and a code."""
    from separatrix.view.cli import main

    (tmp_path / "text.h5").write_text("text")
    for arguments, code in (
        ([tmp_path / "none.h5"], 66),
        ([tmp_path / "text.h5"], 65),
        ([results["map"], "--keep", tmp_path / "none"], 64),
        ([results["map"], "--export", tmp_path / "text.h5"], 73),
        ([results["map"], "--port", "99999"], 64),
        ([], 64),
    ):
        assert main([str(one) for one in arguments]) == code
        assert capsys.readouterr().err.count("\n") == 1
