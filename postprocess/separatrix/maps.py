# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`basin`, `sweep` and `points`: computations of the program, with their results as Datasets."""

import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from separatrix.cases import Case, as_case
from separatrix.cores import cores
from separatrix.errors import (
    GIVEN_UP,
    USAGE,
    CaseError,
    GivenUpError,
    Interrupted,
    SeparatrixError,
)
from separatrix.labelling import Labelling, SecondLookError, can_label
from separatrix.map_axes import Values, axis_keys, evenly_spaced, size_of_axis, with_axes
from separatrix.map_starts import table_of_starts
from separatrix.open import open_result
from separatrix.progress import Progress, Report
from separatrix.runner import StoppedError, run

__all__ = ["basin", "points", "sweep"]

# Below this number of points, starting a second process takes longer than it saves.
_FEW_POINTS = 50_000
# The largest number of points of a result that is kept in memory, without a file.
_MOST_IN_MEMORY = 50_000_000


@dataclass
class _Work:
    """One call: the command, its processes, its output, and the receiver of its progress."""

    command: str
    case: Case
    output: Path | None
    workers: int
    ranks: int | None
    progress: bool | Report | None
    resume: bool
    overwrite: bool
    time_limit: float | None
    extra: Callable[[Path], list[str]]

    def __call__(self, folder: tempfile.TemporaryDirectory | None = None) -> xr.Dataset:
        """Run the command; `folder` holds the work of an earlier run that was stopped."""
        own = folder or tempfile.TemporaryDirectory(prefix="separatrix-")
        work_folder = Path(own.name)
        target = (self.output or work_folder / f"{self.command}.h5").absolute()
        if self.output and target.exists() and not self.overwrite:
            raise SeparatrixError(f"{target}: exists; overwrite=True replaces it", 73)
        try:
            with Progress(self.progress) as report:
                self._compute(work_folder, target, report, resume=self.resume or folder is not None)
        except SeparatrixError as error:
            if error.code != GIVEN_UP:
                raise
            message = str(error).removesuffix(" (--partial: no error)")
            raise GivenUpError(message, self._result(target)) from None
        except StoppedError as stop:
            again = "; resume() goes on" + (", and so does resume=True" if self.output else "")
            raise Interrupted(
                f"stopped at {100 * stop.done:.0f} %{again}", stop.done, lambda: self(own)
            ) from None
        return self._result(target)

    def _result(self, target: Path) -> xr.Dataset:
        if self.output:
            return open_result(target)
        with open_result(target) as result:
            return kept_in_memory(result)

    def _compute(self, work_folder: Path, target: Path, report: Progress, resume: bool) -> None:
        named = self.case.on_command_line(work_folder)
        rename = {named[0]: self.case.name, f"'{target}'": f"'{target.name}'"}
        base = [self.command, *named, *self.extra(work_folder), "--json"]
        if self.workers == 1:
            how = ["--resume"] if resume else ["--force"] if self.overwrite else []
            command = [*base, *how, "-o", str(target)]
            run([command], report, self.ranks, rename, time_limit=self.time_limit)
            return
        self._in_shares(base, target, report, rename, resume)

    def _in_shares(
        self, base: list[str], target: Path, report: Progress, rename: dict[str, str], resume: bool
    ) -> None:
        """Run serial processes, each with a share of the tiles; merged, they equal one run bitwise."""
        count = self.workers
        shares = [Path(f"{target}.shard-{i}-of-{count}.part") for i in range(1, count + 1)]
        if not resume:
            for share in shares:
                share.unlink(missing_ok=True)
        first = [*base, "-o", str(target), "--shard", f"1/{count}"]
        found = []
        if self.command == "basin":
            if not shares[0].exists():
                run([[*first, "--search-only"]], report, None, rename, time_limit=self.time_limit)
            found = ["--catalogue", str(shares[0])]
        commands = [[*first, "--resume"]]
        for i in range(2, count + 1):
            commands.append([*base, "-o", str(target), "--shard", f"{i}/{count}", "--resume", *found])
        run(commands, report, None, rename, time_limit=self.time_limit)
        joined = ["merge", str(target), *map(str, shares), "--json"]
        given_up = None
        try:
            run([[*joined, *(["--force"] if self.overwrite else [])]], report, None, rename)
        except SeparatrixError as error:
            given_up = error
            if error.code != GIVEN_UP:
                raise
        for share in shares:
            share.unlink()
            Path(f"{share}.lock").unlink(missing_ok=True)
        if given_up:
            raise given_up


def basin(
    case: Case | str | Path,
    axes: Mapping[str, Values] | None = None,
    /,
    *,
    output: str | Path | None = None,
    threads: int | None = None,
    workers: int | None = None,
    ranks: int | None = None,
    progress: bool | Report | None = None,
    resume: bool = False,
    overwrite: bool = False,
    time_limit: float | None = None,
    **more: Values,
) -> xr.Dataset:
    """Return the attractors and, for every point of a grid, the one that its trajectory reaches.

    Parameters
    ----------
    case
        The machine, as a Case or the file of one.
    axes, **more
        Axes by name: `x0`, `v0`, `crank_angle`, or the path of a parameter (`{"drive.ratio": ...}`, as a
        keyword `drive__ratio=...`). Values are `sx.linspace(first, last, count)`, the same as a tuple
        `(first, last, count)`, an ascending list or array, or a whole number: that many values over the range
        of the case. Numbers are in SI units; texts have a unit ("-3 mm"). None removes an axis. Axes of
        the case that are not named stay; new ones come first, as the slowest.
    output
        The result file. Without one the result is kept in memory. It is computed in this process unless the
        case has a motor, derived quantities or a refined grid.
    threads, workers, ranks
        Choose one: threads of this process (the default without `output`); serial processes on this machine,
        each with a share of the tiles (the default with `output`); ranks of MPI, where the program has been
        built with it. The default is one per core, or a single one for small maps. The results are bitwise
        identical for any number.
    progress
        True, False, None (a bar in a terminal or a notebook), or a function of (things, done, total).
    resume
        Continue a run into `output` that was stopped, with the same number of workers.
    overwrite
        Replace an existing `output`.
    time_limit
        Seconds after which the run is stopped, to be resumed.

    Ctrl-C raises `Interrupted`, a KeyboardInterrupt whose `resume()` continues the run. An error in the case
    raises a `CaseError` with the message of the program.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> result.separatrix.attractors[["regime", "share"]].round(2)
                   regime  share
    attractor
    1          non_impact   0.35
    2              impact   0.65
    """
    case = with_axes(as_case(case), {**(axes or {}), **_paths(more)})
    sizes = [size_of_axis(axis) for axis in case.resolved.get("axis", [])]
    number = int(np.prod(sizes)) if sizes else 0
    if output is None and number > _MOST_IN_MEMORY:
        raise SeparatrixError(f"{number} points are kept in a file: give output=FILE", USAGE)
    here = output is None and workers is None and ranks is None and time_limit is None
    if threads is not None and not here:
        raise SeparatrixError("threads: allowed without output, workers, ranks and time_limit", USAGE)
    if here and can_label(case):
        count = _workers(threads, None, number, "threads")
        try:
            return Labelling(case, count, progress)()
        except SecondLookError:
            workers = count
    work = _Work(
        "basin", case, _path(output), _workers(workers, ranks, number), ranks, progress, resume, overwrite,
        time_limit, lambda folder: [],
    )  # fmt: skip
    return work()


def sweep(
    case: Case | str | Path,
    parameter: str | None = None,
    values: Values = None,
    *,
    directions: str | None = None,
    starts: tuple[int, int] | None = None,
    x0: tuple[float, float] | None = None,
    v0: tuple[float, float] | None = None,
    samples: int | None = None,
    limit_tolerance: float | None = None,
    output: str | Path | None = None,
    ranks: int | None = None,
    progress: bool | Report | None = None,
    resume: bool = False,
    overwrite: bool = False,
    time_limit: float | None = None,
) -> xr.Dataset:
    """Return how the motion changes with a parameter: up, down, from many starts, and its limits.

    Parameters
    ----------
    case
        The machine, as a Case or the file of one. Omitted arguments are those of its table [sweep].
    parameter, values
        The path of the swept parameter and its values, evenly spaced: `sx.linspace(first, last, count)`, the
        same as a tuple, or an array.
    directions
        "both", "up" or "down".
    starts, x0, v0
        The grid of initial conditions over x0 and v0, and their ranges; (0, 0) for none.
    samples
        Section points stored per value.
    limit_tolerance
        Width to which the limits of a region are bracketed.
    output, ranks, progress, resume, overwrite, time_limit
        As for `basin`. A sweep runs on one core, or on `ranks` of MPI. Each value continues from the final
        state of the previous one.

    Examples
    --------
    >>> result = sx.sweep("examples/sweep_viscous.toml", "drive.ratio", (0.9, 1.0, 3))
    >>> result["amplitude"].dims
    ('direction', 'drive_ratio')
    """
    case = as_case(case)
    table = dict(case.resolved.get("sweep", {}))
    if parameter is not None and parameter != table.get("parameter"):
        table = {key: value for key, value in table.items() if key not in ("from", "to", "count", "values")}
        table["parameter"] = parameter
        if values is None:
            raise CaseError(f"sweep over {parameter}: values are missing", USAGE)
    if values is not None:
        table = {key: value for key, value in table.items() if key not in ("from", "to", "count", "values")}
        swept = table["parameter"]
        table |= evenly_spaced(case, swept, axis_keys(swept, values, None))
    given = {
        "directions": directions, "starts": starts, "x0": x0, "v0": v0, "samples": samples,
        "limit_tolerance": limit_tolerance,
    }  # fmt: skip
    table |= {key: value for key, value in given.items() if value is not None}
    case = case.with_({"sweep": table})
    work = _Work(
        "sweep", case, _path(output), 1, ranks, progress, resume, overwrite, time_limit, lambda folder: []
    )
    return work()


def points(
    case: Case | str | Path,
    starts: object = None,
    *,
    output: str | Path | None = None,
    workers: int | None = None,
    ranks: int | None = None,
    progress: bool | Report | None = None,
    overwrite: bool = False,
    time_limit: float | None = None,
    **columns: Iterable[float] | float,
) -> xr.Dataset:
    """Return the final states, at the end of the duration, of many initial conditions.

    `starts` has the columns x0 [m], v0 [m/s] and optionally the drive ratio: a mapping, a DataFrame, a
    Dataset, or an array with two or three columns; or each as a keyword, `points(case, x0=[...], v0=0.0)`.
    The rest is as for `basin`.

    Examples
    --------
    >>> result = sx.points("examples/basin_coulomb.toml", x0=[0.7, 0.7], v0=[2.0, 4.0])
    >>> sx.decode_flags(result["regime"]).values.tolist()
    ['non_impact', 'impact']
    """
    case = as_case(case)
    table = table_of_starts(case, starts, columns)

    def listed(folder: Path) -> list[str]:
        path = folder / "starts.csv"
        rows = [",".join(repr(float(value)) for value in row) for row in zip(*table.values(), strict=True)]
        path.write_text("\n".join([",".join(table), *rows, ""]))
        return ["--list", str(path)]

    number = len(table["x0"])
    work = _Work(
        "points", case, _path(output), _workers(workers, ranks, number), ranks, progress, False, overwrite,
        time_limit, listed,
    )  # fmt: skip
    return work()


def kept_in_memory(result: xr.Dataset) -> xr.Dataset:
    """Return a copy of a result that no longer needs its file."""
    kept = result.load().copy()
    kept.encoding = {}
    for variable in kept.variables.values():
        variable.encoding = {}
    return kept


def _paths(keywords: Mapping[str, Values]) -> dict[str, Values]:
    return {name.replace("__", "."): values for name, values in keywords.items()}


def _path(output: str | Path | None) -> Path | None:
    return None if output is None else Path(output).expanduser()


def _workers(workers: int | None, ranks: int | None, number: int, name: str = "workers") -> int:
    if ranks is not None:
        if workers not in (None, 1):
            raise SeparatrixError("workers and ranks: choose one", USAGE)
        if ranks < 1:
            raise SeparatrixError(f"ranks: found {ranks}, allowed 1 or more", USAGE)
        return 1
    if workers is None:
        return 1 if number < _FEW_POINTS else cores()
    if workers < 1:
        raise SeparatrixError(f"{name}: found {workers}, allowed 1 or more", USAGE)
    return int(workers)
