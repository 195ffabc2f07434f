# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`boundary`: the boundaries between the basins of a map, as curves."""

import tempfile
from pathlib import Path

import xarray as xr

from separatrix.cases import Case
from separatrix.errors import CANNOT_CREATE, USAGE, SeparatrixError
from separatrix.maps import kept_in_memory
from separatrix.open import open_result
from separatrix.progress import Progress, Report
from separatrix.runner import run_at_once

__all__ = ["boundary"]


def boundary(
    basins: xr.Dataset | str | Path,
    *,
    grow: float | None = None,
    output: str | Path | None = None,
    ranks: int | None = None,
    progress: bool | Report | None = None,
    overwrite: bool = False,
) -> xr.Dataset:
    """Return the boundaries between the basins of a map, as curves known to 1e-10 of its ranges.

    `.separatrix.plot(over=basins)` draws the curves over the map. Piece k has the points `first[k]` to
    `first[k] + points[k] - 1`, between the attractors `label_one[k]` and `label_two[k]`; 0 is not known.
    `piece_name` is what motions on it lead to, `piece_saddle` the number of the saddle in
    `table(result, "saddles")`, from 1.

    Parameters
    ----------
    basins
        The map: its file, or the result of `basin` or `open_result`. One that is in memory only is computed
        once more, into a temporary file.
    grow
        Stable and unstable sets of the saddles are grown within so many times the window of the map; 1 if not
        given, 0: none.
    output
        The result file. Without one the result is kept in memory.
    ranks, progress, overwrite
        As for `basin`; what is counted are edges of cells. Ctrl-C is a KeyboardInterrupt, nothing is kept.

    Examples
    --------
    >>> result = sx.basin("examples/basin_coulomb.toml", x0=20, v0=20)
    >>> sx.boundary(result).attrs["kind"]
    'boundary'
    """
    with tempfile.TemporaryDirectory(prefix="separatrix-") as folder:
        target = (Path(folder) / "boundary.h5" if output is None else Path(output).expanduser()).absolute()
        if output is not None and target.exists() and not overwrite:
            raise SeparatrixError(f"{target}: exists; overwrite=True replaces it", CANNOT_CREATE)
        source = file_of_map(basins, Path(folder), "boundary", ranks, progress)
        command = ["boundary", str(source), "-o", str(target), "--json"]
        command += [] if grow is None else ["--grow", str(float(grow))]
        command += ["--force"] if overwrite else []
        _run(command, ranks, progress)
        if output is not None:
            return open_result(target)
        with open_result(target) as result:
            return kept_in_memory(result)


def file_of_map(
    basins: xr.Dataset | str | Path,
    folder: Path,
    command: str,
    ranks: int | None,
    progress: bool | Report | None,
) -> Path:
    """Return the file of a map for a command.

    Of one in memory that of the same run once more, in `folder`.
    """
    if not isinstance(basins, xr.Dataset):
        return Path(basins).expanduser().absolute()
    if basins.attrs.get("kind") != "basin":
        raise SeparatrixError(
            f"{command}: found a {basins.attrs.get('kind')}, allowed a map of basins", USAGE
        )
    source = basins.encoding.get("source")
    if source and Path(source).is_file():
        return Path(source)
    case = Case.from_text(str(basins.attrs["resolved_case"]))
    target = folder / "map.basin.h5"
    _run(["basin", *case.on_command_line(folder), "-o", str(target), "--json"], ranks, progress)
    return target


def _run(command: list[str], ranks: int | None, progress: bool | Report | None) -> None:
    with Progress(progress) as report:
        run_at_once(command, report, ranks)
