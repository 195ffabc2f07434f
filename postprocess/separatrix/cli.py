# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `separatrix-figures`: the figures that fit each file."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from separatrix import style
from separatrix.arguments import Parser, interval, list_of, names, pairs, size, two_names, whole_number
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures import basin, boundary, branches, contact, erosion, noise, points, sweep, trajectory
from separatrix.figures.animation import animate
from separatrix.figures.difference import difference
from separatrix.figures.look import CAPTIONS, UNITS, Look
from separatrix.figures.page import Figures
from separatrix.given_up import refuse
from separatrix.labels import plain
from separatrix.open import open_result, reading
from separatrix.printed import show
from separatrix.save import FORMATS, save
from separatrix.version import __version__

_FILM_DPI = 150
_BY_KIND = {
    "sweep": sweep,
    "trajectory": trajectory,
    "points": points,
    "branches": branches,
    "measures": erosion,
    "noise": noise,
    "first_passage": noise,
}


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
                show(written)
        except SeparatrixError as error:
            reported = _report(error)
            code = code or reported
    for wanted, together in ((options.beside, make_beside), (options.difference, make_difference)):
        if not wanted or code != 0:
            continue
        try:
            for written in together(options):
                show(written)
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


def make_difference(options: argparse.Namespace) -> list[Path]:
    """Write the map of the first of two files, black where the second differs; return the paths."""
    if len(options.files) != 2:
        raise SeparatrixError(f"--difference: found {len(options.files)} files, allowed 2", USAGE)
    first, second = options.files
    with (
        style.context(options.style),
        reading(second),
        open_result(second) as other,
        open_result(first) as result,
    ):
        title = plain(options.title or result.attrs.get("title", first.stem))
        figure = difference(result, other, options.field, title, _look(options))
        target = (options.output or first.parent) / f"{first.name.removesuffix('.h5')}_difference"
        return save(figure, target, options.formats, options.dpi)


def make(path: Path, options: argparse.Namespace) -> list[Path]:
    """Write the figures of one file; return their paths."""
    with reading(path):
        return _make(path, options)


def _make(path: Path, options: argparse.Namespace) -> list[Path]:
    with style.context(options.style), open_result(path) as result:
        if not options.partial:
            refuse(path, result)
        title = plain(options.title or result.attrs.get("title", path.stem))
        stem = path.name.removesuffix(".h5")
        folder = options.output or path.parent
        look = _look(options)
        if options.animate:
            return [_animated(path, result, folder / f"{stem}_animation", title, look, options)]
        return [
            written
            for name, figure in dict(
                _figures(path, result, options.field, title, look, options.branches)
            ).items()
            for written in save(figure, folder / f"{stem}_{name}", options.formats, options.dpi)
        ]


def _figures(
    path: Path, result: object, field: str | None, title: str, look: Look, orbits: Path | None = None
) -> Figures:
    kind = result.attrs["kind"]
    if kind == "basin":
        return basin.figures(path, result, field, title, look)
    if kind == "boundary" and not field:
        return boundary.figures(path, result, title, look)
    if field:
        raise SeparatrixError(f"{path}: --field is for basin files, this is a {kind} file", USAGE)
    if orbits and kind == "measures":
        with reading(orbits), open_result(orbits) as found:
            return erosion.figures(result, title, look, found)
    return _BY_KIND[kind].figures(result, title, look)


def _animated(
    path: Path, result: object, stem: Path, title: str, look: Look, options: argparse.Namespace
) -> Path:
    if result.attrs["kind"] != "basin":
        raise SeparatrixError(
            f"{path}: --animate is for basin files, this is a {result.attrs['kind']} file", USAGE
        )
    target = stem.with_name(f"{stem.name}.{options.film}")
    dpi = min(options.dpi, _FILM_DPI)
    return animate(result, options.animate, target, title, options.field or "attractor", look, dpi=dpi)


def _look(options: argparse.Namespace) -> Look:
    return Look(
        region=options.region,
        slice=options.slice,
        inset=options.inset,
        axes=options.axes,
        units=options.units,
        shade=options.shade,
        attractors=not options.no_attractors,
        colours=options.colours,
        colour_map=options.colour_map,
        limits=options.range,
        size=options.size,
        caption=options.caption,
        crank_angle=options.crank_angle,
        transient=options.transient,
    )


def _report(error: SeparatrixError) -> int:
    print(f"separatrix-figures: {error}", file=sys.stderr)
    return error.code


def _parser() -> Parser:
    parser = Parser(
        prog="separatrix-figures",
        description="Make the figures that fit each Separatrix result file.",
        epilog="Exit codes: 0 done, 64 usage, 65 not a file to read, 66 no such file, 73 cannot write, "
        "78 every motion was given up.",
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
    parser.add_argument(
        "--difference",
        action="store_true",
        help="two basin files of the same points: also the map of the first, black where the second differs",
    )
    parser.add_argument(
        "--branches",
        metavar="FILE",
        type=Path,
        help="files of measures along a parameter: draw these branches over the same parameter above them",
    )
    parser.add_argument(
        "--partial", action="store_true", help="draw motions that were given up as far as they went"
    )
    parser.add_argument("--title", help="title of the figures [that of the file]")
    parser.add_argument(
        "--dpi",
        type=whole_number(50, 2400),
        default=style.PNG_DPI,
        help=f"resolution of images [{style.PNG_DPI}]",
    )
    _add_looks(parser)
    parser.add_argument("--version", action="version", version=f"separatrix-figures {__version__}")
    return parser


def _add_looks(parser: Parser) -> None:
    looks = parser.add_argument_group("what is shown, and how")
    looks.add_argument(
        "--region",
        metavar="NAME=A:B,...",
        type=pairs(ranges=True),
        default={},
        help="show these ranges of axes",
    )
    looks.add_argument(
        "--slice",
        metavar="NAME=VALUE,...",
        type=pairs(ranges=False),
        default={},
        help="show one value of axes, the nearest",
    )
    looks.add_argument(
        "--inset",
        metavar="NAME=A:B,NAME=A:B",
        type=pairs(ranges=True),
        default={},
        help="basin files: draw this part of the map once more, larger, beside it",
    )
    looks.add_argument(
        "--axes", metavar="ACROSS,UP", type=two_names, help="basin files: the axes of the map [x0,v0]"
    )
    looks.add_argument(
        "--units",
        metavar="LIST",
        type=list_of(UNITS),
        default=[],
        help=f"instead of SI units: {', '.join(UNITS)}",
    )
    looks.add_argument(
        "--shade", action="store_true", help="basin files: the settling time as lightness of the classes"
    )
    looks.add_argument(
        "--no-attractors", action="store_true", help="basin files: do not mark the attractors on the section"
    )
    looks.add_argument(
        "--crank-angle", metavar="RAD", type=float, help="crank angle of a section [that of the start]"
    )
    looks.add_argument(
        "--transient",
        metavar="PERIODS",
        type=float,
        help="drive periods discarded before a section [half of the motion]",
    )
    _add_style(looks)
    looks.add_argument(
        "--animate", metavar="NAME", help="basin files: a film through the values of this axis instead"
    )
    looks.add_argument(
        "--film", choices=("gif", "mp4"), default="gif", help="form of the film; mp4 needs ffmpeg [gif]"
    )


def _add_style(looks: argparse._ArgumentGroup) -> None:
    looks.add_argument(
        "--colours", metavar="LIST", type=names, default=[], help="colours of the classes in their order"
    )
    looks.add_argument(
        "--colour-map", metavar="NAME", help=f"of a field that is a number [{style.SCALAR_MAP}]"
    )
    looks.add_argument("--range", metavar="A:B", type=interval, help="range of the colours of such a field")
    looks.add_argument(
        "--size", metavar="WxH", type=size, help="width of the page and height of the axes in mm [85x62]"
    )
    looks.add_argument(
        "--caption",
        choices=CAPTIONS,
        default="short",
        help="full: all that is needed to repeat the run [short]",
    )
    looks.add_argument("--style", metavar="FILE", help="style of matplotlib, by name or file, on top of ours")


if __name__ == "__main__":
    sys.exit(main())
