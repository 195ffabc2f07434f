# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `separatrix-discover`."""

import argparse
import signal
import sys
import threading
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from separatrix.arguments import Parser, list_of, positive, whole_number
from separatrix.discovery.fitting.catalogue import STARTS
from separatrix.discovery.fitting.joint_effects import JOINT_EFFECTS
from separatrix.discovery.fitting.motor_effects import MOTOR_EFFECTS
from separatrix.discovery.options import COMPARED, Options
from separatrix.discovery.report.document import write_report
from separatrix.discovery.results import FILES, replacing, require_writable, write_results
from separatrix.discovery.wording import at_knot, misfit, of_effects, searched, with_error
from separatrix.discovery.workflow import investigate
from separatrix.errors import INTERNAL, INTERRUPTED, NO_MEMORY, TERMINATED, SeparatrixError
from separatrix.printed import show
from separatrix.version import __version__


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    try:
        with _ending_on_sigterm():
            chosen = _parser().parse_args(arguments)
            _run(chosen)
    except SeparatrixError as error:
        print(f"separatrix-discover: {error}", file=sys.stderr)
        return error.code
    except MemoryError as error:
        print(f"separatrix-discover: not enough memory: {error or 'thin the records'}", file=sys.stderr)
        return NO_MEMORY
    except _TerminatedError:
        print("separatrix-discover: terminated before the end", file=sys.stderr)
        return TERMINATED
    except KeyboardInterrupt:
        print("separatrix-discover: interrupted before the end", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(frame.filename).name}:{frame.lineno}"
        message = f"{type(error).__name__} in {where}: {error}"
        print(f"separatrix-discover: internal error, please report it: {message}", file=sys.stderr)
        return INTERNAL
    return 0


class _TerminatedError(KeyboardInterrupt):
    """SIGTERM, which ends a run as an interrupt does."""


@contextmanager
def _ending_on_sigterm() -> Iterator[None]:
    """Turn SIGTERM into an exception, so that nothing is left behind; handlers belong to the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(*_: object) -> None:
        raise _TerminatedError

    earlier = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, earlier or signal.SIG_DFL)


def _run(chosen: argparse.Namespace) -> None:
    options = Options(
        seed=chosen.seed,
        quick=chosen.quick,
        partial=chosen.partial,
        compare=chosen.compare,
        segment_periods=chosen.segment_periods,
        segment_seconds=chosen.segment_seconds,
        time_limit=chosen.time_limit,
        workers=chosen.workers,
        candidates=chosen.effects and tuple(chosen.effects),
        progress=(lambda stage, done: None) if chosen.quiet else Progress(),
    )
    require_writable(chosen.out)
    verdict, findings = investigate(chosen.base, chosen.records, chosen.hold_out, options, chosen.rest)
    with replacing(chosen.out) as draft:
        write_results(draft, verdict, findings)
        write_report(draft, chosen.base, options)
    for line in summary(verdict):
        show(line)
    for path in (chosen.out / name for name in FILES):
        if path.exists():
            show(f"wrote {path}")


# the report has the last tenth of the steps and takes about a third of the time
_STEPS, _TIMES = (0.0, 0.9, 1.0), (0.0, 0.67, 1.0)


class Progress:
    """A line per stage on stderr, with the time passed and what is left at this rate."""

    def __init__(self) -> None:
        """Start the clock."""
        self.began = time.monotonic()

    def __call__(self, stage: str, done: float) -> None:
        """Report that `stage` begins, `done` of the steps being over."""
        passed = time.monotonic() - self.began
        done = float(np.interp(done, _STEPS, _TIMES))
        left = f", about {passed * (1 - done) / done:.0f} s left" if done > 0.1 and passed > 1 else ""
        print(f"[{100 * done:3.0f} %] {stage} ({passed:.1f} s{left})", file=sys.stderr, flush=True)


def added(verdict: dict) -> str:
    """What of a gap without a name was added to the case, or why nothing was."""
    if not verdict["added"]:
        return verdict["not_added"]
    return f"added to the case as a table, effect.{verdict['added'][-1]}, which is no name"


def summary(verdict: dict) -> list[str]:
    """The verdict in a few lines."""
    names = " and ".join(verdict["effects"])
    others = ", ".join(verdict["alternatives"])
    lines = {
        "named": [f"missing: {names}"],
        "ambiguous": [f"missing: {names}" + (f", or {others}" if others else ", not beyond doubt")],
        "none": ["no missing effect"],
        "not-in-catalogue": [f"something is missing that {searched(verdict)} does not name"],
        "characterised": [
            f"something is missing that {searched(verdict)} does not name:",
            *(f"  {'or ' if number else ''}{one['text']}" for number, one in enumerate(verdict["character"])),
            added(verdict),
        ],
    }[verdict["outcome"]]
    if memory := verdict.get("memory"):
        lines.append(f"  {memory['text']}")
    if verdict["in_families"]:
        lines.append(
            f"  in any case {' and '.join(verdict['in_families'])}: the form is in doubt, not the family"
        )
    lines += [f"  {name} acts {location}" for name, location in verdict["locations"].items()]
    lines += [
        f"  {path}{at_knot(verdict['parameters'][path])} = {with_error(verdict['parameters'][path])}"
        for path in of_effects(verdict)
    ]
    if verdict["function"]:
        lines.append(f"  {verdict['families'][-1]}: {verdict['function']['text']}")
    for use, gap in verdict["gap"].items():
        lines.append(
            f"  reduced chi^2, {use.replace('_', '-')}: {gap['before']:.3f} -> {gap['after']:.3f} (noise: 1)"
            f"; misfit {misfit(gap, 'before')} -> {misfit(gap, 'after')}"
        )
    lines += [f"  {one['text']}" for one in verdict["remains"]]
    if verdict["outcome"] != "none":
        # of no gap it is what noise and small imperfections of the rig leave
        lines += [f"  where: {one['text']}" for one in verdict["where"][:4]]
    lines += [f"  {reason}" for reason in verdict["reasons"]]
    if verdict["separating_experiment"]:
        lines.append(f"  to separate them: {verdict['separating_experiment']}")
    return lines + [f"  note: {note}" for note in verdict["notes"]]


def _parser() -> Parser:
    parser = Parser(
        prog="separatrix-discover",
        description="Find where records and a case disagree, name the missing effect, add it, and prove it.",
        epilog="Exit codes: 0 done, 64 usage, 65 bad case or record, 66 no such file, 70 internal error, "
        "71 not enough memory, 73 cannot write, 75 no verdict within the time limit, 130 interrupted, "
        "143 terminated.",
    )
    parser.add_argument(
        "base", metavar="BASE.toml", type=Path, help="case of the machine as it is believed to be"
    )
    parser.add_argument(
        "records",
        metavar="RECORD",
        nargs="+",
        type=Path,
        help="record to fit (CSV, HDF5, .mat, .npz, UFF 58, TDMS, MDF, LVM, WAV)",
    )
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder of the results")
    parser.add_argument(
        "--hold-out",
        metavar="FILE",
        type=Path,
        action="append",
        default=[],
        help="record that is never fitted; repeatable",
    )
    parser.add_argument(
        "--partial",
        action="store_true",
        help="name effects that help on every record though more is missing: real machines",
    )
    parser.add_argument(
        "--compare",
        choices=COMPARED,
        default="motion",
        help="compare the motion, or the force that drives a joint along its known motion [motion]",
    )
    parser.add_argument("--rest", metavar="FILE", type=Path, help="record at rest, for the noise")
    parser.add_argument("--quick", action="store_true", help="a first look: fewer starts and candidates")
    parser.add_argument("--seed", type=whole_number(0), default=1, help="of all random choices [1]")
    parser.add_argument(
        "--effects",
        metavar="LIST",
        type=list_of(dict.fromkeys([*STARTS, *JOINT_EFFECTS, *MOTOR_EFFECTS])),
        help="only these effects of the catalogue",
    )
    parser.add_argument(
        "--segment-periods",
        metavar="N",
        type=positive,
        default=1.0,
        help="longest segment in drive periods [1]",
    )
    parser.add_argument("--segment-seconds", metavar="S", type=positive, help="longest segment in seconds")
    parser.add_argument(
        "--time-limit",
        metavar="S",
        type=positive,
        help="end the search after so many seconds with the best verdict so far, marked as such",
    )
    parser.add_argument(
        "--workers",
        metavar="N",
        type=whole_number(1),
        default=1,
        help="threads that share the segments, which do not change the verdict [1]",
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress")
    parser.add_argument("--version", action="version", version=f"separatrix-discover {__version__}")
    return parser


if __name__ == "__main__":
    sys.exit(main())
