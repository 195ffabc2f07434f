# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `separatrix-measures`: dynamical integrity, size and fractality of the basins of a map."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from separatrix.arguments import Parser, list_of, pairs, positive, whole_number
from separatrix.errors import CANNOT_CREATE, USAGE, SeparatrixError
from separatrix.given_up import refuse
from separatrix.measuring.along import measures_along
from separatrix.measuring.api import NAMES, measures, tipping
from separatrix.measuring.tipping import Tipping
from separatrix.open import open_result, reading
from separatrix.printed import show
from separatrix.version import __version__


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    try:
        options = _parser().parse_args(arguments)
        _check(options)
        text = _answer(options)
    except SeparatrixError as error:
        print(f"separatrix-measures: {error}", file=sys.stderr)
        return error.code
    except KeyboardInterrupt:
        print("separatrix-measures: stopped", file=sys.stderr)
        return 130
    show(text)
    return 0


def _check(options: argparse.Namespace) -> None:
    if options.output and options.output.exists() and not options.force:
        raise SeparatrixError(f"{options.output}: exists; --force replaces it", CANNOT_CREATE)
    if options.tipping and len(options.files) != 2:
        raise SeparatrixError(f"--tipping: found {len(options.files)} files, allowed 2", USAGE)
    if not options.tipping and len(options.files) != 1:
        raise SeparatrixError(f"found {len(options.files)} files, allowed 1", USAGE)
    if options.along and not options.output:
        raise SeparatrixError("--along: needs -o FILE.h5", USAGE)


def _refuse_given_up(options: argparse.Namespace, *results: xr.Dataset) -> None:
    """Refuse maps all of whose points were given up, unless --partial accepts them."""
    for path, result in zip(options.files, results, strict=True):
        if not options.partial:
            refuse(path, result)


def _answer(options: argparse.Namespace) -> str:
    if options.tipping:
        with (
            reading(options.files[1]),
            open_result(options.files[0]) as one,
            open_result(options.files[1]) as two,
        ):
            _refuse_given_up(options, one, two)
            matrix = tipping(one, two)
        return _written(options, tipping_text(matrix), tipping_dict(matrix))
    with reading(options.files[0]), open_result(options.files[0]) as result:
        _refuse_given_up(options, result)
        given = {
            "attractors": options.attractor,
            "frequency": options.frequency,
            "deviation": options.deviation,
            "starts": options.starts,
            "phases": options.phases,
            "seed": options.seed,
            "threads": options.threads,
            "new_starts": not options.map_only,
        }
        if options.along:
            measures_along(
                result,
                names=options.measures,
                slice=options.slice,
                output=options.output,
                overwrite=options.force,
                **given,
            )
            return f"wrote {options.output}"
        found = measures(result, options.measures, slice=options.slice, **given)
    return _written(options, str(found), found.as_dict())


def _written(options: argparse.Namespace, text: str, data: dict) -> str:
    document = json.dumps(data, indent=1)
    if options.output:
        try:
            options.output.write_text(document + "\n")
        except OSError as error:
            raise SeparatrixError(
                f"{options.output}: cannot be written ({error.strerror})", CANNOT_CREATE
            ) from error
    return document if options.json else text


def tipping_text(matrix: Tipping) -> str:
    """Return the matrix as a table."""
    head = ["before \\ after", *(str(one) for one in matrix.after), "not known"]
    lines = ["  ".join(f"{item:>24}" for item in head)]
    for row, label in enumerate(matrix.before):
        cells = [
            f"{share:.4g} [{low:.4g}, {high:.4g}]"
            for share, low, high in zip(matrix.shares[row], matrix.lower[row], matrix.upper[row], strict=True)
        ]
        lines.append("  ".join(f"{item:>24}" for item in [str(label), *cells]))
    lines += [
        "",
        "tipping: share of the points of each basin before (row) that lie in each basin after (column)",
        "  interval: 95 %, as for random initial conditions (Clopper and Pearson)",
    ]
    return "\n".join(lines)


def tipping_dict(matrix: Tipping) -> dict[str, object]:
    """Return the matrix as JSON has it."""
    return {
        "before": list(matrix.before),
        "after": list(matrix.after),
        "counts": matrix.counts.tolist(),
        "shares": matrix.shares.tolist(),
        "lower": matrix.lower.tolist(),
        "upper": matrix.upper.tolist(),
    }


def _parser() -> Parser:
    parser = Parser(
        prog="separatrix-measures",
        description="Measures dynamical integrity, size and fractality of the basins of a map, "
        "with intervals and limitations.",
        epilog="Exit codes: 0 done, 64 usage, 65 not a file to read, 66 no such file, 73 cannot write, "
        "78 every motion was given up.",
    )
    parser.add_argument("files", metavar="MAP", nargs="+", type=Path, help="basin file (.h5)")
    parser.add_argument(
        "--measures",
        metavar="LIST",
        type=list_of([*NAMES, "all"]),
        help=f"all, or some of {', '.join(NAMES)} [those that take seconds]",
    )
    parser.add_argument(
        "--partial", action="store_true", help="accept a map all of whose motions were given up"
    )
    parser.add_argument(
        "--attractor", metavar="N", type=whole_number(1), help="the basin of this attractor alone [all]"
    )
    parser.add_argument(
        "--slice",
        metavar="NAME=VALUE,...",
        type=pairs(ranges=False),
        default={},
        help="a value of each parameter of the map; the nearest one is taken",
    )
    parser.add_argument(
        "--frequency",
        metavar="W",
        type=positive,
        help="frequency that velocities are divided by, rad/s [natural frequency, or drive frequency]",
    )
    parser.add_argument(
        "--deviation",
        metavar="x0=A,v0=B",
        type=pairs(ranges=False),
        default=None,
        help="basin stability for a normal density about the motion [uniform over the window]",
    )
    parser.add_argument(
        "--starts",
        metavar="N",
        type=whole_number(100),
        default=20000,
        help="further initial conditions for each share [20000]",
    )
    parser.add_argument(
        "--phases",
        metavar="N",
        type=whole_number(2),
        help="adds the measures over N crank angles: critical impulse, safe basin, local integrity of the "
        "orbit",
    )
    parser.add_argument(
        "--along",
        action="store_true",
        help="measures along the parameter of the map; -o FILE.h5 writes them for separatrix-figures",
    )
    parser.add_argument(
        "--tipping",
        action="store_true",
        help="two maps: shares of each basin of the first that lie in each basin of the second",
    )
    parser.add_argument("--map-only", action="store_true", help="only the map, no further initial conditions")
    parser.add_argument(
        "--seed", metavar="N", type=whole_number(0), default=1, help="seed of all random numbers [1]"
    )
    parser.add_argument(
        "--threads",
        metavar="N",
        type=whole_number(1),
        help="threads, which do not change the results [cores]",
    )
    parser.add_argument("--json", action="store_true", help="print JSON, with all curves")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=Path,
        help="write JSON there; with --along a file for separatrix-figures",
    )
    parser.add_argument("--force", action="store_true", help="replace a file that exists")
    parser.add_argument("--version", action="version", version=f"separatrix-measures {__version__}")
    return parser


if __name__ == "__main__":
    sys.exit(main())
