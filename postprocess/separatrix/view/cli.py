# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `separatrix-view`: look around in result files with a browser."""

import argparse
import signal
import sys
import threading
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from separatrix.arguments import Parser, whole_number
from separatrix.errors import USAGE, SeparatrixError
from separatrix.printed import show
from separatrix.version import __version__

_CANNOT_CREATE = 73


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    try:
        options = _parser().parse_args(arguments)
        if options.export:
            return _export(options)
        return _serve(options)
    except SeparatrixError as error:
        print(f"separatrix-view: {error}", file=sys.stderr)
        return error.code


def _serve(options: argparse.Namespace) -> int:
    from separatrix.view.protocol import Desk
    from separatrix.view.server import Server, UnixServer

    if not options.keep.is_dir():
        raise SeparatrixError(f"--keep: {options.keep} is no folder", USAGE)
    desk = Desk(options.files, options.keep)
    try:
        server = UnixServer(desk, options.socket) if options.socket else Server(desk, options.port)
    except OSError as error:
        where = options.socket or f"port {options.port}"
        raise SeparatrixError(f"{where}: cannot be opened ({error.strerror})", _CANNOT_CREATE) from error
    if options.idle:
        server.watch_idle(options.idle)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: threading.Thread(target=server.shutdown).start())
    if options.socket:
        print(f"serving at {options.socket}; on your own machine:", file=sys.stderr)
        print(f"  ssh -L 8000:{options.socket.resolve()} HOST", file=sys.stderr)
        print(f"  and open http://127.0.0.1:8000/#{server.token}", file=sys.stderr)
    else:
        print(f"open {server.address}", file=sys.stderr)
        print("Ctrl-C ends the viewer", file=sys.stderr, flush=True)
        if options.browser:
            threading.Thread(target=webbrowser.open, args=(server.address,), daemon=True).start()
    with server:
        server.serve_forever(poll_interval=0.1)
    desk.close()
    return 0


def _export(options: argparse.Namespace) -> int:
    from separatrix.view.export import export_page

    if options.export.exists() and not options.force:
        raise SeparatrixError(f"{options.export}: exists; --force replaces it", _CANNOT_CREATE)
    size = export_page(options.files, options.export, options.motions)
    show(f"wrote {options.export} ({size / 1e6:.2f} MB)")
    return 0


def _parser() -> Parser:
    parser = Parser(prog="separatrix-view", description=__doc__.partition(": ")[2])
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="result files of separatrix")
    parser.add_argument(
        "--port", type=whole_number(0, 65535), default=0, help="port on 127.0.0.1; default: a free one"
    )
    parser.add_argument(
        "--socket", type=Path, metavar="PATH", help="a Unix socket of mode 0600 instead of a port"
    )
    parser.add_argument("--no-browser", dest="browser", action="store_false", help="only print the address")
    parser.add_argument(
        "--keep", type=Path, default=Path(), metavar="FOLDER", help="where views are kept; default: here"
    )
    parser.add_argument(
        "--idle", type=float, default=0.0, metavar="MINUTES", help="end after so long without a request"
    )
    parser.add_argument(
        "--export", type=Path, metavar="PAGE", help="write one page that opens offline, and end"
    )
    parser.add_argument("--motions", type=whole_number(0, 10000), default=576, metavar="N",
                        help="motions stored in the page; default 576")  # fmt: skip
    parser.add_argument("--force", action="store_true", help="replace an existing page")
    parser.add_argument("--version", action="version", version=f"separatrix-view {__version__}")
    return parser
