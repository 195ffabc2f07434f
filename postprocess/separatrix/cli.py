# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `separatrix-figures`: the figures that fit each file."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from matplotlib.figure import Figure

from separatrix import style
from separatrix.arguments import Parser, list_of, whole_number
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures import basin, contact, points, sweep, trajectory
from separatrix.labels import plain
from separatrix.open import open_result, reading
from separatrix.save import FORMATS, save
from separatrix.version import __version__


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    code = 0
    try:
        options = _parser().parse_args(arguments)
    except SeparatrixError as error:
        return _report(error)
    for path in options.files:
        try:
            for written in make(path, options):
                print(written, flush=True)
        except SeparatrixError as error:
            reported = _report(error)
            code = code or reported
    if options.beside and code == 0:
        try:
            for written in make_beside(options):
                print(written, flush=True)
        except SeparatrixError as error:
            return _report(error)
    return code


def make_beside(options: argparse.Namespace) -> list[Path]:
    """Write one figure with the contacts of all files, named after the first; return its paths."""
    with style.context(), ExitStack() as files:
        results = []
        for path in options.files:
            files.enter_context(reading(path))
            results.append(files.enter_context(open_result(path)))
            if "contact_force" not in results[-1]:
                raise SeparatrixError(f"{path}: --beside is for trajectories with a soft barrier", USAGE)
        first = options.files[0]
        target = (options.output or first.parent) / f"{first.name.removesuffix('.h5')}_beside"
        title = plain(options.title or "Contact forces")
        return save(contact.beside(results, title), target, options.formats, options.dpi)


def make(path: Path, options: argparse.Namespace) -> list[Path]:
    """Write the figures of one file; return their paths."""
    with reading(path):
        return _make(path, options)


def _make(path: Path, options: argparse.Namespace) -> list[Path]:
    with style.context(), open_result(path) as result:
        title = plain(options.title or result.attrs.get("title", path.stem))
        stem = path.name.removesuffix(".h5")
        folder = options.output or path.parent
        return [
            written
            for name, figure in _figures(path, result, options.field, title).items()
            for written in save(figure, folder / f"{stem}_{name}", options.formats, options.dpi)
        ]


def _figures(path: Path, result: object, field: str | None, title: str) -> dict[str, Figure]:
    kind = result.attrs["kind"]
    if kind == "basin":
        return basin.figures(path, result, field, title)
    if field:
        raise SeparatrixError(f"{path}: --field is for basin files, this is a {kind} file", USAGE)
    return {"sweep": sweep, "trajectory": trajectory, "points": points}[kind].figures(result, title)


def _report(error: SeparatrixError) -> int:
    print(f"separatrix-figures: {error}", file=sys.stderr)
    return error.code


def _parser() -> Parser:
    parser = Parser(
        prog="separatrix-figures",
        description="Make the figures that fit each Separatrix result file.",
        epilog="Exit codes: 0 done, 64 usage, 65 not a file to read, 66 no such file, 73 cannot write.",
    )
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path, help="result file (.h5)")
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="folder of the figures [that of the file]"
    )
    parser.add_argument("--field", metavar="NAME", help="basin files: map this variable, e.g. settle_time")
    parser.add_argument(
        "--formats",
        metavar="LIST",
        type=list_of(FORMATS),
        default=["png", "pdf"],
        help="png, pdf, svg [png,pdf]",
    )
    parser.add_argument(
        "--beside",
        action="store_true",
        help="trajectories with soft barriers: also one figure of the fastest contact of each",
    )
    parser.add_argument("--title", help="title of the figures [that of the file]")
    parser.add_argument(
        "--dpi",
        type=whole_number(50, 2400),
        default=style.PNG_DPI,
        help=f"resolution of images [{style.PNG_DPI}]",
    )
    parser.add_argument("--version", action="version", version=f"separatrix-figures {__version__}")
    return parser


if __name__ == "__main__":
    sys.exit(main())
