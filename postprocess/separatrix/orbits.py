# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`branches` of periodic orbits over a parameter, `stability` of one motion and of those of a map."""

import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import xarray as xr

from separatrix.boundaries import file_of_map
from separatrix.cases import Case, as_case, linspace, quantity, toml
from separatrix.errors import CANNOT_CREATE, INTERNAL, USAGE, SeparatrixError
from separatrix.map_axes import with_axes
from separatrix.maps import kept_in_memory
from separatrix.open import open_result
from separatrix.progress import Progress, Report
from separatrix.runner import run_at_once

__all__ = ["Stability", "branches", "stability", "stability_of_map"]

# What the program names by its options.
_IN_PYTHON = {
    "--parameter": "parameter", "--from": "start", "--to": "stop", "--searches": "searches",
    "--periods": "periods", "--free-from": "free", "--free-to": "free", "--free": "free",
}  # fmt: skip


@dataclass(frozen=True)
class Stability:
    """What is known of one motion by its Lyapunov exponents and the 0-1 test.

    `exponents` [1/s], the first the largest within its error, are -inf where sticking or a completed chatter
    loses a direction; `errors` are their standard errors. `sum_found` and `sum_exact` [1/s], the sum of the
    exponents and what damping, impacts and turning points alone make of it, check them. `zero_one` is near 0
    for a regular and near 1 for a chaotic motion. `motion` is "chaotic", "periodic", "quasi_periodic",
    "transient" or "not_known", by `periods` drive periods with `impacts` impacts. What is not known is nan.
    """

    motion: str = "not_known"
    exponents: tuple[float, ...] = (math.nan, math.nan)
    errors: tuple[float, ...] = (math.nan, math.nan)
    sum_found: float = math.nan
    sum_exact: float = math.nan
    zero_one: float = math.nan
    periods: int = 0
    impacts: int = 0
    report: str = field(default="", repr=False)

    def __str__(self) -> str:
        """Return the report of the command."""
        return self.report


def branches(
    case: Case | str | Path,
    parameter: str,
    start: float | str | None = None,
    stop: float | str | None = None,
    *,
    searches: int | None = None,
    free: tuple[str, float, float] | None = None,
    contacts: bool = False,
    x0: tuple[float, float] | None = None,
    v0: tuple[float, float] | None = None,
    output: str | Path | None = None,
    progress: bool | Report | None = None,
    overwrite: bool = False,
) -> xr.Dataset:
    """Return the periodic orbits over a parameter, stable and unstable, with their bifurcations.

    Parameters
    ----------
    case
        The machine, as a Case or the file of one; one body or a structure.
    parameter, start, stop
        The path of the parameter and its range, numbers or texts with a unit; without one that of the sweep
        or the axis of the case.
    searches
        At how many values orbits are searched; 12 if not given.
    free
        A second parameter and its range, over which the labelled points are followed as curves.
    contacts
        Whether homoclinic contacts and boundary crises of the saddles are looked for.
    x0, v0
        Ranges of the starts from which they are searched [m, m/s]; those of the axes of the case, else twice
        the motion that the drive brings about.
    output
        The result file. Without one the result is kept in memory.
    progress, overwrite
        As for `basin`; what is counted are values searched. Ctrl-C is a KeyboardInterrupt, and nothing is
        kept.

    `.separatrix.plot()` draws them, `.separatrix.labelled_points` is the table of their bifurcations.

    Examples
    --------
    >>> case = sx.load("examples/basin_coulomb.toml")
    >>> result = sx.branches(case, "drive.ratio", 1.05, 1.1, searches=2)
    >>> bool(result["stable"].all())
    True
    """
    case = as_case(case)
    case = with_axes(case, {name: _ends(name, given) for name, given in (("x0", x0), ("v0", v0)) if given})
    options = ["--parameter", parameter]
    for name, value in (("--from", start), ("--to", stop)):
        if value is not None:
            options += [name, toml(case.in_si(parameter, value))]
    if searches is not None:
        options += ["--searches", str(searches)]
    if contacts:
        options += ["--contacts"]
    if free is not None:
        options += ["--free", free[0], "--free-from", toml(case.in_si(free[0], free[1]))]
        options += ["--free-to", toml(case.in_si(free[0], free[2]))]
    with tempfile.TemporaryDirectory(prefix="separatrix-") as folder:
        target = (Path(folder) / "branches.h5" if output is None else Path(output).expanduser()).absolute()
        if output is not None and target.exists() and not overwrite:
            raise SeparatrixError(f"{target}: exists; overwrite=True replaces it", CANNOT_CREATE)
        options += ["-o", str(target), *(["--force"] if overwrite else [])]
        _run("branches", case, Path(folder), options, progress)
        if output is not None:
            return open_result(target)
        with open_result(target) as result:
            return kept_in_memory(result)


def stability(
    case: Case | str | Path,
    x0: float | str | None = None,
    v0: float | str | None = None,
    crank_angle: float | str | None = None,
    *,
    periods: int | None = None,
) -> Stability:
    """Return the Lyapunov exponents of one motion after its transients, and what kind of motion it is.

    Parameters
    ----------
    case
        The machine, as a Case or the file of one; one body or a structure.
    x0, v0, crank_angle
        The start: numbers [m, m/s, rad] or texts with a unit; what is not given is that of the case.
    periods
        Drive periods watched, after a quarter as many, 64 or more; 20000 if not given.

    Examples
    --------
    >>> found = sx.stability("examples/basin_coulomb.toml", x0=0.4, v0=0)
    >>> found.motion, round(found.exponents[0], 3)
    ('periodic', -1.337)
    """
    start = {"x0": x0, "v0": v0, "crank_angle": crank_angle}
    with tempfile.TemporaryDirectory(prefix="separatrix-") as folder:
        return stability_by(stability_command(as_case(case), start, periods, Path(folder)))


def stability_command(
    case: Case, start: Mapping[str, float | str | None], periods: int | None, folder: Path
) -> tuple[list[str], dict[str, str]]:
    """Return the command of `stability`, and what it is to call the file that it is given."""
    given = {f"start.{name}": value for name, value in start.items()}
    case = case.with_({name: quantity(name, value) for name, value in given.items() if value is not None})
    named = case.on_command_line(folder)
    options = [] if periods is None else ["--periods", str(periods)]
    return ["stability", *named, *options, "--json"], {named[0]: case.name, **_IN_PYTHON}


def stability_by(work: tuple[list[str], dict[str, str]]) -> Stability:
    """Run a command of `stability`, which several threads may do: they do not meet in the library."""
    events: list[dict] = []
    with Progress(False) as reporter:
        run_at_once(work[0], reporter, rename=work[1], take=events.append)
    return _stability(events)


def stability_of_map(
    basins: xr.Dataset | str | Path,
    *,
    periods: int | None = None,
    progress: bool | Report | None = None,
) -> dict[int, Stability]:
    """Return, by attractor, what kind of motion each one of a map is that has no known period.

    Parameters
    ----------
    basins
        The map: its file, or the result of `basin` or `open_result`. One that is in memory only is computed
        once more, into a temporary file.
    periods
        Drive periods watched, after a quarter as many, 64 or more; 20000 if not given.
    progress
        As for `basin`, where the map has to be computed. Ctrl-C is a KeyboardInterrupt.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> sx.stability_of_map(result)
    {}
    """
    events: list[dict] = []
    with tempfile.TemporaryDirectory(prefix="separatrix-") as folder:
        command = ["stability", str(file_of_map(basins, Path(folder), "stability", None, progress)), "--json"]
        command += [] if periods is None else ["--periods", str(periods)]
        with Progress(False) as reporter:
            run_at_once(command, reporter, rename=_IN_PYTHON, take=events.append)
    return {event["attractor"]: _entry(event) for event in events if event.get("event") == "entry"}


def _entry(event: dict) -> Stability:
    """One attractor of a map."""
    values = event.get("exponents") or ()
    return Stability(
        motion=str(event["type"]),
        exponents=tuple(-math.inf if one is None else one for one in values) or Stability.exponents,
        errors=tuple(math.nan if one is None else one for one in event.get("errors") or ())
        or Stability.errors,
        sum_found=event.get("sum", math.nan),
        sum_exact=event.get("exact_sum", math.nan),
        zero_one=event.get("zero_one", math.nan),
        periods=event.get("periods", 0),
        impacts=event.get("impacts", 0),
        report=str(event["message"]),
    )


def _ends(name: str, given: tuple[float, float]) -> linspace:
    """A range as the axis of which the program takes the ends."""
    if len(given) != 2:
        raise SeparatrixError(f"{name}: found {given}, allowed (lowest, highest)", USAGE)
    return linspace(*given, 2)


def _run(
    command: str,
    case: Case,
    folder: Path,
    options: list[str],
    progress: bool | Report | None,
) -> None:
    """Run a command that keeps nothing when it is stopped."""
    named = case.on_command_line(folder)
    with Progress(progress) as reporter:
        rename = {named[0]: case.name, **_IN_PYTHON}
        run_at_once([command, *named, *options, "--json"], reporter, rename=rename)


def _stability(events: list[dict]) -> Stability:
    """The report of the program in numbers."""
    kinds = ("exponent", "sum", "zero_one", "motion", "not_known")
    reported = [event for event in events if event.get("event") in kinds]
    report = "\n".join(str(event["message"]) for event in reported)
    one = {event["event"]: event for event in reported}
    if "motion" not in one:
        if "not_known" not in one:
            raise SeparatrixError(f"stability: no report of the program on the motion ({report})", INTERNAL)
        return Stability(report=report)
    exponents = [event for event in reported if event["event"] == "exponent"]
    return Stability(
        motion=str(one["motion"]["type"]),
        exponents=tuple(-math.inf if event["value"] is None else event["value"] for event in exponents),
        errors=tuple(event.get("error", math.nan) for event in exponents),
        sum_found=one.get("sum", {}).get("found", math.nan),
        sum_exact=one.get("sum", {}).get("exact", math.nan),
        zero_one=one["zero_one"]["value"],
        periods=one["motion"]["periods"],
        impacts=one["motion"]["impacts"],
        report=report,
    )
