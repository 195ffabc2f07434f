# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `separatrix-structure`: from what engineers' tools write to a file for [structure.NAME]."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from separatrix.arguments import Parser, positive, whole_number
from separatrix.errors import CANNOT_CREATE, USAGE, SeparatrixError
from separatrix.printed import show
from separatrix.structures.content import Matrices, Modes, add_points
from separatrix.structures.files import write
from separatrix.structures.readers import ROLES, read_matrices
from separatrix.structures.reduction import (
    NO_MASS,
    checks,
    condense,
    craig_bampton,
    hold,
    modal,
    smallest_share,
    undamped_modes,
)
from separatrix.structures.universal import read_modes
from separatrix.version import __version__

# Most coordinates of a machine.
_MOST = 16
# labels in a message
_MOST_NAMES = 6
_UNIVERSAL = (".uff", ".unv", ".u55")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    try:
        options = _parser().parse_args(arguments)
        for line in run(options):
            show(line)
    except SeparatrixError as error:
        print(f"separatrix-structure: {error}", file=sys.stderr)
        return error.code
    return 0


def run(options: argparse.Namespace) -> list[str]:
    """Read, reduce, write; return the lines of the report."""
    try:
        return _run(options)
    except SeparatrixError as error:
        # What is wrong with a matrix is known before its file is.
        role = str(error).partition(":")[0]
        path = getattr(options, role) or options.input if role in ROLES else None
        raise (SeparatrixError(f"{path}: {error}", error.code) if path else error) from None


def _run(options: argparse.Namespace) -> list[str]:
    if options.output.exists() and not options.force:
        raise SeparatrixError(f"{options.output} exists; --force replaces it", CANNOT_CREATE)
    full = _read(options)
    add_points(full, dict(options.point))
    if not full.points:
        raise SeparatrixError("no point is named: joints act at points; --point NAME=COORDINATE", USAGE)
    reduced = _reduce(full, options)
    if reduced.size > _MOST:
        raise SeparatrixError(
            f"found {reduced.size} coordinates, allowed at most {_MOST}: --reduce modal or craig-bampton, "
            "with --modes",
            USAGE,
        )
    if isinstance(reduced, Matrices) and not smallest_share(reduced.mass.toarray()) > NO_MASS:
        raise SeparatrixError(
            "mass: found a singular or indefinite matrix, allowed a positive definite one "
            "(--reduce modal leaves out what has no mass)"
        )
    if options.damping_ratio is not None:
        reduced = _damped(reduced, options.damping_ratio)
    write(reduced, options.output, options.title, options.reduce)
    return _report(full, reduced, options)


def _read(options: argparse.Namespace) -> Matrices | Modes:
    given = {role: getattr(options, role) for role in ROLES if getattr(options, role)}
    if options.input and options.input.suffix.lower() in _UNIVERSAL:
        if given:
            raise SeparatrixError(
                "a universal file holds modes: allowed without --mass, --stiffness, --damping", USAGE
            )
        return read_modes(options.input)
    if not options.input and not {"mass", "stiffness"} <= set(given):
        raise SeparatrixError("give a file with all matrices or modes, or --mass and --stiffness", USAGE)
    return read_matrices(given, dict(options.names), options.input)


def _reduce(full: Matrices | Modes, options: argparse.Namespace) -> Matrices | Modes:
    if isinstance(full, Modes):
        if options.reduce == "craig-bampton" or options.hold:
            raise SeparatrixError("--reduce craig-bampton and --hold need matrices, found modes", USAGE)
        kept = slice(options.modes or full.size)
        ratio = None if full.damping_ratio is None else full.damping_ratio[kept]
        return Modes(
            full.frequency[kept], ratio, None, {}, {name: row[kept] for name, row in full.points.items()}
        )
    if options.hold:
        points = full.points
        held = hold(full, options.hold)
        full.mass, full.stiffness, full.damping = held.mass, held.stiffness, held.damping
        full.labels, full.points = held.labels, held.points
        for name in points:
            if not np.any(held.points[name]):
                raise SeparatrixError(f"--hold: the point {name} is held")
    if options.reduce == "none":
        return condense(full)
    if options.modes is None or (options.modes == 0 and options.reduce == "modal"):
        raise SeparatrixError(f"--reduce {options.reduce} needs --modes COUNT, of modal 1 or more", USAGE)
    return modal(full, options.modes) if options.reduce == "modal" else craig_bampton(full, options.modes)


def _damped(structure: Matrices | Modes, ratio: float) -> Matrices | Modes:
    """Give every mode one damping ratio."""
    if isinstance(structure, Modes):
        return Modes(structure.frequency, np.full(structure.size, ratio), None, {}, structure.points)
    squares, shapes = undamped_modes(structure)
    momenta = structure.mass @ shapes
    damping = momenta @ np.diag(2 * ratio * np.sqrt(squares)) @ momenta.T
    return Matrices(structure.mass, structure.stiffness, damping, structure.labels, structure.points)


def _report(full: Matrices | Modes, reduced: Matrices | Modes, options: argparse.Namespace) -> list[str]:
    frequency = (
        reduced.frequency if isinstance(reduced, Modes) else np.sqrt(undamped_modes(reduced)[0]) / (2 * np.pi)
    )
    lines = [
        f"{full.size} {'modes' if isinstance(full, Modes) else 'coordinates'} read, {reduced.size} kept; "
        f"{int(np.sum(frequency == 0))} rigid",
        "frequencies [Hz]: " + ", ".join(f"{value:.6g}" for value in frequency),
    ]
    if isinstance(full, Matrices):
        without = np.flatnonzero(abs(full.mass).sum(axis=1) == 0)
        if without.size:
            names = ", ".join(full.labels[row] for row in without[:_MOST_NAMES])
            more = ", ..." if without.size > _MOST_NAMES else ""
            lines.append(f"note: {without.size} of {full.size} coordinates without mass: {names}{more}")
        for check in checks(full, reduced):
            if np.isnan(check.full):
                continue
            lines.append(
                f"point {check.name}: static flexibility {check.kept:.6g} m/N of {check.full:.6g} m/N "
                f"({100 * check.kept / check.full:.1f} % kept)"
            )
    return [*lines, f"wrote {options.output}"]


def _named(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=VALUE")
    return name, value


def _parser() -> Parser:
    parser = Parser(
        prog="separatrix-structure",
        description="From matrices or modes of an engineering tool to a file for [structure.NAME] of a case.",
        epilog="All in SI units. Coordinates are numbers from 1, or NODE:DIRECTION (x, y, z, rx, ry, rz or 1 "
        "to 6) where the file has nodes; a point may be a weighted sum, 0.5*12:y+0.5*13:y.",
    )
    parser.add_argument(
        "input",
        nargs="?",
        type=Path,
        help="a file with all matrices (.mat, .npz, .op4; of CalculiX .sti) or with modes (.uff, .unv)",
    )
    for role in ROLES:
        parser.add_argument(
            f"--{role}",
            type=Path,
            metavar="FILE",
            help=f"the {role} matrix: .mtx, .hb, .sti, .mas, .mat, .npy, .npz, .op4",
        )
    parser.add_argument(
        "--names", type=_named, action="append", default=[], metavar="ROLE=NAME",
        help="name of the mass, stiffness or damping matrix in a file with several",
    )  # fmt: skip
    parser.add_argument(
        "--point",
        type=_named,
        action="append",
        default=[],
        metavar="NAME=COORDINATE",
        help="a point that joints act at: a coordinate, or a weighted sum of coordinates",
    )
    parser.add_argument(
        "--hold", action="append", default=[], metavar="COORDINATE", help="a coordinate that is held at zero"
    )
    parser.add_argument(
        "--reduce", choices=("none", "modal", "craig-bampton"), default="none", help="default: none"
    )
    parser.add_argument("--modes", type=whole_number(0), metavar="COUNT", help="modes that are kept")
    parser.add_argument(
        "--damping-ratio", type=positive, metavar="RATIO", help="of every mode, instead of other damping"
    )
    parser.add_argument("--title", default="", help="a title for the file")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.h5")
    parser.add_argument("--force", action="store_true", help="replace a file")
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    return parser


if __name__ == "__main__":
    sys.exit(main())
