# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`exponents_along`: Lyapunov exponents over a parameter, and the sections of the same motions."""

import tempfile
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import numpy as np
import xarray as xr

from separatrix.cases import Case, as_case
from separatrix.cores import cores
from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures.parts import several_bodies
from separatrix.map_axes import Values, axis_numbers
from separatrix.motions import trajectory
from separatrix.orbits import Stability, stability_by, stability_command
from separatrix.progress import Progress, Report
from separatrix.sections import section
from separatrix.version import __version__

__all__ = ["exponents_along"]

#: What `stability` calls a motion, in the order of its codes.
_MOTIONS = ("not_known", "periodic", "quasi_periodic", "chaotic", "transient")


def exponents_along(
    source: xr.Dataset | Case | str | Path,
    parameter: str | None = None,
    values: Values = None,
    *,
    x0: float | str | None = None,
    v0: float | str | None = None,
    crank_angle: float | str | None = None,
    direction: str = "up",
    periods: int = 2000,
    points: int = 100,
    threads: int | None = None,
    progress: bool | Report | None = None,
) -> xr.Dataset:
    """Return the Lyapunov exponents of a motion at each value of a parameter.

    The variables are `exponent` and `exponent_error` [1/s] over the parameter and the number of the exponent,
    the largest first; `zero_one`, near 1 for chaos; `motion`, a code ("periodic", "chaotic", ...); and, of a
    machine with a drive of fixed period, `section_x`, the points of the same motions once per drive period.
    An exponent is -inf where sticking loses a direction, NaN where it is not known.
    `.separatrix.plot()` draws the exponents below the bifurcation diagram.

    Parameters
    ----------
    source
        A case, of which every motion begins at one start; or the result of a sweep of one body, whose motions
        are continued from its section points.
    parameter, values
        Of a case the path of the parameter and its values, as for an axis of `basin`.
    x0, v0, crank_angle
        The start of a case: numbers [m, m/s, rad] or texts with a unit.
    direction
        Of a sweep: "up" or "down".
    periods
        Drive periods watched, after a quarter as many, 64 or more.
    points
        Of a case: points of the section at each value, after `periods` / 4.
    threads
        Motions at once; as many as cores if not given. The result does not depend on it.
    progress
        As for `basin`; what is counted are values.

    Examples
    --------
    >>> case = sx.load("examples/basin_coulomb.toml")
    >>> along = sx.exponents_along(case, "drive.ratio", [1.1, 1.2], x0=0.4, v0=0, periods=256, points=4)
    >>> sx.decode_flags(along["motion"]).values.tolist()
    ['periodic', 'periodic']
    """
    if isinstance(source, xr.Dataset):
        if parameter is not None or values is not None:
            raise SeparatrixError("exponents_along: parameter and values are those of the sweep", USAGE)
        case, path, numbers, starts, sections = _of_sweep(source, direction)
    else:
        case = as_case(source)
        if parameter is None or values is None:
            raise SeparatrixError("exponents_along: of a case the parameter and its values are needed", USAGE)
        path, numbers, sections = parameter, axis_numbers(case, parameter, values), None
        starts = [{"x0": x0, "v0": v0, "crank_angle": crank_angle}] * len(numbers)
    cases = [case.with_({path: float(one)}) for one in numbers]
    if sections is None and _is_driven(cases[0], starts[0]):
        each = zip(cases, starts, strict=True)
        drawn = [section(one, **start, periods=points, transient=periods // 4) for one, start in each]
        sections = np.array([one["x"].values for one in drawn])
    with tempfile.TemporaryDirectory(prefix="separatrix-") as folder:
        commands = []
        for number, (one, start) in enumerate(zip(cases, starts, strict=True)):
            own = Path(folder) / str(number)
            own.mkdir()
            commands.append(stability_command(one, start, periods, own))
        rows = _computed(commands, threads or cores(), progress)
    return _dataset(cases[0], path, numbers, rows, sections)


def _of_sweep(sweep: xr.Dataset, direction: str) -> tuple[Case, str, np.ndarray, list[dict], np.ndarray]:
    """The case of a sweep, its parameter and values, the state at each and its section points."""
    if sweep.separatrix.kind != "sweep":
        raise SeparatrixError("exponents_along: found no sweep, allowed the result of sweep or a case", USAGE)
    case = sweep.separatrix.case
    if several_bodies(case.resolved) or "motor" in case.resolved:
        raise SeparatrixError(
            "exponents_along: allowed is a sweep of one body without a motor, or a case", USAGE
        )
    codes = {"up": 0, "down": 1}
    if direction not in codes or codes[direction] not in sweep["direction"].values:
        raise SeparatrixError(f"direction: found '{direction}', allowed those of the sweep: up, down", USAGE)
    run = sweep.sel(direction=codes[direction])
    path = str(case.resolved["sweep"]["parameter"])
    x, v = run["section_x"].values, run["section_v"].values
    if not np.isfinite(x[:, -1]).all():
        raise SeparatrixError(
            f"direction: found '{direction}', in which the sweep has values without section points", USAGE
        )
    ends = zip(x[:, -1].tolist(), v[:, -1].tolist(), strict=True)
    starts = [{"x0": position, "v0": speed, "crank_angle": 0.0} for position, speed in ends]
    return case, path, run[path.replace(".", "_")].values, starts, x


def _is_driven(case: Case, start: dict) -> bool:
    """Whether a drive gives all motions one period, once in which they can be drawn."""
    if "motor" in case.resolved:
        return False
    period = 2 * np.pi / case.model.drive_frequency({})
    case = case.with_({"run.average": "window"})
    return bool(trajectory(case, **start, duration=period, samples=2, partial=True).attrs["driven"])


def _computed(commands: list[tuple], threads: int, progress: bool | Report | None) -> list[Stability]:
    """The rows in their order; what has not begun when one fails, or at Ctrl-C, is not computed."""
    with Progress(progress) as report, ThreadPoolExecutor(threads) as pool:
        tasks = [pool.submit(stability_by, command) for command in commands]
        try:
            for done, task in enumerate(as_completed(tasks), 1):
                task.result()
                report("values", done, len(tasks))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [task.result() for task in tasks]


def _dataset(
    case: Case, path: str, values: np.ndarray, rows: list[Stability], sections: np.ndarray | None
) -> xr.Dataset:
    dim, unit = path.replace(".", "_"), case.parameters[path].unit if path in case.parameters else "1"
    size = max(len(one.exponents) for one in rows)
    exponents, errors = np.full((2, len(rows), size), np.nan)
    for i, row in enumerate(rows):
        exponents[i, : len(row.exponents)], errors[i, : len(row.errors)] = row.exponents, row.errors
    codes = np.array([_MOTIONS.index(one.motion) for one in rows], np.int8)
    flags = {"flag_values": np.arange(len(_MOTIONS), dtype=np.int8), "flag_meanings": " ".join(_MOTIONS)}
    data = {
        "exponent": ((dim, "number"), exponents, {"units": "1/s", "long_name": "Lyapunov exponent"}),
        "exponent_error": ((dim, "number"), errors, {"units": "1/s", "long_name": "standard error of it"}),
        "zero_one": (dim, [one.zero_one for one in rows], {"units": "1", "long_name": "0-1 test for chaos"}),
        "motion": (dim, codes, {"units": "1", "long_name": "kind of motion", **flags}),
    }
    if sections is not None:
        about = {"units": "m", "long_name": "position once in each drive period"}
        data["section_x"] = ((dim, "point"), sections, about)
    coordinates = {dim: (dim, values, {"units": unit, "long_name": path.replace(".", " ").replace("_", " ")})}
    coordinates["number"] = np.arange(1, size + 1)
    attributes = {
        "kind": "exponents", "title": case.title, "parameter": path, "source": f"Separatrix {__version__}",
        "resolved_case": case.to_toml(),
    }  # fmt: skip
    return xr.Dataset(data, coordinates, attributes)
