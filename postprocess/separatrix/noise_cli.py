# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `separatrix-noise`: motions of a case under noise, survival and first passage over starts."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from separatrix.arguments import Parser, positive, whole_number
from separatrix.cases import Case, load
from separatrix.errors import CANNOT_CREATE, USAGE, SeparatrixError
from separatrix.noise import first_passage, noisy
from separatrix.printed import show
from separatrix.version import __version__


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    try:
        options = _parser().parse_args(arguments)
        text = _answer(options)
    except SeparatrixError as error:
        print(f"separatrix-noise: {error}", file=sys.stderr)
        return error.code
    except KeyboardInterrupt:
        print("separatrix-noise: stopped", file=sys.stderr)
        return 130
    show(text)
    return 0


def _answer(options: argparse.Namespace) -> str:
    grid = [axis for axis in (options.x0, options.v0) if axis and len(axis) == 3]
    if grid and len(grid) < 2:
        raise SeparatrixError("--x0, --v0: found one axis, allowed none or both as FIRST,LAST,COUNT", USAGE)
    if grid and options.leaves is None:
        raise SeparatrixError("--leaves: missing, which a grid of starts needs", USAGE)
    if options.resume and not (grid and options.output):
        raise SeparatrixError("--resume: needs a grid of starts and -o FILE.h5", USAGE)
    if options.output and options.output.exists() and not options.force:
        raise SeparatrixError(f"{options.output}: exists; --force replaces it", CANNOT_CREATE)
    case = load(options.case)
    if options.settings:
        case = Case(options.case.read_text(), options.case, options.settings)
    given = {
        name: getattr(options, name)
        for name in (
            "motions", "duration", "impulses", "restitution", "body", "leaves", "step", "seed", "threads",
            "output",
        )
    }  # fmt: skip
    given |= {"intensity": options.intensity, "overwrite": options.force}
    if grid:
        return _starts_text(
            first_passage(case, options.x0, options.v0, resume=options.resume, **given), options
        )
    start = [axis[0] if axis else None for axis in (options.x0, options.v0)]
    return _motions_text(noisy(case, *start, samples=options.samples, **given), options)


def _motions_text(result: xr.Dataset, options: argparse.Namespace) -> str:
    last = result.isel(time=-1)
    lines = [f"{result.sizes['motion']} motions of {float(last.time):.6g} s"]
    names = [str(name) for name in result if result[name].dims == ("motion", "time")]
    for name in names:
        unit = result[name].attrs["units"]
        mean, deviation = float(last[name].mean()), float(last[name].std())
        lines.append(
            f"  {name} at the end: mean {mean:.6g} {unit}, standard deviation {deviation:.6g} {unit}"
        )
    if options.leaves is not None:
        share, low, high = (float(last[f"survival{end}"]) for end in ("", "_lower", "_upper"))
        lines.append(
            f"  {100 * share:.4g} % have not left, between {100 * low:.4g} % and {100 * high:.4g} % "
            "with 95 % confidence"
        )
    return "\n".join([*lines, *_written(options)])


def _starts_text(result: xr.Dataset, options: argparse.Namespace) -> str:
    survival, passage = result["survival"].values, result["passage_time"].values
    lines = [
        f"{survival.size} starts, {result.attrs['motions']} motions of "
        f"{result.attrs['duration']:.6g} s from each",
        f"  share that has not left: {survival.min():.4g} to {survival.max():.4g}, "
        f"mean {survival.mean():.4g}",
        f"  mean first passage, at most the duration: {passage.min():.6g} to {passage.max():.6g} s",
    ]
    return "\n".join([*lines, *_written(options)])


def _written(options: argparse.Namespace) -> list[str]:
    return [f"wrote {options.output}"] if options.output else []


def _several(most: int, what: str, *, exactly: bool) -> "object":
    """Return the reader of up to, or exactly, so many numbers parted by commas."""

    def read(text: str) -> tuple[float, ...]:
        try:
            found = tuple(float(part) for part in text.split(","))
        except ValueError:
            found = ()
        wanted = len(found) == most or (not exactly and len(found) == 1)
        if not wanted or np.isnan(found).any():
            raise argparse.ArgumentTypeError(f"found '{text}', allowed {what}")
        return found

    return read


def _axis(text: str) -> tuple:
    found = _several(3, "VALUE, or FIRST,LAST,COUNT", exactly=False)(text)
    if len(found) == 3 and found[2].is_integer():
        return (found[0], found[1], int(found[2]))
    return found


def _leaves(text: str) -> str | tuple[float, float]:
    if text == "impact":
        return text
    return _several(2, "impact, or LOWER,UPPER", exactly=True)(text)


def _size(text: str) -> float:
    return _several(1, "a number", exactly=True)(text)[0]


def _parser() -> Parser:
    parser = Parser(
        prog="separatrix-noise",
        description="Motions of a case under random forces, impulses and restitution; with a grid of starts "
        "the share of motions that have not left, and the mean time of first passage.",
        epilog="Exit codes: 0 done, 64 usage, 65 faulty case, 66 no such file, 73 cannot write, 78 a motion "
        "was given up.",
    )
    parser.add_argument("case", metavar="CASE", type=Path, help="case file (.toml)")
    parser.add_argument(
        "--set", dest="settings", metavar="KEY=VALUE", action="append", default=[], help="change the case"
    )
    for name, unit in (("x0", "m"), ("v0", "m/s")):
        parser.add_argument(
            f"--{name}",
            metavar="A[,B,N]",
            type=_axis,
            help=f"start, or N starts from A to B [{unit}; the case]",
        )
    parser.add_argument(
        "--motions", metavar="N", type=whole_number(1), default=100, help="of each start [100]"
    )
    parser.add_argument("--duration", metavar="T", type=positive, help="seconds [run.duration]")
    parser.add_argument(
        "--intensity", metavar="I", type=_size, default=0.0, help="of a white random force, N^2 s [0]"
    )
    parser.add_argument(
        "--impulses", metavar="RATE,DEVIATION", type=_several(2, "RATE,DEVIATION", exactly=True),
        help="Poisson impulses: rate, 1/s, and standard deviation of the change of velocity, m/s",
    )  # fmt: skip
    parser.add_argument(
        "--restitution",
        metavar="S",
        type=_size,
        default=0.0,
        help="standard deviation of the coefficient [0]",
    )
    parser.add_argument(
        "--body", metavar="NAME", help="which body force and impulses act on [the watched one]"
    )
    parser.add_argument(
        "--leaves", metavar="impact|LOWER,UPPER", type=_leaves,
        help="when a motion has left: at its first impact, or beyond positions, m",
    )  # fmt: skip
    parser.add_argument(
        "--step", metavar="T", type=positive, help="seconds between kicks of the random force"
    )
    parser.add_argument(
        "--samples", metavar="N", type=whole_number(2), default=200, help="times, without a grid [200]"
    )
    parser.add_argument(
        "--seed", metavar="N", type=whole_number(0), default=1, help="of all random numbers [1]"
    )
    parser.add_argument(
        "--threads", metavar="N", type=whole_number(1),
        help="threads, which do not change the results [cores]",
    )  # fmt: skip
    parser.add_argument("-o", "--output", metavar="FILE.h5", type=Path, help="a file for separatrix-figures")
    parser.add_argument("--force", action="store_true", help="replace a file that exists")
    parser.add_argument("--resume", action="store_true", help="go on with a grid of starts that was stopped")
    parser.add_argument("--version", action="version", version=f"separatrix-noise {__version__}")
    return parser


if __name__ == "__main__":
    sys.exit(main())
